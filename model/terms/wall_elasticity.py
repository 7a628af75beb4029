"""Walls that are not what the straw file says: a share of the way from equation 7 to finite elements, or back.

U = U_7 + s (U_shell - U_7), with the energy of `straw.model.terms.shell_energy`. A straw of equation 7 has s = share,
of the shipped table, which is of the paper's cone; one whose file names an elasticity has s = 1 - share: equation 7 is
at share 1. `straw.model.parameters` scales the table to the straw, `straw.model.terms.elasticity` adds both up.
"""

from straw.model.term import Constant, Term

TERM = Term(
    name="wall_elasticity",
    kind="walls",
    law="U = U_7 + s (U_shell - U_7); s = share, or 1 - share where the straw file names an elasticity",
    source="straw.model.shell, a director shell (Simo and Fox 1989); equation 7 is Almen and Laszlo's disk spring",
    strengths=("share",),
    constants=(
        Constant("share", "1", 0.0, 0.1, 1.5, "of the way from the straw's own energy to the other of the two"),
    ),
)
