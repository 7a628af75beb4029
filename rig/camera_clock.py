"""CameraClock: t_video = a + b t_host, from an LED in both recordings or from the motion, with uncertainties."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.rig.errors import RigError
from straw.rig.run import Run
from straw.tracking.lamp import Blinks

Floats = NDArray[np.float64]

BURST_GAP_S = 0.5  # within a burst the light changes every quarter of a second at the latest
OUTLIER = 4.0  # robust sigmas


@dataclass(frozen=True)
class CameraClock:
    """``t_video = a_s + b * t_host``: seconds since the video's first frame, seconds since the run's zero.

    ``residual_s`` is the RMS residual of the fit; ``sigma_b`` 0 means that b was fixed at 1. ``source`` is "led" or
    "motion"; ``edges`` are the events that were used.
    """

    a_s: float
    b: float
    sigma_a_s: float
    sigma_b: float
    residual_s: float
    edges: int
    source: str

    def __str__(self) -> str:
        drift = f", drift {(self.b - 1) * 1e6:+.0f} +- {self.sigma_b * 1e6:.0f} ppm" if self.sigma_b else ""
        return (
            f"from the {self.source}: t_video = {self.a_s:.6f} s + {self.b:.8f} t_host, "
            f"+- {self.sigma_a_s * 1e3:.2f} ms{drift}; residual {self.residual_s * 1e3:.2f} ms over {self.edges} events"
        )

    def host_s(self, video_s: Floats) -> Floats:
        """Seconds since the run's zero for times since the video's first frame."""
        return np.asarray((video_s - self.a_s) / self.b)


def bursts_of(run: Run) -> list[tuple[list[float], list[float]]]:
    """LED bursts that a run recorded: for each its changes (s since the run's zero) and their half-widths (s)."""
    changes = []
    for event in run.events:
        if event.kind == "led":
            try:
                changes.append((event.time_s, int(event.text.split("+-")[1].split()[0]) * 1e-9))
            except (IndexError, ValueError):
                raise RigError(f"{run.path}: led event {event.text!r} has no half-width; it is damaged") from None
    if not changes:
        raise RigError(f"{run.path}: recorded no LED burst; record with --led, or fit the clock to the motion")
    bursts: list[list[tuple[float, float]]] = [[changes[0]]]
    for before, now in pairwise(changes):
        if now[0] - before[0] > BURST_GAP_S:
            bursts.append([])
        bursts[-1].append(now)
    return [([t for t, _ in burst], [h for _, h in burst]) for burst in bursts]


def fit_led(run: Run, blinks: Blinks) -> CameraClock:
    """Weighted least squares through all changes seen by both; b is fixed at 1 where only one burst was seen."""
    host_s, half_s = (np.concatenate(columns) for columns in zip(*bursts_of(run), strict=True))
    burst = np.concatenate([[k] * len(times) for k, (times, _) in enumerate(bursts_of(run))])
    # A stamp lies anywhere within its half-width, a change anywhere within its frame: both uniform.
    sigma_s = np.hypot(blinks.sigma_s, half_s / np.sqrt(3.0))
    good = np.isfinite(blinks.time_s)
    late_s = blinks.time_s - host_s
    if np.any(good):
        middle = np.median(late_s[good])
        spread = 1.4826 * np.median(np.abs(late_s[good] - middle)) + blinks.sigma_s
        good &= np.abs(late_s - middle) <= OUTLIER * spread + 1e-3 * np.ptp(host_s)
    if np.count_nonzero(good) < 4:
        raise RigError(f"{run.path}: only {np.count_nonzero(good)} of {len(good)} LED changes are in the video")
    return _fitted(host_s[good], blinks.time_s[good], sigma_s[good], len(set(burst[good])) > 1, "led")


def _fitted(host_s: Floats, video_s: Floats, sigma_s: Floats, slope: bool, source: str) -> CameraClock:
    weight = 1.0 / sigma_s**2
    centre_s = float(np.sum(weight * host_s) / weight.sum())
    x, y = host_s - centre_s, video_s - host_s
    offset = float(np.sum(weight * y) / weight.sum())
    steep = float(np.sum(weight * x * y) / np.sum(weight * x**2)) if slope else 0.0
    residual = y - offset - steep * x
    # Excess scatter increases the uncertainty; small scatter never reduces it.
    freedom = max(len(y) - 1 - slope, 1)
    inflate = max(1.0, float(np.sqrt(np.sum(weight * residual**2) / freedom)))
    sigma_b = inflate / float(np.sqrt(np.sum(weight * x**2))) if slope else 0.0
    return CameraClock(
        a_s=offset - steep * centre_s,
        b=1.0 + steep,
        sigma_a_s=float(np.hypot(inflate / np.sqrt(weight.sum()), sigma_b * centre_s)),
        sigma_b=sigma_b,
        residual_s=float(np.sqrt(np.mean(residual**2))),
        edges=len(y),
        source=source,
    )


def load_clock(path: Path) -> CameraClock:
    """Read the file that ``straw clock`` wrote."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        clock = CameraClock(**{field: data[field] for field in CameraClock.__dataclass_fields__})
        if not (np.isfinite([clock.a_s, clock.b]).all() and 0.9 < clock.b < 1.1):
            raise ValueError(f"b = {clock.b}")
        return clock
    except OSError as error:
        raise RigError(f"clock {path} cannot be read: {error.strerror}; check the name") from None
    except (ValueError, KeyError, TypeError) as error:
        raise RigError(f"clock {path} is damaged ({error}); make it again with straw clock") from None


def clock_data(clock: CameraClock) -> dict[str, object]:
    """The clock for a file."""
    return asdict(clock)
