"""App: the lab's routes. GET changes nothing; POST changes something; a WebSocket reports, and vents."""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect

from straw.model.errors import ModelError
from straw.replay.errors import ReplayError
from straw.replay.lab.bench import Bench
from straw.replay.lab.guard import FILM, Door, Guard
from straw.replay.lab.library import Library
from straw.replay.lab.pages import page, vent_key
from straw.replay.lab.protocols import drawn, known_protocols
from straw.replay.lab.record import compared, record, specimen
from straw.replay.lab.table import view
from straw.replay.lab.work import Jobs, Predictor
from straw.rig.errors import RigError
from straw.rig.manifest import seal
from straw.rig.recover import recover

#: What a person's input can be wrong in: one line, status 400. (Trackers' errors come from commands, as text.)
COMPLAINTS = (RigError, ReplayError, ModelError, ValueError, KeyError, TypeError)
TELL_S = 0.25
FILMS = (".mp4", ".mov", ".avi", ".mkv", ".360")
#: For pages that hold what recordings say: they run their scripts, and are nobody to this server.
APART = {"content-security-policy": "sandbox allow-scripts"}
#: Threads of their own: a VENT never waits behind a table.
VENTING = ThreadPoolExecutor(4, thread_name_prefix="vent")
LARGEST = 2_000_000
Answer = Callable[[Request], Coroutine[Any, Any, Response]]


