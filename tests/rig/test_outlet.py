"""The outlet's pressure in closed form agrees with the emulated controller's plant under frequent commands."""

import numpy as np
import pytest

from straw.rig.outlet import Outlet
from straw.rig.plant import PressurePlant
from straw.rig.protocol_toml import protocol_from_toml

HEAD = 'pressure_unit = "kPa"\ninitial_deployed = []\n'


@pytest.mark.parametrize(
    "main",
    [
        "[{ hold = -25, for_s = 0.5 }, { ramp = [-25, 30], for_s = 0.3 }, { hold = 10, for_s = 0.2 }]",
        "[{ sine = { mean = 5, amplitude = 10, frequency_hz = 3 }, for_s = 1.0 }]",
        "[{ rows = [[0, 5], [0.1, -5], [0.4, 20]], for_s = 0.7 }]",
    ],
)
def test_it_is_the_plants_pressure(main: str) -> None:
    protocol = protocol_from_toml(HEAD + f"main = {main}", "p.toml")
    step_s = 1e-4
    plant, pressure_pa = PressurePlant(), []
    grid = np.arange(0.0, protocol.duration_s, step_s)
    for now_s, told_pa in zip(grid.tolist(), protocol(grid + step_s / 2).tolist(), strict=True):
        plant.command(now_s, told_pa)
        pressure_pa.append(plant.pressure(now_s))
    # A ramp or sine commanded in steps at their midpoints errs to second order in the step; a step is half of one late.
    fastest = max(np.abs(np.diff(protocol(grid))).max() / step_s, 1.0)
    jump = 60e3 * plant.rate_per_s * step_s
    np.testing.assert_allclose(Outlet(protocol)(grid), pressure_pa, atol=max(jump, fastest * step_s**2))


def test_a_command_beyond_the_supply_is_clipped_to_the_supply() -> None:
    protocol = protocol_from_toml(
        HEAD + "limits = { max = 300 }\nmain = [{ ramp = [0, 200], for_s = 2.0 }, { hold = 50, for_s = 1.0 }]", "p.toml"
    )
    outlet_pa = Outlet(protocol)(np.array([0.5, 1.9, 2.9]))
    # A ramp of 100 kPa/s lags by 1/50 s of it; the supply ends at 100 kPa, reached after 1 s.
    np.testing.assert_allclose(outlet_pa, [48e3, 100e3, 50e3], atol=1.0)


def test_the_cost_of_sixty_days_is_that_of_their_points() -> None:
    protocol = protocol_from_toml(HEAD + f"main = [{{ hold = 10, for_s = {60 * 86400} }}]", "long.toml")
    outlet = Outlet(protocol)
    assert len(outlet._start_s) == 1
    np.testing.assert_allclose(outlet(np.array([0.0, 0.02, 5e6])), [0.0, 10e3 * (1 - np.exp(-1.0)), 10e3], atol=1e-6)
