"""straw solid: the straw as a body, for a printer (STL) or a mould (STEP)."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from straw.model.solid.outline import Flange, section, volume_m3
from straw.model.solid.step import step_text
from straw.model.solid.stl import stl_bytes, triangles
from straw.model.straw_file import load_straw
from straw.replay.errors import ReplayError
from straw.replay.output import write_text

KINDS = (".stl", ".step", ".stp")
#: Segments of a circle: fewer make no circle; with the most, the flange's chords are 6 nm off, below any printer's
#: resolution.
FEWEST, MOST = 8, 5000


def run(args: argparse.Namespace) -> int:
    """Write the body; its size and volume."""
    path: Path = args.output
    if path.suffix.lower() not in KINDS:
        raise ReplayError(f"{path}: expected a name that ends with .stl or .step")
    if not FEWEST <= args.around <= MOST:
        raise ReplayError(f"--around {args.around}: expected {FEWEST} to {MOST} segments of a circle")
    straw = load_straw(args.straw)
    flange = Flange()
    if args.flange_mm:
        try:
            radius, thickness = (float(x) * 1e-3 for x in args.flange_mm.split(","))
        except ValueError:
            raise ReplayError(f"--flange-mm {args.flange_mm}: expected radius,thickness, as 28.2,2") from None
        flange = replace(flange, radius_m=radius, thickness_m=thickness)
    corners = section(straw, flange, folded=args.folded)
    if path.suffix.lower() == ".stl":
        part = path.with_name(path.name + ".part")
        try:
            part.write_bytes(stl_bytes(triangles(corners, args.around)))
            part.replace(path)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise ReplayError(f"{path}: cannot be written: {error.strerror}; choose another place") from None
    else:
        write_text(path, step_text(corners))
    high, wide = 1e3 * corners[:, 1].max(), 2e3 * corners[:, 0].max()
    how = "folded, its unloaded shape" if args.folded else "deployed, as it is moulded: the even frusta mirrored"
    print(f"{path}: {how}; {high:.2f} mm high, {wide:.2f} mm wide, {volume_m3(corners) * 1e6:.3f} cm3 of wall")
    return 0
