"""A rig with the apparatus on it: takes the arguments of `straw rig run`, writes the recording and its track."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from straw.replay.cli import parser
from straw.rig.errors import RigError
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import load_protocol, protocol_from_toml
from straw.rig.run import Run
from straw.rig.run_read import read_run

from .campaign import make, record, write
from .effects import Cause
from .instrument import GAUGE_S
from .plans import Plan


@dataclass(frozen=True)
class ApparatusRig:
    """One specimen, drawn by ``seed``, that conceals ``truth``; called as `straw.replay.commands.investigate.command`.

    Its history is read from the specimen's recordings in the folder, so that an interrupted benchmark continues with
    the same straw, whose wall has aged and whose channel has clogged by the same amount.
    """

    truth: tuple[Cause, ...]
    seed: int

    def __call__(self, words: Sequence[str]) -> int:
        """`straw rig run P.toml -o RUN.mcap --tip TIP.mcap ...`; RigError where the apparatus cannot run it."""
        args: argparse.Namespace = parser().parse_args(list(words))
        path = Path(args.output)
        before = [as_plan(one, run.run_id, run.cycle) for run, one in runs_in(path.parent, args.specimen)]
        protocol = load_protocol(args.protocol)
        plan = as_plan(protocol, path.stem, args.cycle)
        try:
            (made,) = make(self.truth, self.seed, (plan.run_id,), plans=(*before, plan))
        except RuntimeError as error:
            raise RigError(f"{protocol.name}: {error}") from None
        run = record(made, self.seed, args.specimen)
        given = Path(args.protocol).read_bytes()
        ended = {**run.metadata, "protocol": protocol.name, "exit_status": "success"}
        write(replace(run, tip=None, metadata=ended, attachments={"protocol.toml": given}), path)
        parent = {**run.metadata, "parent_sha256": read_run(path).sha256}
        write(replace(run, command=None, pressure=None, metadata=parent), Path(args.tip))
        return 0


def runs_in(folder: Path, specimen: str) -> list[tuple[Run, PressureProtocol]]:
    """Recordings of runs of a specimen with their protocols, by cycle."""
    runs = [run for path in folder.glob("*.mcap") if (run := read_run(path)).pressure and run.specimen == specimen]
    runs.sort(key=lambda run: run.cycle)
    return [(run, protocol_from_toml(run.attachments["protocol.toml"].decode(), run.run_id)) for run in runs]


def as_plan(protocol: PressureProtocol, run_id: str, cycle: int) -> Plan:
    """Commands of the apparatus: one at each change of the protocol's pressure, at the gauge's rate."""
    time_s = np.arange(round(protocol.duration_s / GAUGE_S)) * GAUGE_S
    pa = protocol(time_s + 1e-9)  # a step takes effect from its own time on, whatever its rounding
    at = np.concatenate([[0], np.flatnonzero(np.diff(pa)) + 1])
    told = tuple((float(time_s[i]), float(pa[i])) for i in at)
    return Plan(run_id, told, protocol.initial_deployed, cycle, protocol.duration_s)


def as_toml(plan: Plan) -> str:
    """A plan of the campaign as a protocol that a rig can be given."""
    lines = [f'name = "{plan.run_id}"', 'pressure_unit = "kPa"', f"initial_deployed = {list(plan.deployed)}"]
    ends = [start for start, _ in plan.commands[1:]] + [plan.seconds]
    for (start, pa), end in zip(plan.commands, ends, strict=True):
        lines += ["", "[[main]]", f"hold = {pa / 1e3:g}", f"for_s = {end - start:.6g}"]
    return "\n".join([*lines, ""])
