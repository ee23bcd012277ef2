"""Why a problem has no feasible point, in the user's words and units.

The motion of least violation is sought once more with the constraints priced as a user would: what
the laws of motion say (momentum and energy) costs most to violate, so that the violation moves to
what the user asked for - goal, contacts, gaps, path constraints, times - and the bounds that then
carry multipliers are those that stand against it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.base.tolerances import TINY
from dmoc.codegen.kernels import Array
from dmoc.guess.hits import jams
from dmoc.motion.friction import STICK
from dmoc.problem.problem import Problem
from dmoc.program.active_constraints import active_bounds
from dmoc.program.blocks import Block, Index
from dmoc.program.layout import Layout
from dmoc.program.minimal_times import phase_minimal_time
from dmoc.program.scale import Scale
from dmoc.program.transcription import Transcription
from dmoc.solvers.ipm import least_violation, solve_ipm
from dmoc.solvers.judge import INFEASIBLE
from dmoc.solvers.outcome import Options, Status

# Share of the largest violation below which another is not worth a word.
NEGLIGIBLE = 1e-3
# Share of the largest multiplier below which a bound does not count as holding something up.
FAINT = 1e-5
# Share by which an estimated shortest time must exceed what is allowed to be mentioned.
CLEARLY = 1e-3
# Iterations that an explanation is worth.
ITERATIONS = 300
MOST_LINES = 4


@record(frozen=True, eq=False)
class Diagnosis:
    """Least violation of a problem.

    ``x`` are its unknowns, ``violation`` the largest violation relative to the size of the
    constraint, ``least`` whether the search for it ended at a minimum, ``missed`` what is not met
    and by how much, ``against`` the bounds and constraints that hold it there, ``times`` what the
    shortest collision times say and which hits would jam, ``pulls`` how strongly contacts would
    have to pull for a motion.
    """

    x: Array
    violation: float
    least: bool
    missed: tuple[str, ...]
    against: tuple[str, ...]
    times: tuple[str, ...]
    pulls: tuple[str, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        if self.pulls:
            return self.pulls
        parts = (
            []
            if self.least
            else [
                "the search for the least violation came to no end, so that there may be a motion: "
                "what follows is of the best that was found"
            ]
        )
        parts += [*self.missed[:MOST_LINES], *self.times]
        if self.against:
            parts.append("what stands against it: " + ", ".join(self.against[:MOST_LINES]))
        return tuple(parts)


def diagnose(problem: Problem, scale: Scale, x: Array, options: Options) -> Diagnosis:
    """Seek the motion of least violation from the unknowns x, shape (n,), and say what it misses.

    It needs compiled kernels.  x is best an initial guess: where a solver has given up, the motion
    may have left what the user had in mind.
    """
    nlp = Transcription(problem, scale, goal_as_rows=True)
    limits = replace(options, iterations=min(options.iterations, ITERATIONS), progress=None)
    outcome = least_violation(nlp, nlp.scaled(x), limits, _prices(nlp))
    if outcome.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    missed = _missed(nlp, outcome.x)
    # What is violated does not hold anything up, and the barrier leaves small multipliers
    # everywhere.
    w = np.where(nlp.inequality(outcome.x) < -INFEASIBLE, 0.0, outcome.duals.w)
    z = outcome.duals.z
    faint = FAINT * max(float(np.abs(z).max(initial=0.0)), float(w.max(initial=0.0)), TINY)
    w, z = (np.where(np.abs(d) > faint, d, 0.0) for d in (w, z))
    against = tuple[str, ...]()
    if outcome.status is Status.INFEASIBLE:
        holding = np.abs(outcome.duals.y) > faint
        against = (*_sticking(nlp, holding), *active_bounds(nlp, outcome.x, w, z))
    amount = max((value for value, _ in missed), default=0.0)
    least = outcome.status in (Status.SOLVED, Status.INFEASIBLE)
    return Diagnosis(
        nlp.physical(outcome.x),
        amount,
        least,
        tuple(text for _, text in missed),
        against,
        (*_times(nlp, outcome.x), *jams(nlp.iterate(nlp.physical(outcome.x)))),
        _pulls(problem, scale, x, limits) if amount > INFEASIBLE else (),
    )


def _sticking(nlp: Transcription, holding: NDArray[np.bool_]) -> Iterator[str]:
    """Sentences on tangents that stick along the motion, where their equations are among those that
    hold it, by a mask of shape (n_eq,)."""
    stuck, contacts = nlp.laws.friction.stuck, nlp.layout.touch.contacts
    along = np.unique(stuck.places[holding[stuck.numbers]][:, 1])
    held = {contacts.tangents[k]: STICK for k in along}
    for name in contacts.said(held):
        turns = name in dict(contacts.pairs)
        slides = "" if turns else f" (it may slide by {name}:slip+ or {name}:slip-)"
        yield f"{name} sticks{slides}"


def _pulls(problem: Problem, scale: Scale, x: Array, options: Options) -> tuple[str, ...]:
    """Sentences on how strongly contacts would have to pull for a motion, if there is one then."""
    if not problem.lasting:
        return ()
    nlp = Transcription(problem, scale, pulling=True)
    ending = solve_ipm(nlp, nlp.scaled(x), options)
    if ending.status is not Status.SOLVED:
        return ()
    lay, y = nlp.layout, nlp.physical(ending.x)
    one_way = nlp.layout.touch.contacts.named(np.flatnonzero(~nlp.layout.touch.contacts.pull))
    return tuple(text for name in one_way for text in _pulls_of(name, lay, y))


def _pulls_of(name: str, lay: Layout, y: Array) -> Iterator[str]:
    """Sentences on how strongly one contact pulls, where it pulls most in a phase, and at
    events."""
    at, forces = lay.stations, []
    t = lay.place_times(y)[at.place]
    for i in range(lay.stepped):
        rows = at.rows(i)
        for r in lay.reactions(i):
            if r.kind == "normal" and name in r.names:
                impulse = r.impulses(y)[:, r.names.index(name)]
                force = impulse / (y[lay.index_h[i]] * at.share[rows])
                k = int(np.argmin(force))
                forces.append((float(force[k]), float(t[rows][k])))
    force, when = min(forces, default=(0.0, 0.0))
    if force < 0:
        yield f"{name} would have to pull with {-force:.3g} N at {when:.3g} s"
    for i in range(len(lay.collision_nodes)):
        for impulses in lay.impulses(i):
            pull = 0.0 if impulses.pulls else impulses.values(y).get(name, 0.0)
            if pull < 0:
                yield (
                    f"{name} would have to pull with an impulse of {-pull:.3g} N s at event {i + 1}"
                )


def _prices(nlp: Transcription) -> Array:
    price = np.empty(nlp.n_eq + nlp.n_in)
    for block in (*nlp.equalities, *nlp.inequalities):
        price[block.numbers] = block.missed.price
    return price


def _missed(nlp: Transcription, x: Array) -> list[tuple[float, str]]:
    """Amounts and sentences of the violations, the worst of each kind of constraint and coordinate
    or surface, largest first."""
    amounts = np.concatenate([np.abs(nlp.equality(x)), -nlp.inequality(x)])
    misses = []
    for block, members in _kinds((*nlp.equalities, *nlp.inequalities)):
        k = members[int(np.argmax(amounts[block.numbers[members]]))]
        row, place = block.numbers[k], block.places[k].tolist()
        if amounts[row] > INFEASIBLE:
            words, unit = block.missed.words, block.missed.unit(*place)
            text = words(*place) if words else f"{block.label(*place)} is violated"
            by = f"{amounts[row] * nlp.row_sizes[row]:.3g}{' ' + unit if unit else ''}"
            misses.append((float(amounts[row]), f"{text} by {by}"))
    misses.sort(reverse=True)
    return [(amount, text) for amount, text in misses if amount > NEGLIGIBLE * misses[0][0]]


def _kinds(blocks: Iterable[Block]) -> Iterator[tuple[Block, Index]]:
    """Blocks with groups of their members, of which only the worst is reported."""
    for block in blocks:
        axis = block.missed.apart
        along = np.zeros(block.count) if axis is None else block.places[:, axis]
        for place in np.unique(along):
            yield block, np.flatnonzero(along == place)


def _times(nlp: Transcription, x: Array) -> tuple[str, ...]:
    """Phases whose estimated shortest time at full input exceeds what the bounds allow."""
    problem, lay = nlp.iterate(x * nlp.sizes).problem, nlp.layout
    if (
        not problem.nu
        or problem.held
        or not np.isfinite(problem.input_bounds).all()
        or not problem.model.has_minimal_times
    ):
        return ()
    low, high = problem.duration_bounds.T
    sentences = []
    for i in np.flatnonzero(problem.touch.impacts).tolist():
        allowed = min(high[i], problem.final_time_bounds[1] - (low.sum() - low[i]))
        at = x.copy()
        if i == 0:  # the start is known: a motion of least violation may have left it
            at[lay.index_q[0]] = np.clip(
                at[lay.index_q[0]], nlp.lower[lay.index_q[0]], nlp.upper[lay.index_q[0]]
            )
        shortest = phase_minimal_time(nlp.iterate(at * nlp.sizes), i)
        if np.isfinite(shortest) and shortest > (1 + CLEARLY) * allowed:
            name = problem.kernels.surfaces[problem.touch.surfaces[i]]
            sentences.append(
                f"phase {i} -> {name!r}: the shortest time at full input is estimated at "
                f"{shortest:.3g} s, the bounds allow {allowed:.3g} s"
            )
    return tuple(sentences)
