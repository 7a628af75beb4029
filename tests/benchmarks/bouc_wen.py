"""An external case: hysteresis of the public Bouc-Wen benchmark, concealed from a linear model, located and named.

    python -m tests.benchmarks.bouc_wen

Noel and Schoukens, "Hysteretic benchmark with a dynamic nonlinearity", nonlinearbenchmark.org: equations, constants,
bands and noise are theirs; the data are made here from the equations (Newmark's rule), at several levels instead of
one. The engine is that of the straw, with another system (`replay/diagnose/systems/oscillator`). Then the same with
hysteresis taken out of the library.
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.fit import Fit, fitted
from straw.replay.diagnose.locate import kind_of
from straw.replay.diagnose.systems.oscillator.system import (
    BASE,
    FINE,
    LIBRARY,
    MASS_KG,
    RATE_HZ,
    SIGMA_M,
    OscillatorSystem,
    Record,
)
from straw.replay.diagnose.verdict import verdict_of
from tests.benchmarks.figures import publish, write_option

#: The benchmark's constants: N s/m, N/m, N/m, 1/m, -, -; nu = 1.
C, K, ALPHA, BETA, GAMMA, DELTA = 10.0, 5e4, 5e4, 1e3, 0.8, -1.1
SAMPLES, LINES_HZ = 2046, (5.0, 150.0)
#: Integration of the truth: steps per step of the library's, iterations in each.
SUBSTEPS, ITERATIONS = 4, 3


def multisine(rms_n: float, seed: int) -> np.ndarray:
    """Random-phase multisine (N) of the benchmark's band, at every step of the integration."""
    n = SAMPLES * FINE
    lines = np.fft.rfftfreq(n, 1 / (RATE_HZ * FINE))
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(lines))
    spectrum = np.where((lines >= LINES_HZ[0]) & (lines <= LINES_HZ[1]), np.exp(1j * phase), 0)
    u = np.fft.irfft(spectrum, n)
    return np.append(u, u[0]) * rms_n / np.sqrt(np.mean(u**2))


def sweep(amplitude_n: float) -> np.ndarray:
    """Sine sweep from 20 to 50 Hz (N)."""
    t = np.arange(SAMPLES * FINE + 1) / (RATE_HZ * FINE)
    return amplitude_n * np.sin(2 * np.pi * (20 * t + (50 - 20) * t**2 / (2 * t[-1])))


def recorded(forces: dict[str, np.ndarray], k: float = K, alpha: float = ALPHA) -> list[Record]:
    """Response of the hysteretic oscillator from rest, with noise; Newmark's average acceleration, as published."""
    u = np.stack(list(forces.values()))
    grid = np.arange(u.shape[1] * SUBSTEPS - SUBSTEPS + 1)
    u = np.stack([np.interp(grid, grid[::SUBSTEPS], row) for row in u])
    h = 1 / (RATE_HZ * FINE * SUBSTEPS)

    def hysteresis(v: np.ndarray, z: np.ndarray) -> np.ndarray:
        return alpha * v - BETA * (GAMMA * np.abs(v) * z + DELTA * v * np.abs(z))

    y, v, z = (np.zeros(len(u)) for _ in range(3))
    a, z_rate = u[:, 0] / MASS_KG, np.zeros(len(u))
    kept = [y]
    for n in range(1, u.shape[1]):
        y_known, v_known, z_known = y + h * v + h**2 / 4 * a, v + h / 2 * a, z + h / 2 * z_rate
        for _ in range(ITERATIONS):
            y, v, z = y_known + h**2 / 4 * a, v_known + h / 2 * a, z_known + h / 2 * z_rate
            a, z_rate = (u[:, n] - C * v - k * y - z) / MASS_KG, hysteresis(v, z)
        if n % (FINE * SUBSTEPS) == 0:
            kept.append(y)
    noise = SIGMA_M * np.random.default_rng(0).normal(size=(len(u), SAMPLES))
    seen = np.array(kept[:SAMPLES]).T + noise
    return [
        Record(name, forces[name], np.arange(SAMPLES) / RATE_HZ, row) for name, row in zip(forces, seen, strict=True)
    ]