@dataclass
class Lab:
    """Everything that the pages of one lab are about."""

    library: Library
    bench: Bench
    jobs: Jobs | None  # None: the folder cannot be written
    predictor: Predictor = field(default_factory=Predictor)
    predictions: dict[str, str] = field(default_factory=dict)
    straw: str = ""

    @property
    def work(self) -> Path | None:
        """Where jobs leave what they find."""
        return self.jobs.folder if self.jobs else None

    def application(self, door: Door) -> ASGIApp:
        """Behind its guard."""
        routes = [
            *(Route(f"/{name}", self._page(name or "catalogue")) for name in PAGES),
            Route("/api/runs", self._answer(lambda q: view(self.library, q))),
            Route("/api/run", self._answer(lambda q: record(self.library, q["name"], self.work))),
            Route("/api/compare", self._answer(lambda q: compared(self.library, q["runs"].split("|")))),
            Route("/api/specimen", self._answer(lambda q: specimen(self.library, q["name"], self.work))),
            Route("/api/columns", self._answer(lambda q: {"metadata": self.library.metadata})),
            Route("/api/protocols", self._answer(lambda q: known_protocols(self.library.folder))),
            Route("/api/job", self._answer(lambda q: self._jobs().as_data(q["id"]))),
            Route("/made/{job}", self._made),
            Route("/predicted/{id}", self._predicted),
            Route(FILM, self._film, methods=["POST"]),
            Route("/api/{action}", self._act, methods=["POST"]),
            WebSocketRoute("/ws", self._talk),
        ]
        return Guard(Starlette(routes=routes), door)

    def _jobs(self) -> Jobs:
        if self.jobs is None:
            raise RigError(f"{self.library.folder} cannot be written, so nothing can be made; check its rights")
        return self.jobs

    def _page(self, name: str) -> Answer:
        async def answer(request: Request) -> Response:
            return HTMLResponse(page(name))

        return answer

    def _answer(self, of: Callable[[Any], Any]) -> Answer:
        """JSON of what a function says of the query; its work is done in a thread, so that the loop stays free."""

        async def answer(request: Request) -> Response:
            return await _said(of, request.query_params)

        return answer

    async def _act(self, request: Request) -> Response:
        """Whatever changes something. VENT first: it asks for nothing but a name."""
        action = request.path_params["action"]
        if action not in ACTIONS:
            return JSONResponse({"error": f"no such action: {action}"}, 404)
        body = b""
        async for chunk in request.stream():
            body += chunk
            if len(body) > LARGEST:
                return JSONResponse({"error": "that is more than any protocol is"}, 413)
        try:
            asked = json.loads(body or b"{}")
        except ValueError:
            asked = None
        if not isinstance(asked, dict):
            return JSONResponse({"error": "expected a JSON object"}, 400)
        if asked.get("who"):
            self.bench.control.heard(str(asked["who"])[:40], str(asked.get("name", "")))
        return await _said(lambda a: ACTIONS[action](self, a), asked, VENTING if action == "vent" else None)

    async def _film(self, request: Request) -> Response:
        """A film that was dropped on a run's page: laid beside the recording and entered in its manifest."""
        try:
            recording = self.library.path(self.library.entry(request.query_params["name"]))
            film = film_of(recording, request.query_params["file"])
            part = film.with_name(film.name + ".part")
            with part.open("wb") as stream:
                async for chunk in request.stream():
                    await asyncio.to_thread(stream.write, chunk)
            part.rename(film)
        except COMPLAINTS as error:
            return JSONResponse({"error": " ".join(str(error).split())}, 400)
        except OSError as error:
            return JSONResponse({"error": f"the film cannot be written: {error.strerror}; check the space"}, 400)

        def entered(_: object) -> dict[str, str]:
            seal(recording, [film])
            return {"film": film.name}

        return await _said(entered, {})

    async def _made(self, request: Request) -> Response:
        """A page that a job made, without any right of the lab's own pages; its VENT key reaches the page around it."""
        folder = self._jobs().folder / Path(request.path_params["job"]).name
        found = sorted(folder.glob("*.html"))
        if not found:
            return JSONResponse({"error": "there is no such page"}, 404)
        text = await asyncio.to_thread(found[0].read_text, encoding="utf-8")
        return HTMLResponse(text + vent_key(), headers=APART)

    async def _predicted(self, request: Request) -> Response:
        text = self.predictions.get(request.path_params["id"])
        return HTMLResponse(text, headers=APART) if text else JSONResponse({"error": "predict it again"}, 404)

    def predict(self, toml: str) -> dict[str, Any]:
        """The prediction of a protocol; its page is kept for a while."""
        answer = self.predictor.ask({"toml": toml, "straw": self.straw})
        number = secrets.token_hex(6)
        self.predictions[number] = str(answer.pop("page"))
        for old in list(self.predictions)[:-8]:
            del self.predictions[old]
        return {**answer, "id": number}

    async def _talk(self, asked: WebSocket) -> None:
        """Tells a page four times a second how the rig is and that this server lives; takes its VENT and its name."""
        await asked.accept()
        who = {"id": "", "name": "somebody"}
        listening = asyncio.create_task(self._listen(asked, who))
        with suppress(WebSocketDisconnect, RuntimeError):
            while not listening.done():
                if who["id"]:
                    self.bench.control.heard(who["id"], who["name"])
                state = {"version": self.library.version, "reading": self.library.reading}
                await asked.send_text(json.dumps(state | {"bench": self.bench.as_data(who["id"])}))
                await asyncio.sleep(TELL_S)
        listening.cancel()

    async def _listen(self, asked: WebSocket, who: dict[str, str]) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                said = await asked.receive_text()
                try:
                    order = json.loads(said)
                    if "id" in order:
                        who["id"] = str(order["id"])[:40]
                        who["name"] = str(order.get("name", ""))[:40]
                    if order.get("do") == "vent":
                        loop = asyncio.get_running_loop()
                        answer = await loop.run_in_executor(VENTING, self.bench.vent, who["name"])
                        await asked.send_text(json.dumps({"vented": answer["says"]}))
                except (ValueError, TypeError, AttributeError):
                    continue


PAGES = ("", "panel", "run", "compare", "specimen", "job")


async def _said(of: Callable[[Any], Any], asked: Any, pool: ThreadPoolExecutor | None = None) -> Response:
    try:
        return JSONResponse(await asyncio.get_running_loop().run_in_executor(pool, of, asked))
    except COMPLAINTS as error:
        missing = isinstance(error, KeyError)
        text = f"{error.args[0]} is missing" if missing and error.args else str(error)
        return JSONResponse({"error": " ".join(text.split())}, 400)


def film_of(recording: Path, name: str) -> Path:
    """Where a film is laid: beside its recording, under its own name after the run's; RigError where that is taken."""
    plain = Path(name.replace("\\", "/")).name
    if Path(plain).suffix.lower() not in FILMS:
        raise RigError(f"{plain!r} is not a film; expected one of {', '.join(FILMS)}")
    film = recording.with_name(f"{recording.name.removesuffix('.part').removesuffix('.mcap')}-{plain}")
    if film.exists():
        raise RigError(f"{film.name} is there already and is not overwritten")
    return film


