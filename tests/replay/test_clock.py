"""The camera's clock, planted and found again: by an LED burst that a painted video shows, and by the motion."""

import json
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.model.simulate import Stepper
from straw.replay.cli import main
from straw.rig.camera_clock import CameraClock, bursts_of, fit_led, load_clock
from straw.rig.clock import SteppedClock
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.errors import RigError
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.run_derived import write_tip
from straw.rig.run_read import read_run
from straw.rig.session import run_protocol
from straw.tracking.encode import VideoWriter
from straw.tracking.errors import TrackingError
from straw.tracking.lamp import blocks_of, find_blinks
from straw.tracking.trace import TipTrace
from straw.tracking.video import Frame

FPS = Fraction(240_000, 1001)
A_S, B = 1.8342, 1.0 + 180e-6  # planted: the video started earlier than the run, and its clock is fast
PROTOCOL = """
pressure_unit = "kPa"
initial_deployed = [1, 4]
prefix = [{ hold = 0, for_s = 0.3 }]
main = [{ hold = -20, for_s = 1.5 }]
"""


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[float], Emulation]:
    """A run with LED bursts; true times (s since the run's zero) at which the emulator's output changed; its twin."""
    path = tmp_path_factory.mktemp("clock") / "run.mcap"
    clock = SteppedClock()
    with (
        Emulation(Stepper(StrawParameters(), (1, 4)), clock=clock, latency_s=2e-3) as emulation,
        make_controller("ob1-mk4", emulation.url, clock=clock) as controller,
    ):
        run_protocol(controller, protocol_from_toml(PROTOCOL, "p.toml"), path, led=True)
    behind_s = (read_run(path).zero_time_ns - emulation.twin.zero_wall_ns) * 1e-9
    changes = [at_s - behind_s for at_s, line in emulation.wire.received if line.startswith(b"<TRIGO!")]
    return path, changes, emulation


def paint(changes_s: list[float], seed: int = 0, glowing: float = 90.0) -> Iterator[Frame]:
    """What a camera sees: an LED of a few pixels among moving, flickering and noisy things, exposed for 1/500 s."""
    random = np.random.default_rng(seed)
    last_s = A_S + B * (changes_s[-1] + 0.4)
    yy, xx = np.ogrid[0:216, 0:384]
    glow = glowing * np.exp(-((yy - 61) ** 2 + (xx - 250) ** 2) / (2 * 4.0**2))
    for k in range(int(last_s * FPS)):
        time_s = float(k / FPS)
        fine_s = (time_s + np.linspace(0, 1 / 500, 20, endpoint=False) + 1 / 40000 - A_S) / B
        lit = np.mean(np.searchsorted(changes_s, fine_s, side="right") % 2)
        scene = 80 + 40 * np.sin(xx / 9 + 3 * time_s) + 30 * (np.sin(2 * np.pi * 6.3 * time_s) > 0) * (yy > 150)
        noisy = scene + glow * lit + 3 * random.standard_normal(scene.shape, np.float32)
        yield Frame(k, time_s, np.clip(noisy, 0, 255).astype(np.uint8))


def test_an_led_burst_gives_offset_and_drift_with_their_uncertainty(
    filmed: tuple[Path, list[float], Emulation],
) -> None:
    path, changes_s, _ = filmed
    run = read_run(path)
    bursts = bursts_of(run)
    assert [len(times) for times, _ in bursts] == [8, 8]
    host_s = np.concatenate([times for times, _ in bursts])
    half_s = np.concatenate([half for _, half in bursts])
    assert np.all(np.abs(host_s - np.array(changes_s)) <= half_s)  # the stamps are as accurate as they state
    blinks = find_blinks(blocks_of(paint(changes_s)), [times for times, _ in bursts])
    assert abs(blinks.row_px - 61) <= 24
    assert abs(blinks.column_px - 250) <= 24
    clock = fit_led(run, blinks)
    assert clock.edges == 16
    middle_s = 1.0
    error_s = (clock.a_s + clock.b * middle_s) - (A_S + B * middle_s)
    # Up to half a frame of systematic error: which moment of a frame its time stamp denotes is not documented.
    assert abs(error_s) < 0.5 / float(FPS) + 3 * clock.sigma_a_s
    assert abs(clock.b - B) < 4 * clock.sigma_b
    assert clock.residual_s < 1.0 / float(FPS)
    assert clock.host_s(np.array([clock.a_s]))[0] == 0.0


