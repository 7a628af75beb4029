"""Work: commands of straw that the lab's pages start (predictions, pages, findings), each in its own process."""

from __future__ import annotations

import json
import os
import secrets
import shutil
import signal
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

#: Processes that drive a rig have priority.
LAST = (found, "-n", "10") if (found := shutil.which("nice")) else ()
STRAW = (sys.executable, "-P", "-m", "straw.replay.cli")
#: The predicting process, which holds a compiled model, ends after so long without a request.
IDLE_S = 300.0
MOST_JOBS = 2
KEPT = 40
#: In a job's folder: how far it is, what it prints, its process, its exit code.
PROGRESS, SAID, PID, ENDED = "progress.json", "said.txt", "pid", "ended"


class Predictor:
    """One process that predicts protocols, one after the other; started when first asked."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._asked_s = 0.0

    def ask(self, task: dict[str, Any]) -> dict[str, Any]:
        """Its answer to a task; RigError with its one-line message."""
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
    """One command: its title, its folder, its outputs, and its progress."""

    id: str
    title: str
    folder: Path
    page: Path | None = None
    began_s: float = field(default_factory=time.monotonic)
    took_s: float = 0.0
    code: int | None = None
    trouble: str = ""  # why there is no output of its own
    process: subprocess.Popen[bytes] | None = field(default=None, repr=False)

    def as_data(self) -> dict[str, Any]:
        """For the page."""
        return {
            "id": self.id,
            "title": self.title,
            "seconds": round(self.took_s or time.monotonic() - self.began_s, 1),
            "running": self.code is None,
            "waits": self.code is None and self.process is None,
            "progress": progress_in(self.folder) if self.code is None else None,
            "well": self.code in (0, 1),  # 1: the answer is no
            "said": self.trouble or said_in(self.folder),
            "page": bool(self.code in (0, 1) and self.page and self.page.is_file()),
        }


def progress_in(folder: Path) -> dict[str, Any] | None:
    """A job's progress as its command reports it: activity, done, total."""
    try:
        said: dict[str, Any] = json.loads((folder / PROGRESS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return said


def said_in(folder: Path) -> str:
    """The end of what a job's command has printed so far."""
    try:
        return (folder / SAID).read_text(encoding="utf-8", errors="replace")[-4000:]
    except OSError:
        return ""


def alive_in(folder: Path) -> bool:
    """Whether the command of a job that an earlier lab started is running; not known on Windows."""
    with suppress(OSError, ValueError):
        if os.name == "posix" and not (folder / ENDED).exists():
            os.kill(int((folder / PID).read_text(encoding="utf-8")), 0)
            return True
    return False


class Jobs:
    """Jobs by id, a few at a time; each in a folder of its own below ``folder``. Started jobs outlive the lab."""

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
        """The state of a job, or the result of an earlier one; RigError when there is none."""
        if job_id in self.jobs:
            return self.jobs[job_id].as_data()
        folder = self.folder / Path(job_id).name
        try:
            title = str(json.loads((folder / "inputs.json").read_text(encoding="utf-8"))["title"])
        except (OSError, ValueError, KeyError, TypeError):
            raise RigError(f"no job {job_id!r} is known; start it again") from None
        alive, page = alive_in(folder), bool(list(folder.glob("*.html")))
        progress = progress_in(folder) if alive else None
        about = {"running": alive, "waits": False, "progress": progress, "well": True, "page": page and not alive}
        seconds = round(time.time() - (folder / PID).stat().st_mtime, 1) if alive else 0
        return {"id": job_id, "title": title, "seconds": seconds, **about, "said": said_in(folder)}

    def stop(self, job_id: str) -> dict[str, Any]:
        """End a job that takes too long; what it has printed stays."""
        job, folder = self.jobs.get(job_id), self.folder / Path(job_id).name
        if job is None and alive_in(folder):  # an earlier lab began it
            os.kill(int((folder / PID).read_text(encoding="utf-8")), signal.SIGTERM)
            return self.as_data(job_id)
        if job is None or job.code is not None:
            raise RigError("that job is no longer running")
        if job.process is None:
            job.code, job.trouble = 130, "stopped before its turn came"
        else:
            job.process.terminate()
        return job.as_data()

    def _work(self, job: Job, command: list[str]) -> None:
        with self._turn:
            if job.code is not None:  # stopped before its turn came
                return
            try:
                with (job.folder / SAID).open("wb") as stream:  # a pipe would end it when the lab is closed
                    job.process = subprocess.Popen(
                        [*LAST, *STRAW, *command],
                        stdin=subprocess.DEVNULL,
                        stdout=stream,
                        stderr=stream,
                        start_new_session=True,
                        env={**os.environ, TOLD_IN: str(job.folder / PROGRESS)},
                    )
                with suppress(OSError):
                    (job.folder / PID).write_text(str(job.process.pid), encoding="utf-8")
                job.code = job.process.wait()
                with suppress(OSError):
                    (job.folder / ENDED).write_text(str(job.code), encoding="utf-8")
            except OSError as error:
                job.trouble, job.code = str(error), 2
            job.took_s = time.monotonic() - job.began_s
