"""The paper's open question: why one set of constants did not fit its runs, and with which physics one set fits all.

    python -m tests.benchmarks.paper_puzzle --out PICTURE.png --json NUMBERS.json

A folding run and four repetitions of a deployment, made by the independent apparatus with squeeze film, fluid inertia,
cohesion that weakens and a weaker fourth cell, are fitted by the base model and by one that has these four laws.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from straw.model.parameters import StrawParameters
from straw.replay.compare.comparison import CHANNELS
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.observation import REPEATABILITY_S, observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.output import write_json

from .puzzle_fits import (
    DELAY,
    WISHED,
    Number,
    base_for_all,
    by_itself,
    improved_for_all,
    near_own,
    numbers,
    one_delay,
)
from .puzzle_picture import draw
from .puzzle_runs import HELD_OUT, recordings

#: The constants that a user would give: the specimen's statics, and damping and channel as a first guess.
GIVEN = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
SHOWN = (*(f"straw.{name}" for name in WISHED), DELAY)
FACTORS = (1.0, 1e3, 1e3, 1e3)
TITLES = ("c_zeta / N s/m", "c_phi / mN m s", "r_ch / mm", "delay / ms")


def main() -> None:
    """Make the runs, fit them, print the tables, draw."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--seed", type=int, default=7)
    place = Path(tempfile.gettempdir()) / "puzzle.png"  # not in the checkout
    ask.add_argument("--out", type=Path, default=place, help="the picture: .png, .svg or .pdf (default: %(default)s)")
    ask.add_argument("--json", type=Path)
    args = ask.parse_args()
    begun_s, used_s = time.monotonic(), time.process_time()
    everything = [observe(run) for run in recordings(args.seed)]
    fitted = [o.name for o in everything if o.name not in HELD_OUT]
    with ThreadPoolExecutor(2) as pool:
        every = Campaign(everything, StrawSystem(GIVEN), pool)
        train, held = every.only(fitted), every.only(HELD_OUT)
        base = base_for_all(train)
        by_base = _each(fitted, train, GIVEN, by_itself)
        _wishes("base model, each run by itself", by_base)
        _one_set("base model, one set, no delay", base)
        _delay("base", train, base)
        improved = improved_for_all(train)
        _one_set("improved model, one set, no delay", improved)
        _delay("improved", train, improved)
        straws = tuple(applied(GIVEN, fit.unknowns, fit.u)[0] for fit in (base, improved))
        by_improved = _each(fitted, train, straws[1], near_own)
        common = numbers(base), numbers(improved)
        _wishes("improved model, each run's three constants and a delay freed again", by_improved, common[1])
        late = [_first_late(every, straw) for straw in straws]
        rms = [_rms(held, straw) for straw in straws]
    print("\nfirst snap of the model after (+) or before the measured one, ms, one set: base; improved")
    for name in [name for name in late[0] if np.isfinite([way[name] for way in late]).any()]:
        print(f"  {name:<18}" + "".join(f"{way[name] * 1e3:8.1f}".replace("nan", "  -") for way in late))
    noise = {
        c: float(np.sqrt(np.mean(np.concatenate([o.sigma(REPEATABILITY_S)[i] ** 2 for o in held.observations]))))
        for i, c in enumerate(CHANNELS)
    }
    print(f"\nruns held out ({', '.join(HELD_OUT)}), RMS: base; improved; noise (camera, repeats within 1 ms)")
    for c, unit in zip(CHANNELS, ("mm", "mm", "mrad"), strict=True):
        print(f"  {c:<8}{rms[0][c] * 1e3:8.3f}{rms[1][c] * 1e3:8.3f}{noise[c] * 1e3:8.3f} {unit}")
    alone = {name: (numbers(by_base[name]), numbers(by_improved[name])) for name in fitted}
    draw(args.out, everything, fitted, straws, alone, common)
    wall_s, cpu_s = time.monotonic() - begun_s, time.process_time() - used_s
    print(f"\n{args.out}; {wall_s:.0f} s, {cpu_s:.0f} s of CPU; {every.tally['failed']} simulations failed")
    if args.json:
        told = {
            "alone": {n: [_plain(one) for one in alone[n]] for n in fitted},
            "alone_chi2": {n: [_chi2(by_base[n]), _chi2(by_improved[n])] for n in fitted},
            "one_set": {k: _plain(one) for k, one in zip(("base", "improved"), common, strict=True)},
            "one_set_chi2": [_chi2(base), _chi2(improved)],
            "first_snap_late_s": dict(zip(("base", "improved"), late, strict=True)),
            "heldout_rms": {"base": rms[0], "improved": rms[1], "noise": noise},
        }
        write_json(args.json, told)


