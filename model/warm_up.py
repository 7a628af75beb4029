"""Compiles what simulates and differentiates, ahead of its use: `python -m straw.model.warm_up`.

The first time on a machine this takes a minute or two of one core; a command that has other work to do meanwhile starts
it in a process of its own and waits for it before it asks for derivatives.
"""

from __future__ import annotations

import numpy as np

from straw.model.derivative import differentiate
from straw.model.direction import Direction
from straw.model.parameters import StrawParameters
from straw.model.simulate import sampled


def main() -> None:
    """A few steps of a short run, by a damping and by the height of the rigid frusta."""
    straw, time_s = StrawParameters(), np.linspace(0.0, 0.01, 6)
    suction = sampled(lambda t: -1e3 * np.asarray(t), time_s)
    taller = straw.replace(zeta0_m=straw.zeta0_m * np.array([1.001, 1.0]))
    for direction in (Direction.of(straw, "c_zeta_n_s_per_m"), Direction.between(straw, taller, 1.0)):
        differentiate(straw, suction, time_s, [1, 4], [direction], cells=True)


if __name__ == "__main__":
    main()
