"""An air line: the far end follows the near end with one lag."""

import itertools
import re

import numpy as np

time = "t"
inputs = {"p1": ("p1", "bar")}
channels = {"p2": ("p2", "bar")}
constants = {"tau": (0.02, "s", 0.002, 0.5)}
start = {"p2": "p2"}
units = {"p2": "bar"}
says = {"p1": "the near pressure", "p2": "the far pressure", "tau": "the line's lag"}
REPEATS, LONGEST_S = 12, 0.5


def slopes(t, x, u, c):
    return (u.p1 - x.p2) / c.tau


def read(path):
    rows = []
    for line in path.read_text(errors="replace").splitlines():
        cells = line.split(",")
        if len(cells) == 5 and all(re.fullmatch(r"\s*-?\d+(\.\d+)?\s*", cell) for cell in cells):
            rows.append([float(x) for x in cells[:3]])
    t, p1, p2 = np.array(rows).T
    begins = [0, *(np.flatnonzero(np.diff(t) < 0) + 1), len(t)]
    out = {}
    for a, b in itertools.pairwise(begins):
        venting = "end" in path.stem
        good = (t[a:b] < 1e3 * LONGEST_S) & (np.diff(t[a:b], append=np.inf) > 0)
        if good.sum() < 5 or (venting and t[a] > 10) or t[a] > 100:
            continue
        out[f"{path.stem} {len(out) + 1}"] = {"t": t[a:b][good] / 1e3, "p1": p1[a:b][good], "p2": p2[a:b][good]}
        if len(out) == REPEATS:
            break
    return out


def hold_out(name, t, table):
    return re.search(r"_p([357])_", name) is not None
