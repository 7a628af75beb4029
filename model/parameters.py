"""StrawParameters: every constant of one straw, SI, checked once; its file is read by `straw_file.py`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from straw.model.constants import Constants
from straw.model.elasticity import EQUATION_7, SHIPPED, elasticity_of
from straw.model.errors import ModelError
from straw.model.term_constants import acting, all_of, checked, finite, packed, per_frustum
from straw.model.terms import ORIGINS
from straw.model.terms.shell_energy import ROW

Floats = NDArray[np.float64]

MAX_CELLS = 300
FORMS = ("truncated", "full")

#: Constants each frustum has a value of its own for: array (cells, 2), [n, 0] the odd and [n, 1] the even frustum.
PER_FRUSTUM = ("zeta0_m", "h_m", "E_pa", "c_zeta_n_s_per_m", "c_phi_n_m_s_per_rad")


def _numbers(value: Any) -> Any:
    """A plain number unchanged, as it is checked faster than an array: a search makes thousands of straws a second."""
    return value if isinstance(value, float) else np.asarray(value)


@dataclass(frozen=True)
class StrawParameters:
    """One straw: geometry, elasticity, damping, channel, tip and the form of its equations.

    Defaults are the specimen of Ilssar et al., section 3, with the damping and channel radius of its folding run
    (Fig. 6). Per-frustum constants have shape (cells, 2): ``[n - 1, 0]`` is the odd frustum of cell n (nearer the
    inlet), ``[n - 1, 1]`` the even one; a scalar or a pair (odd, even) is spread over all cells. ``form`` is "full"
    (4N coordinates) or "truncated" (odd frusta rigid at zeta0, 2N coordinates). ``elasticity`` is what the even frusta
    obey: "equation 7", "shell" (finite elements of the paper's specimen), or a file made by `straw shell`; the term
    ``wall_elasticity`` goes a share of the way from it to the other. A run begins at ``start_s`` of the time that laws
    may depend on; where ``zero_time_s`` is given, in seconds of Unix time, that time counts from there (`in_run`).
    ``readers`` and ``figures`` are files of parts that are no physics, for the code that loads them.

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
    start_s: float = 0.0
    zero_time_s: float = 0.0
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
            self._check(name, all_of(_numbers(getattr(self, name)) > 0), "above zero")
        self._check("r_ch_m", self.r_ch_m > 1e-60, "above 1e-60")  # the loss has its fourth power, 0 below 1e-81
        for name in ("c_zeta_n_s_per_m", "c_phi_n_m_s_per_rad", "cycle", "zero_time_s"):
            self._check(name, all_of(_numbers(getattr(self, name)) >= 0), "zero or above")
        for name in ("g_m_per_s2", "phi_0_rad", "F_X_n", "F_Z_n", "M_Y_n_m", "start_s", "zero_time_s"):
            self._check(name, math.isfinite(getattr(self, name)), "finite")
        object.__setattr__(self, "terms", checked(self.terms, self.cells))
        self._check("r_o_m", self.r_o_m > self.r_i_m, f"above r_i_m = {self.r_i_m}")
        # |zeta0_even| < zeta0_odd keeps every cell's volume, length and mass positive whichever way it snaps.
        odd, even = self.zeta0_m[:, 0], self.zeta0_m[:, 1]
        self._check_elasticity()
        self._check("zeta0_m", np.all((odd > 0) & (even < 0) & (-even < odd)), "(odd, even) with 0 < -even < odd")

    def _check_elasticity(self) -> None:
        if self.elasticity == EQUATION_7 and not acting(self.terms, "walls").any():
            return
        table = elasticity_of(self.walls_table)
        for zeta0, h in {(z, h) for z, h in zip(self.zeta0_m[:, 1].tolist(), self.h_m[:, 1].tolist(), strict=True)}:
            table.check(repr(self.walls_table), self.r_i_m, self.r_o_m, zeta0, h)

    def __reduce__(self) -> tuple[Any, ...]:
        """Construct it when unpickled: arrays would come back writable, which is another type to the compiled model."""
        return type(self), tuple(getattr(self, f.name) for f in fields(self))

    def _spread(self, name: str) -> Floats:
        try:
            full = np.broadcast_to(np.asarray(getattr(self, name), dtype=np.float64), (self.cells, 2)).copy()
        except (TypeError, ValueError):
            raise ModelError(
                f"straw: {name} does not spread over {self.cells} cells: give a number, a pair (odd, even) "
                f"or {self.cells} pairs"
            ) from None
        full.setflags(write=False)
        return full

    def _check(self, name: str, good: bool | np.bool_, expected: str) -> None:
        value = getattr(self, name)
        if not (good and finite(value)):
            value = np.asarray(value, dtype=np.float64)
            shown = value.flat[0] if value.size and np.all(value == value.flat[0]) else value.tolist()
            raise ModelError(f"straw: {name} = {shown}, expected {expected}")

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

    def in_run(self, cycle: int, zero_time_ns: int) -> Self:
        """The straw as a recorded run finds it: after so many cycles, its time 0 at ``zero_time_ns`` of Unix time.

        Without ``zero_time_s`` the laws' time is the run's own.
        """
        start_s = (zero_time_ns - round(1e9 * self.zero_time_s)) * 1e-9 if self.zero_time_s else self.start_s
        return self.replace(cycle=float(cycle), start_s=start_s)

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
        acts = acting(self.terms, "frustum", "memory")
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
            start_s=self.start_s,
            plain=not acts.any(),
            acts=acts,
            remembers=bool(acting(self.terms, "memory").any()),
            terms=packed(self.terms, self.cells),
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
        share = per_frustum("share", self.terms.get("wall_elasticity", {}).get("share", 0.0), "walls", self.cells)
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

    @property
    def laws(self) -> dict[str, str]:
        """Users' laws in this straw, for a recording's metadata: name and SHA-256; {} without any."""
        told = [f"{name} {ORIGINS[name].sha256}" for name in self.terms if name in ORIGINS]
        return {"laws": ", ".join(told)} if told else {}

    def to_toml(self) -> str:
        """The straw as the text of a straw file; `straw.model.straw_file.straw_from_toml` reads it back exactly."""
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
