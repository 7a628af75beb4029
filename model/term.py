"""What a term of the physics is: a name, its law and source, its constants, and the compiled function that acts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError

Floats = NDArray[np.float64]

#: No row of `straw.model.terms.shell_energy`.
EQUATION_7: Floats = np.zeros(1)


class Frustum(NamedTuple):
    """One frustum at one moment, as a frustum term sees it; SI."""

    zeta: float  # height, m
    phi: float  # bending angle, rad
    d_zeta: float  # m/s
    d_phi: float  # rad/s
    zeta0: float  # unloaded height, m
    C1: float  # equation 6
    C2: float  # equation 6
    c_zeta: float  # equation 4
    c_phi: float  # equation 4
    r_i: float  # m
    r_o: float  # m
    cycle: float  # how often the specimen was cycled before this run
    wall: Floats = EQUATION_7  # a row of `straw.model.terms.shell_energy`; equation 7 where its first number is zero
    pressure: float = 0.0  # inside, Pa
    time_s: float = 0.0  # from the run's start, or from the straw's ``zero_time_s`` where that is given


@dataclass(frozen=True)
class Constant:
    """One constant of a term. Its value may differ from frustum to frustum; ``low`` to ``high`` is plausible."""

    name: str  # with its unit, as in a straw file
    unit: str
    default: float  # zero for a strength
    low: float
    high: float
    about: str


@dataclass(frozen=True)
class Term:
    """A law added to the straw. With all its strengths zero it changes nothing.

    ``kind`` says where it acts:

    * ``frustum``: ``force(f: Frustum, k) -> (N, N m)`` on zeta and phi of each frustum; ``energy(f, k)`` in J where
      the force derives from one, else it must not add energy;
    * ``memory``: the force on zeta and phi is itself a state. ``force(f, k, zeta_n, phi_n_m, step_s)`` takes the
      values known before an implicit step (q = known + step_s q') and returns those after it, minus the force.
      Its first constant is its strength;
    * ``body``: ``force(c, k, chain, load)`` adds to the bodies along the straw;
    * ``walls``: constants of the frusta's own energy; taken by `straw.model.parameters` and
      `straw.model.terms.elasticity`;
    * ``flow``: constants of the inlet, taken by `straw.model.channel`.
    """

    name: str  # the cause's name in the contract, if it is one
    law: str
    source: str
    constants: tuple[Constant, ...]
    force: Any = None
    energy: Any = None
    kind: str = "frustum"
    strengths: tuple[str, ...] = ()  # the first constant, where none is named
    rising: tuple[tuple[str, ...], ...] = ()  # constants that are points of a table: each beyond the one before
    cause: bool = True  # one of the contract's; a table stands for what none of them explains

    def __post_init__(self) -> None:
        names = [c.name for c in self.constants if isinstance(c, Constant)]
        if not names:
            raise ModelError(f"law {self.name}: has no constants; its strength is one, straw.Constant(name, unit, ...)")
        object.__setattr__(self, "strengths", tuple(self.strengths) or (names[0],))
        object.__setattr__(self, "constants", tuple(self.constants))
        for name in self.strengths:
            if name not in names:
                raise ModelError(f"law {self.name}: strength {name} is not among its constants {', '.join(names)}")
        for c in self.constants:
            if isinstance(c, Constant) and c.name in self.strengths and c.default != 0:
                raise ModelError(
                    f"law {self.name}: strength {c.name} is {c.default} by default; it must be 0: not there"
                )


#: What `straw.Law` is.
Law = Term
