"""`import straw`: the same answers as the commands, as objects that a notebook shows; bad input is one line."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import straw
from straw.replay.cli import main
from straw.replay.diagnose.systems.straw.library import causes
from tests.apparatus.campaign import NONE, campaign

PROTOCOL = 'name = "p"\npressure_unit = "kPa"\ninitial_deployed = [1, 4]\n[[main]]\nhold = -5\nfor_s = 0.2\n'


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a protocol, a run on the emulator and its tip as an ideal camera records it."""
    folder = tmp_path_factory.mktemp("place")
    (folder / "p.toml").write_text(PROTOCOL)
    run = ["rig", "run", str(folder / "p.toml"), "--emulate", "--fast", "-o", str(folder / "run.mcap")]
    assert main([*run, "--tip", str(folder / "tip.mcap")]) == 0
    return folder


def test_every_public_name_is_there_and_has_a_docstring() -> None:
    for name in straw.__all__:
        value = getattr(straw, name)
        if name not in ("__version__", "USER_ERRORS"):
            assert value.__doc__, name
            assert name in dir(straw)


def test_an_unknown_name_is_answered_with_where_to_look() -> None:
    with pytest.raises(AttributeError, match="__all__"):
        straw.simulat  # noqa: B018


def test_a_protocol_is_predicted_as_by_the_command(place: Path) -> None:
    predicted = straw.simulate(None, place / "p.toml")
    out = place / "predicted.mcap"
    assert main(["simulate", "--protocol", str(place / "p.toml"), "-o", str(out)]) == 0
    said = straw.read_recording(out).predictions["straw"].tip
    assert said is not None
    np.testing.assert_array_equal(predicted.x_m, said.x_m)
    assert predicted.x_m.shape == predicted.time_s.shape == (48,)


def test_times_and_start_may_be_given_with_any_pressure(place: Path) -> None:
    by_number = straw.simulate(None, -5e3, [0.0, 0.1], [1, 4])
    by_function = straw.simulate(straw.StrawParameters(), lambda t: np.full_like(t, -5e3), np.array([0.0, 0.1]), (1, 4))
    np.testing.assert_array_equal(by_number.x_m, by_function.x_m)
    assert len(straw.simulate(None, straw.load_protocol(place / "p.toml"), [0.0, 0.05]).time_s) == 2


def test_a_derivative_agrees_with_a_finite_difference_of_the_constant(place: Path) -> None:
    d = straw.differentiate(None, place / "p.toml", ["c_zeta_n_s_per_m", "delay_s"])
    assert d.x_m.shape == (48, 2)
    base = straw.StrawParameters()
    step = 1.0
    a, b = (straw.simulate(base.replace(c_zeta_n_s_per_m=620 + k * step), place / "p.toml").x_m for k in (-1, 1))
    # each run is accurate to TOLERANCE_M, hence their central difference to TOLERANCE_M / step
    np.testing.assert_allclose(d.x_m[:, 0], (b - a) / (2 * step), atol=1e-6 / (2 * step))


def test_recordings_are_compared_as_by_the_command(place: Path) -> None:
    files = [place / "run.mcap", place / "tip.mcap"]
    found = straw.replay(files)
    joined = straw.replay(straw.read_recording(*files))
    out = place / "r.json"
    assert main(["replay", *map(str, files), "--report", str(place / "r.html"), "--json", str(out)]) == 0
    assert json.loads(out.read_text()) == json.loads(json.dumps(found.as_json()))
    assert found["run"].signals["x_m"].metrics.rmse == joined[0].signals["x_m"].metrics.rmse
    found.write_page(place / "page.html")
    assert (place / "page.html").read_text() == (place / "r.html").read_text()


