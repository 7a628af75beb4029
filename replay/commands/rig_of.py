"""The rig of a command: its rig file, overridden by its flags."""

from __future__ import annotations

import argparse
from typing import Any

from straw.replay.commands.rig_settings import settings_of as given_settings
from straw.replay.errors import ReplayError
from straw.rig.rig_file import RigFile, load_rig

CONTROLLER, RATE_HZ = "ob1-mk4", 100.0


def take_rig(args: argparse.Namespace) -> RigFile | None:
    """Fill in what the flags leave open, from ``--rig`` where it is given; ReplayError where no rig is given."""
    rig = load_rig(args.rig) if args.rig else None
    if rig is None and not args.port and not args.emulate:
        raise ReplayError("no rig: give --port URL, --emulate, or --rig rig.toml")
    if rig is not None:
        if not args.port and not args.emulate:
            args.port, args.emulate = rig.port or None, rig.emulated
        for name, value in (("controller", rig.controller), ("rate", rig.rate_hz), ("straw", rig.straw)):
            if hasattr(args, name) and getattr(args, name) is None:
                setattr(args, name, value)
        if hasattr(args, "led"):
            args.led = args.led or rig.led
    args.controller = args.controller or CONTROLLER
    if hasattr(args, "rate"):
        args.rate = args.rate or RATE_HZ
    return rig


def settings_of(args: argparse.Namespace) -> dict[str, Any]:
    """Channels, limits and driver settings: the rig file's, and over them the command line's."""
    rig = load_rig(args.rig) if getattr(args, "rig", None) else None
    settings: dict[str, Any] = {}
    if rig is not None:
        settings = {**rig.settings, "channels": rig.channels, "limits": rig.limits}
    given = given_settings(args)
    if rig is not None and "limits" in given:
        given["limits"] = given["limits"].and_also(rig.limits)  # the table's limits stay below
    return settings | given
