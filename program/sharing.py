"""Forces of contacts of which a motion determines only some sums, shared among them.

Where conditions of a mode follow from others (:mod:`dmoc.mechanics.redundancy`), other forces have
the same effect.  A result has those of least squares, measured by the masses that they move, as far
as the contacts bear them: on the way there from the forces of the solution none begins to pull, and
none leaves its cone of friction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.model import Model
from dmoc.problem.problem import Problem

# Singular values below this share of the largest are those of forces without effect.
WITHOUT_EFFECT = 1e-8


class Forces(NamedTuple):
    """Rows of forces or impulses of all surfaces (n, nc), tangents (n, nt) and joints (n, nj)."""

    normal: Array
    tangential: Array
    joint: Array


def shared(model: Model, mode: Mode, at: tuple[Array, Array], forces: Forces) -> Forces:
    """Forces with the same effect in a mode, at rows of positions and times."""
    closed, stuck = list(mode.closed), list(mode.sticking)
    B, mass = _pushes(model, mode, *at), model.mass(*at)
    B = B / np.sqrt(np.abs(np.diagonal(mass, axis1=1, axis2=2)))[:, None, :]
    size = np.linalg.norm(B, axis=2)
    size = np.where(size > 0, size, 1.0)
    own = np.hstack([forces.normal[:, closed], forces.tangential[:, stuck], forces.joint])
    effect = np.swapaxes(B / size[..., None], 1, 2)
    least = np.linalg.pinv(effect, rcond=WITHOUT_EFFECT) @ (effect @ (own * size)[..., None])
    change = _spread(model, mode, least[..., 0] / size - own)
    share = _borne(model, mode, forces, change)[:, None]
    return Forces(*(a + share * b for a, b in zip(forces, change, strict=True)))


def in_words(problem: Problem) -> str:
    """What is shared in the phases of a problem; empty where all forces are determined."""
    parts = [
        f"{what} of {' and '.join(names)} in phase {i}"
        for i, follows in enumerate(problem.redundant)
        for what, names in (("forces", follows.pressing), ("friction", follows.rubbing))
        if names
    ]
    if not parts:
        return ""
    return f"only sums are determined of {', '.join(parts)}: shared by least squares"


def _pushes(model: Model, mode: Mode, q: Array, t: Array) -> Array:
    """Directions in which units of the forces of closed contacts, with the friction of those that
    slide, of what sticks and of joints push, shape (n, m, nq)."""
    along = model.tangent_slopes(q, t)[..., :-1]
    normal = -model.gap_slopes(q, t)[..., :-1]
    for k, s in mode.sliding:
        if model.supports[k] != RAIL:
            normal[:, model.supports[k]] -= s * model.friction[..., k, None] * along[:, k]
    held = along[:, list(mode.sticking)], model.joint_slopes(q, t)[..., :-1]
    return np.concatenate([normal[:, list(mode.closed)], *held], axis=1)


def _spread(model: Model, mode: Mode, change: Array) -> Forces:
    """Changes (n, m) of the forces of a mode as those of all surfaces, tangents and joints."""
    normal, tangential = (np.zeros((len(change), size)) for size in (model.nc, model.nt))
    held = len(mode.closed), len(mode.closed) + len(mode.sticking)
    normal[:, list(mode.closed)] = change[:, : held[0]]
    tangential[:, list(mode.sticking)] = change[:, held[0] : held[1]]
    for k, s in mode.sliding:
        if model.supports[k] != RAIL:
            tangential[:, k] = -s * model.friction[..., k] * normal[:, model.supports[k]]
    return Forces(normal, tangential, change[:, held[1] :])


def _borne(model: Model, mode: Mode, forces: Forces, change: Forces) -> Array:
    """The share of a change that contacts and friction bear, shape (n,)."""

    def spare(normal: Array, tangential: Array) -> Array:
        holds = model.bearing(normal)[:, list(mode.sticking)]
        rubs = tangential[:, list(mode.sticking)]
        return np.hstack([normal[:, list(mode.closed)], holds - rubs, holds + rubs])

    now = spare(forces.normal, forces.tangential)
    then = spare(forces.normal + change.normal, forces.tangential + change.tangential)
    with np.errstate(divide="ignore", invalid="ignore"):
        until = np.where(then < 0, np.maximum(now, 0.0) / (now - then), 1.0)
    return np.asarray(np.clip(until, 0.0, 1.0).min(axis=1, initial=1.0))
