"""Held-out runs in the findings: the share explained, what remains, what is worse, and what is within tolerance."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from straw.replay.diagnose import heldout
from straw.replay.diagnose.heldout import Held
from straw.replay.diagnose.systems.straw.system import CHANNELS
from straw.replay.diagnose.tolerance import parse_tolerance
from straw.replay.errors import ReplayError

NOISE = {"x_m": 3e-5, "z_m": 4e-5, "phi_rad": 3e-3}


def above(noise, **more):
    """RMS of noise and an independent remainder together."""
    return {name: (value**2 + more.get(name.split("_")[0], 0.0) ** 2) ** 0.5 for name, value in noise.items()}


def held(before, *steps):
    names = [f"cause {k}" for k in range(1, len(steps) + 1)]
    after = steps[-1] if steps else before
    moves = {"x_m": 0.02, "z_m": 0.05, "phi_rad": 1.0}
    return Held(("a", "b"), ("c",), 9.0, 1.0, before, after, NOISE, moves, tuple(zip(names, steps, strict=True)))


def test_each_cause_explains_the_share_of_the_mean_square_above_noise_that_it_removes():
    one = held(above(NOISE, x=4e-4), above(NOISE, x=2e-4), above(NOISE, x=1e-4))
    first, second = one.explained()
    assert first["share"]["x"] == pytest.approx(12 / 16)
    assert second["share"]["x"] == pytest.approx(3 / 16)
    assert first["share"]["z"] == 0.0  # nothing to explain there


def test_what_remains_is_the_root_of_the_mean_square_above_noise():
    left = held(above(NOISE, x=4e-4), above(NOISE, x=1e-4)).remainder
    assert left["x_m"] == pytest.approx(1e-4)
    assert left["phi_rad"] == 0.0


def test_better_in_one_channel_and_worse_in_another_is_no_improvement():
    one = held(above(NOISE, x=4e-4), above(NOISE, x=1e-4, z=4e-4))
    assert one.worse == ["z_m"]
    assert not one.better


def test_a_model_that_cannot_be_simulated_on_held_out_runs_counts_as_worse():
    one = held(above(NOISE, x=4e-4), dict.fromkeys(NOISE, float("nan")))
    assert one.worse == list(NOISE)
    assert one.remainder["x_m"] == float("inf")


def test_a_tolerance_by_channel_has_units():
    limits = parse_tolerance("x=0.1mm, phi=2mrad", CHANNELS)
    assert limits.si == pytest.approx({"x_m": 1e-4, "phi_rad": 2e-3})
    one = held(above(NOISE, x=0.9e-4, z=1.0))  # none for z
    assert limits.holds(one.remainder, one.moves)
    assert not limits.holds(held(above(NOISE, x=1.1e-4)).remainder, one.moves)


def test_a_tolerance_may_be_a_share_of_the_motion():
    one = held(above(NOISE, x=1.9e-4, z=4.9e-4, phi=9e-3))
    assert parse_tolerance("1%", CHANNELS).holds(one.remainder, one.moves)
    assert not parse_tolerance("0.9%", CHANNELS).holds(one.remainder, one.moves)


@pytest.mark.parametrize("text", ["x", "x=0.1", "x=0.1kg", "y=1mm", "x=-1mm", "x=1mrad", "0%", "x=1mm;z=1mm"])
def test_a_tolerance_that_cannot_be_read_is_refused_in_one_line(text):
    with pytest.raises(ReplayError, match="--tolerance") as error:
        parse_tolerance(text, CHANNELS)
    assert "\n" not in str(error.value)


@dataclass(frozen=True)
class Curve:
    campaign: None = None


@dataclass(frozen=True)
class Law:
    """A missing law with the X that it leaves on the runs held out, m; ``tells``: whether it explains enough."""

    leaves_m: float
    tells: bool = True
    curve: Curve = field(default_factory=Curve)
    noun: str = "a force"
    model: None = None


@pytest.mark.parametrize(
    ("two", "one", "kept"),
    [
        (Law(1e-4), Law(2e-4), 0),  # the second part helps
        (Law(2e-4), Law(1e-4), 1),  # it makes the run held out worse
        (Law(2e-4), Law(1.9e-4), 0),  # it does not matter there
        (Law(1e-4), Law(5e-4), 0),  # alone worse than the base
        (Law(1e-4), Law(5e-5, tells=False), 0),
        (Law(5e-4), Law(5e-4), None),
    ],
)
def test_a_second_law_is_kept_unless_it_makes_held_out_runs_worse(two, one, kept, monkeypatch):
    base = above(NOISE, x=4e-4)
    seen = iter([law.leaves_m for law in (two, one) if law.tells])
    monkeypatch.setattr(heldout, "hold_out", lambda *_args, **_more: held(base, above(NOISE, x=next(seen))))
    found = heldout.helpful(None, [two, one], [])
    assert (found and found[0]) is (None if kept is None else (two, one)[kept])


def test_a_run_with_constants_of_its_own_is_not_held_out():
    runs = [SimpleNamespace(name=name, kind=name) for name in "abcde"]
    campaign = SimpleNamespace(observations=runs, own={"c": {"rate": 0.1}, "e": {"rate": 0.2}})
    worst_first = [SimpleNamespace(run=name) for name in "cb"]
    assert heldout._chosen(campaign, worst_first) == ["b"]
    assert heldout._chosen(campaign, []) == ["d"]
