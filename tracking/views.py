"""Views: the record's corners as rays, each corrected to the moment when the board's middle row was exposed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.tracking.around import nearest, polynomial
from straw.tracking.askew import along, leaning, present
from straw.tracking.lens import Lens
from straw.tracking.record import Record, Rows

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

AROUND = 8  # frames of context on either side of a chunk: two pictures on either side of three B pictures
_NEIGHBOUR_PERIODS = 1.5  # frames farther apart than this give no velocity
_MOST_BETWEEN = 4  # periods from one picture that is no B picture to the next, for a cubic to know the course
_QUINTIC = np.array((-1, 6, -15, 20, -15, 6, -1)) / 20
LEAP_GAIN = float((_QUINTIC**2).sum())  # variance of ``leap_px`` over that of errors independent from frame to frame
# Central differences of the first three derivatives, by how many frames on either side.
_STENCILS = {
    1: ((-1 / 2, 0, 1 / 2), (1, -2, 1), (0, 0, 0)),
    2: ((1 / 12, -2 / 3, 0, 2 / 3, -1 / 12), (-1 / 12, 4 / 3, -5 / 2, 4 / 3, -1 / 12), (-1 / 2, 1, 0, -1, 1 / 2)),
    3: (
        (-1 / 60, 3 / 20, -3 / 4, 0, 3 / 4, -3 / 20, 1 / 60),
        (1 / 90, -3 / 20, 3 / 2, -49 / 18, 3 / 2, -3 / 20, 1 / 90),
        (1 / 8, -1, 13 / 8, 0, -13 / 8, 1, -1 / 8),
    ),
}


@dataclass(frozen=True)
class Views:
    """Corners of f frames: ``rays`` (f, n, 2) as seen, ``px_per_ray`` (f, n, 2, 2), ``used`` (f, n), ``time_s`` (f,).

    Rolling shutter: ``rows`` (f, n) is how many rows below the board's middle a corner was exposed, ``middle`` (f,) the
    middle's row. ``rate``, ``bend`` and ``jerk`` (f, n, 2) are the rays' time derivatives by the frames around.
    ``doubt`` (f,): by how much, px/s, the rate changes when it is computed from more frames around. ``across`` (f, 2,
    2): unit vectors across the edges of x and of y, in the picture; the nearest ones that are perpendicular.
    ``widths`` (f, 2): half widths of the edges, px, and ``sweep`` (f, 2) how fast (px/s) the board's middle crosses
    them. ``key`` (f,): coded without prediction. ``speed_px`` (f,): the corners' motion from
    frame to frame, rms per coordinate, and ``jump_px`` (f,) how far ahead they lie of the prediction from three frames
    on either side, ``leap_px`` (f, n, 2) the same of each corner along u and v; NaN without those. ``chord_px`` (f, n,
    2): of B pictures, the mean by time of the pictures
    around it, from which it is predicted, minus the corners' smooth course. ``leans`` (f, n, 2) and ``askew_px`` (f,):
    errors of edges askew to the raster, as shares, and how far corners lie ahead of the prediction along these.
    """

    frame: NDArray[np.int64]
    time_s: Floats
    rays: Floats
    px_per_ray: Floats
    used: Flags
    rows: Floats
    middle: Floats
    rate: Floats
    bend: Floats
    jerk: Floats
    doubt: Floats
    pitch_px: Floats
    across: Floats
    widths: Floats
    sweep: Floats
    key: Flags
    jump_px: Floats
    leap_px: Floats
    speed_px: Floats
    chord_px: Floats
    leans: Floats
    askew_px: Floats

    def straightened(self, askew_px: float) -> Views:
        """Return views without the error of edges that run askew, which is ``askew_px`` in keyframes."""
        off = self.off(askew_px)
        (a, b), (c, d) = np.moveaxis(self.px_per_ray, (-2, -1), (0, 1))
        u, v, by = off[..., 0], off[..., 1], a * d - b * c
        change = np.stack((d * u - b * v, a * v - c * u), axis=-1) / np.where(by == 0, 1.0, by)[..., None]
        return replace(self, rays=self.rays - change)

    def off(self, askew_px: float) -> Floats:
        """Return the error (f, n, 2), px, of edges that run askew."""
        return np.asarray(askew_px * present(self.key, self.speed_px)[:, None, None] * self.leans)

    def at_once(self, line_s: float, exposure_s: float) -> Floats:
        """Return the rays (f, n, 2) as an ideal global shutter would have seen them.

        Open for T at acceleration a, the middle of the blur lies a T^2 / 24 off: 20 um at 100 m/s^2, 1/480 s.
        """
        late_s, blur = line_s * self.rows[..., None], exposure_s**2 / 24
        rate = self.rate - blur * self.jerk
        return self.rays - late_s * rate + (late_s**2 / 2 - blur) * self.bend

    def by_line(self, line_s: float, exposure_s: float) -> Floats:
        """Return by how much ``at_once`` changes with the row time (f, n, 2)."""
        rows = self.rows[..., None]
        return rows * (line_s * rows * self.bend - self.rate + exposure_s**2 / 24 * self.jerk)

    def pick(self, which: NDArray[np.intp]) -> Views:
        """Return some of the frames."""
        return Views(**{name: getattr(self, name)[which] for name in self.__dataclass_fields__})


def joined(parts: Sequence[Views]) -> Views:
    """Return the frames of several views in one."""
    return Views(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in Views.__annotations__})


def views_of(
    record: Record, lens: Lens, start: int, rows: Rows, believed: Flags | None = None
) -> tuple[Views, NDArray[np.intp]]:
    """Return the views of a chunk of the record, and where in the chunk they are.

    ``believed``: of each frame of the video, whether its sighting is used (see ``doubt``); None: all are.
    """
    around = record.rows(start - AROUND, start + len(rows) + AROUND)
    lead = min(start, AROUND)
    n = record.shape[0] * record.shape[1]
    pixels = around["grid"].reshape(-1, n, 2).astype(np.float64)
    seen, time_s = around["seen"], around["time_s"]
    if believed is not None:
        seen = seen & believed[start - lead : start - lead + len(around)]
    flat, slopes = lens.rays_with_slopes(np.where(seen[:, None, None], pixels, lens.cx).reshape(-1, 2))
    rays = flat.reshape(pixels.shape)
    rate, bend, jerk, doubt = _derivatives(rays, time_s, seen)
    leans = leaning(pixels.reshape(-1, *record.shape, 2))
    jump_px, leap_px, speed_px, askew_px = _jumps(pixels, leans, time_s, seen)
    where = np.flatnonzero(seen[lead : lead + len(rows)])
    at = where + lead
    middle = pixels[at, :, 1].mean(axis=1)
    grid = pixels[at].reshape(-1, *record.shape, 2)
    axes = np.stack((np.diff(grid, axis=2).mean(axis=(1, 2)), np.diff(grid, axis=1).mean(axis=(1, 2))), axis=1)
    normals = np.stack((-axes[..., 1], axes[..., 0]), axis=-1) / np.linalg.norm(axes, axis=-1, keepdims=True)
    px_per_ray = np.nan_to_num(slopes.reshape(len(pixels), n, 2, 2)[at])
    speed = np.einsum("fnij,fnj->fi", px_per_ray, np.nan_to_num(rate[at]))
    unsure = np.einsum("fnij,fnj->fni", px_per_ray, np.nan_to_num(doubt[at]))
    along = np.diff(grid, axis=1)
    finite = np.isfinite(rays[at]).all(axis=-1)
    views = Views(
        frame=rows["frame"][where].astype(np.int64),
        time_s=time_s[at],
        rays=np.nan_to_num(rays[at]),
        px_per_ray=px_per_ray,
        used=around["used"].reshape(-1, n)[at] & finite,
        rows=pixels[at, :, 1] - middle[:, None],
        middle=middle,
        rate=np.nan_to_num(rate[at]),
        bend=np.nan_to_num(bend[at]),
        jerk=np.nan_to_num(jerk[at]),
        doubt=np.sqrt((unsure**2).mean(axis=(1, 2))) if len(at) else np.empty(0),
        pitch_px=np.sqrt((along**2).sum(axis=-1).reshape(len(at), -1).min(axis=1)) if len(at) else np.empty(0),
        across=_perpendicular(normals),
        widths=around["widths"][at].astype(np.float64),
        sweep=np.abs(np.einsum("fki,fi->fk", normals, speed / n)),
        key=around["key"][at],
        jump_px=jump_px[at],
        leap_px=leap_px[at],
        speed_px=speed_px[at],
        chord_px=chords(pixels, time_s, seen, around["between"])[at],
        leans=leans.reshape(-1, n, 2)[at],
        askew_px=askew_px[at],
    )
    return views, where


def _derivatives(rays: Floats, time_s: Floats, seen: Flags) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the first three time derivatives by as many as seven frames around each; zero for a lone frame.

    Then by how much the last two frames changed the first derivative: all of it where it rests on one difference.
    By three frames the speed of a snap of 20 ms comes out 7 % too small, by seven 0.1 %.
    """
    n = len(time_s)
    rate, bend, jerk, doubt = np.zeros((4, *rays.shape))
    if n < 2:
        return rate, bend, jerk, doubt
    gap_s = np.diff(time_s)
    period_s = float(np.median(gap_s))
    joined = seen[1:] & seen[:-1] & (gap_s < _NEIGHBOUR_PERIODS * period_s)
    rate[:-1][joined] = rate[1:][joined] = (np.diff(rays, axis=0) / gap_s[:, None, None])[joined]
    doubt[:] = rate
    for reach, (first, second, third) in _STENCILS.items():
        at = np.flatnonzero(_runs(joined, 2 * reach)) + reach
        for found, weights, order in ((rate, first, 1), (bend, second, 2), (jerk, third, 3)):
            parts = sum(w * rays[at + k - reach] for k, w in enumerate(weights) if w) / period_s**order
            if found is rate:
                doubt[at] = parts - rate[at]
            found[at] = parts
    return rate, bend, jerk, doubt


