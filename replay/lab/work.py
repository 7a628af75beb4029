"""Work: commands of straw that the lab's pages start: predictions, pages, findings; each in a process of its own."""

from __future__ import annotations

import json
import os
import secrets
import shutil
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from straw.replay.progress import TOLD_IN
from straw.rig.errors import RigError

#: Whoever drives a rig goes first, also on a small machine.
LAST = (found, "-n", "10") if (found := shutil.which("nice")) else ()
STRAW = (sys.executable, "-P", "-m", "straw.replay.cli")
#: The predicting process ends when nobody asked it for so long: it holds a compiled model.
IDLE_S = 300.0
MOST_JOBS = 2
KEPT = 40
PROGRESS = "progress.json"


class Predictor:
    """One process that predicts protocols, one after the other; started when first asked."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._asked_s = 0.0

    def ask(self, task: dict[str, Any]) -> dict[str, Any]:
        """Its answer to a task; RigError with the one line it complains in."""
        with self._lock:
            self._asked_s = time.monotonic()
            process = self._running()
            assert process.stdin is not None
            assert process.stdout is not None
            try:
                process.stdin.write(json.dumps(task) + "\n")
                process.stdin.flush()
                answer: dict[str, Any] = json.loads(process.stdout.readline())
            except (OSError, ValueError):
                self.close()
                raise RigError("the predicting process ended; ask again, and look at the lab's terminal") from None
        if "error" in answer:
            raise RigError(answer["error"])
        return answer

    def idle(self) -> None:
        """End the process when it has been idle for long; called now and then."""
        if self._process and time.monotonic() - self._asked_s > IDLE_S and self._lock.acquire(blocking=False):
            try:
                self.close()
            finally:
                self._lock.release()

    def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is None:
            return
        for stream in (process.stdin, process.stdout):
            with suppress(OSError):
                stream.close() if stream else None
        process.kill()
        process.wait()

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None or self._process.poll() is not None:
            command = [sys.executable, "-P", "-m", "straw.replay.lab.predict"]
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
            )
        return self._process


@dataclass
class Job:
    """One command: what it is called, its folder, its outputs, and how it goes."""

    id: str
    title: str
    folder: Path
    page: Path | None = None
    began_s: float = field(default_factory=time.monotonic)
    took_s: float = 0.0
    code: int | None = None
    said: str = ""
    process: subprocess.Popen[str] | None = field(default=None, repr=False)

    def as_data(self) -> dict[str, Any]:
        """For the page."""
        return {
            "id": self.id,
            "title": self.title,
            "seconds": round(self.took_s or time.monotonic() - self.began_s, 1),
            "running": self.code is None,
            "waits": self.code is None and self.process is None,
            "progress": self._progress() if self.code is None else None,
            "well": self.code in (0, 1),  # 1: the answer is no
            "said": self.said[-4000:],
            "page": bool(self.code in (0, 1) and self.page and self.page.is_file()),
        }

    def _progress(self) -> dict[str, Any] | None:
        """How far the command says that it is: what it does, done, of how much in all."""
        try:
            said: dict[str, Any] = json.loads((self.folder / PROGRESS).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return said


class Jobs:
    """Jobs by id, a few at a time; each in a folder of its own below ``folder``."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.jobs: dict[str, Job] = {}
        self._turn = threading.Semaphore(MOST_JOBS)

    def start(self, title: str, command: list[str], page: str = "", inputs: Any = None) -> Job:
        """Start ``straw`` with arguments; ``{folder}`` in them is the job's own. ``page`` is an output to look at."""
        job_id = f"{time.strftime('%Y%m%d-%H%M%S')}-{secrets.token_hex(2)}"
        folder = self.folder / job_id
        try:
            folder.mkdir(parents=True)
            (folder / "inputs.json").write_text(json.dumps({"title": title, "inputs": inputs}), encoding="utf-8")
        except OSError as error:
            raise RigError(f"{folder} cannot be made: {error.strerror}; check space and rights") from None
        job = Job(job_id, title, folder, folder / page if page else None)
        self.jobs[job_id] = job
        for old in list(self.jobs)[:-KEPT]:
            if self.jobs[old].code is not None:
                del self.jobs[old]
        filled = [part.replace("{folder}", str(folder)) for part in command]
        threading.Thread(target=self._work, args=(job, filled), daemon=True).start()
        return job

    def as_data(self, job_id: str) -> dict[str, Any]:
        """How a job goes, or what one of an earlier day left; RigError when there is none."""
        if job_id in self.jobs:
            return self.jobs[job_id].as_data()
        folder = self.folder / Path(job_id).name
        try:
            title = str(json.loads((folder / "inputs.json").read_text(encoding="utf-8"))["title"])
        except (OSError, ValueError, KeyError, TypeError):
            raise RigError(f"no job {job_id!r} is known; start it again") from None
        page = bool(list(folder.glob("*.html")))
        return {"id": job_id, "title": title, "seconds": 0, "running": False, "well": True, "said": "", "page": page}

    def stop(self, job_id: str) -> dict[str, Any]:
        """End a job that takes too long; what it has printed stays."""
        job = self.jobs.get(job_id)
        if job is None or job.code is not None:
            raise RigError("that job is no longer running")
        if job.process is None:
            job.code, job.said = 130, "stopped before its turn came"
        else:
            job.process.terminate()
        return job.as_data()

    def _work(self, job: Job, command: list[str]) -> None:
        with self._turn:
            if job.code is not None:  # stopped before its turn came
                return
            try:
                job.process = subprocess.Popen(
                    [*LAST, *STRAW, *command],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                    env={**os.environ, TOLD_IN: str(job.folder / PROGRESS)},
                )
                job.said = job.process.communicate()[0]
                job.code = job.process.returncode
            except OSError as error:
                job.said, job.code = str(error), 2
            job.took_s = time.monotonic() - job.began_s
