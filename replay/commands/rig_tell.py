"""straw rig tell: an order to a run in progress, from any terminal of this machine."""

from __future__ import annotations

import argparse
import getpass
from pathlib import Path

from straw.replay.errors import ReplayError
from straw.rig.errors import RigError
from straw.rig.orders import SUFFIX, control_of, send_order


def run(args: argparse.Namespace) -> int:
    """Give the order to the run that is named, or to every one below the folder; 0 when one obeyed."""
    controls = [control_of(args.run)] if args.run else sorted(args.dir.rglob(f"*{SUFFIX}"))
    obeyed = 0
    for control in controls:
        try:
            state = send_order(control, args.order, f"{getpass.getuser()} at a terminal", timeout_s=2.0)
        except RigError as error:
            if args.run:
                raise
            print(f"{error}; what is left of it may be removed: {control}")
            continue
        obeyed += 1
        print(f"{name_of(control)}: {state}")
    if not obeyed:
        raise ReplayError(f"{args.dir}: no run in progress there takes orders (straw rig run --live and straw lab do)")
    return 0


def name_of(control: Path) -> Path:
    """The recording of a control file."""
    return control.with_name(control.name.removesuffix(SUFFIX))
