"""A driver in a file, driven behind a guardian on an emulator. On a rig: its port in place of ``there.url``."""

# %%
from pathlib import Path
from tempfile import mkdtemp

import straw

Path("hold.toml").write_text(
    'name = "hold"\npressure_unit = "kPa"\ninitial_deployed = [1, 4]\n[[main]]\nhold = -2\nfor_s = 2.0\n'
)

# %%
with straw.emulated(deployed=[1, 4], controller="my_controller.py") as there:
    mine = straw.controller("my_controller.py", there.url, remembered=False)
    run = straw.run_protocol("hold.toml", Path(mkdtemp()) / "hold.mcap", mine)

# %%
run.plot().savefig("hold.png")
assert run.pressure is not None  # it was read
print(f"{len(run.pressure)} readings by {mine.name}")
