"""What is asked of the finite elements, as plain data that can be sent to another process and written to a file."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from straw.model.errors import ModelError
from straw.model.shell.hold import Hold
from straw.model.shell.mesh import Mesh
from straw.model.shell.profile import Meridian, Profile
from straw.model.shell.solve import Model

#: Poisson's ratio, absent from the reduced model; the paper took 0.33 "arbitrarily".
NU = 0.33


@dataclass(frozen=True)
class Problem:
    """A profile of one material, its mesh, how it is held, and the pressure inside."""

    profile: Profile
    E_pa: float
    nu: float = NU
    mesh: Mesh = field(default_factory=lambda: Mesh(2, 5, 7))
    hold: Hold = field(default_factory=Hold)
    pressure_pa: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.pressure_pa):
            raise ModelError(f"shell: pressure_pa = {self.pressure_pa}, expected a number")

    def model(self) -> Model:
        """The shell, ready to be solved."""
        return Model(self.profile, self.E_pa, self.nu, self.mesh, self.hold, self.pressure_pa)

    def axisymmetric(self) -> Self:
        """The same kept the same all around: phi = 0, a twentieth of the unknowns."""
        return replace(self, mesh=replace(self.mesh, harmonics=1))

    def barely_tilted(self) -> Self:
        """The same with the harmonics an infinitesimal tilt moves: at phi = 0 even the stiffness is exact."""
        return replace(self, mesh=replace(self.mesh, harmonics=2))

    @property
    def slant_m(self) -> float:
        """Length of the shortest wall: |zeta| + r_i |phi| of a frustum cannot exceed it but by stretching the wall."""
        return min(wall.length_m for wall in self.profile.walls)

    def described(self) -> dict[str, Any]:
        """The problem as plain data."""
        return {
            "walls": [
                {"points_m": w.points_m.tolist(), "thickness_m": w.thickness_m.tolist()} for w in self.profile.walls
            ],
            "crease_n": self.profile.crease_n,
            "E_pa": self.E_pa,
            "nu": self.nu,
            "mesh": vars(self.mesh),
            "hold": vars(self.hold),
            "pressure_pa": self.pressure_pa,
        }

    @classmethod
    def from_described(cls, data: dict[str, Any]) -> Self:
        """The problem that `described` gave; ModelError where something is missing."""
        try:
            walls = tuple(Meridian(np.array(w["points_m"]), np.array(w["thickness_m"])) for w in data["walls"])
            return cls(
                Profile(walls, data["crease_n"]),
                data["E_pa"],
                data["nu"],
                Mesh(**data["mesh"]),
                Hold(**data["hold"]),
                data["pressure_pa"],
            )
        except (KeyError, TypeError, ValueError) as error:
            raise ModelError(f"shell: not a description of a shell: {error}") from None

    @property
    def key(self) -> str:
        """The same for the same problem."""
        return hashlib.sha256(json.dumps(self.described(), sort_keys=True).encode()).hexdigest()[:16]
