"""How fast the model runs: the paper's two validation runs against real time, compiled, one core, output at 240 Hz."""

from __future__ import annotations

import time

import numpy as np

from model.parameters import StrawParameters
from model.simulate import simulate

FOLDING = StrawParameters()
DEPLOYMENT = FOLDING.replace(c_zeta_n_s_per_m=0.1, c_phi_n_m_s_per_rad=3e-3, r_ch_m=0.315e-3)
RUNS = {"folding, -25 kPa": (FOLDING, -25e3, (1, 4)), "deployment, 35 kPa": (DEPLOYMENT, 35e3, (2, 3, 5, 6, 7, 8, 9))}
REPEATS = 5


def main() -> None:
    """Print the best of a few repeats: what the machine can do when nothing else runs on it."""
    time_s = np.arange(0.0, 6.0, 1 / 240)
    print(f"{'run':<20}{'steps':>8}{'wall / s':>10}{'times real time':>17}")
    for name, (straw, steady_pa, deployed) in RUNS.items():
        walls = []
        for _ in range(REPEATS + 1):  # the first one compiles
            start = time.perf_counter()
            run = simulate(straw, lambda t, p=steady_pa: p * (1 - np.exp(-50 * t)), time_s, deployed)
            walls.append(time.perf_counter() - start)
        wall_s = min(walls[1:])
        print(f"{name:<20}{run.steps:>8}{wall_s:>10.3f}{6.0 / wall_s:>17.0f}")


if __name__ == "__main__":
    main()
