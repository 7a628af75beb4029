"""A sealed air chamber: its pressure stays."""

import numpy as np

time = "time_s"
channels = {"p": ("p", "bar")}
start = {"p": (7.6, 0.0, 20.0)}
units = {"p": "bar"}
says = {"p": "the pressure"}


def slopes(t, x, u, c):
    return 0.0


def read(path):
    """From when the supply is shut: the last of the first 10 s at which it still holds the highest pressure."""
    rows = [line.split(";") for line in path.read_text().split()]
    t = np.array([float("".join(row[0].split(".")[:-1])) / 1e3 for row in rows])  # 1.075.000 is 1075 ms
    p = np.array([float(row[2]) for row in rows])
    shut = np.flatnonzero((t < 10) & (p > p.max() - 0.02))[-1]
    return {"time_s": t[shut:] - t[shut], "p": p[shut:]}


def hold_out(name, t, table):
    return t > t[-1] / 2
