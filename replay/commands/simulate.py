"""straw simulate: what the model says a protocol does, as a recording of its own."""

from __future__ import annotations

import argparse
import math

from straw.model.straw_file import load_straw
from straw.model.stretches import LongPrediction
from straw.replay.errors import ReplayError
from straw.replay.output import check_new, write_json
from straw.replay.progress import prepare, progress_bar
from straw.replay.protocol.prediction import predict_protocol, write_predicted
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import load_protocol


def run(args: argparse.Namespace) -> int:
    """Simulate the protocol through the controller's nominal response and write the prediction."""
    straw, protocol = load_straw(args.straw), load_protocol(args.protocol)
    check_new(args.output)
    window_s = window_of(args, protocol)
    prepare()
    with progress_bar(f"predict {protocol.name}", "s") as progress:
        p, rate_hz = predict_protocol(
            straw, protocol, window_s, lambda done_s, whole_s: progress(round(done_s), round(whole_s))
        )
    write_predicted(args.output, straw, protocol, p)
    if args.json:
        end = {name: float(getattr(p, name)[-1]) for name in ("x_m", "z_m", "phi_rad", "volume_m3")}
        write_json(
            args.json, {"protocol": protocol.name, "end": end, "straw": straw.to_toml(), "samples": len(p.time_s)}
        )
    if isinstance(p, LongPrediction):
        print(
            f"{len(p.time_s)} samples, {rate_hz:.3g} per second where it moves; {p.skipped_s:.0f} s of rest skipped; "
            "--from and --to predict a stretch at full rate"
        )
    print(
        f"{protocol.name}: after {p.time_s[-1]:g} s the tip is at X {p.x_m[-1] * 1e3:.2f} mm, "
        f"Z {p.z_m[-1] * 1e3:.2f} mm, Phi {math.degrees(p.phi_rad[-1]):.2f} deg; written to {args.output}"
    )
    return 0


def window_of(args: argparse.Namespace, protocol: PressureProtocol) -> tuple[float, float]:
    """The stretch that is wanted, seconds since the protocol's start; all of it where nothing is said."""
    start_s, end_s = (
        otherwise if given is None else given + protocol.zero_s
        for given, otherwise in ((args.start, -math.inf), (args.end, math.inf))
    )
    if not (start_s < end_s and start_s < protocol.duration_s and end_s > 0.0):
        raise ReplayError(
            f"--from {args.start} --to {args.end}: expected a stretch of {-protocol.zero_s:g} to "
            f"{protocol.duration_s - protocol.zero_s:g} s, the first before the second"
        )
    return start_s, end_s
