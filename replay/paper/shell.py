"""The paper's finite elements repeated: Fig. 4 b, c and S2 by a director shell."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.model.shell.hold import Hold
from straw.model.shell.problem import Problem
from straw.model.shell.profile import profile_of
from straw.model.shell.solve import Model, NotFoundError, Point
from straw.replay.paper.landscape import PHI_LABEL, ZETA_LABEL
from straw.replay.paper.style import figure, label
from straw.replay.shell.table import Row, reduced_frustum

Floats = NDArray[np.float64]

#: Share of the barrier within which two energies agree well: no lines of Fig. 4 would be seen apart that are nearer.
MODERATE = 0.05
#: What the paper does not state about the set-up, and what is assumed here.
INFERRED = (
    "the cuts' places are not in the text: here along phi = 0 and along the bent state's zeta = -0.27 mm",
    "radial freedom of the bases is not stated: free (held, the barrier is 60 to 320 mJ against 22)",
    "'displacement along z dictated' is read as each material point's height zeta - r_i phi cos(theta); the other "
    "reading, the deformed base in a tilted plane, is drawn dotted",
    "of the cell's rims 'identical translational motion' is read as tied in all directions; radially free is drawn too",
)


@dataclass(frozen=True)
class Cut:
    """Energies along a cut, J: where, by equation 7, by finite elements in both readings of phi."""

    at: Floats
    reduced: Floats
    shell: Floats
    plane: Floats


def specimen() -> Problem:
    """The paper's even frustum, its E and h; the mesh that `straw shell` chooses for 1e-3."""
    straw = StrawParameters()
    return Problem(profile_of(straw), float(straw.E_pa[0, 1]))


def _along(problem: Problem, places: list[tuple[float, float]]) -> Floats:
    """Energies at places one after the other, NaN from where none is found."""
    model, near = problem.model(), None
    out = np.full(len(places), np.nan)
    for i, (zeta, phi) in enumerate(places):
        try:
            near = model.at(zeta, phi, near)
        except NotFoundError:
            break
        out[i] = near.energy_j
    return out


def cuts(problem: Problem) -> tuple[Cut, Cut]:
    """Fig. 4 b (along phi = 0) and c (along the bent state's zeta, phi of zero and above)."""
    flat = reduced_frustum(problem)
    bent = next(e.zeta_m for e in flat.equilibria() if e.stable and e.phi_rad > 0)
    zeta, phi = np.linspace(-3.4e-3, 3.2e-3, 67), np.linspace(0, 0.34, 35)
    straight = _along(problem.axisymmetric(), [(float(z), 0.0) for z in zeta])
    plane = replace(problem, hold=Hold("plane"))
    tilted = [(bent, float(f)) for f in phi]
    return (
        Cut(zeta, flat.energy(zeta, np.zeros_like(zeta)), straight, straight),
        Cut(phi, flat.energy(np.full_like(phi, bent), phi), _along(problem, tilted), _along(plane, tilted)),
    )


def draw_cuts(made: tuple[Cut, Cut]) -> Figure:
    """Fig. 4 b and c, as the paper draws them: finite elements black, equation 7 orange and dashed."""
    fig = figure(9, 3.4)
    for axes, cut, title, name, scale in zip(
        fig.subplots(1, 2),
        made,
        ("(b) along φ = 0", "(c) along ζ = -0.27 mm"),
        (ZETA_LABEL, PHI_LABEL),
        (1e3, 1.0),
        strict=True,
    ):
        axes.plot(scale * cut.at, 1e3 * cut.shell, color="black", label="finite elements")
        axes.plot(scale * cut.at, 1e3 * cut.reduced, color="#e08a1e", ls="--", label="equation 7")
        if scale == 1.0:
            axes.plot(cut.at, 1e3 * cut.plane, color="#888888", ls=":", label="finite elements, base in a tilted plane")
        axes.set_ylim(-2, 40)
        label(axes, title, name, "energy / mJ")
    fig.axes[1].legend(loc="upper left")
    return fig


def agreement(made: tuple[Cut, Cut]) -> list[str]:
    """Where 'very good agreement at moderate values' holds, in figures."""
    lines = []
    between = np.abs(made[0].at) < abs(float(StrawParameters().zeta0_m[0, 1]))
    near = MODERATE * float(made[0].reduced[between].max()) * 1e3
    for cut, unit, scale, bounds, start in (
        (made[0], "mm", 1e3, (2.5, 3.0, 3.4), float(StrawParameters().zeta0_m[0, 1])),
        (made[1], "rad", 1.0, (0.15, 0.22, 0.28, 0.34), 0.0),
    ):
        off = np.abs(cut.shell - cut.reduced) * 1e3
        low, high = (scale * x for x in _within(cut.at, off <= near, start))
        name, where = ("zeta", "phi = 0") if unit == "mm" else ("phi", "zeta = -0.27 mm")
        lines.append(
            f"{name} from {low:.2f} to {high:.2f} {unit} ({where}): within {near:.1f} mJ, {MODERATE:.0%} of the barrier"
        )
        for bound in bounds:
            inside = np.abs(scale * cut.at) <= bound + 1e-9
            worst = float(np.nanmax(off[inside]))
            lines.append(f"|{name}| up to {bound:g} {unit} ({where}): off by {worst:.1f} mJ at most")
    return lines


