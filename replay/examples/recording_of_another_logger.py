"""Recordings of other loggers brought in: a table, looked at and then imported, and a format that straw cannot know."""

# %%
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import straw

folder = Path(mkdtemp())  # a recording is never overwritten

# %% a table as such a logger writes it: a pump's pressure in mbar and a tip in mm and degrees, with decimal commas
time_s = np.arange(0.0, 0.5, 0.005)
pressure_pa = -25e3 * (1 - np.exp(-np.clip(time_s - 0.1, 0, None) / 0.02))
seen = straw.simulate(None, lambda t: np.interp(t, time_s, pressure_pa), time_s, [1, 4])
columns = time_s, pressure_pa / 100, seen.x_m * 1e3, seen.z_m * 1e3, np.degrees(seen.phi_rad)
lines = (";".join(f"{value:.6f}".replace(".", ",") for value in row) for row in zip(*columns, strict=True))
(folder / "pump.csv").write_text("\n".join(["Zeit;Druck;X [mm];Z [mm];Winkel [deg]", *lines]))

# %% look first: without an output nothing is written, and what nobody states is a guess
looked = straw.import_tables(folder / "pump.csv", as_stated=True)  # this tip hardly rises: 0.1 mm are no mistake
looked.plot().savefig("import.png")
print(looked)

# %% state what was guessed; a file of this (``looked.mapping``) does the same for all the logger's tables
done = straw.import_tables(
    folder / "pump.csv",
    folder / "pump.mcap",
    columns={"time": "Zeit in s", "pressure": "Druck in mbar", "x": "X [mm]", "z": "Z [mm]", "phi": "Winkel [deg]"},
    start="2026-05-03 14:02:11Z",
    initial_deployed=[1, 4],
    as_stated=True,
)
done.recording  # as any other: straw.replay(done.recording), straw.diagnose([...])

# %% a format of one's own, read by a file; `straw import pump.daq --format my_reader.py` does the same
kinds = [("t", "<u4"), ("p", "<f4"), ("x", "<f4"), ("z", "<f4"), ("phi", "<f4")]
rows = np.array(list(zip(np.round(time_s * 1e3), *columns[1:], strict=True)), dtype=kinds)
(folder / "pump.daq").write_bytes(b"DAQ1" + rows.tobytes())
same = straw.import_tables(
    folder / "pump.daq",
    folder / "daq.mcap",
    reader="my_reader.py",
    start="2026-05-03 14:02:11Z",
    initial_deployed=[1, 4],
    as_stated=True,
)
assert done.recording
assert same.recording
assert done.recording.tip
assert same.recording.tip
off_m = np.abs(done.recording.tip.x_m - same.recording.tip.x_m).max()
print(f"{len(done.guesses)} guesses left; both ways agree within {off_m * 1e9:.1f} nm")
