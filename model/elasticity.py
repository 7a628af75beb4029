"""Elasticity: a frustum's energy by finite elements, made once from a geometry and scaled to straws near it.

With w = r_o - r_i, energies scale as C1 w^4, and the share of bending in them as C2 / (C1 w^2), both of equation 6:

    U = C1 w^4 [f_s + C2 / (C1 w^2) / k0 f_b + (zeta_0 - z0) / w f_z]

f_s and f_b are what stretching and bending store, f_z the change with the unloaded height. All three are of the
geometry they were made for: there U is exact in E and to first order in h and zeta_0, as the wall is in equilibrium.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.terms.shell_energy import HEAD, POWERS, ROW

Floats = NDArray[np.float64]

#: What a straw file may say instead of a file's path.
EQUATION_7, SHIPPED = "equation 7", "shell"
#: How far a straw may be from the geometry a table was made for: radii by rounding, h and zeta_0 by what the first
#: order carries (2 % of the energy at the barrier, measured against tables made at these ends).
SAME_RADII, NEAR_H, NEAR_ZETA0 = 1e-3, 0.15, 0.06
#: Width d over which the polynomial saturates beyond its end, as a share of the end, and the stiffness of the wall
#: behind it over the least that is needed: above 1/3 the force rises throughout.
REST_WIDTH, STIFFER = 0.08, 1.5


@dataclass(frozen=True)
class Elasticity:
    """Coefficients (36,) of f_s, f_b, f_z by the powers of `straw.model.terms.shell_energy`, and their geometry."""

    r_i_m: float
    r_o_m: float
    zeta0_m: float
    h_m: float
    nu: float
    end_m: float
    stretching: Floats
    bending: Floats
    by_zeta0: Floats
    outward_n: float  # largest force outwards on a rim's point at the end, over C1 w^3
    made: str = ""  # how: mesh, hold, accuracy

    @property
    def width_m(self) -> float:
        """r_o - r_i."""
        return self.r_o_m - self.r_i_m

    @property
    def bending_share(self) -> float:
        """C2 / (C1 w^2) of the geometry, k0."""
        return bending_share(self.r_i_m, self.r_o_m, self.h_m)

    def row(self, C1: float, C2: float, zeta0_m: float, r_i_m: float, r_o_m: float, share: float = 1.0) -> Floats:
        """What `straw.model.terms.shell_energy` takes for a frustum, (ROW,), scaled by its width."""
        w = r_o_m - r_i_m
        size = w / self.width_m
        c = self.stretching + C2 / (C1 * w**2) / self.bending_share * self.bending
        c = c + (zeta0_m / w - self.zeta0_m / self.width_m) * self.by_zeta0
        row = np.empty(ROW)
        end = self.end_m * size
        d = REST_WIDTH * end
        row[:HEAD] = end, d, STIFFER * C1 * w**3 * self.outward_n / (3 * d**2), share
        row[HEAD:] = C1 * w**4 * c
        return row

    def check(self, where: str, r_i_m: float, r_o_m: float, zeta0_m: float, h_m: float) -> None:
        """Raise ModelError where a frustum is too far from this geometry."""
        for name, own, straws, near in (
            ("r_i_m", self.r_i_m, r_i_m, SAME_RADII),
            ("r_o_m", self.r_o_m, r_o_m, SAME_RADII),
            ("zeta0_m", self.zeta0_m, zeta0_m, NEAR_ZETA0),
            ("h_m", self.h_m, h_m, NEAR_H),
        ):
            if abs(straws / own - 1) > near:
                raise ModelError(
                    f"straw: elasticity {where} was made for {name} = {own:.5g}, the straw has {straws:.5g}; make one "
                    "for it: straw shell --straw STRAW.toml --elasticity FILE.json"
                )

    def described(self) -> dict[str, Any]:
        """As plain data."""
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(self).items()}

    @classmethod
    def from_described(cls, data: dict[str, Any]) -> Self:
        """What `described` gave; ModelError where it is something else."""
        try:
            tables = {k: np.array(data[k], dtype=np.float64) for k in ("stretching", "bending", "by_zeta0")}
            made = cls(**{**data, **tables})
            good = all(t.shape == (len(POWERS),) and np.all(np.isfinite(t)) for t in tables.values())
            numbers = (made.r_i_m, made.r_o_m, made.h_m, made.end_m, made.outward_n)
            if not good or not all(isinstance(x, float) and math.isfinite(x) and x > 0 for x in numbers):
                raise ValueError("its numbers are not those of an elasticity")
        except (KeyError, TypeError, ValueError) as error:
            raise ModelError(f"not an elasticity made by straw shell: {error}") from None
        return made


def bending_share(r_i_m: float, r_o_m: float, h_m: float) -> float:
    """C2 / (C1 w^2) of equation 6: what bending counts against stretching."""
    w, log = r_o_m - r_i_m, math.log(r_o_m / r_i_m)
    C1 = h_m / (8 * w**3) * ((r_o_m + r_i_m) / 2 - w / log)
    return h_m**3 * log / (12 * w**2) / (C1 * w**2)


@cache
def elasticity_of(name: str) -> Elasticity:
    """The elasticity a straw file names: "shell" for the paper's specimen, or a file's path; ModelError otherwise."""
    try:
        if name == SHIPPED:
            text = (files("straw.model") / "samples" / "elasticity.json").read_text(encoding="utf-8")
        else:
            text = Path(name).read_text(encoding="utf-8")
        data = json.loads(text)
    except OSError as error:
        raise ModelError(
            f'straw: elasticity {name!r}: {error.strerror}; give "{EQUATION_7}", "{SHIPPED}" or a file of straw shell'
        ) from None
    except (UnicodeDecodeError, ValueError):
        raise ModelError(f"straw: elasticity {name}: not a file of straw shell") from None
    try:
        return Elasticity.from_described(data)
    except ModelError as error:
        raise ModelError(f"straw: elasticity {name}: {error}") from None
