"""Roles: what a column of a table can be in a run, and by which words of its heading that is guessed."""

from __future__ import annotations

import re
from dataclasses import dataclass

from straw.rig.tables.table import Table
from straw.rig.tables.units import UNITS, bare


@dataclass(frozen=True)
class Role:
    """One role: its quantity, the topic and field it goes to, words that indicate it, its help text."""

    name: str
    quantity: str
    topic: str
    field: str
    words: str
    about: str


_P = r"(p|pressure|press|druck|pression|presi[oó]n|pressione|gauge|manometer|p g|pist|p\d)"
_TARGET = r"(target|set ?point|set|command|cmd|soll|ref\w*)"
_TIME = r"(t|time|zeit|temps|tiempo|tempo|tid|timestamp|time stamp|date ?time|datum.*|date|elapsed.*|.*\btime|time .*"
_COMMAND = rf"((p|press\w*|druck)\D*\d? ?{_TARGET}|(target|set ?point|command|cmd|soll)( ?(p|press\w*|druck))?.*"
_PRESSURE = rf"({_P}( ?\d| read\w*| ist| meas\w*| act\w*)*|.*\b(pressure|druck)( \d)?)"
_SIGMA = r"(sigma|std|sd|err\w*)"
_MEASURED, _COMMANDED, _STATE = "/pressure/measured", "/pressure/command", "/tip/state"
_ALL = (
    Role("time", "time", "", "", rf"{_TIME}|uhrzeit|zeitstempel)", "time"),
    Role("command", "pressure", _COMMANDED, "pressure_pa", rf"{_COMMAND}|p ?soll|p ?set)", "commanded gauge pressure"),
    Role("pressure", "pressure", _MEASURED, "pressure_pa", _PRESSURE, "measured gauge pressure"),
    Role("flow", "flow", _MEASURED, "flow_m3_s", r"(flow|flow ?rate|durchfluss|d[eé]bit|q)( \d)?", "flow"),
    Role("x", "length", _STATE, "x_m", r"(x|tip x|x tip|x board|.* x)", "tip, horizontal"),
    Role("z", "length", _STATE, "z_m", r"(z|tip z|z tip|.* z)", "tip, upwards"),
    Role("phi", "angle", _STATE, "phi_rad", r"(tip )?(phi|φ|ϕ|theta|θ|angle|winkel|tilt)", "tip's angle from upright"),
    Role("sigma_pressure", "pressure", _MEASURED, "sigma_pa", rf"{_SIGMA} (p|pressure|pa)", "standard deviation"),
    Role("sigma_x", "length", _STATE, "sigma_x_m", rf"{_SIGMA} x", "standard deviation of x"),
    Role("sigma_z", "length", _STATE, "sigma_z_m", rf"{_SIGMA} z", "standard deviation of z"),
    Role("sigma_phi", "angle", _STATE, "sigma_phi_rad", rf"{_SIGMA} phi", "standard deviation of phi"),
    Role("valid", "number", _STATE, "valid", r"(valid|ok|gültig)", "0 where the tip is not to be trusted"),
    Role("frame", "number", _STATE, "frame", r"(frame|frame ?(no|number|index)|bild|image)", "the frame's number"),
    Role("likelihood", "number", _STATE, "valid", r"(likelihood|.* likelihood)", "valid where it is high enough"),
    Role("event", "number", "/events", "text", r"(event|events|remark|comment|bemerkung)", "words kept as events"),
)
ROLES = {role.name: role for role in _ALL}
TIP = ("x", "z", "phi")
SIGNALS = ("command", "pressure", *TIP, "event")


def guess(table: Table, wanted: tuple[str, ...], taken: set[str]) -> dict[str, str]:
    """Column by role, for roles that were not stated, from the words of the headings; only unused columns."""
    found: dict[str, str] = {}
    for role in wanted:
        for name, column in table.columns.items():
            if name in taken or name in found.values() or not re.fullmatch(ROLES[role].words, bare(name)):
                continue
            quantity = ROLES[role].quantity
            if column.unit and quantity != "number" and column.unit not in UNITS[quantity]:
                continue
            if (column.is_text and role not in ("time", "event")) or (role == "flow" and not column.unit):
                continue
            found[role] = name
            break
    if "pressure" not in found:
        found.pop("flow", None)
    if "z" in wanted and "z" not in found and "x" in found:  # a plane of a video has x and y
        like_x = re.sub(r"x", "y", bare(found["x"]))
        for name in table.columns:
            if name not in taken and name not in found.values() and bare(name) == like_x:
                found["z"] = name
    return found
