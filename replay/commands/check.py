"""straw check: the contract test of a user's own part; a defect is one line."""

from __future__ import annotations

import argparse
import inspect
import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np

from straw.model.errors import ModelError
from straw.model.plugged import add_laws, module_of
from straw.replay.errors import ReplayError
from straw.replay.output import write_json
from straw.replay.progress import say


def run(args: argparse.Namespace) -> int:
    """Check the part by its kind; 0 when it can be used, 2 with one line when not."""
    module = module_of(args.part.resolve(), "part")
    kinds = [name for name in PARTS if hasattr(module, name)]
    if not kinds:
        raise ReplayError(
            f"{args.part}: defines none of {', '.join(PARTS)}; end it, for example, with LAW = straw.Law(...)"
        )
    said = PARTS[kinds[0]](args.part, module, args)
    if args.json:
        write_json(args.json, {"part": str(args.part), "gives": kinds[0], "good": True, "says": said})
    print("\n".join(said))
    return 0


def check_laws(path: Path, _module: ModuleType, args: argparse.Namespace) -> list[str]:
    """Describe a file's laws; with ``--run`` also run them in the model."""
    whole = args.run
    if whole:
        add_laws(path)
    from straw.model.law_file import laws_in, ready  # loads the compiler
    from straw.replay.diagnose.systems.straw.library import library_of

    said = []
    for law in laws_in(path.resolve()):
        compiles(str(path), ready(law))
        strengths = ", ".join(f"{c.name} / {c.unit}" for c in law.constants if c.name in law.strengths)
        unknowns, starts = library_of(law)
        said.append(
            f"{path}: law {law.name} is good: {law.law}; strength {strengths}; "
            f"in the diagnosis {len(unknowns)} unknowns from {len(starts)} starts"
        )
        if whole:
            said.append(f"  on the paper's two runs the tip changes by up to {runs(law.name):.3g} mm")
    if not whole:
        say("not run in the model; --run does so, and compiles for a minute or two")
    return said


def compiles(where: str, law: object) -> None:
    """Raise ModelError, one line, where numba cannot compile a law that runs as Python."""
    from straw.model.law_contract import some_frusta, typical_row
    from straw.model.term import Law

    assert isinstance(law, Law)
    if law.kind == "body":
        return
    more = (0.0, 0.0, 1e-3) if law.kind == "memory" else ()
    for name, function, rest in (("force", law.force, more), ("energy", law.energy, ())):
        if function is None:
            continue
        try:
            function(some_frusta(1)[0], typical_row(law), *rest)
        except Exception as error:
            lines = [" ".join(line.split()) for line in str(error).splitlines() if line.strip()]
            told = next((x for x in lines if "line" not in x.lower() and len(x) > 20), "numba refuses it")
            raise ModelError(
                f"{where}: law {law.name}: {name} does not compile: {told[:200]}; use math and numbers only"
            ) from None


def runs(name: str) -> float:
    """Change of the tip (mm) by a law of plausible strength in the paper's two runs; ModelError if it fails."""
    from straw.model.parameters import StrawParameters
    from straw.model.simulate import simulate
    from straw.model.terms import TERMS
    from straw.model.typical import with_typical

    base, time_s = StrawParameters(), np.linspace(0, 2.0, 481)
    loose = base.replace(c_zeta_n_s_per_m=0.1, c_phi_n_m_s_per_rad=3e-3, r_ch_m=0.315e-3)
    most = 0.0
    for straw, steady_pa, deployed in ((base, -25e3, [1, 4]), (loose, 35e3, [2, 3, 5, 6, 7, 8, 9])):
        one, other = (
            simulate(s, lambda t, p=steady_pa: p * (1 - np.exp(-50 * t)), time_s, deployed)  # type: ignore[misc]
            for s in (straw, with_typical(straw, TERMS[name]))
        )
        most = max(most, *(float(np.abs(a - b).max()) for a, b in ((one.x_m, other.x_m), (one.z_m, other.z_m))))
    return most * 1e3


def check_controller(path: Path, _module: ModuleType, _args: argparse.Namespace) -> list[str]:
    """Describe a driver."""
    from straw.rig.drivers import driver_in

    driver = driver_in(path.resolve())
    settings = [name for name in inspect.signature(driver).parameters if name not in ("port", "kwargs", "settings")]
    return [
        f"{path}: controller {driver.name} is good; its settings: {', '.join(settings) or 'those of any controller'}"
    ]


def check_system(path: Path, _module: ModuleType, _args: argparse.Namespace) -> list[str]:
    """Check that a system can be simulated and diagnosed; ReplayError with every defect in one line."""
    from straw.replay.diagnose.systems.function.check import defects

    if found := defects(path):
        raise ReplayError("; ".join(found))
    return [f"{path}: a system that can be diagnosed: straw diagnose --system {path} DATA.csv ..."]


def check_readers(path: Path, _module: ModuleType, args: argparse.Namespace) -> list[str]:
    """Describe a file's readers; with ``--on TABLE`` the first one reads it, whole and damaged."""
    from straw.rig.parts import in_file
    from straw.rig.tables import Reading, table_bytes
    from straw.rig.tables.reader import READERS, reader_in, tried

    out = []
    for part in in_file(READERS, path.resolve()):
        one = part.what
        by = ", ".join(one.suffixes) or ("what it recognises" if one.recognises else "what --format names")
        out.append(f"{path}: reader {one.name} is good: {one.about}; takes {by}")
    if args.on is None:
        say("not tried on a table of its logger: --on TABLE")
        return out
    form = reader_in(path)
    table = form.read(args.on, table_bytes(args.on), Reading())
    for column in table.columns.values():
        role = table.roles.get(column.name, "no role stated")
        kind = "words" if column.is_text else column.unit or "no unit stated"
        out.append(f"  {column.name!r}: {len(column)} rows, {kind}; {role}")
    return [*out, f"  {tried(form, args.on)} damaged copies: each is read, or refused in one line"]


def check_figures(path: Path, _module: ModuleType, _args: argparse.Namespace) -> list[str]:
    """Describe a file's figures of merit, with their values for a fold that rings and a straw at rest."""
    from straw.replay.metrics.merit import FIGURES, asked
    from straw.replay.metrics.typical import typical_motions
    from straw.rig.parts import in_file

    out = []
    for part in in_file(FIGURES, path.resolve()):
        one = part.what
        values = {name: asked(part, motion, name) for name, motion in typical_motions().items()}
        if all(math.isnan(value) for value in values.values()):
            names = " and ".join(values)
            raise ReplayError(f"{path}: figure of merit {one.name!r}: value is NaN of every motion tried ({names})")
        told = ", ".join(f"{value:.4g} {one.unit} of the {name} motion" for name, value in values.items())
        out.append(f"{path}: figure of merit {one.name} is good: {one.about}; {told}")
    return out


#: Kinds of part by the name in the file, and their checks.
PARTS: dict[str, Callable[[Path, ModuleType, argparse.Namespace], list[str]]] = {
    "LAW": check_laws,
    "LAWS": check_laws,
    "CONTROLLER": check_controller,
    "READER": check_readers,
    "READERS": check_readers,
    "FIGURE": check_figures,
    "FIGURES": check_figures,
    "channels": check_system,
}
