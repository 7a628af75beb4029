"""straw investigate: diagnose, propose and simulate an experiment, ask, run it, repeat until there is an answer."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from straw.model.straw_file import load_straw
from straw.replay.commands.diagnose import chosen
from straw.replay.commands.rig_of import settings_of, take_rig
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.diagnose.tolerance import parse_tolerance
from straw.replay.errors import ReplayError
from straw.replay.investigate.ask import answer, at_terminal, from_elsewhere
from straw.replay.investigate.bench import Bench, check_place
from straw.replay.investigate.budget import Budget
from straw.replay.investigate.campaign import Folder, specimen_of
from straw.replay.investigate.log import Log, log_of
from straw.replay.investigate.loop import Loop
from straw.replay.investigate.pulse import Pulse
from straw.replay.output import write_json
from straw.replay.progress import prepare, say
from straw.replay.workers import threads
from straw.rig.limits import STRAW_LIMITS
from straw.rig.rig_file import load_rig


def run(args: argparse.Namespace) -> int:
    """Repeat until there is a reason to stop; 0 when that is an answer, 1 when not."""
    if not 0.5 < args.certainty < 1:
        raise ReplayError(f"--certainty {args.certainty:g}: expected a probability between 0.5 and 1, as 0.9")
    for name in ("rounds", "minutes", "snaps"):
        if (value := getattr(args, name)) is not None and value <= 0:
            raise ReplayError(f"--{name} {value:g}: expected a number above 0, or leave it out")
    if args.answer:
        return _answered(args)
    rig = take_rig(args)
    if (args.fast or args.twin) and not args.emulate:
        raise ReplayError("--fast and --twin belong to --emulate: a real rig runs in real time, with a real straw")
    straw = load_straw(args.straw)
    system = StrawSystem(straw)
    chosen(system, args.without)  # errors in these are reported before anything else happens, too
    if args.tolerance:
        parse_tolerance(args.tolerance, system.channels)
    if args.twin:
        load_straw(args.twin)
    path = Path(args.folder or (rig.folder if rig else Path())).resolve()
    folder = Folder(path, specimen_of(path, args.specimen, args.emulate))
    log = (args.log or log_of(path, folder.specimen)).resolve()
    limits = settings_of(args).get("limits", STRAW_LIMITS).and_also(STRAW_LIMITS)
    place = log.with_suffix("")
    _make_folder(path)
    prepare()
    with Log(log) as lines, threads(args.jobs, args.dask) as pool:
        if lines.torn:
            say(f"{log}: {lines.torn} lines that were cut are left out")
        if lines.lines:
            say(f"{log}: goes on from its {len(lines.lines)} lines")
        check_place(place)
        budget = Budget(args.rounds, args.minutes, args.snaps)
        asked = {"certainty": args.certainty, **asdict(budget), "tolerance": args.tolerance, "yes": args.yes}
        lines.write("began", specimen=folder.specimen, emulated=bool(args.emulate), **asked)
        with Pulse(place) as pulse:
            asks = from_elsewhere(place, pulse, args.emulate) if args.wait else at_terminal(args.operator, args.emulate)
            bench = Bench(args, straw, limits, rig, folder, place, pool, command, asks, pulse.tell)
            loop = Loop(lines, bench, budget, args.certainty, args.yes, say)
            stop = loop.run()
    spent = loop.state.spent
    if args.json:
        write_json(args.json, {**asdict(stop), "code": stop.code, "spent": asdict(spent), "log": str(log)})
    print(f"stopped: {stop.reason.replace('_', ' ')}: {stop.says}")
    print(f"{spent.rounds} rounds, {spent.minutes:.2f} minutes of driving, {spent.snaps} snaps; all of it in {log}")
    return stop.code


def command(words: Sequence[str]) -> int:
    """Another command of straw, in this process, as from the command line."""
    from straw.replay.cli import parser

    given = parser().parse_args(list(words))
    return int(importlib.import_module(f"straw.replay.commands.{given.module}").run(given))


def _answered(args: argparse.Namespace) -> int:
    """Answer the process that waits for a yes."""
    path = Path(args.folder or (load_rig(args.rig).folder if args.rig else Path())).resolve()
    log = (args.log or log_of(path, specimen_of(path, args.specimen, emulated=True))).resolve()
    print(answer(log.with_suffix(""), args.answer == "yes", args.operator))
    return 0


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise ReplayError(f"{path} is not a folder; name the one that holds the recordings, or a new one") from None
    except OSError as error:
        raise ReplayError(f"{path}: cannot be made: {error.strerror}; choose another place") from None
