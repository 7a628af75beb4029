"""Walls that are not what equation 7 says: a share of the way from it to what finite elements of the cone give.

U = U_7 + s (U_shell - U_7), with the energy of `straw.model.terms.shell_energy`; `straw.model.parameters` scales it to
the straw, from the paper's cone or from the one that the straw file names, and `straw.model.terms.elasticity` adds it
up.
"""

from straw.model.term import Constant, Term

TERM = Term(
    name="wall_elasticity",
    kind="walls",
    law="U = U_7 + s (U_shell - U_7)",
    source="straw.model.shell, a director shell (Simo and Fox 1989); equation 7 is Almen and Laszlo's disk spring",
    strengths=("share",),
    constants=(Constant("share", "1", 0.0, 0.1, 1.5, "s; 1 is the finite elements' energy, 0 equation 7"),),
    cause=False,  # no hypothesis of the diagnosis until it has been tried on concealed straws
)
