"""The quality report of a track: one page to judge it by."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Callable, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from straw.tracking.task import Track

_SHOWN = (
    ("x_m", "X / mm", 1e3, 1e6, "µm"),
    ("z_m", "Z / mm", 1e3, 1e6, "µm"),
    ("phi_rad", "Phi / deg", 57.2958, 1e3, "mrad"),
)
_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:1080px;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse;margin:1em 0}td,th{padding:.2em .9em .2em 0;text-align:left;vertical-align:top}
img{max-width:100%;display:block}h1{font-size:1.4em}h2{font-size:1.1em;margin-top:1.6em}.bad{color:#b00020}"""


def page(track: Track, videos: Sequence[str]) -> str:
    """The HTML text of the report on the track of a recording's files."""
    name = html.escape(", ".join(videos))
    rows = "".join(
        f"<tr><th>{html.escape(what)}</th><td>{html.escape(value)}</td></tr>" for what, value in _facts(track)
    )
    lost = "".join(
        f"<tr><td>{html.escape(reason)}</td><td>{count}</td></tr>" for reason, count in track.invalid.items()
    )
    hand = "".join(f"<tr><td>{html.escape(why)}</td><td>{count}</td></tr>" for why, count in track.by_hand.items())
    hand = f"<h2>Poses not from the board</h2><table>{hand}</table>" if hand else ""
    lost = f"<h2>Frames without a trustworthy board</h2><table>{lost}</table>" if lost else ""
    pictures = "".join(
        f"<h2>{title}</h2><p>{text}</p><img alt='{title}' src='data:image/png;base64,{_png(draw, track)}'>"
        for title, text, draw in (
            ("The track", "Grey stripes: frames that are not valid. Shaded: one sigma, where it can be seen.", _path),
            (
                "Its sigma",
                "Per frame: the corners' own residuals, the codec, and how well camera and row time are known.",
                _sigmas,
            ),
            ("Corners", "How many corners each frame uses, and their residual.", _corners),
            (
                "Residual of each corner",
                "The mean over all frames, by corner of the board, and where the board was in the picture. A pattern "
                "that is the same all over means a wrong lens.",
                _pattern,
            ),
        )
    )
    return (
        f"<!doctype html><html lang='en'><meta charset='utf-8'><title>Track of {name}</title><style>{_STYLE}</style>"
        f"<h1>Track of {name}</h1><p>{html.escape(_sentence(track))}</p><table>{rows}</table>{lost}{hand}"
        f"{pictures}</html>\n"
    )


def _sentence(track: Track) -> str:
    valid = track.trace.valid
    share = 100 * float(np.mean(valid))
    x, z, phi = (float(np.nanmedian(getattr(track.trace, f"sigma_{channel}"))) for channel, *_ in _SHOWN)
    return (
        f"{np.count_nonzero(valid)} of {len(valid)} frames are valid ({share:.1f} %). "
        f"Median sigma: X {x * 1e6:.1f} µm, Z {z * 1e6:.1f} µm, Phi {phi * 1e3:.2f} mrad."
    )


def _facts(track: Track) -> list[tuple[str, str]]:
    camera = track.camera
    about_x, about_z = (1e3 * turn for turn in camera.board_turn_rad)
    sigma_x, sigma_z = (1e3 * sigma for sigma in track.turn_sigma_rad)
    place = f"{track.rest_frames} still frames at the start" if track.rest_frames else "given"
    gaps = "; ".join(f"{gap.missing} after {gap.after_s:.3f} s" for gap in track.decode.gaps[:12])
    return [
        ("Frames", str(track.decode)),
        *([("Gaps", gaps)] if gaps else []),
        ("Camera", str(track.telemetry) or "the file does not say"),
        ("Lens", f"{camera.lens.name or 'unnamed'} ({camera.lens.kind}, {camera.lens.width}x{camera.lens.height})"),
        ("Placed by", place),
        (
            "Board rotated on its mount by",
            f"{about_x:.2f} ± {sigma_x:.2f} mrad about x, {about_z:.2f} ± {sigma_z:.2f} mrad about z",
        ),
        ("Rolling shutter", f"{1e6 * (camera.line_s or 0):.3f} ± {1e6 * track.line_sigma_s:.3f} µs from row to row"),
        ("Exposure", f"1/{1 / track.exposure_s:.0f} s" if track.exposure_s else "not known: too little motion"),
        ("Codec's lag", f"{track.lag_px:.4f} px behind the motion, by the jumps at keyframes; corrected"),
        ("Corner residual", f"{float(np.nanmedian(track.rms_px)):.4f} px, median of the frames' rms"),
    ]