def _queue(lab: Lab, asked: dict[str, Any]) -> Any:
    lab.bench.control.check(str(asked["who"]))
    queue, do = lab.bench.queue, asked["do"]
    if do == "add":
        if lab.bench.rig is not None:
            drawn(str(asked["toml"]), lab.bench.rig.limits)
        repeats, pause_s = int(asked.get("repeats", 1)), float(asked.get("pause_s", 0.0))
        by_hand = bool(asked.get("by_hand", False))
        queue.add(str(asked["toml"]), str(asked.get("specimen", "")).strip(), repeats, pause_s, by_hand)
    elif do == "remove":
        queue.remove(str(asked["id"]))
    elif do == "move":
        queue.move(str(asked["id"]), int(asked["by"]))
    elif do == "hold":
        queue.hold("held by hand")
    else:
        raise RigError(f"the queue cannot {do}")
    return queue.as_data()


def _control(lab: Lab, asked: dict[str, Any]) -> Any:
    control, who = lab.bench.control, str(asked["who"])
    if asked["do"] == "take":
        control.take(who)
    else:
        control.give(who, keep=asked["do"] == "keep")
    return control.as_data(who)


def _say(lab: Lab, asked: dict[str, Any]) -> Any:
    more = {"instead_of": int(asked["instead_of"])} if "instead_of" in asked else {}
    changed = []
    for name in asked["names"]:
        entry = lab.library.say(str(name), str(asked["kind"]), str(asked["text"]), **more)
        changed.append({"name": entry.name, "tags": entry.tags, "marks": entry.marks})
    return changed


def _recover(lab: Lab, asked: dict[str, Any]) -> Any:
    entry = lab.library.entry(str(asked["name"]))
    done = recover(lab.library.path(entry))
    lab.library.look()
    return {"path": done.path.relative_to(lab.library.folder).as_posix(), "lost": list(done.lost)}


def _job(lab: Lab, asked: dict[str, Any]) -> Any:
    """Replay, diagnose or identify chosen runs, with their tracks, as the command of that name does."""
    kind = str(asked["kind"])
    entries = [lab.library.entry(str(name)) for name in asked["names"]]
    tracks = [
        e for e in lab.library.entries if e.kind == "track" and e.parent in {r.sha256 for r in entries if r.sha256}
    ]
    if not entries or kind not in JOBS:
        raise RigError(f"{kind} of {len(entries)} recordings: choose some, and one of {', '.join(JOBS)}")
    paths = [str(lab.library.path(e)) for e in (*entries, *(t for t in tracks if t not in entries))]
    words, options, made = JOBS[kind]
    straw = lab.bench.rig.straw if lab.bench.rig else None
    command = [*words, *paths, *options, *(["--straw", str(straw)] if straw else [])]
    names = ", ".join(e.run_id or e.name for e in entries[:3]) + (
        f" and {len(entries) - 3} more" if len(entries) > 3 else ""
    )
    inputs = {e.name: e.sha256 for e in (*entries, *tracks)}
    return lab._jobs().start(f"{kind} of {names}", command, made, inputs).as_data()


#: What a job is: words of its command, its outputs, the one to look at.
JOBS: dict[str, tuple[list[str], list[str], str]] = {
    "replay": (["replay"], ["--report", "{folder}/replay.html", "--json", "{folder}/replay.json"], "replay.html"),
    "diagnose": (
        ["diagnose"],
        ["--report", "{folder}/diagnosis.html", "--json", "{folder}/findings.json"],
        "diagnosis.html",
    ),
    "identify": (["identify", "runs"], ["--each", "--json", "{folder}/findings.json"], ""),
}
ACTIONS: dict[str, Callable[[Lab, dict[str, Any]], Any]] = {
    "vent": lambda lab, asked: lab.bench.vent(str(asked.get("name", "") or "somebody")),
    "order": lambda lab, asked: {"state": lab.bench.order(str(asked["who"]), str(asked["do"]))},
    "arm": lambda lab, asked: {"armed": lab.bench.arm(str(asked["who"]), bool(asked["on"]))},
    "start": lambda lab, asked: {"started": lab.bench.start(str(asked["who"]))},
    "queue": _queue,
    "control": _control,
    "protocol": lambda lab, asked: drawn(str(asked["toml"]), lab.bench.rig.limits if lab.bench.rig else None),
    "predict": lambda lab, asked: lab.predict(str(asked["toml"])),
    "say": _say,
    "recover": _recover,
    "job": _job,
    "stopjob": lambda lab, asked: lab._jobs().stop(str(asked["id"])),
}
