"""Physics, one term a file. A file with a ``TERM`` is part of the model, of straw files and of `straw diagnose`.

So is a law from outside, see `straw.model.plugged`.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module

from straw.model.errors import ModelError
from straw.model.law_file import Origin, plugged_laws
from straw.model.term import Term

#: Where each law that is not the package's own comes from, by its name.
ORIGINS: dict[str, Origin] = {}


def _discover() -> dict[str, Term]:
    modules = (import_module(f"{__name__}.{m.name}") for m in sorted(pkgutil.iter_modules(__path__)))
    found = {module.TERM.name: module.TERM for module in modules if hasattr(module, "TERM")}
    for law, origin in plugged_laws():
        if law.name in found:
            whose = str(ORIGINS[law.name].path) if law.name in ORIGINS else "the package"
            raise ModelError(f"{origin.path}: law {law.name}: {whose} has one of this name; give yours another")
        found[law.name], ORIGINS[law.name] = law, origin
    return found


#: Every term the base model lacks, by its name: the package's own, and those that files and packages add.
TERMS: dict[str, Term] = _discover()

#: Those of them that are causes of the contract; the others are tables for what none of these explains.
CAUSES: dict[str, Term] = {name: term for name, term in TERMS.items() if term.cause}


def _columns() -> dict[str, tuple[int, int]]:
    columns, at = {}, 0
    for name, term in TERMS.items():
        columns[name] = (at, at + len(term.constants))
        at += len(term.constants)
    return columns


#: Where each term's constants lie in a row of ``Constants.terms``.
COLUMNS: dict[str, tuple[int, int]] = _columns()
WIDTH = sum(len(term.constants) for term in TERMS.values())
#: Such a row where nothing is given: strengths zero.
DEFAULTS: tuple[float, ...] = tuple(c.default for term in TERMS.values() for c in term.constants)
