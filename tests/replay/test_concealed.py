"""A short version of the sealed benchmark: the whole library against an apparatus of other code and laws' forms.

`python -m tests.benchmarks.concealed` is the long one.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from model.parameters import StrawParameters
from replay.diagnose.diagnosis import inquire
from replay.diagnose.findings import Findings, conclude
from replay.diagnose.observation import observe
from tests.apparatus.campaign import campaign
from tests.apparatus.effects import Cause

BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
RUNS = ("fold-25kPa", "deploy-35kPa-1", "staircase", "deploy-35kPa-3")


def diagnosed(cause: Cause | None, seed: int) -> Findings:
    """What is said of a specimen and repeats drawn by chance."""
    runs = campaign((cause,) if cause else (), seed, RUNS)
    with ThreadPoolExecutor(2) as pool:
        return conclude(inquire([observe(run) for run in runs], BASE, executor=pool), brief=True)


@pytest.mark.parametrize(
    "cause",
    [
        Cause("crease_stiffness", 400.0, "hardening hinge"),
        Cause("viscoelasticity", 1000.0, "two branches"),
        Cause("intrinsic_curvature", 8e-3, "curled near the base", 5),
    ],
    ids=lambda cause: cause.name,
)
def test_physics_of_another_form_is_named_and_improves_runs_it_did_not_fit(cause: Cause) -> None:
    findings = diagnosed(cause, seed=21)
    assert findings.verdict == "missing_physics"
    assert findings.causes == [cause.name]
    assert findings.held is not None
    assert findings.held.after["x_m"] < max(findings.held.before["x_m"] / 3, 1.3 * findings.held.floor["x_m"])


def test_a_magnet_that_no_library_holds_is_not_given_another_name() -> None:
    findings = diagnosed(Cause("unknown", 0.3, "magnet near the tip", 3), seed=22)
    assert findings.verdict in ("unknown_physics", "ambiguous")


def test_another_specimen_s_damping_and_geometry_are_not_called_missing_physics() -> None:
    assert diagnosed(None, seed=23).verdict == "complete"
