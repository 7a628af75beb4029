"""Fig. S1: flow through the channel against the pressure difference, with the fitted steady Bernoulli law."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from straw.model.filling import ChannelRadius, FillingTests
from straw.replay.paper.style import figure, label


def flow(tests: FillingTests, radius: ChannelRadius, table: str, rho_kg_per_m3: float) -> Figure:
    """Fig. S1 from a table of filling tests."""
    fig = figure(5.2, 3.8)
    axes = fig.subplots()
    most_pa = 1.06 * float(tests.pressure_difference_pa.max())
    pressure = np.linspace(0, most_pa, 300)

    def law(r_m: float) -> np.ndarray:
        return np.asarray(1e6 * np.pi * r_m**2 * np.sqrt(2 * pressure / rho_kg_per_m3))

    axes.fill_between(
        1e-3 * pressure, law(radius.low_m), law(radius.high_m), color="#f3c99b", lw=0, label="95 % interval"
    )
    axes.plot(
        1e-3 * pressure,
        law(radius.r_ch_m),
        color="#e08a1e",
        label=f"Bernoulli, $r_{{ch}}$ = {radius.r_ch_m * 1e3:.3f} mm",
    )
    axes.plot(
        1e-3 * tests.pressure_difference_pa, 1e6 * tests.flow_m3_per_s, "o", color="#222222", ms=3.5, mew=0,
        label=f"{radius.tests} tests: {table}",
    )  # fmt: skip
    label(axes, "", "pressure difference / kPa", "mean flow V / t / (cm³/s)")
    axes.set(xlim=(0, 1e-3 * most_pa), ylim=(0, None))
    axes.legend(loc="lower right")
    return fig