def test_without_the_led_in_view_there_is_an_error_and_no_clock(filmed: tuple[Path, list[float], Emulation]) -> None:
    path, changes_s, _ = filmed
    with pytest.raises(TrackingError, match="no light in the picture follows the burst"):
        find_blinks(blocks_of(paint(changes_s, glowing=0.0)), [times for times, _ in bursts_of(read_run(path))])


def test_the_command_finds_the_led_in_a_video_file(
    filmed: tuple[Path, list[float], Emulation], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, changes_s, _ = filmed
    with VideoWriter(tmp_path / "v.mp4", 384, 216, FPS, bitrate=8e6) as video:
        for frame in paint(changes_s, seed=1):
            video.write(frame.luma)
    out = tmp_path / "clock.json"
    assert main(["clock", str(tmp_path / "v.mp4"), "--run", str(path), "-o", str(out)]) == 0
    assert "from the led" in capsys.readouterr().out
    clock = load_clock(out)
    assert abs((clock.a_s + clock.b) - (A_S + B)) < 0.5 / float(FPS) + 3 * clock.sigma_a_s
    out.write_text('{"a_s": 1}')
    with pytest.raises(RigError, match="is damaged"):
        load_clock(out)


def test_without_an_led_the_motion_gives_the_offset_and_says_so(
    filmed: tuple[Path, list[float], Emulation], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, _, emulation = filmed
    run, truth = read_run(path), emulation.twin.history
    behind_s = (run.zero_time_ns - truth.zero_wall_ns) * 1e-9
    time_s = np.arange(truth.time_s[0] - behind_s + 0.3, truth.time_s[-1] - behind_s - 0.1, 1 / 239.76)
    random = np.random.default_rng(3)
    pose = [np.interp(time_s + behind_s, truth.time_s, axis) for axis in (truth.x_m, truth.z_m, truth.phi_rad)]
    noisy = [axis + random.normal(0, sigma, len(axis)) for axis, sigma in zip(pose, (2e-5, 2e-5, 3e-4), strict=True)]
    unknown, n = np.full(len(time_s), np.nan), len(time_s)
    planted_s = 2.7183
    trace = TipTrace(time_s + planted_s, *noisy, unknown, unknown, unknown, valid=np.ones(n, bool), frame=np.arange(n))
    write_tip(tmp_path / "t.mcap", trace, run.metadata, run.sha256, run.zero_time_ns)
    found, moved = tmp_path / "c.json", tmp_path / "m.mcap"
    command = ["clock", str(tmp_path / "t.mcap"), "--run", str(path), "--json", str(found), "--retimed", str(moved)]
    assert main(command) == 0
    said = capsys.readouterr()
    assert "from the motion" in said.out
    assert "no LED" in said.err
    data = json.loads(found.read_text())
    assert data["source"] == "motion"
    assert abs(data["a_s"] - planted_s) < 3e-3  # readings of the pressure every 10 ms limit it to about a millisecond
    tip = read_run(moved).tip
    assert tip is not None
    np.testing.assert_allclose(tip.time_s, time_s, atol=3e-3)
    assert "from the motion" in read_run(moved).metadata["clock"]


def test_a_run_without_bursts_is_an_error_with_its_cure(
    tmp_path: Path, filmed: tuple[Path, list[float], Emulation]
) -> None:
    clock = CameraClock(0.1, 1.0, 1e-3, 0.0, 2e-3, 8, "led")
    assert "+- 1.00 ms; residual 2.00 ms over 8 events" in str(clock)
    run = read_run(filmed[0])
    with pytest.raises(RigError, match="recorded no LED burst; record with --led"):
        bursts_of(type(run)(**{**vars(run), "events": ()}))
