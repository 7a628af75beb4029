"""Equations 1 to 7 of the paper, transcribed literally, at 50 digits: the reference for the compiled ones.

Shares nothing with the model package: positions come from the printed sums, velocities and Lagrange's equations from
numerical differentiation in high precision, forces from virtual work.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from mpmath import atan2, cos, log, mp, mpf, pi, sin

mp.dps = 50
STEP = mpf(10) ** -14  # central differences err by STEP squared, rounding by 1e-50 / STEP


class PaperStraw:
    """A straw of the full form; q = zeta odd[N], zeta even[N], phi odd[N], phi even[N]."""

    def __init__(self, cells: int, **constants: float) -> None:
        self.N = cells
        for name, value in constants.items():
            setattr(self, name, mpf(value))
        r_i, r_o, E, h = self.r_i, self.r_o, self.E, self.h
        self.C1 = pi * E * h / (8 * (r_o - r_i) ** 3) * ((r_o + r_i) / 2 - (r_o - r_i) / log(r_o / r_i))
        self.C2 = pi * E * h**3 * log(r_o / r_i) / (12 * (r_o - r_i) ** 2)
        self.C3 = pi * (r_o**2 - 2 * r_i**2 + r_o * r_i) / 3

    def split(self, q: Sequence) -> tuple:
        N = self.N
        return q[:N], q[N : 2 * N], q[2 * N : 3 * N], q[3 * N :]

    def Phi(self, q, n: int):
        _, _, f1, f2 = self.split(q)
        return self.phi_0 + sum(f1[j] + f2[j] for j in range(n)) + f1[n]

    def tip(self, q):
        z1, z2, f1, f2 = self.split(q)
        x = sum((z1[j] + z2[j]) * sin(self.Phi(q, j)) for j in range(self.N))
        z = sum((z1[j] + z2[j]) * cos(self.Phi(q, j)) for j in range(self.N))
        return x, z, self.phi_0 + sum(f1) + sum(f2)

    def V(self, q, n: int):
        z1, z2, _, _ = self.split(q)
        return pi * (self.r_o**2 + self.r_i**2 + self.r_o * self.r_i) * (z1[n] + z2[n]) / 3

    def local(self, q, n: int):
        z1, z2, f1, f2 = (part[n] for part in self.split(q))
        r_i, r_o = self.r_i, self.r_o
        x = -r_o * r_i * (f1 + f2) / (4 * (z1 + z2))
        z = (
            2 * (r_o**2 + 3 * r_i**2 + 2 * r_o * r_i) * (z2**2 - z1**2)
            + r_o * r_i**2 * (r_o + 2 * r_i) * (f2**2 - f1**2)
        ) / (8 * (r_o**2 + r_i**2 + r_o * r_i) * (z1 + z2))
        return x, z

    def body(self, q, n: int):
        """X bar, Z bar and Phi bar + phi bar of cell n."""
        z1, z2, _, _ = self.split(q)
        x, z = self.local(q, n)
        P = self.Phi(q, n)
        X = sum((z1[j] + z2[j]) * sin(self.Phi(q, j)) for j in range(n)) + (z1[n] + z) * sin(P) + x * cos(P)
        Z = sum((z1[j] + z2[j]) * cos(self.Phi(q, j)) for j in range(n)) + (z1[n] + z) * cos(P) - x * sin(P)
        return X, Z, P + atan2(z, x)

    def inertia(self, q, n: int):
        z1, z2, f1, f2 = (part[n] for part in self.split(q))
        r_i, r_o = self.r_i, self.r_o
        x, z = self.local(q, n)
        return (
            pi * self.rho * (r_o**2 + 6 * r_i**2 + 3 * r_o * r_i) * (z1**3 + z2**3) / 30
            + pi * self.rho * r_i**2 * (r_o**2 + r_i**2 + 3 * r_o * r_i) * (z1 * f1**2 + z2 * f2**2) / 20
            + pi * self.rho * (r_o**5 - r_i**5) * (z1 + z2) / (20 * (r_o - r_i))
            - self.rho * self.V(q, n) * (x**2 + z**2)
        )

    def T(self, q, v):
        """Equation 3."""
        total = mpf(0)
        for n in range(self.N):
            dX, dZ, dP = along(lambda s, n=n: self.body(s, n), q, v)
            total += self.rho * self.V(q, n) / 2 * (dX**2 + dZ**2) + self.inertia(q, n) / 2 * dP**2
        dX, dZ, dP = along(self.tip, q, v)
        return total + self.m_tip / 2 * (dX**2 + dZ**2) + self.I_tip / 2 * dP**2

    def elastic(self, q):
        """Equation 7 summed over all frusta, without its pressure part."""
        z1, z2, f1, f2 = self.split(q)
        total = mpf(0)
        for zetas, phis, zeta0 in ((z1, f1, self.zeta0_odd), (z2, f2, self.zeta0_even)):
            k = self.C2 - 4 * self.C1 * zeta0**2
            for zeta, phi in zip(zetas, phis, strict=True):
                total += 2 * self.C1 * zeta**4 + k * zeta**2 - 2 * self.C2 * zeta0 * zeta
                total += 3 * self.C1 * self.r_i**4 / 4 * phi**4 + k / 2 * self.r_i**2 * phi**2
                total += 6 * self.C1 * self.r_i**2 * zeta**2 * phi**2
        return total

    def pressure(self, q, v, external):
        """Equation 2."""
        (flow,) = along(lambda s: (sum(self.V(s, n) for n in range(self.N)),), q, v)
        return external - self.rho / (2 * pi**2 * self.r_ch**4) * flow * abs(flow)

    def residual(self, q, v, a, external) -> list:
        """Q - d/dt(dT/dv) + dT/dq - dV/dq - dD/dv, one number a coordinate."""
        p = self.pressure(q, v, external)
        later = [x + STEP * y for x, y in zip(q, v, strict=True)], [x + STEP * y for x, y in zip(v, a, strict=True)]
        before = [x - STEP * y for x, y in zip(q, v, strict=True)], [x - STEP * y for x, y in zip(v, a, strict=True)]
        out = []
        for j in range(len(q)):
            e = [mpf(i == j) for i in range(len(q))]

            def momentum(q, v, e=e):
                up = [x + y for x, y in zip(v, e, strict=True)]
                down = [x - y for x, y in zip(v, e, strict=True)]
                return (self.T(q, up) - self.T(q, down)) / 2  # T is quadratic in v: exact

            value = -(momentum(*later) - momentum(*before)) / (2 * STEP)
            value += along(lambda s: (self.T(s, v),), q, e)[0]
            value -= along(lambda s: (self.elastic(s),), q, e)[0]
            zeta = j < 2 * self.N
            value += self.C3 * p if zeta else 0
            value -= (self.c_zeta if zeta else self.c_phi) * v[j]
            for n in range(self.N):
                value -= self.rho * self.g * self.V(q, n) * along(lambda s, n=n: self.body(s, n), q, e)[1]
            X, Z, angle = along(self.tip, q, e)
            P = self.tip(q)[2]
            force = pi * self.r_i**2 * p
            value += (self.F_X + force * sin(P)) * X + (self.F_Z + force * cos(P) - self.m_tip * self.g) * Z
            value += self.M_Y * angle
            out.append(value)
        return out


def along(function: Callable, q, direction) -> tuple:
    """Derivative of a tuple-valued function of q along a direction."""
    up = function([x + STEP * d for x, d in zip(q, direction, strict=True)])
    down = function([x - STEP * d for x, d in zip(q, direction, strict=True)])
    return tuple((b - a) / (2 * STEP) for a, b in zip(down, up, strict=True))