def _delay(name: str, campaign: Campaign, fit: Fit) -> None:
    """Print the common delay of all runs."""
    late, gain = one_delay(campaign, fit)
    told = f"{late.value * 1e3:.2f} ± {late.sigma * 1e3:.2f} ms"
    worth = f"to first order the misfit would be less by {gain:.0f} of {fit.cost:.0f}"
    print(f"  {name} model, a delay that all runs would share: {told}; {worth}", flush=True)


def _each(
    names: Sequence[str], runs: Campaign, straw: StrawParameters, fit: Callable[[Campaign], Fit]
) -> dict[str, Fit]:
    """Every run fitted by itself with a straw."""
    return {name: fit(Campaign(runs.only([name]).observations, StrawSystem(straw), runs.pool)) for name in names}


def _rms(campaign: Campaign, straw: StrawParameters) -> dict[str, float]:
    """RMS of the residual by channel (m, m, rad); NaN where a run cannot be simulated."""
    rows = Campaign(campaign.observations, StrawSystem(straw), campaign.pool).misfits((), [np.empty(0)])[0]
    plain = [np.full((3, 1), np.nan) if one is None else one.plain for one in rows]
    return {c: float(np.sqrt(np.mean(np.concatenate([p[i] for p in plain]) ** 2))) for i, c in enumerate(CHANNELS)}


def _first_late(campaign: Campaign, straw: StrawParameters) -> dict[str, float]:
    """Lateness (s) of the model's first snap against the measured one, by run; NaN where Phi of either lacks it."""
    rows = Campaign(campaign.observations, StrawSystem(straw), campaign.pool).misfits((), [np.empty(0)])[0]
    return {
        o.name: float(one.late_s[0]) if one is not None and len(one.late_s) else float("nan")
        for o, one in zip(campaign.observations, rows, strict=True)
    }


def _wishes(title: str, fits: Mapping[str, Fit], common: Mapping[str, Number] | None = None) -> None:
    """Print the constants of each run's own fit; with a common set, how many sigmas from it, or from no delay."""
    print(f"\n{title}: value ± sigma" + (" (sigmas from the one set)" if common else ""))
    print(f"  {'':<18}" + "".join(f"{t:>24}" for t in TITLES) + "    chi2")
    for name, fit in fits.items():
        found, cells = numbers(fit), []
        for target, factor in zip(SHOWN, FACTORS, strict=True):
            n = found[target]
            away = f" ({n.away(common.get(target, Number(0.0, 0.0))):.1f})" if common else ""
            cells.append(f"{n.value * factor:.4g} ± {n.sigma * factor:.2g}{away}")
        print(f"  {name:<18}" + "".join(f"{c:>24}" for c in cells) + f"{_chi2(fit):8.2f}", flush=True)


def _one_set(title: str, fit: Fit) -> None:
    print(f"\n{title}: chi2 {_chi2(fit):.2f}")
    for target, n in numbers(fit).items():
        print(f"  {target.partition('.')[2]:<40}{n.value:12.4g} ± {n.sigma:.2g}", flush=True)


def _chi2(fit: Fit) -> float:
    return float(np.mean(fit.residual**2))


def _plain(found: Mapping[str, Number]) -> dict[str, dict[str, float]]:
    return {target: {"value": n.value, "sigma": n.sigma} for target, n in found.items()}


if __name__ == "__main__":
    main()
