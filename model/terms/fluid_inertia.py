"""Inertia of the fluid in the channel: it takes pressure to change the flow, dp = I dQ/dt."""

from straw.model.term import Constant, Term

TERM = Term(
    name="fluid_inertia",
    kind="flow",
    law="dp = I dQ/dt, I = rho l / (pi r^2)",
    source="inertance of a pipe (Munson, Fundamentals of Fluid Mechanics, unsteady Bernoulli)",
    strengths=("inertance_kg_per_m4",),
    constants=(Constant("inertance_kg_per_m4", "kg/m^4", 0.0, 1e6, 3e8, "I; 1e8 is 60 mm of channel of r = 0.43 mm"),),
)
