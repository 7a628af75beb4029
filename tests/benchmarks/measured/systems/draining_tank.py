"""A flared water tank that drains through a hole: Torricelli's law."""

import numpy as np

G_CM = 981.0
LOW, HIGH, HOLE = 4.5, 27.9, 2.5  # cm: the sensor's reading, the tank's rim, the hole
RADIUS = 2.54 / 16

time = "Time [s]"
channels = {"h": ("h", "cm", 0.25)}
constants = {"c": (0.4, "1", 0.05, 1.0)}
start = {"h": (25.0, 15.0, 30.0)}
units = {"h": "cm"}
says = {"h": "the level", "c": "the discharge coefficient"}
start_from_s = 200 / 6.25


def slopes(t, x, u, c):
    return -c.c * np.pi * RADIUS**2 * np.sqrt(2 * G_CM * max(x.h - HOLE, 0.0)) / area(x.h)


def area(h):
    """Cross-section of the empty tank, cm^2, a rounded rectangle that widens from bottom to top."""
    share = h / HIGH
    length, width, perimeter = 13.4 + 1.2 * share, 7.8 + 1.2 * share, 40.1 + 4.2 * share
    r = (perimeter / 2 - (length + width)) / (np.pi - 4)
    return (length - 2 * r) * (width - 2 * r) + 2 * r * (length + width - 4 * r) + np.pi * r**2


def read(path):
    counts, heights = np.genfromtxt(path.parent / "level_sensor_calibration.csv", delimiter=",", skip_header=1).T[::-1]
    lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line[:1].isdigit()]
    t, reading = np.array([[float(x) for x in line.split(",")] for line in lines]).T
    h = np.interp(reading, counts, heights)
    begins = np.flatnonzero(reading == reading.max())[-1]
    t, h = t[begins:], h[begins:]
    keep = (h > LOW) & np.append(True, np.diff(t) > 0)
    return {"Time [s]": t[keep] - t[0], "h": h[keep]}


def hold_out(name, t, table):
    return name.endswith("test") or ("bottle" in name and (t // 20) % 2 == 1)
