"""Air between the controller and the reservoir: the reservoir's pressure lags and dips when the straw takes water.

p_r' = (p_c - p_r) / tau - Q / C,  C = V / p_0 (isothermal, linear).
"""

from straw.model.term import Constant, Term

TERM = Term(
    name="line_lag",
    kind="flow",
    law="p_r' = (p_c - p_r)/tau - Q/C, C = V/p_0",
    source="first-order pneumatic line: a restriction into a volume",
    strengths=("tau_s",),
    constants=(
        Constant("tau_s", "s", 0.0, 5e-3, 0.5, "time constant of the line"),
        Constant("air_m3", "m^3", 1e-3, 1e-5, 1.0, "V, air above the water; the larger, the smaller the dips"),
    ),
)
