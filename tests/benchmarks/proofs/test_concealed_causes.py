"""A cause of another form against a few rivals, and one that is not in the library: whole searches."""

from __future__ import annotations

from tests.apparatus.effects import Cause
from tests.replay.test_concealed import RUNS, SPECIMEN, diagnosed


def test_a_crease_that_hardens_is_named_and_improves_runs_it_did_not_fit() -> None:
    rivals = ("crease_stiffness", "tip_offset")
    findings = diagnosed(Cause("crease_stiffness", 400.0, "hardening hinge"), SPECIMEN, rivals, RUNS[:3])
    assert findings.verdict == "missing_physics"
    assert findings.causes == ["crease_stiffness"]
    assert findings.held is not None
    assert findings.held.after["x_m"] < max(findings.held.before["x_m"] / 3, 1.3 * findings.held.floor["x_m"])


def test_a_magnet_which_is_not_in_the_library_is_not_mistaken_for_a_cause_that_is() -> None:
    rivals = ("intrinsic_curvature",)
    findings = diagnosed(Cause("unknown", 0.3, "magnet near the tip", 3), SPECIMEN, rivals, RUNS[1:2])
    assert findings.verdict in ("unknown_physics", "ambiguous")
