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
from straw.replay.lab.actions import ACTIONS
from straw.replay.lab.bench import Bench
from straw.replay.lab.films import how_to_track, taken
from straw.replay.lab.guard import FILM, Door, Guard
from straw.replay.lab.library import Library
from straw.replay.lab.loops import Loops
from straw.replay.lab.pages import page, vent_key
from straw.replay.lab.protocols import known_protocols
from straw.replay.lab.record import compared, record, specimen
from straw.replay.lab.table import view
from straw.replay.lab.work import Jobs, Predictor
from straw.rig.errors import RigError

#: Errors of a user's input: one line, status 400. (Errors of tracking come from commands, as text.)
COMPLAINTS = (RigError, ReplayError, ModelError, ValueError, KeyError, TypeError)
TELL_S = 0.25
#: For pages with contents of recordings: they run their scripts, but without any rights on this server.
APART = {"content-security-policy": "sandbox allow-scripts"}
#: Threads of their own: a VENT never waits behind a table.
VENTING = ThreadPoolExecutor(4, thread_name_prefix="vent")
LARGEST = 2_000_000
Answer = Callable[[Request], Coroutine[Any, Any, Response]]


@dataclass
class Lab:
    """The state of one lab."""

    library: Library
    bench: Bench
    jobs: Jobs | None  # None: the folder cannot be written
    predictor: Predictor = field(default_factory=Predictor)
    predictions: dict[str, str] = field(default_factory=dict)
    straw: str = ""

    def __post_init__(self) -> None:
        self.loops = Loops(self.library, self.bench)

    @property
    def work(self) -> Path | None:
        """The folder of the jobs' results."""
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
            Route("/api/job", self._answer(lambda q: self.working().as_data(q["id"]))),
            Route("/api/loops", self._answer(lambda q: self.loops.all())),
            Route("/api/loop", self._answer(lambda q: self.loops.one(q["log"]))),
            Route("/found/{log}/{page}", self._found),
            Route("/made/{job}", self._made),
            Route("/predicted/{id}", self._predicted),
            Route(FILM, self._film, methods=["POST"]),
            Route("/api/{action}", self._act, methods=["POST"]),
            WebSocketRoute("/ws", self._talk),
        ]
        return Guard(Starlette(routes=routes), door)

    def working(self) -> Jobs:
        """Its jobs; RigError where none can be kept."""
        if self.jobs is None:
            raise RigError(f"{self.library.folder} cannot be written, so nothing can be made; check its rights")
        return self.jobs

    def _page(self, name: str) -> Answer:
        async def answer(request: Request) -> Response:
            return HTMLResponse(page(name))

        return answer

    def _answer(self, of: Callable[[Any], Any]) -> Answer:
        """JSON of a function's answer to the query, computed in a thread, so that the event loop stays free."""

        async def answer(request: Request) -> Response:
            return await _said(of, request.query_params)

        return answer

    async def _act(self, request: Request) -> Response:
        """Every action that changes something. VENT comes first and needs only a name."""
        action = request.path_params["action"]
        if action not in ACTIONS:
            return JSONResponse({"error": f"no such action: {action}"}, 404)
        body = b""
        async for chunk in request.stream():
            body += chunk
            if len(body) > LARGEST:
                return JSONResponse({"error": "the request is too large for a protocol"}, 413)
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
        """A video that was dropped on a run's page."""
        try:
            said = await taken(self.library, request)
            track = how_to_track(request.query_params["name"], said["film"], self.bench.rig)
            return JSONResponse({**said, "track": track})
        except COMPLAINTS as error:
            return complained(error)

    async def _made(self, request: Request) -> Response:
        """A page that a job made, without any right of the lab's own pages; its VENT key reaches the page around it."""
        folder = self.working().folder / Path(request.path_params["job"]).name
        found = sorted(folder.glob("*.html"))
        return await _apart(found[0]) if found else JSONResponse({"error": "there is no such page"}, 404)

    async def _found(self, request: Request) -> Response:
        """A page of findings of a closed loop, likewise."""
        try:
            return await _apart(self.loops.page(request.path_params["log"], request.path_params["page"]))
        except RigError as error:
            return JSONResponse({"error": str(error)}, 404)

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
        """Sends a page the rig's state four times a second, which also shows that the server lives; takes VENT and
        name."""
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


PAGES = ("", "panel", "investigate", "run", "compare", "specimen", "job")


async def _apart(path: Path) -> Response:
    return HTMLResponse(await asyncio.to_thread(path.read_text, encoding="utf-8") + vent_key(), headers=APART)


async def _said(of: Callable[[Any], Any], asked: Any, pool: ThreadPoolExecutor | None = None) -> Response:
    try:
        return JSONResponse(await asyncio.get_running_loop().run_in_executor(pool, of, asked))
    except COMPLAINTS as error:
        return complained(error)


def complained(error: Exception) -> JSONResponse:
    """What is wrong, in one line."""
    text = f"{error.args[0]} is missing" if isinstance(error, KeyError) and error.args else str(error)
    return JSONResponse({"error": " ".join(text.split())}, 400)