def test_a_recording_that_is_written_reads_the_same(place: Path) -> None:
    read = straw.read_recording(place / "run.mcap", place / "tip.mcap")
    about = {"initial_deployed": read.initial_deployed, "specimen": "s", "cycle": 3, "zero_time_ns": read.zero_time_ns}
    columns = {"pressure": read.pressure, "command": read.command, "tip": read.tip, "events": read.events}
    back = straw.write_recording(place / "back.mcap", **columns, **about)  # type: ignore[arg-type]
    assert (back.initial_deployed, back.specimen, back.cycle) == ((1, 4), "s", 3)
    assert [e.kind for e in back.events] == [e.kind for e in read.events]
    for log in ("pressure", "command", "tip"):
        one, other = getattr(read, log), getattr(back, log)
        for name in vars(one):
            # times are stored in ns
            np.testing.assert_allclose(
                np.asarray(getattr(one, name), float), np.asarray(getattr(other, name), float), rtol=0, atol=1e-9
            )


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"pressure": {"time_s": [0.0, 1.0]}}, "pressure_pa is missing"),
        ({"pressure": {"time_s": [0.0, 1.0], "pressure_pa": [0.0]}}, "make them equal"),
        ({"pressure": {"time_s": [1.0, 0.0], "pressure_pa": [0.0, 0.0]}}, "increase"),
        ({"pressure": {"time_s": [0.0], "pressure_pa": [np.nan]}}, "no numbers"),
        ({"pressure": {"time_s": [0.0], "pressure_kpa": [1.0]}}, "unknown column 'pressure_kpa'"),
        ({"tip": {"time_s": ["a"], "x_m": [0], "z_m": [0], "phi_rad": [0]}}, "not a column of numbers"),
        ({}, "nothing to write"),
    ],
)
def test_columns_that_do_not_form_a_recording_are_refused_in_one_line(
    tmp_path: Path, given: dict[str, object], words: str
) -> None:
    with pytest.raises(straw.USER_ERRORS, match=words) as refused:
        straw.write_recording(tmp_path / "r.mcap", **given)  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_argument_is_named_in_the_error(place: Path) -> None:
    with pytest.raises(straw.ReplayError, match="give time_s and deployed"):
        straw.simulate(None, 1e3)
    with pytest.raises(straw.ReplayError, match="give a controller"):
        straw.run_protocol(place / "p.toml", place / "no.mcap")
    with pytest.raises(straw.ReplayError, match="not a track of"):
        straw.read_recording(place / "run.mcap", place / "run.mcap")
    with pytest.raises(straw.ReplayError, match="no recording is given"):
        straw.replay([])


def test_a_run_on_the_emulator_is_a_recording(place: Path) -> None:
    recorded = straw.run_protocol(place / "p.toml", place / "again.mcap", emulate=True, metadata={"fluid": "water"})
    assert recorded.metadata["fluid"] == "water"
    assert "ob1-mk4" in straw.controllers()


def test_results_have_an_html_view_and_convert_to_data_frames(place: Path) -> None:
    results = [
        straw.load_protocol(place / "p.toml"),
        straw.read_recording(place / "run.mcap", place / "tip.mcap"),
        straw.simulate(None, place / "p.toml"),
        straw.replay([place / "run.mcap", place / "tip.mcap"]),
        straw.replay([place / "run.mcap", place / "tip.mcap"])[0],
    ]
    for result in results:
        shown = result._repr_html_()
        assert "<svg" in shown
        assert "<table" in shown
        frame = result.to_dataframe()
        assert len(frame) > 0
        assert all(len(name.rsplit("_", 1)) == 2 for name in frame.columns if name not in ("run", "valid"))


def test_a_diagnosis_has_an_html_view_and_writes_its_page_and_straw(tmp_path: Path) -> None:
    """One run without a snap, with two causes in question: the shortest diagnosis there is."""
    (run,) = campaign((), 3, ("staircase",), NONE)
    most = [name for name in causes(9) if name not in ("clock_offset", "gauge_gain")]
    steps: list[int] = []
    found = straw.diagnose(run, without=most, tolerance="2%", progress=lambda done, total: steps.append(done))
    assert steps
    assert found.verdict in ("complete", "ambiguous", "within_tolerance")
    assert found.to_dataframe()["probability"].sum() == pytest.approx(1.0)
    assert len(found.heldout["channel"]) == 0  # a single run leaves nothing to hold out
    assert set(found.located) == {"run", "channel", "phase", "from_s", "to_s", "share_of_misfit"}
    assert "<svg" in found._repr_html_()
    assert repr(found) == f"<Diagnosis: {found.verdict}: {found.says}>"
    found.write_page(tmp_path / "why.html")  # simulates again
    found.write_straw(tmp_path / "s.toml")
    assert straw.load_straw(tmp_path / "s.toml").to_toml() == found.straw.to_toml()
    assert json.loads(json.dumps(found.as_json()))["verdict"] == found.verdict


