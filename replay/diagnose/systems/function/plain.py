"""A user's plain function, ``simulate(t, u, c)`` of whole recordings, with added laws."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.systems.function.clocks import delays, warped
from straw.replay.diagnose.systems.function.codes import (
    CHANNEL,
    FACTOR,
    INPUT,
    OF_INPUT,
    OF_SHOWN,
    OF_TIME,
    SHIFT,
    STRENGTH,
)
from straw.replay.diagnose.systems.function.functions import fields
from straw.replay.diagnose.systems.function.law_values import ahead_of, within
from straw.replay.diagnose.systems.function.model import Model
from straw.replay.diagnose.systems.function.shapes import FOLLOWS, PLAY, YIELDS, values_of
from straw.replay.errors import ReplayError

Floats = NDArray[np.float64]


def plain_march(model: Model, t: Floats, inputs: Floats, c: Floats, rows: NDArray[np.int64], p: Floats) -> Floats:
    """Shown (channels, n). A law in a constant makes it an array over the recording where the law has a state."""
    late = delays(rows, p, len(inputs))
    U, C = fields("U", [i.name for i in model.inputs]), fields("C", [k.name for k in model.constants])
    felt = np.array([np.interp(t - s, t, row) if s else row for s, row in zip(late, inputs, strict=True)])
    felt = felt.reshape(inputs.shape)
    shown = np.zeros((len(model.channels), len(t)))

    def force(m: int) -> Floats:
        kind, which = rows[m, 2], rows[m, 3]
        s = felt[which] if kind == OF_INPUT else t if kind == OF_TIME else np.ones_like(t)
        if kind == OF_SHOWN:
            s = shown[which]
        if rows[m, 7] >= 0:
            made = {PLAY: with_play, YIELDS: with_gradual_play}.get(int(rows[m, 4]), lagged)
            late = made(t, s, p[rows[m, 5] - 1])
            s = late - s if rows[m, 4] in (FOLLOWS, PLAY, YIELDS) else late
        out = values_of(rows[m, 4], p[rows[m, 5] : rows[m, 5] + rows[m, 6]], s)
        for j in np.flatnonzero((rows[:, 0] == STRENGTH) & (rows[:, 1] == m)):
            out = out * (1 + force(int(j)))
        return out

    constants: list[Floats | float] = [float(x) for x in c]
    u = felt.copy()
    for m in range(len(rows)):
        if rows[m, 0] == FACTOR:
            constants[rows[m, 1]] = constants[rows[m, 1]] * (1 + force(m))
        elif rows[m, 0] == SHIFT:
            constants[rows[m, 1]] = constants[rows[m, 1]] + force(m)
        elif rows[m, 0] == INPUT:
            u[rows[m, 1]] += force(m)
    try:
        said = model.module.simulate(t, U(*(list(u[: len(model.inputs)]) or [0.0])), C(*constants))
        shown[:] = np.asarray(said, dtype=np.float64).reshape(shown.shape)
    except Exception as problem:  # the user's code may raise anything
        raise ReplayError(f"{model.path}: simulate(t, u, c): {type(problem).__name__}: {problem}") from problem
    for m in range(len(rows)):
        if rows[m, 0] == CHANNEL:
            shown[rows[m, 1]] += force(m)
    warped(rows, p, t, shown)
    return shown


def lagged(t: Floats, s: Floats, tau_s: float) -> Floats:
    """A signal (n,) through a first-order lag, from its first value: exact for one that is linear between samples."""
    out = np.empty_like(s)
    z = out[0] = s[0]
    for k in range(len(t) - 1):
        h = t[k + 1] - t[k]
        fade, slope = np.exp(-h / tau_s), (s[k + 1] - s[k]) / h
        z = out[k + 1] = s[k + 1] - slope * tau_s + (z - s[k] + slope * tau_s) * fade
    return out


def with_play(t: Floats, s: Floats, half_width: float) -> Floats:
    """A signal (n,) through a play, from its first value."""
    out = np.empty_like(s)
    z = out[0] = s[0]
    for k in range(1, len(t)):
        z = out[k] = within(z, s[k], half_width)
    return out


def with_gradual_play(t: Floats, s: Floats, half_width: float) -> Floats:
    """A signal (n,) through a gradual play, from its first value."""
    out = np.empty_like(s)
    out[0], z = s[0], 0.0
    for k in range(1, len(t)):
        z = ahead_of(z, s[k] - s[k - 1], half_width)
        out[k] = s[k] - z
    return out
