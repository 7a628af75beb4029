"""A protocol, what the model says it does, and by which constants that changes."""

# %%
from pathlib import Path

import straw

Path("deploy.toml").write_text(
    'name = "deploy"\npressure_unit = "kPa"\ninitial_deployed = [1, 4]\n'
    "[[main]]\nramp = [0, 8]\nfor_s = 0.2\n[[main]]\nhold = 8\nfor_s = 0.1\n"
)
protocol = straw.load_protocol("deploy.toml")
protocol

# %%
prediction = straw.simulate(None, protocol)  # None is the paper's straw; a file or StrawParameters is another one
prediction.plot().savefig("deploy.png")
prediction

# %%
by = straw.differentiate(None, protocol, ["r_ch_m", "E_pa"])
for k, (name, percent) in enumerate((("r_ch_m", 0.01 * 0.43e-3), ("E_pa", 0.01 * 0.92e9))):
    print(f"one percent of {name} moves the tip's X by up to {abs(by.x_m[:, k] * percent).max() * 1e6:.2f} um")