def test_a_users_own_system_is_diagnosed_from_arrays(tmp_path: Path) -> None:
    (tmp_path / "line.py").write_text(
        'time = "t"\ninputs = {"u": ("u", "V")}\nchannels = {"y": ("y", "N")}\n'
        'constants = {"a": (2.0, "N/V", 0.5, 8.0)}\n'
        'places = ["channel:y"]\ndepends_on = ["u"]\ndef shown(t, x, u, c):\n    return c.a * u.u\n'
    )
    random, t = np.random.default_rng(2), np.linspace(0, 10, 400)
    u = {name: 2 * np.sin(k * t) for name, k in (("one", 1.0), ("two", 1.7), ("three", 0.6))}
    tables = {n: {"t": t, "u": v, "y": 3 * v + 0.5 * v**3 + 1e-2 * random.normal(size=400)} for n, v in u.items()}
    found = straw.diagnose_system(tmp_path / "line.py", tables, hold_out=["three"])
    assert found.verdict == "missing_physics"
    (before,), (after,) = found.heldout["rms_before"], found.heldout["rms_after"]
    assert after < 2e-2 < before
    assert len(found.laws) == len(found.curves) >= 1
    assert set(found.to_dataframe().columns) == {"cause", "constant", "value", "sigma", "unit"}
    assert "<svg" in found._repr_html_()
    found.write_page(tmp_path / "why.html")
    for wrong in ({}, {"one": {"t": t, "u": t}}):
        with pytest.raises(straw.ReplayError):
            straw.diagnose_system(tmp_path / "line.py", wrong)


def test_a_table_is_interpreted_then_stated_then_written(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("Zeit;Druck\n" + "".join(f"0,{k:03};-{k},5\n" for k in range(100)))
    looked = straw.import_tables(path)
    assert looked.recording is None
    assert len(looked.guesses) > 1
    assert "<svg" in looked._repr_html_()
    with pytest.raises(straw.ReplayError, match="to state it"):
        straw.import_tables(path, tmp_path / "r.mcap")
    assert not (tmp_path / "r.mcap").exists()
    said = {"time": "Zeit in s", "pressure": "Druck in mbar"}
    done = straw.import_tables(
        path, tmp_path / "r.mcap", columns=said, start="2026-05-03 14:02:11Z", initial_deployed=[]
    )
    assert done.guesses == ()
    assert done.recording is not None
    assert done.recording.pressure is not None
    assert done.recording.pressure.pressure_pa[-1] == pytest.approx(-9950)
    assert done.to_dataframe()["role"].tolist() == ["pressure"]
    (tmp_path / "m.toml").write_text(done.mapping)
    again = straw.import_tables(path, tmp_path / "again.mcap", mapping=tmp_path / "m.toml")
    assert again.guesses == ()
    assert straw.export_table(done.recording, csv=tmp_path / "back.csv") == 100
    with pytest.raises(straw.ReplayError, match="no role 'druck'"):
        straw.import_tables(path, columns={"druck": "Druck"})


def test_a_users_own_figure_of_merit_is_judged_by_replay(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STRAW_FIGURES", "")
    (place / "f.py").write_text(
        "import straw\nFIGURE = straw.FigureOfMerit('deepest', 'Pa', 'most suction', lambda m: m.pressure_pa.min())\n"
    )
    straw.add_figures(place / "f.py")
    found = straw.replay([place / "run.mcap", place / "tip.mcap"])[0].quantities[-1]
    assert (found.name, found.unit) == ("deepest", "Pa")
    assert found.measured == found.predicted == pytest.approx(-5e3, rel=0.05)


def test_without_pandas_the_error_says_what_to_install(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(straw.ReplayError, match="pip install pandas"):
        straw.load_protocol(place / "p.toml").to_dataframe()
