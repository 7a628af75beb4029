"""Silverbox: an electronic oscillator, taken to be linear."""

import numpy as np

RATE_HZ = 1e7 / 2**14

time = RATE_HZ
inputs = {"u": ("V1", "V")}
channels = {"y": ("V2", "V")}
constants = {
    "c": (50.0, "1/s", 5.0, 500.0),
    "k": (1.8e5, "1/s^2", 5e4, 6e5),
    "b": (1.8e5, "1/s^2", 2e4, 1e6),
}
start = {"y": "y", "v": (0.0, -100.0, 100.0)}
units = {"v": "V/s"}
says = {"y": "the output y", "v": "the output's speed v", "u": "the input u"}
skip_s = 300 / RATE_HZ
start_from_s = 300 / RATE_HZ
hold_out = ["multisine 8", "multisine 9", "arrowhead"]


def slopes(t, y, u, c):
    return y.v, -c.c * y.v - c.k * y.y + c.b * u.u


def read(path):
    u, y = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=(0, 1)).T
    u, y = u - u.mean(), y - y.mean()
    parts = {f"multisine {k}": (40650 + 8585 * (k - 1), 40650 + 8585 * (k - 1) + 8192) for k in (2, 3, 4, 8, 9)}
    parts["arrowhead"] = (0, 40500)
    return {name: {"V1": u[a:b], "V2": y[a:b]} for name, (a, b) in parts.items()}
