"""Folder: the recordings and tracks of one specimen that a loop diagnoses and adds to."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from straw.replay.errors import ReplayError
from straw.rig.catalogue import Entry, catalogue, latest_tracks
from straw.rig.run_read import read_run

FILMS = (".mp4", ".mov", ".avi", ".mkv", ".360")


@dataclass(frozen=True)
class Folder:
    """A folder of recordings and a specimen's name; the files are read again at every call."""

    path: Path
    specimen: str

    def runs(self) -> list[Entry]:
        """Runs of the specimen that ended well and are not archived, oldest first."""
        mine = [e for e in catalogue(self.path) if e.kind == "run" and e.specimen == self.specimen]
        return [e for e in mine if e.status in ("", "success") and "archive" not in e.marks]

    def tracks(self) -> dict[str, Entry]:
        """The latest track of each run, by the run's SHA-256."""
        return latest_tracks(catalogue(self.path))

    def paths(self) -> list[Path]:
        """Input files of a diagnosis: runs with a tip, and their tracks."""
        tracks, out = self.tracks(), []
        for run in self.runs():
            if run.sha256 in tracks:
                out += [self.path / run.name, self.path / tracks[run.sha256].name]
            elif read_run(self.path / run.name).tip is not None:
                out.append(self.path / run.name)
        return out

    def sums(self) -> tuple[str, ...]:
        """SHA-256 of runs and tracks, in order, which change when anything is added."""
        tracks, runs = self.tracks(), self.runs()
        return tuple(
            sorted([*(r.sha256 for r in runs), *(tracks[r.sha256].sha256 for r in runs if r.sha256 in tracks)])
        )

    def tracked(self, recording: str) -> bool:
        """Whether a run has a track, or a tip of its own."""
        tracks = self.tracks()
        mine = [run for run in self.runs() if run.name == recording]
        return any(run.sha256 in tracks or read_run(self.path / run.name).tip is not None for run in mine)

    def next_cycle(self) -> int:
        """How often the specimen was cycled so far: one more with every run of it, however it ended."""
        mine = [e for e in catalogue(self.path) if e.specimen == self.specimen and e.kind in ("run", "part")]
        return max((e.cycle + 1 for e in mine), default=0)

    def tip_of(self, recording: str) -> Path:
        """Where a run's track goes."""
        return self.path / f"{Path(recording).stem}-tip.mcap"

    def films(self, recording: str) -> list[Path]:
        """Videos beside a run under its name."""
        return sorted(p for p in self.path.glob(f"{Path(recording).stem}-*") if p.suffix.lower() in FILMS)

    def new(self, stem: str) -> str:
        """The name of a recording that is not there yet, nor cut, nor its track."""
        for number in range(1, 1000):
            name = f"{stem}{f'-{number}' if number > 1 else ''}.mcap"
            taken = (self.path / name, self.path / f"{name}.part", self.tip_of(name))
            if not any(path.exists() for path in taken):
                return name
        raise ReplayError(f"{self.path}: there are a thousand recordings {stem}; choose another --log")


def specimen_of(folder: Path, given: str | None, emulated: bool) -> str:
    """The specimen: as named, else the only one in the folder; ReplayError where that is not clear."""
    if given:
        return given
    entries = catalogue(folder) if folder.exists() else []
    names = sorted({e.specimen for e in entries if e.kind == "run" and e.specimen})
    if len(names) == 1:
        return names[0]
    if not names and emulated:
        return "twin"
    there = f"{len(names)} are there ({', '.join(names[:4])})" if names else "there are no runs yet"
    raise ReplayError(f"{folder}: say which specimen with --specimen NAME: {there}")
