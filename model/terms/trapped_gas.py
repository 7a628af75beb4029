"""Gas trapped inside the straw: what flows in through the channel partly compresses it.

v' = V' - Q,  p_inside = p_0 ((V_g / v)^n - 1),  v the gas's volume, V_g its volume at ambient pressure p_0.
"""

from straw.model.term import Constant, Term

TERM = Term(
    name="trapped_gas",
    kind="flow",
    law="v' = V' - Q, p = p_0 ((V_g/v)^n - 1)",
    source="polytropic ideal gas; compliance V_g / (n p_abs)",
    strengths=("volume_m3",),
    constants=(
        Constant("volume_m3", "m^3", 0.0, 5e-9, 2e-6, "V_g, gas inside the straw at ambient pressure"),
        Constant("exponent", "1", 1.0, 1.0, 1.4, "n: 1 isothermal, slow; 1.4 adiabatic, quick"),
    ),
)
