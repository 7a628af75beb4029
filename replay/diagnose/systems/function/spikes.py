"""Single readings that jump away from their neighbours and back: dropouts and glitches of a logger."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Neighbours on each side: the means of opposite ones foretell a reading three times, and the median withstands a
#: second spike among them.
SIDE = 3
#: A spike is so many times farther off than 95 % of readings are (20 standard deviations of Gaussian noise), and than
#: its neighbours' means scatter.
FAR = 10.0
#: And so many times what the channel passes through there: of a step it is half, so four times a step's.
STEPS = 2.0
#: The largest share of readings that may be spikes, less than the 5 % beyond that quantile; more is how the channel
#: moves.
MOST = 0.03


def spikes(values: Floats) -> Flags:
    """Which readings (n,) are spikes; NaN is none."""
    out = np.zeros(len(values), dtype=bool)
    good = np.flatnonzero(np.isfinite(values))
    row = values[good]
    if len(row) < 4 * SIDE:
        return out
    windows = np.lib.stride_tricks.sliding_window_view(row, 2 * SIDE + 1)
    before, after = windows[:, :SIDE][:, ::-1], windows[:, SIDE + 1 :]
    means = (before + after) / 2
    expected = np.median(means, axis=1)
    off = np.abs(windows[:, SIDE] - expected)
    scatter = np.median(np.abs(means - expected[:, None]), axis=1)
    passes = np.abs(np.median(after, axis=1) - np.median(before, axis=1))
    usual = np.maximum(scatter, max(float(np.quantile(off, 0.95)), 1e-9 * float(np.ptp(row))))
    found = (off > FAR * usual) & (off > STEPS * passes)
    if found.mean() <= MOST:
        out[good[SIDE:-SIDE][found]] = True
    return out
