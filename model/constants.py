"""Constants: one straw's numbers as the compiled equations take them; names and equation numbers are the paper's."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Constants(NamedTuple):
    """Made by `StrawParameters.constants`; SI, per-frustum arrays (cells, 2) with the odd frustum first."""

    cells: int
    active: int  # frusta of a cell that move: 2 in the full form, 1 (the even one) in the truncated form
    r_i: float
    r_o: float
    rho: float
    g: float
    phi_0: float
    m_tip: float
    I_tip: float
    F_X: float
    F_Z: float
    M_Y: float
    loss: float  # rho / (2 pi^2 r_ch^4), equation 2
    S: float  # dV/dzeta of any frustum
    C3: float  # equation 6a
    zeta0: Floats
    C1: Floats  # equation 6
    C2: Floats  # equation 6
    wall: Floats  # (cells, 2, straw.model.terms.shell_energy.ROW) what takes the place of C1, C2; zero for equation 7
    c_zeta: Floats  # equation 4
    c_phi: Floats  # equation 4
    cycle: float  # how often the specimen was cycled before the run
    start_s: float  # when the run starts, in the time that laws may depend on
    plain: bool  # no frustum term beyond the base model
    acts: NDArray[np.bool_]  # (straw.model.terms.TERMS,) which of the frusta's terms beyond the base model act
    remembers: bool  # a term with memory among them
    terms: Floats  # (cells, 2, straw.model.terms.WIDTH) constants of the terms the base model lacks
