"""A ball that falls freely."""

import re
import zipfile

import numpy as np

G = 9.81

time = "t"
channels = {"h": ("h", "m")}
start = {"h": "h", "v": (0.0, -3.0, 3.0)}
units = {"h": "m", "v": "m/s"}
says = {"h": "the height", "v": "the speed"}
start_from_s = 0.8
hold_out = ["drop 2"]


def slopes(t, x, u, c):
    return x.v, -G


def read(path):
    """Drops from a table of drop, time and height."""
    drop, t, h = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=(0, 1, 2)).T
    return {f"drop {k:.0f}": {"t": t[drop == k], "h": h[drop == k]} for k in np.unique(drop)}


def tables(workbook):
    """Each ball's drops of the repository's workbook as such a table's text."""
    with zipfile.ZipFile(workbook) as book:
        names = re.findall(r'<sheet [^>]*name="([^"]+)"', book.read("xl/workbook.xml").decode())
        for number, name in enumerate(names, 1):
            sheet = book.read(f"xl/worksheets/sheet{number}.xml").decode()
            rows = re.findall(r"<row [^>]*>(.*?)</row>", sheet, re.S)[1:]
            cells = [re.findall(r'<c r="([A-Z])\d+"[^>]*>(?:<f>.*?</f>)?<v>(.*?)</v>', row) for row in rows]
            kept = [dict(row) for row in cells]
            lines = [f"{row['A']},{row['B']},{row['C']}" for row in kept if {"A", "B", "C"} <= row.keys()]
            yield name, "\n".join(["drop,time_s,height_m", *lines]) + "\n"
