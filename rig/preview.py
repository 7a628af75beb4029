"""Preview: a recording reduced for a thumbnail: pressure against time, the tip's path."""

from __future__ import annotations

from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from straw.rig.run import Run

Floats = NDArray[np.float64]
Preview: TypeAlias = dict[str, list[int]]
#: Bins of the pressure's curve; each keeps its lowest and highest sample, so that no peak is lost.
BINS = 24
#: Points of the tip's path.
POINTS = 48
#: Units of the integers: a thumbnail shows no less than 0.1 kPa and 0.1 mm.
STEP_PA, STEP_M = 100.0, 1e-4


def preview_of(run: Run) -> Preview:
    """``t`` (thousandths of the run) and ``p`` (0.1 kPa) of the pressure, ``x`` and ``z`` (0.1 mm) of the tip."""
    preview: Preview = {}
    if run.pressure is not None and len(run.pressure) > 1:
        at = _extremes(run.pressure.pressure_pa)
        time_s = run.pressure.time_s
        share = (time_s[at] - time_s[0]) / (time_s[-1] - time_s[0])
        preview["t"] = np.round(1000 * share).astype(int).tolist()
        preview["p"] = np.round(run.pressure.pressure_pa[at] / STEP_PA).astype(int).tolist()
    tip = run.tip or next((model.tip for model in run.predictions.values() if model.tip), None)
    if tip is not None and np.count_nonzero(tip.valid) > 1:
        seen = np.flatnonzero(tip.valid)
        at = seen[np.linspace(0, len(seen) - 1, min(POINTS, len(seen))).astype(int)]
        preview["x"], preview["z"] = (np.round(axis[at] / STEP_M).astype(int).tolist() for axis in (tip.x_m, tip.z_m))
    return preview


def _extremes(values: Floats) -> NDArray[np.intp]:
    """Indices (increasing) of the lowest and highest value in each of ``BINS`` bins, and of both ends."""
    edges = np.linspace(0, len(values), BINS + 1).astype(int)
    kept = {0, len(values) - 1}
    for low, high in pairwise(edges.tolist()):
        if high > low:
            kept |= {low + int(np.argmin(values[low:high])), low + int(np.argmax(values[low:high]))}
    return np.array(sorted(kept))
