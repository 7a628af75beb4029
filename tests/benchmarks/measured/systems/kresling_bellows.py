"""An origami bellows, compressed by the pressure around it in proportion."""

import csv

import numpy as np

time = "time_s"
inputs = {"p": ("P_g", "kPa")}
channels = {"y": ("compression_pct", "%")}
constants = {"offset": (0.0, "%", -30.0, 30.0), "c": (0.2, "%/kPa", 0.01, 2.0)}
says = {"p": "the pressure", "y": "the compression"}


def shown(t, x, u, c):
    return c.offset + c.c * u.p


def read(path):
    with path.open(encoding="utf-8-sig") as file:
        rows = [row for row in csv.DictReader(file) if row["compression_pct"] and row["P_g"]]
    out = {k: np.array([float(row[k]) for row in rows]) for k in ("time_s", "P_g", "compression_pct")}
    states = np.array([row["state"] for row in rows])
    begins = (states == "UP") & (np.append("", states[:-1]) != "UP")
    keep = np.append(True, np.diff(out["time_s"]) > 0)
    cycle = np.where(np.char.find(states, "RAMP") >= 0, 0, np.cumsum(begins))
    return {k: v[keep] for k, v in {**out, "cycle": cycle.astype(float)}.items()}


def hold_out(name, t, table):
    return table["cycle"][: len(t)] % 2 == 1
