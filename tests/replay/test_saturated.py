"""Best subsets: of all causes fitted at once, the single one or pair that explains as much comes first."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import evaluated
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.robust import robust_cost
from straw.replay.diagnose.saturated import saturated, subsets
from straw.replay.diagnose.screen import Start
from straw.replay.diagnose.system import Differences, System

RNG = np.random.default_rng(3)
SAMPLES = 400
LEVEL, FIRST, SECOND, OTHER, EXTRA = RNG.normal(size=(5, SAMPLES))
#: The decoy is the single column nearest to the sum of the first and the second.
COLUMNS = {"base": LEVEL, "first": FIRST, "second": SECOND, "other": OTHER, "decoy": FIRST + SECOND + 0.8 * EXTRA}


class Linear(System):
    """A sum of columns, each times its strength, against data with noise of one sigma."""

    channels = ()
    base = (Unknown("base", 1.0, kind="linear", sd=10.0),)
    causes = ("first", "second", "other", "decoy")

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        (name,) = names
        return Hypothesis((name,), (Unknown(name, 1.0, sd=10.0),), ((0.3,), (3.0,)))

    def misfit(self, recording, unknowns, u, *, level=None, derivatives=False):
        A = np.stack([COLUMNS[one.target] for one in unknowns], axis=1)
        values = np.array([one.value(x) for one, x in zip(unknowns, u, strict=True)])
        slopes = A * [one.per_u(x) for one, x in zip(unknowns, u, strict=True)]
        return Differences(A @ values - recording.y, slopes, np.empty((1, 0)), 1)

    def size(self, recording, level):
        return SAMPLES


def ranked(y: np.ndarray, likely: Sequence[Start] = ()) -> list[list[Start]]:
    system = Linear()
    recording = SimpleNamespace(name="run", y=y)
    with ThreadPoolExecutor(1) as pool:
        campaign = Campaign([recording], system, pool)
        known = evaluated(campaign, system.base, np.zeros(1))
        return subsets(campaign, known, [system.hypothesis([name]) for name in system.causes], likely)


def test_two_causes_come_first_although_a_third_is_the_best_single_one():
    y = 2 * LEVEL + 2 * FIRST + 2 * SECOND + RNG.normal(size=SAMPLES)
    (found,) = ranked(y)
    singles = [start for start in found if len(start.hypothesis.causes) == 1]
    pairs = [start for start in found if len(start.hypothesis.causes) == 2]
    assert singles[0].hypothesis.name == "decoy"
    assert pairs[0].hypothesis.causes == ("first", "second")
    assert pairs[0].gain > pairs[1].gain + 100


def test_a_start_is_where_its_causes_alone_fit_best():
    y = 2 * LEVEL + 1.2 * FIRST + RNG.normal(size=SAMPLES)
    start = next(one for one in ranked(y)[0] if one.hypothesis.causes == ("first",))
    level, strength = start.u[0], np.sinh(start.u[1])
    # its prior deviation of 1.5 in u shrinks a strength, whose own deviation is 1 / sqrt(400)
    assert level == pytest.approx(2.0, abs=4 / np.sqrt(SAMPLES))
    assert strength == pytest.approx(1.2, abs=0.3)


def test_a_probable_cause_of_a_large_strength_is_used_as_a_start():
    system = Linear()
    likely = [Start(system.hypothesis(["other"]), np.array([1.0, np.arcsinh(40.0)]))]
    with ThreadPoolExecutor(1) as pool:
        campaign = Campaign([SimpleNamespace(name="run", y=40 * OTHER)], system, pool)
        known = evaluated(campaign, system.base, np.zeros(1))
        model = saturated(known, [system.hypothesis([name]) for name in system.causes])
    u = model.with_causes(likely)
    assert u[0] == 1.0
    assert u[model.own[2][0]] == pytest.approx(np.arcsinh(40.0))
    assert all("other" in start.hypothesis.causes for start in ranked(40 * OTHER, likely)[0][:3])


def test_what_all_causes_together_do_not_explain_is_ranked_from_both_starts():
    likely = [Start(Linear().hypothesis(["other"]), np.array([1.0, np.arcsinh(40.0)]))]
    y = 40 * OTHER + RNG.normal(size=SAMPLES)
    assert len(ranked(y, likely)) == 2  # noise of one sigma is beyond what counts as explained in a coarse comparison
    assert len(ranked(40 * OTHER, likely)) == 1


def test_a_gain_is_what_the_base_leaves_less_than_what_the_causes_leave():
    y = 2 * LEVEL + 2 * FIRST  # the fit of all starts where the base's constant is 0
    (found,) = ranked(y)
    first = next(one for one in found if one.hypothesis.causes == ("first",))
    # all but what the strength's prior costs, of deviation 1.5 at u = asinh(2), twice at most
    assert robust_cost(y) - 2 * np.arcsinh(2.0) ** 2 / 1.5**2 < first.gain < robust_cost(y)


def test_a_cause_without_a_strength_or_with_an_unknown_of_another_is_left_out():
    known = SimpleNamespace(unknowns=Linear.base, u=np.zeros(1))
    form = Hypothesis(("form",), (Unknown("form", 1.0, kind="linear"),), ((1.0,),))
    first, again = Linear().hypothesis(["first"]), Hypothesis(("again",), (Unknown("first", 1.0),), ((1.0,),))
    assert [one.name for one in saturated(known, [form, first, again]).causes] == ["first"]


def test_a_run_whose_derivatives_have_diverged_does_not_spoil_the_information_of_the_others():
    class Unstable(Linear):
        def misfit(self, recording, unknowns, u, *, level=None, derivatives=False):
            one = super().misfit(recording, unknowns, u, level=level, derivatives=derivatives)
            return replace(one, jacobian=1e70 * one.jacobian**2) if recording.name == "unstable" else one

    system, y = Unstable(), 2 * LEVEL + 2 * FIRST + 2 * SECOND + RNG.normal(size=SAMPLES)
    runs = [SimpleNamespace(name=name, y=y) for name in ("run", "unstable")]
    with ThreadPoolExecutor(1) as pool:
        campaign = Campaign(runs, system, pool)
        known = evaluated(campaign, system.base, np.zeros(1))
        (found,) = subsets(campaign, known, [system.hypothesis([name]) for name in system.causes], [])
    pairs = [start for start in found if len(start.hypothesis.causes) == 2]
    assert set(pairs[0].hypothesis.causes) == {"first", "second"}
