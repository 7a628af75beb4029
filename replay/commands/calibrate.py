"""straw calibrate: a lens from videos or stills of a checkerboard."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np

from straw.replay.errors import ReplayError
from straw.replay.output import write_json
from straw.replay.progress import progress_bar, say
from straw.tracking.calibrate import Calibration, calibrate
from straw.tracking.camera import Camera, save_camera


def run(args: argparse.Namespace) -> int:
    """Calibrate; print the lens model, its quality, and advice."""
    for path in filter(None, (args.output, args.picture)):
        if not path.parent.is_dir():
            raise ReplayError(f"{path}: there is no folder {path.parent}; make it or choose another place")
    with progress_bar("calibrate", "picture") as progress:
        found = calibrate(args.pictures, progress, squares_of(args.board) if args.board else None)
    lens = dataclasses.replace(found.fit.lens, name=args.name or args.output.stem)
    save_camera(args.output, Camera(lens))
    if args.picture:
        draw(found, args.picture)
    if args.json:
        write_json(args.json, as_data(found))
    for line in found.advice:
        say(f"advice: {line}")
    print(summary(found) + f"; written to {args.output}")
    return 0


def squares_of(text: str) -> tuple[int, int]:
    """The squares along both sides, of ``CxR``; ReplayError for anything else."""
    across, _, down = text.lower().partition("x")
    if not (across.isdecimal() and down.isdecimal() and min(int(across), int(down)) >= 5):
        raise ReplayError(f"--board {text}: expected squares along both sides, at least 5, as 10x7 (9x6 inner corners)")
    return int(across), int(down)


def summary(found: Calibration) -> str:
    """One sentence on the lens that was found."""
    lens, middle = found.fit.lens, found.uncertainty_px[4:-4, 8:-8]
    crossed = ", ".join(f"{kind} {error:.3f}" for kind, error in found.crossed_px.items())
    return (
        f"{lens.kind}, f {lens.fx:.1f} px, centre ({lens.cx:.1f}, {lens.cy:.1f}), residual {found.fit.rms_px:.3f} px; "
        f"{len(found.views)} views of {found.looked_at} pictures; on views left out: {crossed} px; uncertain by "
        f"{float(np.nanmedian(middle)):.3f} px in the middle, {float(np.nanmax(found.uncertainty_px)):.2f} px at worst"
    )


def as_data(found: Calibration) -> dict[str, object]:
    """The calibration's figures for machines."""
    return {
        "lens": found.fit.lens.to_json(),
        "views": len(found.views),
        "pictures": found.looked_at,
        "rms_px": found.fit.rms_px,
        "cross_validation_px": found.crossed_px,
        "uncertainty_px": found.uncertainty_px.tolist(),
        "advice": list(found.advice),
    }


def draw(found: Calibration, path: Path) -> None:
    """Draw one sigma of the projection over the picture, and where corners were seen."""
    import matplotlib as mpl  # slow to import

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    lens = found.fit.lens
    figure, axes = plt.subplots(figsize=(10, 10 * lens.height / lens.width + 0.8), layout="constrained")
    shown = np.clip(found.uncertainty_px, 1e-3, 30)
    every = np.array((0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 30))
    first, last = np.searchsorted(every, (np.nanmin(shown), np.nanmax(shown)))
    levels = every[max(first - 1, 0) : last + 1]
    u, v = found.grid_px[..., 0], found.grid_px[..., 1]
    norm = mpl.colors.BoundaryNorm(levels, 256)
    drawn = axes.contourf(u, v, shown, levels=levels, norm=norm, cmap="viridis_r")
    axes.plot(*np.concatenate([view.pixels for view in found.views]).T, ".", ms=2, color="k", alpha=0.4)
    axes.set(xlim=(0, lens.width), ylim=(lens.height, 0), aspect="equal", xlabel="u / px", ylabel="v / px")
    axes.set_title(f"Where a ray lands, one sigma ({lens.kind}, {len(found.views)} views; dots: corners seen)")
    figure.colorbar(drawn, ax=axes, label="px", ticks=levels, format="%g")
    part = path.with_name(path.name + ".part")
    try:
        figure.savefig(part, dpi=110, format=path.suffix.lstrip(".") or "png")
        part.replace(path)
    except (OSError, ValueError) as error:
        part.unlink(missing_ok=True)
        raise ReplayError(f"{path}: cannot be written: {error}; name a .png, .svg or .pdf") from None
    finally:
        plt.close(figure)
