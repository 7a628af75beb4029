"""Predict: a protocol before it is run: the rig's commands and the straw's motion, as a page of the report.

``python -m straw.replay.lab.predict`` reads one task a line and answers one line each: the model is compiled once, in a
process of its own, so that neither its memory nor its work is the server's.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np

from straw.replay.errors import USER_ERRORS

#: Rows a second of a prediction, and at the most: a long protocol is drawn with longer steps.
RATE_HZ, MOST = 60.0, 3000


def predicted(task: dict[str, Any]) -> dict[str, Any]:
    """The prediction's page, its snaps as [time s, cell], and where the tip ends; raises as its parts do."""
    from straw.model.straw_file import straw_from_toml
    from straw.replay.live.follow import Follower
    from straw.replay.live.server import run_of
    from straw.replay.report.page import SCRIPTS, assemble
    from straw.rig.outlet import Outlet
    from straw.rig.protocol_toml import protocol_from_toml

    protocol = protocol_from_toml(task["toml"], "protocol")
    straw = straw_from_toml(task.get("straw", ""))
    follower, outlet = Follower(straw, protocol), Outlet(protocol)
    count = int(min(MOST, protocol.duration_s * RATE_HZ)) + 1
    for time_s in np.linspace(0.0, protocol.duration_s, count)[1:].tolist():
        follower.reading(time_s, float(outlet(np.array([time_s]))[0]), float(protocol(time_s)))
    run = run_of(straw, protocol, orders=False) | {"role": "predicted", "rows": follower.rows}
    bent, snaps, seen = run["straw"]["bent"], [], set()
    for row in follower.rows:
        for cell, angle in enumerate(row[8], 1):
            if abs(angle) > bent / 2 and cell not in seen:
                seen.add(cell)
                snaps.append([row[0], cell])
    says = f"Not run yet: the model's prediction of {protocol.name}, through a controller of nominal speed."
    return {
        "page": assemble(protocol.name, says, [run], "live", (*SCRIPTS, "vent", "live")),
        "snaps": snaps,
        "end": dict(zip(("x_mm", "z_mm", "phi_deg"), follower.rows[-1][4:7], strict=True)),
    }


def main() -> None:
    """Answer until stdin ends."""
    for line in sys.stdin:
        try:
            answer = predicted(json.loads(line))
        except USER_ERRORS as error:
            answer = {"error": " ".join(str(error).split())}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
