"""Input that cannot be diagnosed is refused before the work begins, in one line with thing, place and cure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from straw.replay import workers
from straw.replay.cli import main
from straw.replay.compare.gather import check_run
from straw.replay.compare.plausible import check_plausible
from straw.replay.errors import ReplayError
from straw.rig.run import PressureLog, Run
from straw.tracking.trace import TipTrace


def recorded() -> Run:
    """A run of 4 s in which a cell folds: 12 mm of motion under 25 kPa, noise of 25 um."""
    t = np.linspace(0.0, 4.0, 400)
    moved = (t > 2.0).astype(float)
    sigma = np.full(t.shape, 25e-6)
    tip = TipTrace(t, 0.022 - 0.012 * moved, 0.05 - 0.01 * moved, 1.5 + 0.2 * moved, sigma, sigma, 40 * sigma,
                   np.ones(t.shape, dtype=np.bool_), np.arange(400))  # fmt: skip
    pressure = PressureLog(t, -25e3 * np.minimum(t, 1.0), np.full(t.shape, 20.0))
    return Run(Path("run.mcap"), "0" * 64, "run", "A", (1,), 0, 9, 0, {}, {}, None, pressure, tip, {}, (), ())


def with_pressure(run: Run, **changed: np.ndarray) -> Run:
    assert run.pressure is not None
    return replace(run, pressure=replace(run.pressure, **changed))


def with_tip(run: Run, **changed: np.ndarray) -> Run:
    assert run.tip is not None
    return replace(run, tip=replace(run.tip, **changed))


def test_a_plausible_run_passes_and_so_does_one_at_rest():
    check_plausible(recorded())
    still = with_tip(recorded(), x_m=np.full(400, 0.02) + 25e-6 * np.random.default_rng(0).normal(size=400))
    assert still.tip is not None
    noise = 25e-6 * np.random.default_rng(1).normal(size=(2, 400))
    still = with_tip(still, z_m=0.05 + noise[0], phi_rad=1.5 + 40 * noise[1])
    check_plausible(with_pressure(still, pressure_pa=np.full(400, 3.0)))


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        (lambda r: with_pressure(r, pressure_pa=r.pressure.pressure_pa / 1e3), "25 Pa at most; it looks like kPa"),
        (lambda r: with_pressure(r, pressure_pa=r.pressure.pressure_pa / 1e5), "looks like bar"),
        (lambda r: with_pressure(r, pressure_pa=r.pressure.pressure_pa + 101325), "looks absolute"),
        (lambda r: with_tip(r, x_m=1e3 * r.tip.x_m), "x_m is up to 22 m; it looks like mm"),
        (lambda r: with_tip(r, phi_rad=np.degrees(r.tip.phi_rad)), "it looks like deg"),
        (lambda r: with_tip(r, sigma_x_m=1e3 * r.tip.sigma_x_m), "sigma_x_m is 0.025, and x_m spans 0.012 in all"),
        (lambda r: with_tip(r, time_s=r.tip.time_s + 1e3), "0 % of the tip has a pressure; check both clocks"),
    ],
)
def test_implausible_units_and_clocks_are_reported_with_their_likely_cause(changed, says):
    with pytest.raises(ReplayError) as error:
        check_plausible(changed(recorded()))
    assert says in str(error.value)
    assert str(error.value).startswith("run.mcap: ")


def test_a_start_that_names_cells_the_straw_lacks_is_quoted_as_it_was_written():
    said = "metadata initial_deployed = '77' does not list cells of 1..9: the initial state is unknown"
    with pytest.raises(ReplayError, match=r"initial_deployed = '77' does not list cells of 1..9; a prediction needs"):
        check_run(replace(recorded(), initial_deployed=None, lost=(said,)))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--tolerance", ""], "--tolerance '': give CHANNEL=VALUE"),
        (["--tolerance", "x=0.1"], "x=0.1: has no unit; write m or mm"),
        (["--tolerance", "x=1e999mm"], "1e999 is no finite number above zero"),
        (["--tolerance", "x=0.1mm,x=0.2mm"], "x is given twice"),
        (["--tolerance", "500%"], "more than all of the motion"),
        (["--given", "c=1,0,2"], "--given: is for --system S.py"),
        (["--hold-out", "a"], "--hold-out: is for --system S.py"),
        (["--report", "nowhere/r.html"], "there is no folder nowhere"),
        (["--json", "."], "is a folder"),
        (["--report", "run.mcap"], "run.mcap: is one of the files to be read"),
        ([], "run.mcap is empty (0 bytes)"),
    ],
)
def test_arguments_that_would_fail_at_the_end_are_refused_at_once(arguments, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("run.mcap").touch()
    assert main(["diagnose", "run.mcap", *arguments]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert says in err
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--straw", "s.toml"], "--straw: is for a straw; leave it out with --system"),
        (["--report", "my.py"], "my.py: is one of the files to be read"),
        (["--json", "nowhere/f.json"], "there is no folder nowhere"),
    ],
)
def test_what_a_users_own_system_does_not_support_is_refused_at_once(arguments, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("my.py").touch()
    Path("s.toml").touch()
    assert main(["diagnose", "data.csv", "--system", "my.py", *arguments]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("jobs", ["0", "-1", "two"])
def test_a_number_of_jobs_below_one_is_refused(jobs, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["diagnose", "run.mcap", f"--jobs={jobs}"])
    assert stopped.value.code == 2
    assert "expected a whole number, one or above" in capsys.readouterr().err


def test_a_scheduler_without_workers_is_an_error_instead_of_a_wait(monkeypatch):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster:
        monkeypatch.setattr(workers, "ANSWERS_S", 0.3)
        with (
            pytest.raises(ReplayError, match="has no workers; start one with dask worker"),
            workers.threads(1, cluster.scheduler_address),
        ):
            pass
