"""A network over sets of runs and its training: one encoder for every run, mean and maximum over runs, then a head.

Deep sets (Zaheer et al. 2017); Adam (Kingma and Ba 2015) with decoupled weight decay (Loshchilov and Hutter 2019). In
NumPy, which suffices for two matrices before and two behind the pooling: it trains in minutes, and a user who adds a
law can train it again without further dependencies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Singles = NDArray[np.float32]

#: Widths: of the encoder's two layers and of the head's first.
ENCODER, HEAD = (256, 128), 256
#: Largest step, decay of weights and memory of both moments of Adam (Loshchilov and Hutter 2019, its usual memory).
RATE, DECAY, BETAS = 2e-3, 0.1, (0.9, 0.999)
#: Shares of inputs and of neurons that are left out in training (Srivastava et al. 2014).
DROP_IN, DROP = 0.02, 0.25
#: Least and largest logarithm of a stated deviation; weight of the numbers beside the causes;
#: deviations beyond which an error of a number no longer pulls.
LOG_SD, NUMBERS, OUTLIER = (-3.0, 2.0), 0.3, 2.5


@dataclass(frozen=True, eq=False)
class Batch:
    """Runs of some campaigns one after the other: x (runs, features), and where each campaign's begin."""

    x: Singles
    starts: NDArray[np.int64]

    def counts(self) -> NDArray[np.int64]:
        """Runs of each campaign."""
        return np.diff(np.append(self.starts, len(self.x)))


@dataclass(frozen=True, eq=False)
class Truth:
    """``present`` (campaigns, causes) 0 or 1; ``values`` (campaigns, numbers) in deviations, NaN where there is no
    target."""

    present: Singles
    values: Singles


Weights = dict[str, Singles]


def fresh(rng: np.random.Generator, features: int, causes: int, numbers: int) -> Weights:
    """Weights to begin with (He et al. 2015)."""
    sizes = [(features, ENCODER[0]), ENCODER, (2 * ENCODER[1] + 1, HEAD), (HEAD, causes + 2 * numbers)]
    out: Weights = {}
    for k, (a, b) in enumerate(sizes):
        scale = np.sqrt(2 / a) * (0.1 if k == len(sizes) - 1 else 1.0)
        out[f"w{k}"] = rng.normal(scale=scale, size=(a, b)).astype(np.float32)
        out[f"b{k}"] = np.zeros(b, dtype=np.float32)
    return out


def answer(w: Weights, batch: Batch) -> Singles:
    """The network's output for each campaign, (campaigns, causes + 2 numbers)."""
    return _forward(w, batch, None)[0]


def _forward(w: Weights, batch: Batch, rng: np.random.Generator | None) -> tuple[Singles, dict[str, Singles]]:
    def dropped(x: Singles, share: float) -> tuple[Singles, Singles | float]:
        if rng is None:
            return x, 1.0
        mask = (rng.random(x.shape, dtype=np.float32) >= share).astype(np.float32) / np.float32(1 - share)
        return x * mask, mask

    x, _ = dropped(batch.x, DROP_IN)
    h0, m0 = dropped(np.maximum(x @ w["w0"] + w["b0"], 0), DROP)
    h1 = np.maximum(h0 @ w["w1"] + w["b1"], 0)
    counts = batch.counts()[:, None].astype(np.float32)
    mean = np.add.reduceat(h1, batch.starts) / counts
    most = np.maximum.reduceat(h1, batch.starts)
    pooled, m1 = dropped(np.concatenate([mean, most], axis=1), DROP)
    how_many: Singles = np.log(counts).astype(pooled.dtype)
    joined: Singles = np.concatenate([pooled, how_many], axis=1)
    h2, m2 = dropped(np.maximum(joined @ w["w2"] + w["b2"], 0), DROP)
    out = h2 @ w["w3"] + w["b3"]
    kept = {"x": x, "h0": h0, "h1": h1, "most": most, "joined": joined, "h2": h2}
    kept.update({k: np.asarray(m, dtype=np.float32) for k, m in (("m0", m0), ("m1", m1), ("m2", m2))})
    return out, kept


