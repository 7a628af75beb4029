"""The loop's steps on a rig, or an emulator: straw's own diagnosis, and runs driven exactly as `straw rig run` does."""

from __future__ import annotations

import argparse
import getpass
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path

from straw.model.parameters import StrawParameters
from straw.replay.commands.diagnose import check_campaign, chosen
from straw.replay.compare.gather import gather
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import Findings, conclude
from straw.replay.diagnose.inquiry import Inquiry, Told, silent
from straw.replay.diagnose.page.report import report
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.snaps import crossings, levels_of
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.diagnose.tolerance import Tolerance, parse_tolerance
from straw.replay.errors import USER_ERRORS, ReplayError
from straw.replay.investigate.ask import Ask
from straw.replay.investigate.campaign import Folder
from straw.replay.investigate.dry_run import planned
from straw.replay.investigate.propose import extremes, openings, proposals
from straw.replay.investigate.steps import Ahead, Found, Plan, Proposal, Ran
from straw.replay.output import write_json, write_text
from straw.replay.progress import progress_bar, say
from straw.rig.interrupts import Interrupts
from straw.rig.limits import PressureLimits
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.rig_file import RigFile
from straw.rig.run_read import read_run

#: Least number of runs for a diagnosis: a single run can be fitted whatever the cause.
FEWEST = 2
#: Runs another command of straw: words as on the command line, its exit code.
Command = Callable[[Sequence[str]], int]


