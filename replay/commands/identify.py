"""straw identify: constants of a straw from measurements, one kind of measurement a subcommand."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

import numpy as np

from model.filling import channel_radius, read_filling_tests
from model.geometry import Readings, identify_geometry
from model.parameters import StrawParameters, load_straw
from replay.output import check_new, write_json, write_text
from replay.progress import prepare


def run(args: argparse.Namespace) -> int:
    """Hand over to the kind of measurement, then write the straw and the result."""
    known = load_straw(args.straw)
    if args.output:
        check_new(args.output)
    straw, result = {"filling": _filling, "geometry": _geometry}[args.kind](args, known)
    if args.output:
        write_text(args.output, straw.to_toml())
        print(f"the straw with what was found is in {args.output}")
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
