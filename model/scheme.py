"""The Runge-Kutta tableau: singly diagonally implicit, stiffly accurate, order 4 with an order-3 error estimate.

Hairer & Wanner, Solving Ordinary Differential Equations II, table IV.6.5 (gamma = 1/4), L-stable.
"""

from __future__ import annotations

import numpy as np

GAMMA = 0.25
COEFFICIENTS = np.array(
    [
        [1 / 4, 0, 0, 0, 0],
        [1 / 2, 1 / 4, 0, 0, 0],
        [17 / 50, -1 / 25, 1 / 4, 0, 0],
        [371 / 1360, -137 / 2720, 15 / 544, 1 / 4, 0],
        [25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4],
    ]
)
STAGES = len(COEFFICIENTS)
TIMES = COEFFICIENTS.sum(axis=1)
ORDER_BELOW = 3
ERROR = COEFFICIENTS[-1] - np.array([59 / 48, -17 / 96, 225 / 32, -85 / 12, 0])

#: Weights (STAGES, 1 + STAGES) that guess a stage's acceleration from the step's start and its earlier stages: the
#: polynomial through all earlier stages; the second starts from the first, as extrapolating from one point is none.
GUESS = np.zeros((STAGES, STAGES + 1))
GUESS[0, 0] = 1.0
for _i in range(1, STAGES):
    for _j in range(_i):
        _others = np.delete(TIMES[:_i], _j)
        GUESS[_i, _j + 1] = np.prod((TIMES[_i] - _others) / (TIMES[_j] - _others))
