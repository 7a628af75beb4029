"""Starts a process of this package that survives its parent's end by Ctrl-C, a closed terminal or a killed group."""

from __future__ import annotations

import subprocess
import sys

# The other process must import the same code as this one, and no file of the working directory in place of a module:
# hence this process's own path without that directory.
START = "import sys; sys.path[:] = {path!r}; from {module} import main; main()"


def start_detached(module: str, *, answers: bool) -> subprocess.Popen[bytes]:
    """Run ``main`` of a module in its own session and process group (on Windows without console, and out of the job).

    Its stdin is a pipe, which the operating system closes when this process ends, however it ends. With ``answers`` its
    stdout is a pipe too and it shares stderr; without, it has neither.
    """

    def started(flags: int) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-P", "-c", START.format(path=[p for p in sys.path if p], module=module)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE if answers else subprocess.DEVNULL,
            stderr=None if answers else subprocess.DEVNULL,
            start_new_session=True,  # POSIX
            creationflags=flags,  # Windows
        )

    detached, freed = (
        sum(getattr(subprocess, name, 0) for name in names)
        for names in (("DETACHED_PROCESS", "CREATE_NEW_PROCESS_GROUP"), ("CREATE_BREAKAWAY_FROM_JOB",))
    )
    try:
        return started(detached | freed)
    except OSError:
        if not freed:
            raise
        return started(detached)  # the job does not allow its processes to leave it
