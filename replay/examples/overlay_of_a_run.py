"""A run laid over the model, in ten lines. On a rig: a controller in place of ``emulate``, and a track of the film."""

# %%
from pathlib import Path
from tempfile import mkdtemp

import straw

Path("fold.toml").write_text(
    'name = "fold"\npressure_unit = "kPa"\ninitial_deployed = [1, 4]\n[[main]]\nhold = -25\nfor_s = 0.3\n'
)
folder = Path(mkdtemp())  # a recording is never overwritten
run = straw.run_protocol("fold.toml", folder / "fold.mcap", emulate=True, tip=folder / "fold-tip.mcap")
run  # a notebook shows it

# %%
overlay = straw.replay(run)
overlay.plot().savefig("fold.png")
overlay.write_page("fold.html")
print(f"X off by {overlay[0].signals['x_m'].metrics.rmse * 1e6:.0f} um RMS; look at fold.png and fold.html")
