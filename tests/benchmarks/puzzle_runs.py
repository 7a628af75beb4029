"""The paper's puzzle as recordings: a folding run, four repetitions of a deployment, two runs of other kinds.

One specimen of the independent apparatus, with what the paper says its model leaves out: squeeze film between frusta
that nearly touch, fluid inertia, cohesion of the faces that weakens with each cycle, and a weaker cell 4.
"""

from __future__ import annotations

from straw.rig.run import Run
from tests.apparatus.campaign import campaign
from tests.apparatus.effects import Cause
from tests.apparatus.layout import CELLS
from tests.apparatus.plans import WITHOUT_1_4, step
from tests.apparatus.straw import Straw

WEAK_CELL, WEAKER = 4, 0.08
SPECIMEN = Straw(
    c_zeta=2.0,
    c_phi=4e-3,
    weaker=tuple(1.0 - WEAKER * (cell == WEAK_CELL) for cell in range(1, CELLS + 1)),
).with_laws(FILM_TILT=8.4e-5)  # m^2: of a ring as wide as the frusta
CAUSES = (
    Cause("squeeze_film", 8e3, "disk with gap floor, h^-3"),
    Cause("fluid_inertia", 1e8, "channel and filled straw"),
    Cause("cohesion", 6.0, "binding curve"),
)
REPETITIONS = tuple(step(f"deploy-35kPa-{k + 1}", 35, WITHOUT_1_4, k, 4.5) for k in range(4))
PLANS = (
    *REPETITIONS,
    step("fold-25kPa", -25, (1, 4), 4, 3.5),
    step("fold-20kPa", -20, (1, 4), 5, 4.0),
    step("deploy-40kPa-2-6", 40, (1, 3, 4, 5, 7, 8, 9), 5, 4.0),
)
#: Runs not used in any fit: a repetition, and two of other kinds (another pressure; other cells).
HELD_OUT = ("deploy-35kPa-3", "fold-20kPa", "deploy-40kPa-2-6")


def recordings(seed: int) -> tuple[Run, ...]:
    """The runs as ``straw diagnose`` would read them; the seed draws noise and the scatter of repeats."""
    return campaign(CAUSES, seed, plans=PLANS, name="puzzle", straw=SPECIMEN)
