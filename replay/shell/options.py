"""Options of `straw shell`, `straw design` and `straw solid`."""

from __future__ import annotations

import argparse
from pathlib import Path

from straw.replay.options import workers_options


def shell_options(p: argparse.ArgumentParser) -> None:
    """What `straw shell` takes beside --straw and --json."""
    p.add_argument("--cell", type=int, default=1, metavar="N", help="which cell (1)")
    p.add_argument(
        "--whole", action="store_true", help="the whole cell with both frusta compliant, instead of its even frustum"
    )
    p.add_argument(
        "--profile", type=Path, metavar="P.csv", help="a measured wall: r_m,z_m,thickness_m; an empty line is a crease"
    )
    p.add_argument(
        "--crease", type=float, default=0.0, metavar="N", help="stiffness of the creases, N m per rad and m (0)"
    )
    p.add_argument("--nu", type=float, default=0.33, help="Poisson's ratio (0.33, as the paper)")
    p.add_argument(
        "--phi",
        default="material",
        metavar="READING",
        help="meaning of phi: material (default), a point of the base keeps its height; or plane",
    )
    p.add_argument(
        "--rims",
        default="tied",
        metavar="HOW",
        help="rims of a cell: tied (default), free, or a stiffness in N/m per m of rim",
    )
    p.add_argument(
        "--bases",
        default="free",
        metavar="HOW",
        help="bases: radially free (default), held, or a stiffness in N/m per m of rim",
    )
    p.add_argument("--pressure-kpa", type=float, default=0.0, metavar="P", help="pressure inside, end sealed (0)")
    p.add_argument(
        "--tolerance",
        type=float,
        default=1e-3,
        metavar="SHARE",
        help="relative error of energy, force and moment at which the mesh is fine enough (1e-3)",
    )
    p.add_argument("--points", type=int, default=900, metavar="N", help="points of the energy landscape (900)")
    p.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="solve the energy landscape over (zeta, phi), and store and draw it here",
    )
    p.add_argument(
        "--elasticity", type=Path, metavar="E.json", help="fit the landscape, for elasticity = ... in a straw file"
    )
    jobs_options(p)


def jobs_options(p: argparse.ArgumentParser) -> None:
    """Where many jobs run."""
    workers_options(p, "processes")


def design_options(p: argparse.ArgumentParser) -> None:
    """What `straw design` takes beside --straw and --json."""
    p.add_argument("wish", type=Path, metavar="WISH.toml", help="[wanted] and [vary], or [order]; see the guide")
    p.add_argument(
        "--out", type=Path, default=Path("design"), metavar="DIR", help="folder for straw files, table and map (design)"
    )
    p.add_argument("--count", type=int, default=2048, metavar="N", help="designs tried (2048)")
    p.add_argument("--keep", type=int, default=5, metavar="N", help="designs shown (5)")
    p.add_argument(
        "--check",
        type=int,
        default=2,
        metavar="N",
        help="designs checked by finite elements (2); of an order every cell, unless 0",
    )
    jobs_options(p)


def solid_options(p: argparse.ArgumentParser) -> None:
    """What `straw solid` takes beside --straw."""
    p.add_argument(
        "-o", "--output", type=Path, required=True, metavar="S.stl|S.step", help="triangles or exact surfaces, mm"
    )
    p.add_argument(
        "--folded",
        action="store_true",
        help="the folded, unloaded shape instead of the deployed one",
    )
    p.add_argument("--flange-mm", metavar="R,T", help="radius and thickness of the board's flange (28.2,2)")
    p.add_argument("--around", type=int, default=180, metavar="N", help="segments of a circle in STL (180)")
