"""Limits and settings of a driver, or of an emulated instrument, as given on the command line."""

from __future__ import annotations

import argparse
import ast
from typing import Any

from straw.replay.errors import ReplayError
from straw.rig.limits import PressureLimits


def settings_of(args: argparse.Namespace) -> dict[str, Any]:
    """Limits and driver settings as given on the command line."""
    settings: dict[str, Any] = {}
    for text in args.setting:
        key, equals, value = text.partition("=")
        if not equals or not key.isidentifier():
            raise ReplayError(f"--setting {text}: expected KEY=VALUE, as unit=B or regulators=4,0,0,0")
        try:
            settings[key] = ast.literal_eval(value)
        except (ValueError, SyntaxError):
            settings[key] = value  # text needs no quotes
    if args.limits:
        try:
            low, high, *rate = (float(part) * 1e3 for part in args.limits.split(","))
            settings["limits"] = PressureLimits(low, high, *rate)
        except (ValueError, TypeError):
            raise ReplayError(
                f"--limits {args.limits}: expected MIN,MAX or MIN,MAX,RATE in kPa, as -40,60,50"
            ) from None
    return settings