def chords(pixels: Floats, time_s: Floats, seen: Flags, between: Flags) -> Floats:
    """Return by how much (f, n, 2), px, the line between a B picture's neighbours is off the cubic through two a side.

    The neighbours are those that are no B pictures themselves; 0 for other pictures, and without two on either side.
    """
    found = np.zeros_like(pixels)
    if not (between & seen).any():
        return found
    before, after = nearest(seen & ~between, len(seen), 2)
    by = np.concatenate((before, after), axis=1)
    span_s = np.ptp(time_s[by], axis=1)
    near = span_s < 3 * _MOST_BETWEEN * np.median(np.diff(time_s))
    at = np.flatnonzero(between & seen & (by >= 0).all(axis=1) & near)
    flat = pixels.reshape(len(pixels), -1)
    line, cubic = (polynomial(time_s, flat, time_s[at], by[at][:, of])[0] for of in ([0, 2], [0, 1, 2, 3]))
    found[at] = (line - cubic).reshape(-1, *pixels.shape[1:])
    return found


def _perpendicular(normals: Floats) -> Floats:
    """Return the pairs of perpendicular unit vectors (f, 2, 2) nearest to pairs that are not quite."""
    angle = np.arctan2(normals[..., 1], normals[..., 0])
    apart = np.mod(angle[:, 1] - angle[:, 0], np.pi) - np.pi / 2  # the sign of a normal does not matter
    cos, sin = np.cos(angle[:, 0] + apart / 2), np.sin(angle[:, 0] + apart / 2)
    return np.stack((np.stack((cos, sin), axis=-1), np.stack((-sin, cos), axis=-1)), axis=1)


