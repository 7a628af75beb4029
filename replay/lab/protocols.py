"""Protocols for the panel: the list of files, and one drawn against its limits as it is being written."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from straw.rig.errors import RigError
from straw.rig.limits import PressureLimits
from straw.rig.protocol_toml import protocol_from_toml

#: Points of a drawing; longer ones are thinned evenly.
POINTS = 2000
LARGEST = 100_000


def known_protocols(folder: Path) -> list[dict[str, str]]:
    """Protocol files of the folder (itself and ``protocols``), then those that come with straw, as name and text."""
    found: dict[str, dict[str, str]] = {}
    shipped = Path(str(files("straw.rig").joinpath("protocols")))
    for place, source in ((folder, "here"), (folder / "protocols", "here"), (shipped, "shipped")):
        for path in sorted(place.glob("*.toml")) if place.is_dir() else []:
            try:
                text = path.read_text(encoding="utf-8") if path.stat().st_size < LARGEST else ""
            except (OSError, UnicodeDecodeError):
                continue
            if "[[main]]" in text or ("main" in text and "pressure_unit" in text):
                found.setdefault(path.name, {"name": path.stem, "toml": text, "source": source})
    return list(found.values())


def drawn(toml: str, limits: PressureLimits | None) -> dict[str, Any]:
    """A protocol compiled: its table in s and kPa for each channel, its limits; RigError with the line to correct."""
    protocol = protocol_from_toml(toml, "protocol")
    bound = protocol.limits.and_also(limits) if limits else protocol.limits
    beyond = ""
    try:
        for part in protocol.parts:
            part.check_limits(bound)
    except RigError as error:
        beyond = str(error)
    return {
        "name": protocol.name,
        "specimen": protocol.specimen,
        "deployed": ",".join(map(str, protocol.initial_deployed)) or "none",
        "duration_s": protocol.duration_s,
        "zero_s": protocol.zero_s,
        "limits": [bound.min_pa / 1e3, bound.max_pa / 1e3],
        "says": f"{protocol.duration_s:g} s, {protocol.pressure_pa.min() / 1e3:g} to "
        f"{protocol.pressure_pa.max() / 1e3:g} kPa; limits {bound}",
        "beyond": beyond,
        "channels": [
            {
                "channel": part.channel,
                "time_s": np.round(part.time_s[every] - protocol.zero_s, 4).tolist(),
                "kpa": np.round(part.pressure_pa[every] / 1e3, 4).tolist(),
            }
            for part in protocol.parts
            for every in [slice(None, None, max(1, len(part.time_s) // POINTS))]
        ],
    }
