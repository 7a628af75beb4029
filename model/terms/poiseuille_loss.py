"""Laminar loss in the channel, beside the base model's Bernoulli loss: dp = R Q."""

from straw.model.term import Constant, Term

TERM = Term(
    name="poiseuille_loss",
    kind="flow",
    law="dp = R Q, R = 8 mu l / (pi r^4)",
    source="Hagen-Poiseuille",
    strengths=("resistance_pa_s_per_m3",),
    constants=(
        Constant(
            "resistance_pa_s_per_m3", "Pa s/m^3", 0.0, 1e8, 1e10, "R; 4e9 is 50 mm of water channel of r = 0.43 mm"
        ),
    ),
)
