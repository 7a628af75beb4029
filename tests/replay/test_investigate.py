"""The closed loop by itself: reasons to stop, the choice of experiments, the log, and recovery from any crash."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from straw.replay.errors import ReplayError
from straw.replay.investigate.budget import Budget, Spent
from straw.replay.investigate.log import Log
from straw.replay.investigate.state import State
from straw.replay.investigate.steps import Found, Proposal, Ran
from straw.replay.investigate.stop import REASONS, certainty_of
from straw.rig.errors import RigError
from tests.replay.loop_fakes import SURE, Crash, Fakes, lines, offered, went


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "log.jsonl"


def test_it_runs_the_most_informative_experiment_until_the_cause_is_named_with_the_required_certainty(
    path: Path,
) -> None:
    fakes = Fakes(named_after=2)
    stop = went(path, fakes)
    assert (stop.reason, stop.code, fakes.ran) == ("named", 0, ["a", "b"])
    rounds = [line for line in lines(path) if line["kind"] == "round"]
    assert [(r["round"], r["proposal"]["why"], r["who"]) for r in rounds] == [
        (1, "a", "somebody"),
        (2, "b", "somebody"),
    ]
    assert rounds[0]["verdict_before"] == "ambiguous"
    assert lines(path)[-1]["reason"] == "named"


def test_a_cause_below_the_required_certainty_does_not_end_it(path: Path) -> None:
    stop = went(path, Fakes(named_after=0), Budget(rounds=3), certainty=0.97)
    assert (stop.reason, stop.code) == ("budget", 1)


def test_a_cause_named_after_few_runs_must_be_named_again_after_a_run_under_another_protocol(path: Path) -> None:
    fakes = Fakes(named_after=2, menu=[offered("a", 0.9), offered("b", 0.5), offered("c", 0.2, chances=(0.0,))])
    fakes.recorded_before = 0
    assert (went(path, fakes).reason, fakes.ran) == ("named", ["a", "b", "c"])
    proposed = [line["proposal"]["why"] for line in lines(path) if line["kind"] == "proposed"]
    assert proposed[-1] == "to confirm cohesion by a run that was not fitted; c"


def test_a_cause_that_another_replaces_after_the_next_run_does_not_end_it(path: Path) -> None:
    fakes = Fakes(named_after=3)
    fakes.recorded_before = 0
    other = Found("missing_physics", ("squeeze_film",), {"squeeze_film": 0.95, "cohesion": 0.05}, "a film")
    fakes.unsure = [fakes.unsure[0], fakes.unsure[0], other]
    stop = went(path, fakes)
    assert (stop.reason, stop.says[:8], len(fakes.ran)) == ("named", "cohesion", 4)


def test_where_the_budget_does_not_pay_for_a_run_that_confirms_the_name_it_is_no_answer(path: Path) -> None:
    fakes = Fakes(named_after=2)
    fakes.recorded_before = 0
    stop = went(path, fakes, Budget(rounds=2))
    assert (stop.reason, stop.code) == ("budget", 1)
    assert stop.says.endswith("cohesion is missing")


def test_a_complete_model_ends_it_without_a_run(path: Path) -> None:
    fakes = Fakes(named_after=0)
    fakes.sure = Found("complete", (), {"complete": 0.95, "cohesion": 0.05}, "nothing is missing")
    assert (went(path, fakes).reason, fakes.ran) == ("complete", [])


def test_a_complete_model_does_not_end_it_before_the_largest_pressures_were_run(path: Path) -> None:
    fakes = Fakes(named_after=0)
    complete = {"complete": 0.95, "cohesion": 0.05}
    fakes.sure = Found("complete", (), complete, "nothing is missing", untried=True)
    stop = went(path, fakes, Budget(rounds=2))
    assert (stop.reason, len(fakes.ran)) == ("budget", 2)


def test_every_cause_that_is_named_must_reach_the_certainty() -> None:
    both = Found("missing_physics", ("cohesion", "clock_offset"), SURE)
    assert certainty_of(both) == pytest.approx(0.06)
    assert certainty_of(Found("missing_physics", ("cohesion",), SURE)) == pytest.approx(0.96)
    assert certainty_of(Found("unknown_physics", ("unknown",), {"unknown": 0.99})) == 0


def test_it_ends_where_the_chance_of_a_decision_is_at_most_one_minus_the_certainty(path: Path) -> None:
    fakes = Fakes(menu=[offered("a", chances=(0.0, 0.05, 0.1))])
    assert (went(path, fakes).reason, fakes.ran) == ("nothing_left", [])
    fakes = Fakes(named_after=1, menu=[offered("a", chances=(0.0, 0.05, 0.11))])
    assert went(path, fakes).reason == "named"


def test_a_person_sees_how_many_identical_runs_are_expected_to_be_needed(path: Path) -> None:
    fakes = Fakes(named_after=3, menu=[offered("a", chances=(0.0, 0.3, 0.8, 0.85))])
    went(path, fakes)
    assert [(one.number, one.before, one.runs) for one in fakes.ahead] == [(1, 0, 3), (2, 1, 3), (3, 2, 3)]
    assert next(line for line in lines(path) if line["kind"] == "proposed")["runs"] == 3


def test_where_a_decision_needs_more_runs_than_the_budget_allows_that_is_the_reason(path: Path) -> None:
    fakes = Fakes(menu=[offered("a", chances=(0.0, 0.0, 0.0, 0.6))])
    stop = went(path, fakes, Budget(rounds=3))
    assert (stop.reason, fakes.ran) == ("budget", [])
    assert "4 runs alike" in stop.says


def test_it_ends_where_three_runs_in_a_row_changed_nothing(path: Path) -> None:
    fakes = Fakes(named_after=99)
    stop = went(path, fakes, Budget(rounds=9))
    assert (stop.reason, stop.code, len(fakes.ran)) == ("nothing_left", 1, 3)
    assert "changed nothing" in stop.says


NOTHING_FITS = Found("unknown_physics", ("unknown",), {"unknown": 0.85, "cohesion": 0.15}, "nothing explains it.")


def test_an_unknown_cause_is_confirmed_by_one_more_run_then_fitted_as_a_law_and_ends_the_loop(path: Path) -> None:
    fakes = Fakes(named_after=99, menu=[offered("a", chances=(0.0,))])
    fakes.unsure = [NOTHING_FITS]
    stop = went(path, fakes)
    assert (stop.reason, stop.code, fakes.ran, fakes.searched) == ("unknown", 1, ["a"], 1)
    assert stop.says == "nothing explains it. It pulls at cell 4."


def test_an_unknown_cause_does_not_end_it_while_an_experiment_could_still_name_one(path: Path) -> None:
    fakes = Fakes(named_after=3)
    fakes.unsure = [NOTHING_FITS]
    assert (went(path, fakes).reason, fakes.searched) == ("named", 0)


def test_every_way_to_end_is_logged(path: Path) -> None:
    """Ctrl-C while it waits for approval, and a file that cannot be read while it diagnoses."""
    fakes = Fakes()
    fakes.dry_run = _raising(KeyboardInterrupt())  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        went(path, fakes)
    assert lines(path)[-1]["reason"] == "interrupted"
    fakes.dry_run = _raising(ValueError())  # type: ignore[method-assign]
    fakes.diagnose = _raising(RigError("a.mcap: damaged"))  # type: ignore[method-assign]
    with pytest.raises(RigError):
        went(path, fakes)
    assert (lines(path)[-1]["reason"], lines(path)[-1]["says"]) == ("error", "a.mcap: damaged")
    assert {"interrupted", "error", "unknown", "nothing_left"} < set(REASONS)


def _raising(error: BaseException) -> Any:
    def does(*_: object) -> None:
        raise error

    return does


def test_nothing_is_run_twice_unless_a_repeat_is_the_most_informative(path: Path) -> None:
    fakes = Fakes(named_after=3, menu=[offered("a", 0.6), offered("b", 0.5), offered("c", 0.4)])
    went(path, fakes)
    assert fakes.ran == ["a", "b", "c"]
    fakes = Fakes(named_after=3, menu=[offered("a", 0.6), offered("b", 0.25), offered("c", 0.1)])
    went(path.with_name("other.jsonl"), fakes)
    assert fakes.ran == ["a", "a", "b"]


def test_runs_that_were_recorded_without_the_loop_count_as_run(path: Path) -> None:
    known = Proposal('name = "a"', (), "a", 0.6, 9.0, 0.1, 3, run_before=2, chances=(0.9,))
    fakes = Fakes(named_after=1, menu=[known, offered("b", 0.5)])
    went(path, fakes)
    assert fakes.ran == ["b"]


def test_a_refusal_ends_the_loop_before_anything_moves(path: Path) -> None:
    fakes = Fakes()
    fakes.answer = ""
    stop = went(path, fakes)
    assert (stop.reason, stop.code, fakes.ran) == ("refused", 1, [])


def test_approval_in_advance_covers_its_number_of_rounds_but_none_that_needs_work_by_hand(path: Path) -> None:
    fakes = Fakes(named_after=3)
    went(path, fakes, yes=2)
    assert (len(fakes.ran), fakes.asked) == (3, 1)
    fakes = Fakes(named_after=2)
    fakes.hand = "set cells 1, 4"
    went(path.with_name("other.jsonl"), fakes, yes=2)
    assert fakes.asked == 2


@pytest.mark.parametrize(
    ("budget", "runs"), [(Budget(rounds=2), 2), (Budget(None, minutes=0.25), 2), (Budget(None, snaps=5), 1)]
)
def test_rounds_minutes_and_snaps_are_counted_and_never_exceed_the_budget(
    path: Path, budget: Budget, runs: int
) -> None:
    fakes = Fakes(named_after=99)
    stop = went(path, fakes, budget)
    assert (stop.reason, stop.code, len(fakes.ran)) == ("budget", 1, runs)
    assert went(path, fakes, budget).reason == "budget"  # and are spent for the next call as well
    assert len(fakes.ran) == runs


def test_of_two_equally_informative_experiments_the_cheaper_one_is_run_and_unaffordable_ones_are_skipped(
    path: Path,
) -> None:
    fakes = Fakes(
        named_after=1, menu=[offered("dear", snaps=8), offered("cheap", snaps=2), offered("over", 9.0, snaps=20)]
    )
    went(path, fakes, Budget(rounds=None, snaps=10))
    assert fakes.ran == ["cheap"]


def test_an_experiment_beyond_the_limits_is_skipped_and_reported_if_none_is_left(path: Path) -> None:
    fakes = Fakes(named_after=1)
    fakes.forbidden = {"a"}
    went(path, fakes)
    assert fakes.ran == ["b"]
    fakes = Fakes()
    fakes.forbidden = {"a", "b", "c"}
    stop = went(path.with_name("other.jsonl"), fakes)
    assert stop.reason == "nothing_left"
    assert "a is beyond the limit" in stop.says


@pytest.mark.parametrize(("status", "error"), [("abort", ""), ("success", "the link is lost")])
def test_a_run_that_aborts_is_recorded_and_counted_and_ends_it(path: Path, status: str, error: str) -> None:
    fakes = Fakes()
    fakes.status, fakes.error = status, error
    stop = went(path, fakes)
    assert (stop.reason, stop.code) == ("aborted", 1)
    ran = next(line for line in lines(path) if line["kind"] == "ran")
    assert ran["status"] in ("abort", "cut")
    assert lines(path)[-1]["spent"]["rounds"] == 1
    fakes.status, fakes.error = "success", ""
    assert went(path, fakes, yes=9).reason == "named"  # the same command continues,
    assert fakes.asked == 1 + 2  # and a person approved each run


def test_a_run_without_a_track_waits_for_one(path: Path) -> None:
    fakes = Fakes(named_after=1)
    fakes.tracks = False
    assert went(path, fakes).reason == "untracked"
    assert went(path, fakes).reason == "untracked"
    fakes.tracks = True
    assert (went(path, fakes).reason, fakes.ran) == ("named", ["a"])


STEPS = ("diagnose", "propose", "dry_run", "ask", "run", "after", "track")


@pytest.mark.parametrize("step", STEPS)
def test_after_a_crash_at_any_step_the_same_command_reaches_the_same_end(path: Path, step: str) -> None:
    fakes = Fakes(named_after=2)
    fakes.crash = step
    with pytest.raises(Crash):
        went(path, fakes)
    stop = went(path, fakes)
    assert (stop.reason, fakes.ran) == ("named", ["a", "b"])
    assert [line["round"] for line in lines(path) if line["kind"] == "round"] == [1, 2]


@pytest.mark.parametrize("line", range(1, 14))
def test_after_a_crash_after_any_line_of_the_log_the_same_command_reaches_the_same_end(path: Path, line: int) -> None:
    whole = Fakes(named_after=2)
    went(path, whole)
    assert len(lines(path)) == 14
    path.unlink()
    fakes = Fakes(named_after=2)
    with pytest.raises(Crash):
        went(path, fakes, until=line)
    stop = went(path, fakes)
    assert (stop.reason, fakes.ran) == ("named", ["a", "b"])
    assert [row["round"] for row in lines(path) if row["kind"] == "round"] == [1, 2]


def test_a_proposal_is_not_computed_again_after_a_crash(path: Path) -> None:
    fakes = Fakes(named_after=1)
    fakes.crash = "ask"
    with pytest.raises(Crash):
        went(path, fakes)
    fakes.crash = "propose"
    assert went(path, fakes).reason == "named"
    assert fakes.diagnosed == 2


def test_a_run_cut_by_a_crash_counts_as_spent_and_the_next_needs_approval_by_a_person(path: Path) -> None:
    fakes = Fakes(named_after=1)
    fakes.crash, fakes.late = "run", True
    with pytest.raises(Crash):
        went(path, fakes, yes=5)
    assert fakes.asked == 0
    stop = went(path, fakes, yes=5)
    assert (stop.reason, fakes.ran, fakes.asked) == ("named", ["a"], 1)
    assert lines(path)[-1]["spent"]["rounds"] == 2


def test_added_recordings_are_diagnosed_before_an_old_proposal_is_run(path: Path) -> None:
    fakes = Fakes(named_after=1)
    fakes.answer = ""
    went(path, fakes)
    fakes.ended["by-hand.mcap"] = Ran("success", "by-hand.mcap", "by-hand")
    assert (went(path, fakes).reason, fakes.ran) == ("named", [])


def test_the_log_is_only_appended_to_and_a_line_that_was_cut_is_left_out(path: Path) -> None:
    went(path, Fakes(named_after=1))
    before = path.read_bytes()
    path.write_bytes(before + b'{"kind": "ran", "sta')
    with Log(path) as log:
        assert (log.torn, State.of(log.lines).spent) == (1, Spent(1, 0.1, 3))
        log.write("note")
    assert path.read_bytes().startswith(before)
    with Log(path) as log:
        assert log.lines[-1]["kind"] == "note"


def test_a_second_process_on_one_log_and_a_file_that_is_no_log_are_refused(path: Path) -> None:
    with Log(path), pytest.raises(ReplayError, match="another straw investigate"), Log(path):
        pass
    path.write_text("somebody's notes\n")
    with pytest.raises(ReplayError, match="not a log"), Log(path):
        pass
    assert path.read_text() == "somebody's notes\n"
