"""straw identify: constants of a straw from measurements, one kind of measurement a subcommand."""

from __future__ import annotations

import argparse
import itertools
from dataclasses import asdict
from typing import Any

import numpy as np

from straw.model.filling import channel_radius, read_filling_tests
from straw.model.geometry import Readings, identify_geometry
from straw.model.parameters import StrawParameters
from straw.model.straw_file import load_straw
from straw.replay.output import check_new, write_json, write_text
from straw.replay.progress import prepare, progress_bar
from straw.replay.workers import threads

#: Where the search of damping and channel radius starts: all combinations; the paper's span 0.1 to 620, 0.7 to 3e-3,
#: 0.315 to 0.43 mm.
C_ZETA_STARTS, C_PHI_STARTS, R_CH_STARTS = (1.0, 10.0, 100.0, 600.0), (1e-3, 3e-3), (0.33e-3, 0.42e-3, 0.52e-3)
#: Reduced chi-square above which the command reports that the straw does not explain the runs.
POOR_CHI2 = 2.0


def run(args: argparse.Namespace) -> int:
    """Call the kind of measurement, then write the straw and the result."""
    known = load_straw(args.straw)
    if args.output:
        check_new(args.output)
    straw, result = {"filling": _filling, "geometry": _geometry, "runs": _runs}[args.kind](args, known)
    if args.output:
        write_text(args.output, straw.to_toml())
        print(f"the straw with these constants is in {args.output}")
    if args.json:
        write_json(args.json, {**result, "straw": straw.to_toml()})
    return 0


def _filling(args: argparse.Namespace, known: StrawParameters) -> tuple[StrawParameters, dict[str, Any]]:
    tests = read_filling_tests(args.table)
    found = channel_radius(tests, known.rho_kg_per_m3)
    print(
        f"r_ch = {found.r_ch_m * 1e3:.4f} mm, 95 % interval {found.low_m * 1e3:.4f} to {found.high_m * 1e3:.4f} mm; "
        f"{found.tests} tests scatter by {100 * found.scatter:.1f} % about Bernoulli's law"
    )
    if np.isfinite(found.exponent):
        off = abs(found.exponent - 0.5) / found.exponent_sigma if found.exponent_sigma > 0 else 0.0
        print(
            f"the flow grows as the pressure difference to the power {found.exponent:.3f} ± {found.exponent_sigma:.3f} "
            f"(Bernoulli 0.5, Poiseuille 1)" + ("" if off < 3 else f": {off:.0f} sigma from Bernoulli's law")
        )
    return known.replace(r_ch_m=found.r_ch_m), asdict(found)


def _geometry(args: argparse.Namespace, known: StrawParameters) -> tuple[StrawParameters, dict[str, Any]]:
    readings = Readings(
        folded_length_m=args.folded_length_mm * 1e-3,
        deployed_length_m=args.deployed_length_mm * 1e-3,
        fold_pressure_pa=args.fold_pressure_kpa * 1e3,
        deploy_pressure_pa=args.deploy_pressure_kpa * 1e3,
        length_resolution_m=args.length_resolution_mm * 1e-3,
        pressure_resolution_pa=args.pressure_step_kpa * 1e3,
    )
    prepare()
    found = identify_geometry(readings, known, held=not args.whole_straw)
    for name, value, sigma, unit, digits in (
        ("zeta_01", found.zeta01_m * 1e3, found.zeta01_sigma_m * 1e3, "mm", 4),
        ("zeta_02", found.zeta02_m * 1e3, found.zeta02_sigma_m * 1e3, "mm", 4),
        ("h", found.h_m * 1e3, found.h_sigma_m * 1e3, "mm", 4),
        ("E", found.E_pa / 1e9, found.E_sigma_pa / 1e9, "GPa", 4),
    ):
        print(f"{name:<8}{value:>9.{digits}f} ± {sigma:.{digits}f} {unit}")
    result = {name: value for name, value in vars(found).items() if name != "straw"}
    return found.straw, {**result, "readings": asdict(readings), "whole_straw": args.whole_straw}


def _runs(args: argparse.Namespace, known: StrawParameters) -> tuple[StrawParameters, dict[str, Any]]:
    from straw.replay.compare.gather import gather
    from straw.replay.identify.fit import fit

    runs = gather(args.runs)
    prepare()
    names = ("c_zeta_n_s_per_m", "c_phi_n_m_s_per_rad", "r_ch_m")
    ranges = (C_ZETA_STARTS, C_PHI_STARTS, R_CH_STARTS)
    starts = [np.array(start) for start in itertools.product(*ranges)]
    groups = [[run] for run in runs] if args.each and len(runs) > 1 else []
    print(f"{'runs':<20} {'c_zeta / N s/m':>24} {'c_phi / mN m s/rad':>24} {'r_ch / mm':>26} {'chi2':>8}")
    found = []
    for group in [*groups, runs]:
        label = f"all {len(runs)} jointly" if len(group) > 1 else group[0].run_id
        with threads(args.jobs, args.dask) as pool, progress_bar(label, "stage") as update:
            found.append(fit(group, known, names, starts=starts, executor=pool, progress=update))
        low, high = found[-1].interval.T
        cells = (
            f"{v * scale:.{digits}f} ({a * scale:.{digits}f} to {b * scale:.{digits}f})"
            for v, a, b, scale, digits in zip(found[-1].value, low, high, (1, 1e3, 1e3), (2, 3, 4), strict=True)
        )
        print(f"{label:<20} " + "{:>24} {:>24} {:>26}".format(*cells) + f" {found[-1].reduced_chi2:>8.2f}")
    joint = found[-1]
    if joint.reduced_chi2 > POOR_CHI2:
        print(
            "the straw does not explain these runs to their noise; the intervals do not account for what it leaves out"
        )
    if joint.failures:
        print(f"{joint.failures} simulations failed and were counted as bad fits")
    fits = [
        {
            "runs": f.runs,
            "constants": {
                n: {"value": v, "low": a, "high": b}
                for n, v, (a, b) in zip(f.names, f.value.tolist(), f.interval.tolist(), strict=True)
            },
            "reduced_chi2": f.reduced_chi2,
            "rms": f.rms,
            "failures": f.failures,
        }
        for f in found
    ]
    return joint.straw, {"joint": fits[-1], "each": fits[:-1]}