class Bench:
    """`Steps` of one specimen on one rig. ``place`` is the folder for protocols and findings of the rounds; ``asks``
    gives approval, ``told`` receives progress."""

    def __init__(
        self,
        args: argparse.Namespace,
        straw: StrawParameters,
        limits: PressureLimits,
        rig: RigFile | None,
        folder: Folder,
        place: Path,
        pool: Executor,
        command: Command,
        asks: Ask,
        told: Told = silent,
    ) -> None:
        self.args, self.straw, self.limits, self.rig = args, straw, limits, rig
        self.folder, self.place, self.pool, self.command = folder, place, pool, command
        self.asks, self.told = asks, told
        self.model = straw  # as the last diagnosis improved it
        self._inquiry: Inquiry | None = None
        self._known: list[str] = []

    def recordings(self) -> tuple[str, ...]:
        """SHA-256 of every recording and track of the specimen."""
        return self.folder.sums()

    def diagnose(self) -> Found:
        """As `straw diagnose` does, but without a search for an unknown law, which takes minutes: see `unknown`."""
        sums, paths = self.folder.sums(), self.folder.paths()
        runs = gather(paths) if paths else []
        self._known = [text for run in runs if (text := run.attachments.get("protocol.toml", b"").decode())]
        before, self._inquiry = self._inquiry, None
        if len(runs) < FEWEST:
            so_far = f"{len(runs)} {'run' if len(runs) == 1 else 'runs'} of {self.folder.specimen} so far"
            return Found("too_few", says=so_far, recordings=sums)
        check_campaign(runs, self.straw.cells)
        system = StrawSystem(self.straw)
        with progress_bar("diagnose", "step") as update, Interrupts() as interrupts:
            found = inquire(
                [observe(run) for run in runs],
                system,
                library=chosen(system, self.args.without),
                executor=self.pool,
                told=lambda what, done, total: self._tell(update, what, done, total),
                stop=lambda: interrupts.pending is not None,
                before=before,
            )
            interrupts.check()
            findings = conclude(found, brief=True, tolerance=self._tolerance())
        self._inquiry, self.model = found, findings.model
        self._keep(findings)
        untried = findings.verdict == "complete" and bool(self.untried())
        probability = dict(findings.judgement.probability)
        return Found(
            findings.verdict, tuple(findings.causes), probability, findings.says, sums, untried, runs=len(runs)
        )

    def untried(self) -> list[Proposal]:
        """Runs that are still to be made before a complete model is an answer."""
        return extremes(self.straw.cells, self.limits, self._known)

    def unknown(self, found: Found) -> str:
        """As `straw diagnose` ends: a curve of what is missing, over the state it depends on, and a formula if any."""
        assert self._inquiry is not None
        say("search for an unknown law: some minutes")
        with progress_bar("look for a law", "step") as update:
            findings = conclude(
                self._inquiry,
                told=lambda what, done, total: self._tell(update, what, done, total),
                tolerance=self._tolerance(),
            )
        self.model = findings.model
        name = self._keep(findings)
        if findings.discovered:
            seen = f"what is missing acts at {findings.discovered['place']}: {findings.discovered['formula']}"
        else:
            seen = f"where it shows: {findings.where}" if findings.where else "no law was found for it"
        return f"{seen}; look at {name.with_suffix('.html').name}"

    def _tolerance(self) -> Tolerance | None:
        given = self.args.tolerance
        return parse_tolerance(given, StrawSystem(self.straw).channels) if given else None

    def _tell(self, update: Callable[[int, int], None], what: str, done: int, total: int) -> None:
        update(done, total)
        self.told(what, done, total)

    def _keep(self, findings: Findings) -> Path:
        """Write a diagnosis beside the log; return its path without suffix."""
        assert self._inquiry is not None
        name = self.place / f"after-{len(self._inquiry.campaign.observations):02d}-runs"
        write_json(name.with_suffix(".json"), findings.as_json())
        write_text(name.with_suffix(".html"), report(findings, self._inquiry))
        return name

    def propose(self, found: Found) -> Sequence[Proposal]:
        """The menu, free designs and repeats, judged by the hypotheses of the last diagnosis."""
        if found.verdict == "too_few":
            return openings(self.straw.cells, self.limits, self._known)
        if found.untried:
            return self.untried()
        assert self._inquiry is not None
        say("design the next experiment")
        self.told("design the next experiment", 0, 0)
        return proposals(self._inquiry, self.limits, self._known, self.args.certainty)

    def dry_run(self, proposal: Proposal, left: Sequence[int] | None) -> Plan:
        """Checked against the limits, and predicted by the model as improved so far."""
        protocol = protocol_from_toml(proposal.protocol, "the proposed protocol")
        for part in protocol.parts:
            part.check_limits(self.limits)
        set_before = self.args.emulate or (left is not None and tuple(sorted(left)) == protocol.initial_deployed)
        return planned(protocol, self.model, self.limits, by_hand=not set_before)

    def ask(self, proposal: Proposal, plan: Plan, ahead: Ahead) -> str:
        """The approval of a person, or of --yes."""
        return self.asks(proposal, plan, ahead)

    def recording_of(self, proposal: Proposal, number: int) -> str:
        """An unused file name."""
        name = protocol_from_toml(proposal.protocol, "the proposed protocol").name
        plain = "".join(c if c.isalnum() or c in "-_.+" else "-" for c in name)
        return self.folder.new(f"{self.place.name}-{number:02d}-{plain}")

    def run(self, proposal: Proposal, recording: str) -> None:
        """As `straw rig run`, with its limits, guardian and vents."""
        path, args = self.folder.path / recording, self.args
        protocol = self.place / f"{path.stem}.toml"
        write_text(protocol, proposal.protocol)
        words = ["rig", "run", str(protocol), "-o", str(path), "--specimen", self.folder.specimen]
        words += ["--cycle", str(self.folder.next_cycle()), "--operator", args.operator or getpass.getuser()]
        for flag, value in (("--rig", args.rig), ("--controller", args.controller), ("--limits", args.limits)):
            words += [f"{flag}={value}"] if value else []
        words += [f"--setting={one}" for one in args.setting]
        straw = args.twin or args.straw
        words += [f"--straw={straw}"] if straw else []
        words += ["--meta", f"investigated={proposal.key}"]
        if args.emulate:
            words += ["--emulate", "--tip", str(self.folder.tip_of(recording)), "--no-film", *(["--fast"] * args.fast)]
        elif args.port:
            words += [f"--port={args.port}"]
        if args.wait and not args.fast:  # so that the lab's panel shows it and vents it
            words += ["--live", "127.0.0.1:0", "--watched"]
        self.told(f"run {protocol.stem}", 0, 0)
        self.command(words)

    def after(self, recording: str) -> Ran:
        """The outcome of a run by its files."""
        path = self.folder.path / recording
        part = path.with_name(path.name + ".part")
        if not path.exists() and not part.exists():
            return Ran("none", recording, reason="nothing was recorded, so nothing was driven")
        try:
            run = read_run(path if path.exists() else part)
        except USER_ERRORS as error:
            return Ran("cut", recording, reason=" ".join(str(error).split()))
        log, tip = run.pressure, self.folder.tip_of(recording)
        minutes = float(log.time_s[-1] - log.time_s[0]) / 60 if log is not None else 0.0
        if not path.exists():
            return Ran("cut", recording, minutes=minutes, reason=f"it was cut; straw runs recover {part} keeps it")
        status, reason = run.metadata.get("exit_status", "fail"), run.metadata.get("exit_reason", "")
        if self.args.emulate and status == "success" and not tip.exists():
            status, reason = "fail", "the emulator's tip was not written"
        seen = read_run(tip).tip if tip.exists() else None
        snaps = None if seen is None else len(crossings(seen.time_s, seen.phi_rad, levels_of(seen.phi_rad))[::2])
        return Ran(status, recording, run.sha256, minutes, snaps, "" if status == "success" else reason)

    def track(self, recording: str) -> bool:
        """Whether there is a track; a video that shows the LED's code is tracked here, as `straw track` does."""
        if self.folder.tracked(recording):
            return True
        films, tip = self.folder.films(recording), self.folder.tip_of(recording)
        run = self.folder.path / recording
        lens = self.rig.camera.lens if self.rig and self.rig.camera else None
        if not films or lens is None or not (self.rig and self.rig.led):
            what = f"the video {films[0].name}" if films else "its film"
            say(f"{recording}: track {what} with: straw track FILM --run {run} --camera CAMERA.json -o {tip}")
            return False
        clock = self.place / f"{run.stem}-clock.json"
        try:
            self.command(["clock", str(films[0]), "--run", str(run), "-o", str(clock)])
            names = [str(film) for film in films]
            where = ["--camera", str(lens), "--clock", str(clock), "-o", str(tip)]
            self.command(["track", *names, "--run", str(run), *where])
        except USER_ERRORS as error:
            say(f"{recording}: not tracked: {error}")
        return self.folder.tracked(recording)


def check_place(place: Path) -> None:
    """Make the folder for a loop's protocols and findings; ReplayError where it cannot be."""
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ReplayError(f"{place}: cannot be made: {error.strerror}; choose another --log") from None
