"""The loop's steps on a rig, or an emulator: straw's own diagnosis, and runs driven exactly as `straw rig run` does."""

from __future__ import annotations

import argparse
import getpass
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.replay.commands.diagnose import check_campaign, chosen
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import conclude
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.report import report
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.snaps import crossings, levels_of
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.diagnose.tolerance import parse_tolerance
from straw.replay.errors import USER_ERRORS, ReplayError
from straw.replay.gather import gather
from straw.replay.investigate.campaign import Folder
from straw.replay.investigate.propose import openings, proposals
from straw.replay.investigate.steps import Found, Plan, Proposal, Ran
from straw.replay.output import write_json, write_text
from straw.replay.progress import progress_bar, say
from straw.replay.protocol_prediction import predict_protocol
from straw.rig.interrupts import Interrupts
from straw.rig.limits import PressureLimits
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.rig_file import RigFile
from straw.rig.run_read import read_run

#: With fewer runs than this nothing can be diagnosed: one is fitted whatever the cause is.
FEWEST = 2
#: Runs another command of straw: words as on the command line, its exit code.
Command = Callable[[Sequence[str]], int]


class Bench:
    """`Steps` of one specimen on one rig. ``place`` is the folder for protocols and findings of the rounds."""

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
    ) -> None:
        self.args, self.straw, self.limits, self.rig = args, straw, limits, rig
        self.folder, self.place, self.pool, self.command = folder, place, pool, command
        self.model = straw  # as the last diagnosis improved it
        self._inquiry: Inquiry | None = None
        self._known: list[str] = []

    def recordings(self) -> tuple[str, ...]:
        """SHA-256 of every recording and track of the specimen."""
        return self.folder.sums()

    def diagnose(self) -> Found:
        """As `straw diagnose` does, but without a search for an unknown law, which takes minutes and ends a day."""
        sums, paths = self.folder.sums(), self.folder.paths()
        runs = gather(paths) if paths else []
        self._known = [text for run in runs if (text := run.attachments.get("protocol.toml", b"").decode())]
        self._inquiry = None
        if len(runs) < FEWEST:
            return Found("too_few", says=f"{len(runs)} runs of {self.folder.specimen} so far", recordings=sums)
        check_campaign(runs, self.straw.cells)
        system = StrawSystem(self.straw)
        given = self.args.tolerance
        tolerance = parse_tolerance(given, system.channels) if given else None
        with progress_bar("diagnose", "step") as update, Interrupts() as interrupts:
            found = inquire(
                [observe(run) for run in runs],
                system,
                library=chosen(system, self.args.without),
                executor=self.pool,
                told=lambda _what, done, total: update(done, total),
                stop=lambda: interrupts.pending is not None,
            )
            interrupts.check()
            findings = conclude(found, brief=True, tolerance=tolerance)
        self._inquiry, self.model = found, findings.model
        name = self.place / f"after-{len(runs):02d}-runs"
        write_json(name.with_suffix(".json"), findings.as_json())
        write_text(name.with_suffix(".html"), report(findings, found))
        return Found(
            findings.verdict, tuple(findings.causes), dict(findings.judgement.probability), findings.says, sums
        )

    def propose(self, found: Found) -> Sequence[Proposal]:
        """The menu, free designs and repeats, as the hypotheses of the last diagnosis see them."""
        if found.verdict == "too_few":
            return openings(self.straw.cells, self.limits, self._known)
        assert self._inquiry is not None
        say("design the next experiment")
        return proposals(self._inquiry, self.limits, self._known)

    def dry_run(self, proposal: Proposal, left: Sequence[int] | None) -> Plan:
        """Checked against the limits, and predicted by the model as improved so far."""
        protocol = protocol_from_toml(proposal.protocol, "the proposed protocol")
        for part in protocol.parts:
            part.check_limits(self.limits)
        seen, _ = predict_protocol(self.model, protocol)
        deployed = None
        if isinstance(seen, Prediction):  # one of hours leaves out what happens inside
            deployed = tuple(int(c) + 1 for c in np.flatnonzero(seen.zeta_m[-1, :, 1] > 0))
        begins = crossings(seen.time_s, seen.phi_rad, levels_of(seen.phi_rad))[::2] - protocol.zero_s
        low, high = protocol.pressure_pa.min() / 1e3, protocol.pressure_pa.max() / 1e3
        snaps = f"{len(begins)} snaps, the first at {begins[0]:.2f} s" if len(begins) else "no snap"
        says = (
            f"{protocol.name}: {low:g} to {high:g} kPa within {self.limits}, {protocol.duration_s:.1f} s; predicted: "
            f"{snaps}{'' if deployed is None else f', then deployed: {_cells(deployed)}'}"
        )
        begin = protocol.initial_deployed
        by_hand = not self.args.emulate and (left is None or tuple(sorted(left)) != begin)
        hand = f"set the straw so that these cells are deployed, and no others: {_cells(begin)}" if by_hand else ""
        return Plan(protocol.duration_s / 60, len(begins), says, hand, deployed)

    def ask(self, proposal: Proposal, plan: Plan, repeat: int) -> str:
        """A person at the terminal; where there is none, nobody says yes."""
        again = f"\n  run {repeat} times before; a repeat tells most" if repeat else ""
        expected = (
            ""
            if proposal.opening
            else f"\n  {proposal.information_nats:.2f} nats, {proposal.separation_sigma:.0f} sigma"
        )
        say(f"\nnext: {proposal.why}{again}{expected}\n  {plan.says}")
        say(f"  {plan.hand}" if plan.hand else "  the emulator sets the cells by itself" if self.args.emulate else "")
        if not sys.stdin or not sys.stdin.isatty():
            say("nobody is at the terminal to say yes; --yes N says it for N rounds that need no hand")
            return ""
        say("run it? [y/N] ")
        try:
            answer = sys.stdin.readline().strip().lower()
        except ValueError:
            answer = ""
        return (self.args.operator or getpass.getuser()) if answer in ("y", "yes") else ""

    def recording_of(self, proposal: Proposal, number: int) -> str:
        """A name that no file has yet."""
        name = protocol_from_toml(proposal.protocol, "the proposed protocol").name
        plain = "".join(c if c.isalnum() or c in "-_.+" else "-" for c in name)
        return self.folder.new(f"{self.place.name}-{number:02d}-{plain}")

    def run(self, proposal: Proposal, recording: str) -> None:
        """`straw rig run`: limits, guardian, vent in every way out and all."""
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
        self.command(words)

    def after(self, recording: str) -> Ran:
        """What the files say of a run."""
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
        """Whether there is a track; a film that saw the LED's code is tracked here, as `straw track` does."""
        if self.folder.tracked(recording):
            return True
        films, tip = self.folder.films(recording), self.folder.tip_of(recording)
        run = self.folder.path / recording
        lens = self.rig.camera.lens if self.rig and self.rig.camera else None
        if not films or lens is None or not (self.rig and self.rig.led):
            what = f"the film {films[0].name}" if films else "its film"
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
        place.mkdir(exist_ok=True)
    except OSError as error:
        raise ReplayError(f"{place}: cannot be made: {error.strerror}; choose another --log") from None


def _cells(cells: Sequence[int]) -> str:
    return ", ".join(map(str, cells)) or "none"