def campaign_forces() -> dict[str, np.ndarray]:
    """Three levels, another realisation of the highest, and a sweep."""
    forces = {f"multisine-{rms}N": multisine(rms, rms) for rms in (10, 25, 50)}
    return forces | {"multisine-50N-again": multisine(50, 7), "sweep-40N": sweep(40.0)}


def located(campaign: Campaign, null: Fit) -> str:
    """In which record the base model is wrong, in time, amplitude or shape, and which constant would have to vary."""
    rows = campaign.misfits(null.unknowns, [null.u])[0]
    lines = []
    for record, one in zip(campaign.observations, rows, strict=True):
        assert one is not None
        own = fitted(campaign.only([record.name]), BASE, null.u, rounds=20).values
        kind = kind_of(record, one, 0, np.ones(SAMPLES, bool))
        lines.append(
            f"  {record.name:<20} off by {np.std(one.plain) / SIGMA_M:5.1f} sigma, mostly {kind}; by itself it would "
            f"want c = {own['base.c']:5.1f} N s/m, k = {own['base.k'] / 1e3:5.1f} kN/m"
        )
    return "\n".join(lines)


def held_out(campaign: Campaign, fits: tuple[Fit, ...], name: str) -> str:
    """RMS in sigmas on a record that was not fitted."""
    train = campaign.only([o.name for o in campaign.observations if o.name != name])
    rest = campaign.only([name])
    found = []
    for fit in fits:
        (row,) = rest.misfits(fit.unknowns, [fitted(train, fit.unknowns, fit.u, rounds=10).u])
        found.append(float(np.std(row[0].plain)) / SIGMA_M if row[0] else np.nan)
    return " -> ".join(f"{off:.2f}" for off in found)


def main() -> None:
    """Make the data, locate, name, show; the same without the true cause; and an oscillator that is linear."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    write_option(options)
    args = options.parse_args()
    figures = {}
    start = time.perf_counter()
    forces = campaign_forces()
    hysteretic, linear = recorded(forces), recorded(forces, K + ALPHA, 0.0)
    print(f"{len(forces)} records of {SAMPLES} samples, twice, made in {time.perf_counter() - start:.0f} s")
    every = list(LIBRARY)
    for title, records, library in (
        ("hysteresis concealed", hysteretic, every),
        ("the same, hysteresis not in the library", hysteretic, [name for name in every if name != "hysteresis"]),
        ("nothing concealed", linear, every),
    ):
        start = time.perf_counter()
        with ThreadPoolExecutor() as pool:
            found = inquire(records, OscillatorSystem(tuple(library)), executor=pool)
            campaign, null, best = found.campaign, found.null, found.contestants[0]
            probability = found.judgement().probability
            verdict, causes = verdict_of(probability, campaign.system.faults)
            print(f"  verdict: {verdict} {', '.join(causes)}")
            said = ", ".join(causes) or verdict
            key = "concealed" if title == "hysteresis concealed" else "absent" if "not in" in title else "nothing"
            figures[key] = f"{said}, {max(probability.values()):.2f}"
            print(f"  {', '.join(f'{n} {p:.3f}' for n, p in list(probability.items())[:4])}")
            if title == "hysteresis concealed":
                print(located(campaign, null))
                figures["held-out"] = held_out(campaign, (null, best.fit), "sweep-40N").replace(" -> ", " to ")
                print(f"  held out sweep-40N, sigmas RMS: {figures['held-out']}")
                print("  " + ", ".join(f"{k} = {v:.4g}" for k, v in best.fit.values.items()))
        off = [np.sqrt(np.mean(fit.residual**2)) for fit in (null, best.fit)]
        print(f"  off by, sigmas RMS: linear {off[0]:.2f}, with {best.name.replace('_', ' ')} {off[1]:.2f}")
        tally, took_s = campaign.tally, time.perf_counter() - start
        print(f"  {tally['played']} plays, {tally['failed']} failed, {took_s:.0f} s")
    publish("bouc_wen", figures, args.write)


if __name__ == "__main__":
    main()