def _png(draw: Callable[[Track], Figure], track: Track) -> str:
    figure = draw(track)
    for axes in figure.axes:
        axes.grid(alpha=0.3)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    plt.close(figure)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def _stripes(axes: Any, track: Track) -> None:
    """Shade stretches of frames that are not valid."""
    bad = np.concatenate(([False], ~track.trace.valid, [False]))
    edges = np.flatnonzero(np.diff(bad)).reshape(-1, 2)
    for start, stop in edges.tolist():
        last = min(stop, len(track.trace) - 1)
        axes.axvspan(track.trace.time_s[start], track.trace.time_s[last], color="0.85", zorder=0)


def _path(track: Track) -> Figure:
    figure, rows = plt.subplots(3, 1, figsize=(10, 7), sharex=True, layout="constrained")
    for axes, (channel, label, scale, *_) in zip(rows, _SHOWN, strict=True):
        value, sigma = getattr(track.trace, channel) * scale, getattr(track.trace, f"sigma_{channel}") * scale
        axes.plot(track.trace.time_s, value, lw=1, color="tab:blue")
        axes.fill_between(track.trace.time_s, value - sigma, value + sigma, alpha=0.3, color="tab:blue", lw=0)
        axes.set_ylabel(label)
        _stripes(axes, track)
    rows[-1].set_xlabel("time / s")
    return figure


def _sigmas(track: Track) -> Figure:
    figure, axes = plt.subplots(figsize=(10, 2.8), layout="constrained")
    for channel, label, _, scale, unit in _SHOWN:
        name = f"{label.split()[0]} / {unit}"
        axes.plot(track.trace.time_s, getattr(track.trace, f"sigma_{channel}") * scale, lw=1, label=name)
    axes.set_yscale("log")
    axes.set_xlabel("time / s")
    axes.set_ylabel("sigma")
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False)
    _stripes(axes, track)
    return figure


def _corners(track: Track) -> Figure:
    figure, (count, left) = plt.subplots(2, 1, figsize=(10, 3.6), sharex=True, layout="constrained")
    count.plot(track.trace.time_s, track.corners, lw=1, color="tab:green")
    count.set_ylabel("corners used")
    count.set_ylim(0, 1.1 * max(int(track.corners.max()), 1))
    left.plot(track.trace.time_s, track.rms_px, lw=1, color="tab:red")
    left.set_ylabel("residual / px")
    left.set_xlabel("time / s")
    left.set_ylim(0, None)
    for axes in (count, left):
        _stripes(axes, track)
    return figure


def _pattern(track: Track) -> Figure:
    figure, (board, picture) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    points = track.board.corner_points_m() * 1e3
    miss = track.residual_px
    arrows = board.quiver(
        points[:, 1], points[:, 0], miss[:, 0], -miss[:, 1], angles="uv", scale_units="width", width=4e-3
    )
    largest = max(float(np.abs(miss).max()), 1e-3)
    board.quiverkey(arrows, 0.8, 1.04, largest, f"{largest:.3f} px", labelpos="E")
    board.set(aspect="equal", xlabel="board y / mm", ylabel="board x / mm", title="mean miss")
    board.invert_yaxis()
    width, height = track.camera.lens.width, track.camera.lens.height
    if track.record is not None:
        step = max(len(track.trace) // 400, 1)
        for _, rows in track.record.chunks():
            seen = rows[::step][rows[::step]["seen"]]
            picture.plot(*seen["grid"].mean(axis=(1, 2)).T, ".", ms=3, color="tab:blue")
    picture.set(
        xlim=(0, width), ylim=(height, 0), aspect="equal", xlabel="u / px", ylabel="v / px", title="board's middle"
    )
    return figure
