"""The learned proposal: its mathematics, its file, and its answers for recordings of another apparatus."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.replay.compare.gather import gather
from straw.replay.diagnose.propose import network
from straw.replay.diagnose.propose.dataset import Examples
from straw.replay.diagnose.propose.learned import SHIPPED, load, shipped
from straw.replay.diagnose.propose.proposal import Proposal, propose
from straw.replay.diagnose.propose.recorded import recorded
from straw.replay.diagnose.propose.simulate_campaigns import Group, simulated_group
from straw.replay.diagnose.propose.train import scales_of
from straw.replay.diagnose.systems.straw.library import causes
from straw.replay.diagnose.systems.straw.observation import Observation, observe
from straw.replay.errors import ReplayError

BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)


@pytest.fixture(scope="module")
def given(shared: Path) -> dict[str, list[Observation]]:
    """The recordings by specimen, four runs of each."""
    names = ("fold-25kPa", "deploy-35kPa-1", "staircase", "deploy-30kPa-6")
    return {
        specimen: [observe(r) for r in gather([shared / "recordings" / specimen / f"{n}.mcap" for n in names])]
        for specimen in ("open-a", "open-b", "open-c", "open-d")
    }


@pytest.fixture(scope="module")
def proposals(given: dict[str, list[Observation]]) -> dict[str, Proposal]:
    return {specimen: propose(observations, BASE) for specimen, observations in given.items()}


def test_the_networks_gradients_are_those_of_its_loss() -> None:
    rng = np.random.default_rng(5)
    w = {k: x.astype(np.float64) for k, x in network.fresh(rng, 12, 3, 4).items()}
    batch = network.Batch(rng.normal(size=(9, 12)), np.array([0, 2, 3]))
    values = np.where(rng.random((3, 4)) < 0.3, np.nan, rng.normal(size=(3, 4)))
    truth = network.Truth((rng.random((3, 3)) < 0.5).astype(np.float64), values)
    _, slopes = network.slopes(w, batch, truth, None)
    means = network.answer(w, batch)[:, 3:7]  # taken as known where deviations are learned
    for name, x in w.items():
        along = rng.normal(size=x.shape)
        losses = []
        for step in (1e-6, -1e-6):
            moved = {**w, name: x + step * along}
            losses.append(network.loss(network.answer(moved, batch), truth, means)[0])
        assert (losses[0] - losses[1]) / 2e-6 == pytest.approx(float(np.sum(slopes[name] * along)), rel=1e-5, abs=1e-8)


def test_a_target_that_is_constant_does_not_count_more_than_others() -> None:
    """A squared error in units of a deviation of zero would dominate everything else that is learned."""
    values = np.array([[1.0, 5.0], [1.0, -5.0], [1.0, np.nan]], dtype=np.float32)
    none = np.zeros((3, 1))
    examples = Examples(none.astype(np.float16), np.arange(3), none.astype(np.bool_), values, np.zeros(3, np.bool_))
    np.testing.assert_allclose(scales_of(examples), [1.0, 5.0], rtol=0.01)


def test_a_group_is_the_same_for_the_same_seed_and_after_saving(tmp_path: Path) -> None:
    group, again = simulated_group(3), simulated_group(3)
    assert group is not None
    assert again is not None
    np.testing.assert_array_equal(group.motion, again.motion)
    group.save(tmp_path / "group-000003.npz")
    kept = Group.load(tmp_path / "group-000003.npz")
    assert kept.protocols == group.protocols
    np.testing.assert_array_equal(kept.cause_u, group.cause_u)
    np.testing.assert_array_equal(kept.nominal.zeta0_m, group.nominal.zeta0_m)
    one, other = (recorded(g, 0, np.random.default_rng(1)) for g in (group, kept))
    np.testing.assert_array_equal(one.runs[0].tip, other.runs[0].tip)


def test_the_weights_are_small_and_state_their_origin() -> None:
    about = shipped().about
    assert SHIPPED.stat().st_size <= 10e6
    assert set(about["causes"]) <= set(causes(9))
    assert {"recipe", "seed", "date", "version", "sha256", "recordings"} <= set(about)


def test_damaged_weights_are_refused_by_name(tmp_path: Path) -> None:
    learned = shipped()
    path = tmp_path / "weights.npz"
    learned.save(path)
    assert load(path).about["sha256"]
    with np.load(path) as data:
        arrays = dict(data)
    arrays["scaling_mean"] = arrays["scaling_mean"] + 1
    np.savez(path, **arrays)
    with pytest.raises(ReplayError, match=r"weights\.npz"):
        load(path)
    path.write_bytes(b"nothing")
    with pytest.raises(ReplayError, match="train"):
        load(path)


@pytest.mark.parametrize(
    ("specimen", "cause"), [("open-b", "cohesion"), ("open-c", "poiseuille_loss"), ("open-d", "clock_offset")]
)
def test_the_causes_concealed_in_the_given_recordings_are_among_the_first_to_be_tried(
    proposals: dict[str, Proposal], specimen: str, cause: str
) -> None:
    assert cause in list(proposals[specimen].scores)[:3]


def test_starting_values_are_near_the_concealed_ones(proposals: dict[str, Proposal]) -> None:
    """5 N, 2e9 Pa s/m^3, 60 ms late: within a factor of three, from which an exact fit converges."""
    for specimen, cause, truth in (
        ("open-b", "cohesion", 5.0),
        ("open-c", "poiseuille_loss", 2e9),
        ("open-d", "clock_offset", 0.06),
    ):
        ways = proposals[specimen].start([cause])
        first = len(proposals[specimen].base)
        sizes = [way[first].unknown.value(way[first].u) for way in ways]
        assert any(truth / 3 < size < truth * 3 for size in sizes), sizes


def test_the_order_of_the_runs_does_not_matter(
    given: dict[str, list[Observation]], proposals: dict[str, Proposal]
) -> None:
    turned = propose(given["open-b"][::-1], BASE)
    for name, score in proposals["open-b"].scores.items():
        assert turned.scores[name] == pytest.approx(score, abs=1e-4)


def test_an_untrained_cause_is_tried_too(given: dict[str, list[Observation]]) -> None:
    learned = shipped()
    few = dict(learned.about, causes=["a law of yesterday", *learned.about["causes"][1:]])
    forgotten = learned.about["causes"][0]
    found = propose(
        given["open-a"], BASE, learned=type(learned)(learned.members, learned.scaling, learned.familiar, few)
    )
    assert set(found.unknown_to_it) == {forgotten, *propose(given["open-a"], BASE).unknown_to_it}
    assert 0.01 < found.scores[forgotten] < 0.5
    assert any(forgotten in names for names, _ in found.hypotheses)


def test_hypotheses_are_all_sets_of_at_most_two_causes(proposals: dict[str, Proposal]) -> None:
    found = proposals["open-a"].hypotheses
    n = len(causes(9))
    assert len({names for names, _ in found}) == len(found) == 1 + n + n * (n - 1) // 2
    weights = [weight for _, weight in found]
    assert weights == sorted(weights, reverse=True)
    assert sum(weights) == pytest.approx(1)


def test_a_campaign_outside_the_training_distribution_is_called_unfamiliar(
    given: dict[str, list[Observation]], proposals: dict[str, Proposal]
) -> None:
    """A tip that oscillates by millimetres all the time."""
    from dataclasses import replace

    rng = np.random.default_rng(0)
    shaken = [
        replace(o, tip=o.tip + rng.normal(size=o.tip.shape) * np.array([[3e-3], [3e-3], [0.1]]))
        for o in given["open-a"]
    ]
    assert proposals["open-a"].familiar
    assert not propose(shaken, BASE).familiar


def test_runs_that_cannot_be_simulated_are_left_out_by_name(given: dict[str, list[Observation]]) -> None:
    """A straw without a deployed rest state."""
    thick = BASE.replace(h_m=5e-3)
    found = propose(given["open-a"], thick)
    assert set(found.runs_left_out) == {o.name for o in given["open-a"]}
    assert not found.familiar
