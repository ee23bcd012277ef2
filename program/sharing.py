"""Forces of contacts of which a motion determines only some sums, shared among them.

Where conditions of a mode follow from others (:mod:`dmoc.mechanics.redundancy`), other forces have
the same effect.  A result has those of least squares, measured by the masses that they move, as far
as the contacts bear them: on the way there from the forces of the solution none begins to pull, and
none leaves its cone of friction.
"""

from __future__ import annotations

import numpy as np

from dmoc.base.tolerances import DEPENDENT
from dmoc.codegen.kernels import Array
from dmoc.mechanics.conditions import Conditions, Forces, conditions_of
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.problem.problem import Problem


def shared(model: Model, mode: Mode, at: tuple[Array, Array], forces: Forces) -> Forces:
    """Forces with the same effect in a mode, shared by least squares, at rows of positions and
    times, shapes (n, nq) and (n,); forces have n rows."""
    kept, mass = conditions_of(model, mode), model.mass(*at)
    B = kept.pushes(model, *at) / np.sqrt(np.abs(np.diagonal(mass, axis1=1, axis2=2)))[:, None, :]
    size = np.linalg.norm(B, axis=2)
    size = np.where(size > 0, size, 1.0)
    own, effect = kept.gathered(forces), np.swapaxes(B / size[..., None], 1, 2)
    least = np.linalg.pinv(effect, rcond=DEPENDENT) @ (effect @ (own * size)[..., None])
    change = kept.changes(model, least[..., 0] / size - own)
    share = _borne(model, kept, forces, change)[:, None]
    return Forces(*(a + share * b for a, b in zip(forces, change, strict=True)))


def in_words(problem: Problem) -> str:
    """Say which forces the phases of a problem share; empty where all forces are determined."""
    parts = [
        f"{what} of {' and '.join(names)} in phase {i}"
        for i, follows in enumerate(problem.redundant)
        for what, names in (("forces", follows.pressing), ("friction", follows.rubbing))
        if names
    ]
    if not parts:
        return ""
    return f"only sums are determined of {', '.join(parts)}: shared by least squares"


def _borne(model: Model, kept: Conditions, forces: Forces, change: Forces) -> Array:
    """The share of a change that contacts and friction bear, shape (n,)."""
    now, whole = (
        kept.margins(model, of)
        for of in (forces, Forces(*(a + b for a, b in zip(forces, change, strict=True))))
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        until = np.where(whole < 0, np.maximum(now, 0.0) / (now - whole), 1.0)
    return np.asarray(np.clip(until, 0.0, 1.0).min(axis=1, initial=1.0))
