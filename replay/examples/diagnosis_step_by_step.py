"""A diagnosis step by step, on a pressure that an instrument measured: a chamber that is taken to be sealed.

A straw is diagnosed in the same steps: ``straw.diagnose(["monday.mcap", ...], "base.toml")``, which takes minutes.
"""

# %%
from importlib.resources import files
from pathlib import Path

import numpy as np

import straw

Path("readings.csv").write_bytes((files("straw.replay") / "demo/measured/Ultimaker_015.csv").read_bytes())

# %% 1. a base model: what is known of the system, and nothing else. Here: the pressure of a sealed chamber stays
Path("chamber.py").write_text('''"""A sealed air chamber: its pressure stays."""
time = "time_s"
channels = {"p": ("p", "bar")}
start = {"p": (7.6, 0.0, 20.0)}
units = {"p": "bar"}
says = {"p": "the pressure"}
places = ["rate:p", "channel:p"]  # where something may be missing; all by default, fewer are quicker

def slopes(t, x, u, c):
    return 0.0

def hold_out(name, t, table):
    return t > t[-1] / 2  # no fit sees the second half
''')  # `straw check chamber.py` says in one line what is wrong with it

# %% 2. the recordings, as columns (or files, where the base says how to read them)
rows = [line.split(";") for line in Path("readings.csv").read_text().split()]
time_s = np.array([float("".join(row[0].split(".")[:-1])) / 1e3 for row in rows])  # 1.075.000 is 1075 ms
pressure_bar = np.array([float(row[2]) for row in rows])
shut = np.flatnonzero((time_s < 10) & (pressure_bar > pressure_bar.max() - 0.02))[-1]  # the supply is shut here
readings = {"time_s": time_s[shut:] - time_s[shut], "p": pressure_bar[shut:]}

# %% 3. what does the base leave out?
diagnosis = straw.diagnose_system("chamber.py", {"chamber": readings})
print(diagnosis)

# %% 4. does it hold where nothing was fitted? How sure are its constants? What else would explain it?
held, constants = diagnosis.heldout, diagnosis.constants
print(f"RMS held out {held['rms_before'][0]:.3f} -> {held['rms_after'][0]:.3f} bar, noise {held['noise_floor'][0]:.3f}")
for name, value, sigma, unit in zip(*(constants[c] for c in ("constant", "value", "sigma", "unit")), strict=True):
    print(f"{name} = {value:.3g} +- {sigma:.1g} {unit}")
print({name: round(p, 2) for name, p in diagnosis.probability.items()})
diagnosis.plot().savefig("diagnosis.png")

# %% 5. the page with all of it, and the law as a curve with its band
diagnosis.write_page("why.html")
curve = diagnosis.curves[0]  # state, value, sigma
diagnosis