def loss(out: Singles, truth: Truth, known_means: Singles | None = None) -> tuple[float, Singles]:
    """Cross entropy of the causes, squared error of the numbers, and negative log likelihood of the numbers' deviations
    about means taken as known (``known_means``, else as in ``out``): the mean of all campaigns; and its slope by out.

    If means were learned by likelihood, the accurate ones would dominate all others (Seitzer et al. 2022).
    """
    causes, numbers, n = truth.present.shape[1], truth.values.shape[1], len(out)
    logits, mean, raw = out[:, :causes], out[:, causes : causes + numbers], out[:, causes + numbers :]
    p = 1 / (1 + np.exp(-np.clip(logits, -30, 30)))
    total = float(np.sum(np.logaddexp(0, logits) - truth.present * logits))
    known, truth_or_0 = np.isfinite(truth.values), np.nan_to_num(truth.values)
    off = np.where(known, mean - truth_or_0, 0)
    log_sd = np.clip(raw, *LOG_SD)
    about = mean if known_means is None else known_means
    away = np.where(known, np.clip((about - truth_or_0) / np.exp(log_sd), -OUTLIER, OUTLIER), 0)
    # beyond OUTLIER deviations an error is clipped, with the slope of the clipped number
    within = known & (raw > LOG_SD[0]) & (raw < LOG_SD[1])
    total += NUMBERS * float(np.sum(0.5 * off**2) + np.sum(np.where(known, 0.5 * away**2 + log_sd, 0)))
    slope = np.empty_like(out)
    slope[:, :causes] = p - truth.present
    slope[:, causes : causes + numbers] = NUMBERS * off
    slope[:, causes + numbers :] = NUMBERS * np.where(within, 1 - away**2, 0)
    return total / n, slope / np.float32(n)


def slopes(w: Weights, batch: Batch, truth: Truth, rng: np.random.Generator | None) -> tuple[float, Weights]:
    """The loss and its derivative by every weight, by back-propagation."""
    out, kept = _forward(w, batch, rng)
    value, back = loss(out, truth)
    grad: Weights = {"w3": kept["h2"].T @ back, "b3": back.sum(axis=0)}
    back = (back @ w["w3"].T) * kept["m2"] * (kept["h2"] > 0)
    grad["w2"], grad["b2"] = kept["joined"].T @ back, back.sum(axis=0)
    back = (back @ w["w2"].T)[:, :-1] * kept["m1"]
    width, counts = ENCODER[1], batch.counts()
    each: Singles = np.repeat(back[:, :width] / counts[:, None].astype(back.dtype), counts, axis=0)
    largest = kept["h1"] == np.repeat(kept["most"], counts, axis=0)
    each += np.repeat(back[:, width:], counts, axis=0) * largest
    back = each * (kept["h1"] > 0)
    grad["w1"], grad["b1"] = kept["h0"].T @ back, back.sum(axis=0)
    back = (back @ w["w1"].T) * kept["m0"] * (kept["h0"] > 0)
    grad["w0"], grad["b0"] = kept["x"].T @ back, back.sum(axis=0)
    return value, grad


class Adam:
    """Adam with decoupled weight decay."""

    def __init__(self, w: Weights) -> None:
        self._mean = {k: np.zeros_like(x) for k, x in w.items()}
        self._square = {k: np.zeros_like(x) for k, x in w.items()}
        self._steps = 0

    def step(self, w: Weights, grad: Weights, rate: float) -> None:
        """Change the weights in place."""
        self._steps += 1
        a, b = BETAS
        size = rate * np.sqrt(1 - b**self._steps) / (1 - a**self._steps)
        for k, g in grad.items():
            self._mean[k] += (1 - a) * (g - self._mean[k])
            self._square[k] += (1 - b) * (g * g - self._square[k])
            if k.startswith("w"):
                w[k] *= np.float32(1 - rate * DECAY)
            w[k] -= (size * self._mean[k] / (np.sqrt(self._square[k]) + 1e-8)).astype(np.float32)


def learning_rates(steps: int) -> Iterator[float]:
    """One cycle: up over a tenth, then down along a cosine."""
    for k in range(steps):
        up = min(1.0, (k + 1) / (0.1 * steps))
        yield RATE * up * 0.5 * (1 + np.cos(np.pi * max(0.0, k / steps - 0.1) / 0.9))
