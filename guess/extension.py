"""A motion with one more event: one of its phases, bent to a surface and cut there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dmoc.guess.tracking import reflected
from dmoc.guess.transfer import Piece
from dmoc.mechanics.contacts import NOWHERE
from dmoc.problem.contacts import onto_surface, onto_switch
from dmoc.problem.problem import Problem


def with_event(
    problem: Problem, pieces: Sequence[Piece], i: int, surface: int, switch: int = NOWHERE
) -> list[Piece]:
    """The pieces of a motion with one more event in phase i: it is bent to touch a surface, or to
    pass a switch, where it comes closest to it, or cut in its middle where there is neither."""
    piece = pieces[i] if len(pieces[i].t) > 2 else pieces[i].with_node(0)
    steps = len(piece.t) - 1
    k, q, rates = steps // 2, piece.q, [piece.v[: steps // 2 + 1], piece.v[steps // 2 :]]
    if surface != NOWHERE or switch != NOWHERE:
        first = max(1, steps // 10)
        inner = slice(first, steps - first + 1)
        if surface != NOWHERE:
            gaps = problem.model.gaps(piece.q, piece.t)[inner, surface]
            k = int(np.argmax(gaps)) + first
            met = onto_surface(problem, piece.q[k], surface, float(piece.t[k]))
        else:
            w = problem.model.crossings(piece.q, piece.v, piece.t)[inner, switch]
            passes = np.flatnonzero((w[:-1] < 0) & (w[1:] >= 0))
            k = int(passes[0] if len(passes) else np.argmax(w)) + first
            there = piece.q[[k]], piece.v[[k]], piece.t[[k]]
            met = onto_switch(problem, *there, switch)[0]
        bend = np.zeros(problem.nq) if met is None else met - piece.q[k]
        share = np.concatenate([np.linspace(0, 1, k + 1), np.linspace(1, 0, steps - k + 1)[1:]])
        q = piece.q + share[:, None] * bend
        rates = [
            piece.v[part] + sign * bend / np.ptp(piece.t[part])
            for part, sign in ((slice(k + 1), 1), (slice(k, None), -1))
        ]
    before = replace(piece, t=piece.t[: k + 1], q=q[: k + 1], v=rates[0], forces={})
    after = replace(piece, t=piece.t[k:], q=q[k:], v=rates[1], forces={})
    return [*pieces[:i], before, after, *pieces[i + 1 :]]


def impulse_between(problem: Problem, before: Piece, after: Piece, surface: int) -> float:
    """The impulse of a surface that is hit between two pieces, by the rate before; 0 for none."""
    if surface == NOWHERE:
        return 0.0
    return reflected(problem, after.q[0], before.v[-1], surface, float(after.t[0]))[1]
