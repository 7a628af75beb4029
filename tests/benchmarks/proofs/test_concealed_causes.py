"""A cause of another form against a few rivals, one that is not in the library, and none: whole searches."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import Findings, conclude
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from tests.apparatus.campaign import campaign
from tests.apparatus.cases import deck, generate, recorded
from tests.apparatus.effects import Cause
from tests.benchmarks.concealed import BASE, SIX
from tests.replay.test_concealed import RUNS, SPECIMEN

#: Damping 1.5 and 4.4 times the base's (axial, bending).
ANOTHER = 47


def diagnosed(
    cause: Cause | None, seed: int, library: tuple[str, ...] | None = None, runs: tuple[str, ...] = RUNS
) -> Findings:
    """Findings on a random specimen with random scatter between repeats; by default with the whole library."""
    seen = [observe(run) for run in campaign((cause,) if cause else (), seed, runs)]
    with ThreadPoolExecutor(2) as pool:
        return conclude(inquire(seen, StrawSystem(BASE), library=library, executor=pool), brief=True)


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


def test_a_run_that_goes_the_other_way_gets_constants_of_its_own_before_causes_are_sought() -> None:
    """One run of this opened case, a tip's offset, snaps as no other constants of all runs let it."""
    case = next(case for case in deck("final", 20261129) if case.name == "final-000")
    runs = [observe(run) for run in generate(replace(case, runs=SIX), recorded).runs]
    with ThreadPoolExecutor() as pool:
        found = inquire(runs, StrawSystem(BASE), executor=pool)
        assert list(found.campaign.own) == ["fold-25kPa"]
        assert not found.spent
        assert next(iter(found.judgement().probability)) == "tip_offset"


def test_deviating_damping_and_geometry_of_a_specimen_are_not_called_missing_physics() -> None:
    findings = diagnosed(None, ANOTHER)
    assert findings.verdict == "complete"
    assert findings.causes == []
    assert "cohesion" in findings.smallest
