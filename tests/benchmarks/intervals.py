"""Confidence intervals of a mean over clips: bootstrap by whole clips, since errors of frames are correlated."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm, t

_DRAWS = 4000


def between(by_clip: ArrayLike, level: float = 0.95) -> NDArray[np.float64]:
    """Return the interval (2, m) of the mean of values (clips, m), one row a clip; infinite for a single clip.

    Bootstrap by clips, its percentiles expanded: with few clips plain ones are too narrow (Hesterberg, What teachers
    should know about the bootstrap, Am. Stat. 69 (2015) 371, section 4.3.3). For four clips it spans all their values,
    and cannot include rarer ones.
    """
    values = np.atleast_2d(np.asarray(by_clip, dtype=np.float64))
    n = len(values)
    if n < 2:
        return np.stack((np.zeros(values.shape[1]), np.full(values.shape[1], np.inf)))
    tail = norm.cdf(np.sqrt(n / (n - 1)) * t.ppf((1 - level) / 2, n - 1))
    drawn = values[np.random.default_rng(0).integers(n, size=(_DRAWS, n))].mean(axis=1)
    return np.asarray(np.quantile(drawn, (tail, 1 - tail), axis=0))


def shown(by_clip: ArrayLike) -> str:
    """Return the intervals of values (clips, m) as text."""
    return ", ".join(f"{low:.2f} to {high:.2f}" for low, high in between(by_clip).T)


def beside(by_clip: ArrayLike) -> list[str]:
    """Return each column's interval as text in brackets, to follow its mean; empty for a single clip."""
    values = np.atleast_2d(np.asarray(by_clip, dtype=np.float64))
    return [f" ({low:.2f} to {high:.2f})" if len(values) > 1 else "" for low, high in between(values).T]
