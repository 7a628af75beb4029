"""Two water tanks, one draining into the other, filled by a pump."""

import numpy as np

time = 0.25
inputs = {"u": ("u", "V")}
channels = {"x2": ("y", "V")}
constants = {
    "k1": (0.05, "V^0.5/s", 0.005, 0.5),
    "k2": (0.05, "V^0.5/s", 0.005, 0.5),
    "k3": (0.05, "V^0.5/s", 0.005, 0.5),
    "k4": (0.04, "1/s", 0.004, 0.4),
}
start = {"x1": (5.0, 0.0, 20.0), "x2": "x2"}
units = {"x1": "V", "x2": "V"}
says = {"x1": "the upper level", "x2": "the lower level", "u": "the pump's voltage"}
start_from_s = 200.0
hold_out = ["val"]


def slopes(t, x, u, c):
    upper, lower = np.sqrt(max(x.x1, 0.0)), np.sqrt(max(x.x2, 0.0))
    return -c.k1 * upper + c.k4 * u.u, c.k2 * upper - c.k3 * lower


def read(path):
    table = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=(0, 1, 2, 3))
    return {"est": {"u": table[:, 0], "y": table[:, 2]}, "val": {"u": table[:, 1], "y": table[:, 3]}}
