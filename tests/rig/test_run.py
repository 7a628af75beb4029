"""Recordings read back as written, in the project's own protobuf and in another logger's JSON."""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from straw.rig.errors import RigError
from straw.rig.run import PressureLog
from straw.rig.run_derived import write_prediction, write_tip
from straw.rig.run_read import read_run
from straw.rig.run_write import RunWriter
from straw.rig.schema import TOPICS, descriptor_set, message_class
from straw.tracking.trace import TipTrace

ZERO_NS = 1_795_000_000_000_000_000
METADATA = {"run_id": "r1", "specimen": "s1", "initial_deployed": "1,4", "cycle": "3", "cells": "9"}
TIP_FIELDS = ("x_m", "z_m", "phi_rad", "sigma_x_m", "sigma_z_m", "sigma_phi_rad", "valid", "frame")


def assert_same_tip(found: TipTrace | None, truth: TipTrace) -> None:
    assert found is not None
    np.testing.assert_allclose(found.time_s, truth.time_s, rtol=0, atol=1e-9)
    for name in TIP_FIELDS:
        np.testing.assert_array_equal(getattr(found, name), getattr(truth, name))


def json_file(path: Path, messages: list[tuple[str, int, Any]], metadata: dict[str, str] | None = None) -> Path:
    """A recording as another logger would write it."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        if metadata is not None:
            writer.add_metadata("straw.run", metadata)
        channels: dict[str, int] = {}
        for topic, time_ns, value in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", 0)
            writer.add_message(channels[topic], time_ns, json.dumps(value).encode(), time_ns)
        writer.finish()
    return path


def test_a_live_run_reads_back_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    meta = {**METADATA, "zero_time_ns": str(ZERO_NS)}
    before_ns = time.time_ns()
    with RunWriter(path, meta, {"protocol.toml": b"name = 'x'"}) as writer:
        writer.event("start", "go", ZERO_NS - 500_000_000)
        writer.add("/pressure/command", ZERO_NS, pressure_pa=-25e3, channel=1)
        for i in range(100):
            writer.add("/pressure/measured", ZERO_NS + i * 10_000_000, pressure_pa=-1.5 * i, sigma_pa=30.0, channel=1)
        assert not path.exists()
    assert not path.with_name("run.mcap.part").exists()
    run = read_run(path)
    assert run.lost == ()
    assert run.metadata == meta
    assert run.attachments == {"protocol.toml": b"name = 'x'"}
    assert (run.initial_deployed, run.cycle, run.cells, run.zero_time_ns) == ((1, 4), 3, 9, ZERO_NS)
    assert [(event.time_s, event.kind, event.text) for event in run.events] == [(-0.5, "start", "go")]
    assert run.pressure is not None
    np.testing.assert_allclose(run.pressure.time_s, np.arange(100) * 0.01, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(run.pressure.pressure_pa, -1.5 * np.arange(100))
    np.testing.assert_array_equal(run.pressure.sigma_pa, 30.0)
    assert run.command is not None
    assert run.command(10.0) == -25e3
    with path.open("rb") as stream:
        for _, _, message in make_reader(stream, validate_crcs=True).iter_messages():
            assert message.publish_time < before_ns + 60 * 10**9
            assert before_ns <= message.log_time <= time.time_ns()


def test_viewers_find_schemas_and_units_in_the_file(tmp_path: Path, trace: TipTrace) -> None:
    write_tip(tmp_path / "tip.mcap", trace, METADATA, "ab" * 32, ZERO_NS)
    with (tmp_path / "tip.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        schema, channel, message = next(reader.iter_messages())
        summary = reader.get_summary()
    assert summary is not None
    assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
    assert schema is not None
    assert (schema.encoding, schema.name, channel.message_encoding) == ("protobuf", "straw.TipState", "protobuf")
    assert channel.metadata["unit.x_m"] == "m"
    assert channel.metadata["unit.sigma_phi_rad"] == "rad"
    decoded = message_class(schema.name, schema.data).FromString(message.data)
    assert (decoded.z_m, decoded.valid, message.publish_time) == (0.08, True, ZERO_NS)


def test_a_tracked_tip_reads_back_with_its_parent(tmp_path: Path, trace: TipTrace) -> None:
    write_tip(tmp_path / "tip.mcap", trace, METADATA, "ab" * 32, ZERO_NS)
    run = read_run(tmp_path / "tip.mcap")
    assert run.lost == ()
    assert run.metadata == {**METADATA, "zero_time_ns": str(ZERO_NS), "parent_sha256": "ab" * 32}
    assert_same_tip(run.tip, trace)


def test_a_prediction_reads_back_under_its_models_name(tmp_path: Path, trace: TipTrace) -> None:
    times, pressures = np.arange(50) * 0.01, np.linspace(0, -25e3, 50)
    path = tmp_path / "sim.mcap"
    write_prediction(
        path, "base", METADATA, "cd" * 32, ZERO_NS, tip=trace, pressure_time_s=times, pressure_pa=pressures
    )
    run = read_run(path)
    assert run.lost == ()
    assert (run.tip, run.pressure) == (None, None)
    assert list(run.predictions) == ["base"]
    assert_same_tip(run.predictions["base"].tip, trace)
    inside = run.predictions["base"].pressure
    assert inside is not None
    np.testing.assert_allclose(inside.time_s, times, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(inside.pressure_pa, pressures)
    assert run.metadata["parent_sha256"] == "cd" * 32
    assert run.metadata["model"] == "base"


def test_a_derived_file_that_fails_leaves_no_file(tmp_path: Path, trace: TipTrace) -> None:
    with pytest.raises(RigError, match="not a time since 1970"):
        write_tip(tmp_path / "tip.mcap", trace, METADATA, "", 0)
    with pytest.raises(RigError, match="would be empty"):
        write_prediction(tmp_path / "tip.mcap", "base", METADATA, "", ZERO_NS)
    with pytest.raises(RigError, match="topic '/sim/a/b/tip/state' is not known"):
        write_prediction(tmp_path / "tip.mcap", "a/b", METADATA, "", ZERO_NS, tip=trace)
    assert list(tmp_path.iterdir()) == []


def test_a_value_of_the_wrong_type_raises_an_error_and_leaves_the_recording_intact(tmp_path: Path) -> None:
    with RunWriter(tmp_path / "run.mcap", METADATA) as writer:
        writer.add("/pressure/measured", ZERO_NS, pressure_pa=1.0)
        for topic, values in [("/pressure/measured", {"pressure_pa": "1"}), ("/tip/state", {"y_m": 1.0}), ("/x", {})]:
            with pytest.raises(RigError, match=topic):
                writer.add(topic, ZERO_NS, **values)
        writer.add("/pressure/measured", ZERO_NS + 1000, pressure_pa=2.0)
    run = read_run(tmp_path / "run.mcap")
    assert run.pressure is not None
    assert run.pressure.pressure_pa.tolist() == [1.0, 2.0]
    assert np.all(np.isnan(run.pressure.sigma_pa))


def test_recordings_of_another_logger_are_read_completely(recordings: Path) -> None:
    paths = sorted(recordings.glob("*/*.mcap"))
    assert len(paths) >= 32
    for path in paths[::5]:
        run = read_run(path)
        assert run.lost == ()
        assert run.run_id == path.stem
        assert run.specimen == path.parent.name
        assert run.initial_deployed is not None
        assert run.tip is not None
        assert run.pressure is not None
        assert run.command is not None
        assert run.tip.time_s[-1] > 3.0
        assert np.median(np.diff(run.tip.time_s)) == pytest.approx(1 / 239.76, abs=1e-4)
        assert np.nanmax(np.abs(run.tip.x_m)) < 0.2


def test_fields_may_be_absent_or_null(tmp_path: Path) -> None:
    path = json_file(
        tmp_path / "a.mcap",
        [
            ("/tip/state", ZERO_NS, {"x_m": 0.01, "z_m": 0.08, "phi_rad": 0}),
            (
                "/tip/state",
                ZERO_NS + 5_000_000,
                {"x_m": None, "z_m": None, "valid": False, "frame": 1.0},
            ),
            ("/tip/state", ZERO_NS + 9_000_000, {"x_m": 0.5, "z_m": 0.5, "phi_rad": 0.5, "valid": False}),
            ("/pressure/measured", ZERO_NS, {"pressure_pa": 5}),
            ("/pressure/measured", ZERO_NS + 1, {"pressure_pa": 7, "channel": 2}),
            ("/somebody/elses", ZERO_NS, [1, 2]),
        ],
        {**METADATA, "zero_time_ns": str(ZERO_NS)},
    )
    run = read_run(path)
    assert run.lost == ()
    assert run.tip is not None
    assert run.tip.valid.tolist() == [True, False, False]
    assert np.isnan(run.tip.x_m).tolist() == [False, True, True]
    assert np.all(np.isnan(run.tip.sigma_x_m))
    assert run.pressure is not None
    assert run.pressure.pressure_pa.tolist() == [5.0]


def test_missing_metadata_is_reported_and_not_silently_guessed(tmp_path: Path) -> None:
    messages = [("/pressure/measured", ZERO_NS + i, {"pressure_pa": i}) for i in (3000, 4000)]
    run = read_run(json_file(tmp_path / "a.mcap", messages))
    assert (run.run_id, run.initial_deployed, run.cycle, run.cells) == ("a", None, 0, 9)
    assert run.zero_time_ns == ZERO_NS + 3000
    for word in ("straw.run is missing", "initial_deployed", "zero_time_ns", "cycle", "cells"):
        assert any(word in line for line in run.lost), word


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("initial_deployed", "1,x"),
        ("initial_deployed", "12"),
        ("cycle", "often"),
        ("zero_time_ns", "-5"),
        ("cells", "?"),
    ],
)
def test_invalid_metadata_are_reported(tmp_path: Path, key: str, value: str) -> None:
    messages = [("/pressure/measured", ZERO_NS, {"pressure_pa": 1})]
    metadata = {**METADATA, "zero_time_ns": str(ZERO_NS), key: value}
    run = read_run(json_file(tmp_path / "a.mcap", messages, metadata))
    assert [line for line in run.lost if key in line] != []


def test_unsorted_and_repeated_samples_are_sorted_and_dropped_with_a_note(tmp_path: Path) -> None:
    order = [4, 0, 1, 1, 3, 2]
    messages = [("/tip/state", ZERO_NS + i * 10**6, {"x_m": i, "z_m": n, "phi_rad": 0.0}) for n, i in enumerate(order)]
    run = read_run(json_file(tmp_path / "a.mcap", messages, {**METADATA, "zero_time_ns": str(ZERO_NS)}))
    assert run.tip is not None
    assert run.tip.x_m.tolist() == [0, 1, 2, 3, 4]
    assert run.tip.z_m.tolist() == [1, 2, 5, 4, 0]
    assert run.lost == (
        "/tip/state was not in order of time and was sorted",
        "1 messages on /tip/state repeat a time and were left out",
    )


def test_messages_of_a_wrong_type_are_counted(tmp_path: Path) -> None:
    values: list[Any] = [{"pressure_pa": 1}, {"pressure_pa": "2"}, {}, [], None, 3, {"pressure_pa": 1, "channel": 1.5}]
    messages = [("/pressure/measured", ZERO_NS + i * 1000, value) for i, value in enumerate(values)]
    run = read_run(json_file(tmp_path / "a.mcap", messages, {**METADATA, "zero_time_ns": str(ZERO_NS)}))
    assert run.pressure is not None
    assert len(run.pressure) == 1
    assert run.lost == ("6 messages on /pressure/measured could not be decoded and were left out",)


def test_a_zero_far_from_the_data_is_reported_and_does_no_harm(tmp_path: Path) -> None:
    messages = [("/pressure/measured", ZERO_NS + i, {"pressure_pa": i}) for i in range(5)]
    run = read_run(json_file(tmp_path / "a.mcap", messages, {**METADATA, "zero_time_ns": "0"}))
    assert any("check the clocks" in line for line in run.lost)
    assert run.pressure is not None


def test_a_minute_of_data_reads_in_under_a_second(tmp_path: Path) -> None:
    n = 240 * 60
    time_s = np.arange(n) / 240
    pose = [np.sin(time_s), np.cos(time_s), time_s, *[np.full(n, 1e-5)] * 3]
    trace = TipTrace(time_s, *pose, valid=np.ones(n, bool), frame=np.arange(n))
    path = tmp_path / "long.mcap"
    pressure_time_s = np.arange(12_000) / 200
    write_prediction(
        path, "base", METADATA, "", ZERO_NS, tip=trace, pressure_time_s=pressure_time_s, pressure_pa=pressure_time_s
    )
    took_s = []
    for _ in range(3):
        start_s = time.perf_counter()
        run = read_run(path)
        took_s.append(time.perf_counter() - start_s)
    assert_same_tip(run.predictions["base"].tip, trace)
    assert min(took_s) < 1.0


def test_a_measured_pressure_is_interpolated_linearly_and_a_command_is_held() -> None:
    time_s, pressure_pa, sigma_pa = np.array([0.0, 1.0]), np.array([0.0, 100.0]), np.full(2, np.nan)
    at_s = np.array([-1.0, 0.5, 1.0, 2.0])
    np.testing.assert_array_equal(PressureLog(time_s, pressure_pa, sigma_pa)(at_s), [0, 50, 100, 100])
    np.testing.assert_array_equal(PressureLog(time_s, pressure_pa, sigma_pa, held=True)(at_s), [0, 0, 100, 100])


def test_reading_a_run_loads_no_serial_port_and_no_wire() -> None:
    heavy = ("serial", "mcap", "google", "cv2", "straw.rig.wire")
    code = f"import sys, straw.rig.run_read, straw.rig.protocol; print([m for m in {heavy} if m in sys.modules])"
    root = Path(__file__).parents[2]
    assert subprocess.check_output([sys.executable, "-c", code], cwd=root, text=True).strip() == "[]"


def test_nothing_can_be_added_to_a_finished_recording(tmp_path: Path) -> None:
    with RunWriter(tmp_path / "run.mcap", METADATA) as writer:
        writer.event("start", "", ZERO_NS)
    with pytest.raises(RigError, match="is finished"):
        writer.event("late", "", ZERO_NS)


def test_every_topic_describes_itself_in_protobuf() -> None:
    for schema in TOPICS.values():
        described = message_class(schema.name, descriptor_set(schema)).DESCRIPTOR
        assert described.full_name == schema.name
        assert [field.name for field in described.fields] == [name for name, *_ in schema.fields]
