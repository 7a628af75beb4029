"""StrawParameters: every constant of one straw, SI, checked once; read from and written to a TOML file."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from straw.model import plugged
from straw.model.constants import Constants
from straw.model.elasticity import EQUATION_7, SHIPPED, elasticity_of
from straw.model.errors import ModelError
from straw.model.terms import COLUMNS, DEFAULTS, ORIGINS, TERMS, WIDTH
from straw.model.terms.shell_energy import ROW

Floats = NDArray[np.float64]

MAX_CELLS = 300
FORMS = ("truncated", "full")

#: Constants each frustum has a value of its own for: array (cells, 2), [n, 0] the odd and [n, 1] the even frustum.
PER_FRUSTUM = ("zeta0_m", "h_m", "E_pa", "c_zeta_n_s_per_m", "c_phi_n_m_s_per_rad")


def _numbers(value: Any) -> Any:
    """A plain number unchanged, as it is checked faster than an array: a search makes thousands of straws a second."""
    return value if isinstance(value, float) else np.asarray(value)


def _all(condition: Any) -> bool:
    return condition if isinstance(condition, bool) else bool(np.all(condition))


def _finite(value: Any) -> bool:
    return math.isfinite(value) if isinstance(value, float) else bool(np.isfinite(np.asarray(value, np.float64)).all())


@dataclass(frozen=True)
class StrawParameters:
    """One straw: geometry, elasticity, damping, channel, tip and the form of its equations.

    Defaults are the specimen of Ilssar et al., section 3, with the damping and channel radius of its folding run
    (Fig. 6). Per-frustum constants have shape (cells, 2): ``[n - 1, 0]`` is the odd frustum of cell n (nearer the
    inlet), ``[n - 1, 1]`` the even one; a scalar or a pair (odd, even) is spread over all cells. ``form`` is "full"
    (4N coordinates) or "truncated" (odd frusta rigid at zeta0, 2N coordinates). ``elasticity`` is what the even frusta
    obey: "equation 7", "shell" (finite elements of the paper's specimen), or a file made by `straw shell`; the term
    ``wall_elasticity`` goes a share of the way from it to the other. ``readers``
    and ``figures`` are files of parts that are no physics, for the code that loads them.

    Raises ModelError for anything that is not a straw, naming the constant.
    """

    cells: int = 9
    form: str = "truncated"
    r_i_m: float = 11.1e-3
    r_o_m: float = 14.65e-3
    zeta0_m: Floats = field(default_factory=lambda: np.array([3.78e-3, -2.28e-3]))
    h_m: Floats = field(default_factory=lambda: np.array(0.508e-3))
    E_pa: Floats = field(default_factory=lambda: np.array(0.92e9))
    c_zeta_n_s_per_m: Floats = field(default_factory=lambda: np.array(620.0))
    c_phi_n_m_s_per_rad: Floats = field(default_factory=lambda: np.array(7e-4))
    r_ch_m: float = 0.43e-3
    m_tip_kg: float = 13.45e-3
    I_tip_kg_m2: float = 2986.91e-9
    rho_kg_per_m3: float = 1000.0
    g_m_per_s2: float = 9.795
    phi_0_rad: float = math.pi / 2
    F_X_n: float = 0.0
    F_Z_n: float = 0.0
    M_Y_n_m: float = 0.0
    cycle: float = 0.0
    elasticity: str = EQUATION_7
    terms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    readers: tuple[str, ...] = ()
    figures: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not 1 <= self.cells <= MAX_CELLS:
            raise ModelError(f"straw: cells = {self.cells}, expected 1 to {MAX_CELLS}")
        if self.form not in FORMS:
            raise ModelError(f"straw: form = {self.form!r}, expected one of {', '.join(FORMS)}")
        for name in PER_FRUSTUM:
            object.__setattr__(self, name, self._spread(name))
        positive = ("r_i_m", "r_o_m", "h_m", "E_pa", "r_ch_m", "m_tip_kg", "I_tip_kg_m2", "rho_kg_per_m3")
        for name in positive:
            self._check(name, _all(_numbers(getattr(self, name)) > 0), "above zero")
        for name in ("c_zeta_n_s_per_m", "c_phi_n_m_s_per_rad"):
            self._check(name, _all(getattr(self, name) >= 0), "zero or above")
        for name in ("g_m_per_s2", "phi_0_rad", "F_X_n", "F_Z_n", "M_Y_n_m"):
            self._check(name, math.isfinite(getattr(self, name)), "finite")
        self._check("cycle", self.cycle >= 0, "zero or above")
        object.__setattr__(self, "terms", self._known_terms())
        self._check("r_o_m", self.r_o_m > self.r_i_m, f"above r_i_m = {self.r_i_m}")
        # |zeta0_even| < zeta0_odd keeps every cell's volume, length and mass positive whichever way it snaps.
        odd, even = self.zeta0_m[:, 0], self.zeta0_m[:, 1]
        self._check_elasticity()
        self._check("zeta0_m", np.all((odd > 0) & (even < 0) & (-even < odd)), "(odd, even) with 0 < -even < odd")

    def _check_elasticity(self) -> None:
        if self.elasticity == EQUATION_7 and not self._has("walls"):
            return
        table = elasticity_of(self.walls_table)
        for zeta0, h in {(z, h) for z, h in zip(self.zeta0_m[:, 1].tolist(), self.h_m[:, 1].tolist(), strict=True)}:
            table.check(repr(self.walls_table), self.r_i_m, self.r_o_m, zeta0, h)

    def __reduce__(self) -> tuple[Any, ...]:
        """Construct it when unpickled: arrays would come back writable, which is another type to the compiled model."""
        return type(self), tuple(getattr(self, f.name) for f in fields(self))

    def _spread(self, name: str) -> Floats:
        try:
            given = np.asarray(getattr(self, name), dtype=np.float64)
            full = np.broadcast_to(given, (self.cells, 2)).copy()
        except (TypeError, ValueError):
            raise ModelError(
                f"straw: {name} does not spread over {self.cells} cells: give a number, a pair (odd, even) "
                f"or {self.cells} pairs"
            ) from None
        full.setflags(write=False)
        return full

    def _check(self, name: str, good: bool | np.bool_, expected: str) -> None:
        value = getattr(self, name)
        if not (good and _finite(value)):
            value = np.asarray(value, dtype=np.float64)
            shown = value.flat[0] if value.size and np.all(value == value.flat[0]) else value.tolist()
            raise ModelError(f"straw: {name} = {shown}, expected {expected}")

    def _known_terms(self) -> Mapping[str, Mapping[str, Any]]:
        """The terms checked against `straw.model.terms`, as plain numbers and lists."""
        checked: dict[str, dict[str, Any]] = {}
        for name, given in self.terms.items():
            if name not in TERMS:
                raise ModelError(f"straw: unknown term {name!r}; known: {', '.join(TERMS)}")
            if not isinstance(given, Mapping):
                raise ModelError(f"straw: terms.{name} = {given!r}, expected constants by name")
            known = {constant.name: constant for constant in TERMS[name].constants}
            checked[name] = {}
            for key, value in given.items():
                where = f"terms.{name}.{key}"
                if key not in known:
                    raise ModelError(f"straw: unknown constant {where}; known: {', '.join(known)}")
                plain = isinstance(value, float)
                numbers = value if plain else self._per_frustum_of_term(where, value, TERMS[name].kind)
                if known[key].low >= 0 and key in TERMS[name].strengths:
                    good, expected = _all(numbers >= 0), "zero or above"
                else:
                    good, expected = _all((numbers > 0) | (known[key].low <= 0)), "above zero"
                if not (good and _finite(numbers)):
                    raise ModelError(f"straw: {where} = {value!r}, expected {expected}")
                checked[name][key] = float(value) if plain else np.asarray(value, dtype=np.float64).tolist()
            for points in TERMS[name].rising:
                at = [checked[name].get(point, known[point].default) for point in points]
                if any(np.ndim(x) for x in at) or not np.all(np.diff(at) > 0):
                    raise ModelError(
                        f"straw: terms.{name}: {points[0]} to {points[-1]} = {at}, expected rising numbers"
                    )
        return checked

    def _per_frustum_of_term(self, where: str, value: Any, kind: str) -> Floats:
        try:
            given = np.asarray(value, dtype=np.float64)
            if given.ndim == 1:  # one number a cell, for both of its frusta
                given = np.broadcast_to(given[:, np.newaxis], (len(given), 2))
            if given.ndim and (kind in ("body", "flow") or len(given) != self.cells):
                raise ValueError
            return np.broadcast_to(given, (self.cells, 2))
        except (TypeError, ValueError):
            wanted = "a number" if kind in ("body", "flow") else f"a number, {self.cells} numbers or {self.cells} pairs"
            raise ModelError(f"straw: {where} = {value!r}, expected {wanted}") from None

    def with_term(self, name: str, **constants: Any) -> Self:
        """The same straw with some constants of a term changed, the term's other constants kept."""
        return replace(self, terms={**self.terms, name: {**self.terms.get(name, {}), **constants}})

    def replace(self, **changes: Any) -> Self:
        """The same straw with some constants changed; constants alike in all cells spread over new ``cells``."""
        if "cells" in changes:
            for name in PER_FRUSTUM:
                rows = getattr(self, name)
                if np.all(rows == rows[0]):
                    changes.setdefault(name, rows[0])
        return replace(self, **changes)

    @property
    def coordinates(self) -> int:
        """Number of generalised coordinates: 4N in the full form, 2N in the truncated form."""
        return 4 * self.cells if self.form == "full" else 2 * self.cells

    def constants(self) -> Constants:
        """Constants of the compiled equations; C1, C2, C3 as below equation 6. Computed once; read-only."""
        return self._constants

    @cached_property
    def _constants(self) -> Constants:
        r_i, r_o, E, h = self.r_i_m, self.r_o_m, self.E_pa, self.h_m
        width, log = r_o - r_i, math.log(r_o / r_i)
        C1 = math.pi * E * h / (8 * width**3) * ((r_o + r_i) / 2 - width / log)
        C2 = math.pi * E * h**3 * log / (12 * width**2)
        return Constants(
            cells=self.cells,
            active=2 if self.form == "full" else 1,
            r_i=r_i,
            r_o=r_o,
            rho=self.rho_kg_per_m3,
            g=self.g_m_per_s2,
            phi_0=self.phi_0_rad,
            m_tip=self.m_tip_kg,
            I_tip=self.I_tip_kg_m2,
            F_X=self.F_X_n,
            F_Z=self.F_Z_n,
            M_Y=self.M_Y_n_m,
            loss=self.rho_kg_per_m3 / (2 * math.pi**2 * self.r_ch_m**4),
            S=math.pi * (r_o**2 + r_i**2 + r_o * r_i) / 3,
            C3=math.pi * (r_o**2 - 2 * r_i**2 + r_o * r_i) / 3,
            zeta0=self.zeta0_m,
            C1=C1,
            C2=C2,
            wall=self._wall_rows(C1, C2),
            c_zeta=self.c_zeta_n_s_per_m,
            c_phi=self.c_phi_n_m_s_per_rad,
            cycle=self.cycle,
            plain=not (self._has("frustum") or self._has("memory")),
            remembers=self._has("memory"),
            terms=self._packed_terms(),
        )

    @property
    def walls_table(self) -> str:
        """The finite elements this straw obeys, or may obey a share of: as `elasticity` may be, but equation 7."""
        return SHIPPED if self.elasticity == EQUATION_7 else self.elasticity

    def _wall_rows(self, C1: Floats, C2: Floats, everywhere: bool = False) -> Floats:
        """Rows of `straw.model.terms.shell_energy` for the even frusta, (cells, 2, ROW); zero for equation 7.

        ``everywhere``: a row of share zero where there is none, which is the same straw; slower, but its derivative by
        the share is there.
        """
        rows = np.zeros((self.cells, 2, ROW))
        given = self.terms.get("wall_elasticity", {}).get("share", 0.0)
        share = self._per_frustum_of_term("share", given, "walls")
        share = share if self.elasticity == EQUATION_7 else 1 - share
        places = np.flatnonzero((share[:, 1] != 0) | everywhere)
        table = elasticity_of(self.walls_table) if len(places) else None
        for n in places:
            assert table is not None
            zeta0 = float(self.zeta0_m[n, 1])
            scaled = float(C1[n, 1]), float(C2[n, 1]), zeta0, self.r_i_m, self.r_o_m, float(share[n, 1])
            rows[n, 1] = table.row(*scaled)
        return rows

    def walls(self) -> Floats:
        """The rows of `Constants.wall`, (cells, 2, ROW), written out where their share is zero as well."""
        c = self.constants()
        return self._wall_rows(c.C1, c.C2, everywhere=True)

    def _has(self, kind: str) -> bool:
        """Whether a term of that kind has a strength other than zero."""
        return any(
            np.any(np.asarray(self.terms[name].get(strength, 0.0)) != 0)
            for name in self.terms
            if TERMS[name].kind == kind
            for strength in TERMS[name].strengths
        )

    def _packed_terms(self) -> Floats:
        """Constants of all terms side by side, (cells, 2, WIDTH); defaults, strengths zero, where none are given."""
        packed = np.empty((self.cells, 2, WIDTH))
        packed[:] = DEFAULTS
        for name, given in self.terms.items():
            for column, constant in enumerate(TERMS[name].constants, COLUMNS[name][0]):
                if constant.name in given:
                    packed[:, :, column] = self._per_frustum_of_term(
                        constant.name, given[constant.name], TERMS[name].kind
                    )
        return packed

    @property
    def laws(self) -> dict[str, str]:
        """Users' laws in this straw, for a recording's metadata: name and SHA-256; {} without any."""
        told = [f"{name} {ORIGINS[name].sha256}" for name in self.terms if name in ORIGINS]
        return {"laws": ", ".join(told)} if told else {}

    def to_toml(self) -> str:
        """The straw as the text of a straw file; `straw_from_toml` reads it back exactly."""
        lines = []
        if laws := sorted({ORIGINS[name].as_toml() for name in self.terms if name in ORIGINS}):
            lines.append(f"laws = [{', '.join(laws)}]")
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, Mapping):
                continue
            if isinstance(value, str):
                lines.append(f"{f.name} = {json.dumps(value)}")
            elif isinstance(value, tuple):
                lines += [f"{f.name} = {json.dumps(value)}"] if value else []
            elif isinstance(value, np.ndarray):
                same = bool(np.all(value == value[0]))
                lines.append(f"{f.name} = {(value[0] if same else value).tolist()!r}")
            else:
                lines.append(f"{f.name} = {value!r}")
        for name, constants in self.terms.items():
            lines += ["", f"[terms.{name}]"] + [f"{key} = {value!r}" for key, value in constants.items()]
        return "\n".join(lines) + "\n"


