"""A law of one's own: creases that harden with the third power. `straw check hardening.py` checks it."""

from straw import Constant, Law


def force(f, k):  # type: ignore[no-untyped-def]
    """N on the frustum's height, N m on its angle; plain Python of numbers, which straw compiles."""
    return -k[0] * (f.zeta - f.zeta0) ** 3, 0.0


def energy(f, k):  # type: ignore[no-untyped-def]
    """J, of which the force is minus the slope; a law that only brakes has none."""
    return k[0] * (f.zeta - f.zeta0) ** 4 / 4


LAW = Law(
    name="hardening",
    law="F = -k (zeta - zeta_0)^3",
    source="a spring of third power (Duffing), the weakest that is odd and not linear",
    constants=(Constant("k_n_per_m3", "N/m^3", 0.0, 1e5, 1e8, "k"),),
    force=force,
    energy=energy,
)