def _runs(flags: Flags, length: int) -> Flags:
    """Return where (n + 1 - length,) as many flags as this, from there on, are all set; empty where n is too small."""
    if len(flags) < length:
        return np.zeros(0, np.bool_)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(flags, length).all(axis=1))


def _jumps(pixels: Floats, leans: Floats, time_s: Floats, seen: Flags) -> tuple[Floats, Floats, Floats, Floats]:
    """Return how far (f,) the corners are ahead of the quintic through three frames on either side, each of them off it
    (f, n, 2), and their speed; then how far along ``leans`` (f, nx, ny, 2)."""
    n = len(time_s)
    leap, (jump, speed, askew) = np.full(pixels.shape, np.nan), np.full((3, n), np.nan)
    if n > 6:
        even = np.diff(time_s) < _NEIGHBOUR_PERIODS * np.median(np.diff(time_s))
        whole = _runs(seen, 7) & _runs(even, 6)
        parts = sum(w * pixels[k : n - 6 + k] for k, w in enumerate(_QUINTIC))
        motion = (pixels[4:-2] - pixels[2:-4]) / 2
        length = np.sqrt((motion**2).mean(axis=(1, 2)))
        leap[3:-3] = np.where(whole[:, None, None], parts, np.nan)
        jump[3:-3] = np.where(whole, (parts * motion).mean(axis=(1, 2)) / np.maximum(length, 1e-9), np.nan)
        speed[3:-3] = np.where(whole, length, np.nan)
        askew[3:-3] = np.where(whole, along(parts.reshape(-1, *leans.shape[1:]), leans[3:-3]), np.nan)
    return jump, leap, speed, askew
