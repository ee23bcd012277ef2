"""Motions folded at the surfaces: random smooth ones, mirrored wherever they pass a surface, so
that they touch where they do and say a sequence of hits by themselves.

Their inputs are those that the folded motion needs: nearly all relaxed programs are solved from
such starts, few from those without inputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import natural_time
from dmoc.guess.extension import impulse_between, with_event
from dmoc.guess.inverse_dynamics import inputs_for
from dmoc.guess.random_motions import FEW_IN_TURN, random_motions
from dmoc.guess.transfer import Piece, equally_long, unknowns_along
from dmoc.mechanics.algebra import solved
from dmoc.problem.design import designed_as
from dmoc.problem.problem import Problem
from dmoc.program.layout import Layout

# Nodes of a motion that is folded, and surfaces one after the other that it is folded at.
NODES, FOLDS = 96, 6
# Share of a motion between two hits, at least: closer ones are one.
APART = 0.02


@dataclass(frozen=True)
class Folded:
    """A motion with hits: their surfaces, its pieces between them, and their impulses; "" is an
    event at which nothing is hit."""

    hits: tuple[str, ...]
    pieces: tuple[Piece, ...]
    impulses: tuple[float, ...]

    def unknowns(self, problem: Problem) -> Array:
        """Unknowns of a problem with its events along the pieces, shape (n,)."""
        return unknowns_along(problem, self.pieces, self.impulses)

    def between_hits(self) -> Folded:
        """The same motion without events other than hits."""
        first, *rest = self.pieces
        pieces, kept = [first], list[tuple[str, float]]()
        for name, impulse, piece in zip(self.hits, self.impulses, rest, strict=True):
            if name:
                kept.append((name, impulse))
                pieces.append(piece)
            else:
                pieces[-1] = pieces[-1].followed_by(piece)
        return Folded(tuple(n for n, _ in kept), tuple(pieces), tuple(p for _, p in kept))

    def hitting(self, problem: Problem, i: int, surface: int) -> Folded:
        """The motion, bent to one hit more in its phase i. Phases take equally long, because the
        place of the cut tells little about when the hit shall be."""
        problem = designed_as(problem, self.pieces[0].parameters)
        bent = with_event(problem, self.pieces, i, surface)
        if not problem.explicit_time:  # else the surface, too, is where it is at its time
            bent = equally_long(bent)
        impulse = impulse_between(problem, bent[i], bent[i + 1], surface)
        hits, impulses = list(self.hits), list(self.impulses)
        hits.insert(i, problem.kernels.surfaces[surface])
        impulses.insert(i, impulse)
        return Folded(tuple(hits), tuple(bent), tuple(impulses))


def folded_motions(
    problem: Problem, mirrors: Sequence[int], numbers: range, seed: int
) -> Iterator[Folded]:
    """The random motions of a problem without events with some numbers, folded at all surfaces and
    with hits of ``mirrors``; those that stay beyond a surface are left out."""
    plain = problem.meshed(NODES)
    lay, names = Layout.of(plain), problem.kernels.surfaces
    grips = problem.touch.contacts.pull
    kept = [j for j, name in enumerate(names) if name not in problem.ignored and not grips[j]]
    with np.errstate(all="ignore"):
        for x in random_motions(plain, [], natural_time(plain), numbers, seed, FEW_IN_TURN):
            own = lay.problem_at(problem, x)
            folded = _folded(own, lay.times(x), x[lay.index_q], kept, mirrors)
            if folded is not None:
                yield folded


def _folded(
    problem: Problem, t: Array, q: Array, walls: Sequence[int], mirrors: Sequence[int]
) -> Folded | None:
    events = list[tuple[float, int]]()
    for _ in range(FOLDS):
        gaps = problem.model.gaps(q, t)[:, walls]
        gaps[[0, -1]] = np.minimum(gaps[[0, -1]], 0.0)
        if not np.isfinite(gaps).all():
            return None
        if (gaps <= 0).all():
            break
        column = int(np.argmax(gaps.max(axis=0)))
        j, gap = walls[column], gaps[:, column]
        beyond = gap > 0
        if j in mirrors:
            k = np.flatnonzero(np.diff(beyond))
            share = gap[k] / (gap[k] - gap[k + 1])
            events += [(float(at), j) for at in t[k] + share * (t[k + 1] - t[k])]
        q[beyond] += _mirrored(problem, q[beyond], t[beyond], j)
    else:
        return None
    return _cut(problem, t, q, _apart(events, float(np.ptp(t))))


def _mirrored(problem: Problem, q: Array, t: Array, j: int) -> Array:
    """Moves of positions beyond surface j to their mirror images, measured by the masses, shape (n,
    nq), for q (n, nq) and t (n,)."""
    n = problem.model.gap_slopes(q, t)[:, j, :-1]
    back = solved(problem.model.mass(q, t), n)
    share = problem.model.gaps(q, t)[:, j] / (n * back).sum(axis=1)
    return np.asarray(-2 * share[:, None] * back)


def _apart(events: list[tuple[float, int]], length: float) -> list[tuple[float, int]]:
    """Events in their order, without those that follow another one at once."""
    kept = list[tuple[float, int]]()
    for at, j in sorted(events):
        before = kept[-1][0] if kept else 0.0
        if at - before > APART * length and length - at > APART * length:
            kept.append((at, j))
    return kept


def _cut(problem: Problem, t: Array, q: Array, events: list[tuple[float, int]]) -> Folded:
    """Positions cut at events, which lie on their surfaces."""
    times = [float(t[0]), *(at for at, _ in events), float(t[-1])]
    ends = [q[0], *(_onto(problem, t, q, at, j) for at, j in events), q[-1]]
    pieces = []
    for k in range(len(times) - 1):
        inside = (t > times[k]) & (t < times[k + 1])
        at = np.concatenate([[times[k]], t[inside], [times[k + 1]]])
        nodes = np.vstack([ends[k], q[inside], ends[k + 1]])
        near = np.concatenate([[True], np.diff(at) > 1e-9 * np.ptp(t)])
        near[-1], near[-2] = True, near[-2] and near[-1]
        pieces.append(_driven(problem, at[near], nodes[near]))
    impulses = [_impulse(problem, pieces[k], pieces[k + 1], j) for k, (_, j) in enumerate(events)]
    names = problem.kernels.surfaces
    return Folded(tuple(names[j] for _, j in events), tuple(pieces), tuple(impulses))


def _driven(problem: Problem, t: Array, q: Array) -> Piece:
    """Positions with the rates and the inputs that they need."""
    middle, rate = (t[:-1] + t[1:]) / 2, np.diff(q, axis=0) / np.diff(t)[:, None]
    a = np.gradient(rate, middle, axis=0) if len(middle) > 1 else np.zeros_like(rate)
    u = inputs_for(problem, problem.model, (q[:-1] + q[1:]) / 2, rate, a, middle)
    v, u = np.gradient(q, t, axis=0), np.clip(u, *problem.input_bounds.T)
    design = dict(zip(problem.design, problem.design_values.tolist(), strict=True))
    return Piece(t, q, v, middle, u, parameters=design)


def _onto(problem: Problem, t: Array, q: Array, when: float, j: int) -> Array:
    """The position at a time, moved onto a surface."""
    at = np.array([[np.interp(when, t, c) for c in q.T]])
    for _ in range(3):
        at = at + _mirrored(problem, at, np.array([when]), j) / 2
    return np.asarray(at[0])


def _impulse(problem: Problem, before: Piece, after: Piece, j: int) -> float:
    """The impulse of a surface that changes the rate of its gap as much as the motion does."""
    q, t = after.q[0], float(after.t[0])
    n = problem.model.gap_slopes(q, t)[j, :-1]
    square = float(n @ solved(problem.model.mass(q, t), n))
    return max(float(n @ (before.v[-1] - after.v[0])), 0.0) / square
