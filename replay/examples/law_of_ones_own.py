"""A law of one's own added from a file, fitted to a run, and shown. The model is compiled with it, once, a minute."""

# %%
from pathlib import Path

import numpy as np

import straw

straw.add_laws("hardening.py")  # before anything else: the model is compiled with all its laws in it
base = straw.StrawParameters().replace(c_zeta_n_s_per_m=20.0)
time_s = np.linspace(0.0, 0.06, 31)


def suction(t):  # type: ignore[no-untyped-def]
    """Gauge pressure (Pa) at seconds: a step as a controller makes it."""
    return -25e3 * (1 - np.exp(-50 * t))


def predicted(k: float) -> straw.Prediction:
    """The tip's motion with the law at strength k."""
    return straw.simulate(base.with_term("hardening", k_n_per_m3=k), suction, time_s, [1, 4])


# %% what a camera would have seen of a straw that has the law, with its noise
truth, sigma_m = 3e6, 5e-6
seen_m = predicted(truth).x_m + np.random.default_rng(1).normal(0.0, sigma_m, len(time_s))

# %% Gauss-Newton steps of one constant
k = 1e6
for _ in range(4):
    here, there = predicted(k).x_m, predicted(1.1 * k).x_m
    slope = (there - here) / (0.1 * k)
    k += float(slope @ (seen_m - here) / (slope @ slope))
print(f"k = {k:.4g} +- {sigma_m / np.sqrt(slope @ slope):.2g} N/m^3, truth {truth:.4g}")

# %%
Path("law.toml").write_text(base.with_term("hardening", k_n_per_m3=k).to_toml())  # with the law's SHA-256
predicted(k).plot().savefig("law.png")