def _within(at: Floats, good: NDArray[np.bool_], start: float) -> tuple[float, float]:
    """The places around ``start`` up to which all are good; twice the start where it is not."""
    begin = int(np.argmin(np.abs(at - start)))
    if not good[begin]:
        return start, start
    below, above = np.flatnonzero(~good[:begin]), np.flatnonzero(~good[begin:])
    low = int(below[-1]) + 1 if below.size else 0
    high = begin + int(above[0]) - 1 if above.size else len(at) - 1
    return float(at[low]), float(at[high])


@dataclass(frozen=True)
class Rigid:
    """The even frustum's own motion in a cell whose bases are dictated: (zeta, phi) by rims tied, and free."""

    dictated: Floats
    tied: Floats
    free: Floats


def rigidity() -> tuple[Rigid, Rigid]:
    """Fig. S2: both frusta of equal thickness compliant, along phi = 0 and along the bent state's height."""
    straw = StrawParameters()
    odd = float(straw.zeta0_m[0, 0])
    profile = profile_of(straw, whole=True)
    heights = np.linspace(odd - 2.8e-3, odd + 2.8e-3, 29)
    angles = np.linspace(0, 0.26, 14)
    bent = odd - 0.2735e-3
    out = []
    for dictated, places in (
        (heights, [(float(z), 0.0) for z in heights]),
        (angles, [(bent, float(f)) for f in angles]),
    ):
        found = []
        for rims in ("tied", "free"):
            problem = Problem(profile, float(straw.E_pa[0, 1]), hold=Hold(rims=rims))
            found.append(_even_motion(problem.axisymmetric() if dictated is heights else problem, places))
        out.append(Rigid(dictated, *found))
    return out[0], out[1]


def _even_motion(problem: Problem, places: list[tuple[float, float]]) -> Floats:
    """zeta and phi of the even frustum alone (n, 2): means of its two rims' heights and tilts around the wall."""
    model, near = problem.model(), None
    out = np.full((len(places), 2), np.nan)
    for i, (zeta, phi) in enumerate(places):
        try:
            near = model.at(zeta, phi, near)
        except NotFoundError:
            break
        out[i] = even_frustum(model, near)
    return out


def even_frustum(model: Model, point: Point) -> tuple[float, float]:
    """Height and angle of a cell's upper frustum between its rims, as a rigid body's: means over the rims."""
    q = model.held.place(point.y, point.zeta_m, point.phi_rad)
    upper = model.shell.coefficients(q, 1)
    r_o, r_i = (float(model.shell.coefficients(model.shell.unloaded, 1)[n, 0, 1]) for n in (0, -1))
    height = float(upper[-1, 2, 0] - upper[0, 2, 0])
    return height, float(upper[0, 2, 1] / r_o - upper[-1, 2, 1] / r_i)


def draw_rigidity(made: tuple[Rigid, Rigid]) -> Figure:
    """Fig. S2 a, b: the even frustum's deformation against what is dictated of the cell."""
    odd = float(StrawParameters().zeta0_m[0, 0])
    fig = figure(9, 3.4)
    for k, (axes, one) in enumerate(zip(fig.subplots(1, 2), made, strict=True)):
        scale = 1e3 if k == 0 else 1.0
        ideal = one.dictated - odd if k == 0 else one.dictated
        axes.plot(scale * one.dictated, scale * ideal, color="#e08a1e", ls="--", label="odd frustum rigid")
        axes.plot(scale * one.dictated, scale * one.tied[:, k], color="black", label="finite elements, rims tied")
        axes.plot(scale * one.dictated, scale * one.free[:, k], color="#888888", ls=":", label="rims radially free")
        names = (("dictated zeta / mm", ZETA_LABEL), ("dictated phi / rad", PHI_LABEL))[k]
        label(axes, ("(a) along φ = 0", "(b) along the bent state's height")[k], *names)
    fig.axes[0].legend(loc="upper left")
    return fig


def rigidity_rows(made: tuple[Rigid, Rigid]) -> list[Row]:
    """How far the even frustum is from 'odd rigid', at most; reduced: zero by assumption."""
    odd = float(StrawParameters().zeta0_m[0, 0])
    height, angle = made
    rows = []
    for name, found in (("tied", "tied"), ("radially free", "free")):
        off = np.nanmax(np.abs(getattr(height, found)[:, 0] - (height.dictated - odd)))
        rows.append(Row(f"rigid odd frustum's error along phi = 0, rims {name}", "mm", 0.0, 1e3 * float(off)))
        off = np.nanmax(np.abs(getattr(angle, found)[:, 1] - angle.dictated))
        rows.append(Row(f"its error in phi along the bent height, rims {name}", "rad", 0.0, float(off)))
    return rows