#: Keys of a straw file that name files of parts besides laws.
PARTS = ("readers", "figures")


def straw_from_toml(text: str, name: str = "straw file", folder: Path | None = None) -> StrawParameters:
    """A straw from TOML text: any of the constants by name, the paper's value for each one left out.

    Files that it names are looked for from ``folder``.
    """
    try:
        table: Mapping[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ModelError(f"{name}: not TOML: {error}") from None
    _check_laws(table.get("laws", []), folder or Path(), name)
    parts = {}
    for key in PARTS:
        files = plugged.files_of(table.get(key, []), key, folder or Path(), name)
        parts[key] = tuple(str(file.resolve() if folder else file) for file in files)
    table = {key: value for key, value in table.items() if key not in ("laws", *PARTS)}
    known = {f.name: f.type for f in fields(StrawParameters)}
    for key, value in table.items():
        if key not in known:
            raise ModelError(f"{name}: unknown key {key!r}; known: {', '.join(known)}")
        wanted = {"cells": int, "form": str, "elasticity": str, "terms": dict}.get(
            key, list if key in PER_FRUSTUM else float
        )
        accepted = {list: (list, int, float), float: (int, float)}.get(wanted, (wanted,))
        if isinstance(value, bool) or not isinstance(value, accepted):
            expected = "a text" if wanted is str else "tables [terms.NAME]" if wanted is dict else "a number"
            raise ModelError(f"{name}: {key} = {value!r}, expected {expected}")
    if folder and table.get("elasticity", EQUATION_7) not in (EQUATION_7, SHIPPED):
        table = {**table, "elasticity": str((folder / table["elasticity"]).resolve())}
    try:
        return StrawParameters(**table, readers=parts["readers"], figures=parts["figures"])
    except ModelError as error:
        raise ModelError(f"{name}: {error}") from None


def _check_laws(given: object, folder: Path, name: str) -> None:
    """Raise ModelError unless the laws that a straw file names are part of the model, unchanged."""
    loaded = {origin.sha256 for origin in ORIGINS.values()}
    for path, sha256 in plugged.laws_of(given, folder, name):
        if sha256 in loaded:
            continue
        if sha256 and (path is None or not path.exists() or plugged.sha256_of(path) != sha256):
            what = f"{path} has been changed or removed" if path else "the package is another version or not installed"
            raise ModelError(
                f"{name}: made with a law of SHA-256 {sha256[:12]}...: {what}; restore it, or leave out sha256"
            )
        if path and plugged.sha256_of(path) not in loaded:
            raise ModelError(
                f"{name}: its law {path} is not part of the model that is loaded; give --laws {path}, or call "
                f"straw.add_laws({str(path)!r}) before anything else"
            )


def load_straw(path: str | Path | None = None) -> StrawParameters:
    """The straw in a TOML file, the paper's for None; ModelError where it cannot be read or is not a straw."""
    if path is None:
        return StrawParameters()
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise ModelError(f"{path}: cannot read the straw file: {reason}") from None
    if not text.strip():
        raise ModelError(f"{path}: the straw file is empty; name a constant that differs, or leave the file out")
    return straw_from_toml(text, str(path), path.parent)
