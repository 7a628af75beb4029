"""A reader of a logger that straw does not know. `straw check my_reader.py --on LOG.daq` tries it on a log."""

from pathlib import Path

import numpy as np

import straw


def read(path: Path) -> dict[str, np.ndarray]:
    """Columns (n,) of a log: four letters, then for each row a whole number of ms and mbar, mm, mm, deg."""
    data = path.read_bytes()
    if data[:4] != b"DAQ1":
        raise ValueError("does not begin with DAQ1")
    rows = np.frombuffer(data[4:], [("t", "<u4"), ("p", "<f4"), ("x", "<f4"), ("z", "<f4"), ("phi", "<f4")])
    return {name: rows[name] for name in rows.dtype.names or ()}


READER = straw.Reader(
    name="daq1",
    about="binary logs of the DAQ on the second table",
    read=read,
    suffixes=(".daq",),
    roles={"t": "time", "p": "pressure", "x": "x", "z": "z", "phi": "phi"},
    units={"t": "ms", "p": "mbar", "x": "mm", "z": "mm", "phi": "deg"},
)
