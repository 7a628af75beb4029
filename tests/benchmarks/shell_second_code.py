"""A second code at six points: NGSolve's elements, automatic derivatives and solver against `straw.model.shell`.

    pip install ngsolve && python -m tests.benchmarks.shell_second_code

The same shell theory as one energy; everything else is NGSolve's. For walls as solid bodies see ../shared/facts/fe.md.
"""

from __future__ import annotations

import math
import time

import numpy as np
from ngsolve import (
    H1,
    BilinearForm,
    CoefficientFunction,
    FESpace,
    GridFunction,
    InnerProduct,
    NumberSpace,
    Variation,
    cos,
    ds,
    dx,
    grad,
    sin,
    x,
    y,
)
from ngsolve.meshes import MakeStructured2DMesh

from straw.model.parameters import StrawParameters
from straw.model.shell.problem import NU, Problem
from straw.model.shell.profile import profile_of
from straw.model.shell.threads import one_thread

#: (zeta mm, phi rad): bent state, beyond it, both saddles, compressed and tilted, stretched and tilted.
POINTS = ((-0.1295, 0.215), (-0.27354, 0.22), (1.037, 0.104), (-0.867, 0.143), (-2.6, 0.03), (1.9, 0.08))
STEPS = 14


class NGSolveFrustum:
    """A half frustum over (s, theta) in NGSolve: displacement and change of the director, six fields."""

    def __init__(self, straw: StrawParameters, nx: int = 2, ny: int = 6, order: int = 4) -> None:
        self.r_i, self.r_o = straw.r_i_m, straw.r_o_m
        self.zeta0, self.h, self.E = (float(v[0, 1]) for v in (straw.zeta0_m, straw.h_m, straw.E_pa))
        w = self.r_o - self.r_i
        length = math.hypot(w, self.zeta0)
        mesh = MakeStructured2DMesh(quads=True, nx=nx, ny=ny, mapping=lambda a, b: (a * length, b * math.pi))
        # left: large base, right: small base, bottom and top: the plane of bending
        free, base, plane = "", "left|right", "bottom|top"
        held = (free, plane, base, free, plane, free)
        fields = [H1(mesh, order=order, dirichlet=edge) for edge in held]
        self.space: FESpace = fields[0] * fields[1] * fields[2] * fields[3] * fields[4] * fields[5] * NumberSpace(mesh)
        self.mesh = mesh
        r = self.r_o - w / length * x
        slope = (-w / length, self.zeta0 / length)  # dr, dz by s
        normal = (-slope[1], slope[0])
        c, s = cos(y), sin(y)
        X1 = CoefficientFunction((slope[0] * c, slope[0] * s, slope[1]))
        X2 = CoefficientFunction((-r * s, r * c, 0))
        D = CoefficientFunction((normal[0] * c, normal[0] * s, normal[1]))
        D2 = CoefficientFunction((-normal[0] * s, normal[0] * c, 0))
        zero = CoefficientFunction((0, 0, 0))
        *unknown, shift = self.space.TrialFunction()
        u, d = unknown[:3], unknown[3:]

        def vector(base: CoefficientFunction, parts: list, along: int) -> CoefficientFunction:
            values = parts if along < 0 else [grad(p)[along] for p in parts]
            return base + CoefficientFunction(tuple(values))

        a1, a2, n = vector(X1, u, 0), vector(X2, u, 1), vector(D, d, -1)
        n1, n2 = vector(zero, d, 0), vector(D2, d, 1)
        ip = InnerProduct
        e = [(ip(a1, a1) - 1) / 2, (ip(a2, a2) - r**2) / 2 / r**2, ip(a1, a2) / r]
        k = [ip(a1, n1), (ip(a2, n2) - ip(X2, D2)) / r**2, (ip(a1, n2) + ip(a2, n1)) / r]
        g = [ip(a1, n), ip(a2, n) / r]
        t = (ip(n, n) - 1) / 2

        def plane_stress(v: list) -> CoefficientFunction:
            return (v[0] ** 2 + v[1] ** 2 + 2 * NU * v[0] * v[1] + (1 - NU) / 2 * v[2] ** 2) / (1 - NU**2)

        h, E = self.h, self.E
        shear = 5 / 6 / (2 * (1 + NU)) * (g[0] ** 2 + g[1] ** 2)
        density = E * (h / 2 * plane_stress(e) + h**3 / 24 * plane_stress(k) + h / 2 * (shear + t**2))
        form = BilinearForm(self.space, symmetric=False)
        form += Variation((2 * r * density).Compile() * dx)  # the other half
        form += Variation(1e3 * shift * u[0] * ds("left"))  # keeps the centre of the large base on the axis
        self.form = form
        self.state = GridFunction(self.space)

    def dictate(self, zeta: float, phi: float) -> GridFunction:
        """Prescribe displacements of the small base along z, zero elsewhere."""
        value = GridFunction(self.space)
        value.components[2].Set((zeta - self.zeta0) - self.r_i * phi * cos(y), definedon=self.mesh.Boundaries("right"))
        return value

    def at(self, zeta: float, phi: float) -> float:
        """Energy (J) at (zeta, phi), reached from the unloaded shape."""
        self.state.vec[:] = 0
        before = self.dictate(self.zeta0, 0.0)
        for step in np.linspace(0, 1, STEPS + 1)[1:]:
            # straight first, then bent
            now = self.dictate(self.zeta0 + (zeta - self.zeta0) * min(1, 2 * step), phi * max(0, 2 * step - 1))
            change = now.vec.CreateVector()
            change.data = now.vec - before.vec
            before = now
            for iteration in range(12):
                residual, w = self.state.vec.CreateVector(), self.state.vec.CreateVector()
                self.form.Apply(self.state.vec, residual)
                self.form.AssembleLinearization(self.state.vec)
                if iteration == 0:
                    residual.data += self.form.mat * change
                w.data = self.form.mat.Inverse(self.space.FreeDofs(), "umfpack") * residual
                self.state.vec.data -= w
                if iteration == 0:
                    self.state.vec.data += change
                elif w.Norm() < 1e-7 * self.state.vec.Norm():
                    break
        return float(self.form.Energy(self.state.vec))


def main() -> None:
    """Print both codes' energies and their difference."""
    straw = StrawParameters()
    second = NGSolveFrustum(straw)
    problem = Problem(profile_of(straw), float(straw.E_pa[0, 1]))
    print("zeta mm  phi rad   NGSolve mJ  straw.model.shell mJ  relative      s      s")
    with one_thread():
        model = problem.model()
        for zeta, phi in POINTS:
            begun = time.monotonic()
            one = second.at(1e-3 * zeta, phi)
            middle = time.monotonic()
            other = model.at(1e-3 * zeta, phi).energy_j
            ended = time.monotonic()
            print(
                f"{zeta:7.3f} {phi:8.3f} {1e3 * one:12.4f} {1e3 * other:15.4f} {other / one - 1:+9.1e} "
                f"{middle - begun:6.1f} {ended - middle:6.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
