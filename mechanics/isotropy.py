"""Whether a contact is hit as a ball is: its normal impulse changes no sliding velocity, and its
tangential one changes that by the same share in all directions."""

from __future__ import annotations

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model


def coupled(model: Model, surface: int, q: Array, t: float) -> str:
    """Why the hit of a surface whose tangent has two directions is none of a ball at a position,
    shape (nq,); empty where it is one, or where the tangent has one direction.

    With the directions D = (-grad g, s_1, s_2) of the rates, the law of a ball holds where
    D M^-1 D^T is diagonal and both tangential entries are the same.
    """
    if surface not in model.contacts.in_space:
        return ""
    along = list(model.contacts.tangents_of(surface))
    normal = -model.gap_slopes(q, t)[surface, :-1]
    D = np.vstack([normal, model.tangent_slopes(q, t)[along, :-1]])
    A = D @ model.responses(q, D, t)
    size = np.sqrt(np.outer(np.diag(A), np.diag(A)))
    name = model.kernels.surfaces[surface]
    if not np.abs(A[0, 1:]).max() <= SAME * size[0, 1:].min():
        return (
            f"the normal impulse of {name!r} changes its sliding velocity, so that this turns in a "
            "hit, for which no law is known in space: expected a ball, or another body with the "
            "centre of mass above the point that is hit; give the tangent one direction, or leave "
            "it out"
        )
    if not max(abs(A[1, 2]), abs(A[1, 1] - A[2, 2])) <= SAME * size[1:, 1:].max():
        return (
            f"a tangential impulse of {name!r} changes one sliding velocity more than the other, "
            "so that sliding turns in a hit, for which no law is known in space: expected a ball, "
            "or the same moment of inertia about both directions, which have the same unit and "
            "are perpendicular; give the tangent one direction, or leave it out"
        )
    return ""
