"""Why a problem has no feasible point, in the user's words and units.

The motion of least violation is sought once more with the constraints priced as a user would: what
the laws of motion say (momentum and energy) costs most to violate, so that the violation moves to
what the user asked for - goal, contacts, gaps, path constraints, times - and the bounds that then
carry multipliers are those that stand against it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from dmoc.base.tolerances import LEAST
from dmoc.codegen.kernels import Array
from dmoc.guess.hits import jams
from dmoc.problem.problem import Problem
from dmoc.program.active_constraints import active_bounds
from dmoc.program.blocks import NOWHERE, Block, Index
from dmoc.program.layout import Layout
from dmoc.program.minimal_times import phase_minimal_time
from dmoc.program.reactions import node_shares
from dmoc.program.scale import Scale
from dmoc.program.transcription import Transcription
from dmoc.solvers.ipm import least_violation, solve_ipm
from dmoc.solvers.judge import INFEASIBLE
from dmoc.solvers.outcome import Options, Status

# Prices of a violation relative to that of missing the goal: of what limits the motion, and of the
# laws of motion.
LIMITS = 10.0
LAWS = 1000.0
# Share of the largest violation below which another is not worth a word.
NEGLIGIBLE = 1e-3
# Share of the largest multiplier below which a bound does not count as holding something up.
FAINT = 1e-5
# Share by which an estimated shortest time must exceed what is allowed to be mentioned.
CLEARLY = 1e-3
# Iterations that an explanation is worth.
ITERATIONS = 300
MOST_LINES = 4
# Units of momenta by the unit of the coordinate; of another coordinate, the unit of its momentum is
# not known.
MOMENTUM_UNITS = {"m": "kg m/s", "rad": "kg m2/s"}
# Rows of a kind, what is said of one of them that is violated, and the unit of its amount.
Kind: TypeAlias = tuple[Index, Callable[[int], str], str]


@dataclass(frozen=True)
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
    """Seek the motion of least violation from the unknowns x and say what it misses; needs compiled
    kernels.

    x is best an initial guess: where a solver has given up, the motion may have left what the user
    had in mind.
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
    faint = FAINT * max(float(np.abs(z).max(initial=0.0)), float(w.max(initial=0.0)), LEAST)
    w, z = (np.where(np.abs(d) > faint, d, 0.0) for d in (w, z))
    against = active_bounds(nlp, outcome.x, w, z) if outcome.status is Status.INFEASIBLE else ()
    amount = max((value for value, _ in missed), default=0.0)
    least = outcome.status in (Status.SOLVED, Status.INFEASIBLE)
    return Diagnosis(
        nlp.physical(outcome.x),
        amount,
        least,
        tuple(text for _, text in missed),
        against,
        (*_times(nlp, outcome.x), *jams(problem, nlp.physical(outcome.x))),
        _pulls(problem, scale, x, limits) if amount > INFEASIBLE else (),
    )


def _pulls(problem: Problem, scale: Scale, x: Array, options: Options) -> tuple[str, ...]:
    """How strongly contacts would have to pull for a motion, if there is one then."""
    if not problem.lasting:
        return ()
    nlp = Transcription(problem, scale, pulling=True)
    ending = solve_ipm(nlp, nlp.scaled(x), options)
    if ending.status is not Status.SOLVED:
        return ()
    lay, y = nlp.layout, nlp.physical(ending.x)
    return tuple(text for name in nlp.kernels.surfaces for text in _pulls_of(name, lay, y))


def _pulls_of(name: str, lay: Layout, y: Array) -> Iterator[str]:
    """How strongly one contact pulls where it pulls most in a phase, and at events."""
    t, forces = lay.times(y), []
    for i, steps in enumerate(lay.steps):
        for r in lay.reactions(i):
            if not r.pulls and name in r.names:
                impulse = r.impulses(y)[:, r.names.index(name)]
                force = impulse / (y[lay.index_h[i]] * node_shares(steps))
                k = int(np.argmin(force))
                forces.append((float(force[k]), float(t[lay.ends[i] + k])))
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
    price = np.full(nlp.n_eq + nlp.n_in, LIMITS)
    step, impact, ends, hit = nlp.laws.step, nlp.laws.impact, nlp.laws.ends, nlp.laws.hit
    for block in (ends.goal, ends.periodic, ends.goal_range):
        price[block.numbers] = 1.0
    for block in (
        step.momentum, step.inside, step.time, impact.arrival, impact.departure, impact.energy,
        ends.start_velocity, ends.goal_velocity, hit.within, hit.restitution, hit.slips,
    ):  # fmt: skip
        price[block.numbers] = LAWS
    return price


def _missed(nlp: Transcription, x: Array) -> list[tuple[float, str]]:
    """Amount and text of what is not met, the worst of each kind of constraint and coordinate or
    surface, largest first."""
    amounts = np.concatenate([np.abs(nlp.equality(x)), -nlp.inequality(x)])
    misses = []
    for rows, text, unit in _kinds(nlp):
        k = int(np.argmax(amounts[rows])) if len(rows) else 0
        if len(rows) and amounts[rows[k]] > INFEASIBLE:
            amount = amounts[rows[k]] * nlp.row_unit[rows[k]]
            misses.append(
                (float(amounts[rows[k]]), f"{text(k)} by {amount:.3g}{' ' + unit if unit else ''}")
            )
    misses.sort(reverse=True)
    return [(amount, text) for amount, text in misses if amount > NEGLIGIBLE * misses[0][0]]


def _kinds(nlp: Transcription) -> Iterator[Kind]:
    """All rows: those of which more is said than their names, and those of every other block."""
    ends, worded = nlp.laws.ends, np.zeros(nlp.n_eq + nlp.n_in, dtype=bool)
    for kind in _in_words(nlp):
        worded[kind[0]] = True
        yield kind
    for block in (*nlp.laws.equalities, *nlp.laws.inequalities):
        if not worded[block.numbers].all():
            unit = "s" if block in (ends.earliest, ends.latest) else ""
            yield block.numbers, _violated(block), unit


def _in_words(nlp: Transcription) -> Iterator[Kind]:
    """Rows that are told in the words of mechanics."""
    problem, kernels, laws = nlp.problem, nlp.kernels, nlp.laws
    units, names = kernels.manifest["units"], kernels.coordinates
    step, impact, at_ends = laws.step, laws.impact, laws.ends

    def said(text: str) -> Callable[[int], str]:
        return lambda k: text.format(k=k)

    goals = [*at_ends.fixed_goals, *(g for g, _, _ in at_ends.limits)]
    for row, goal in zip((*at_ends.goal.numbers, *at_ends.goal_range.numbers), goals, strict=True):
        yield np.array([row]), said(f"the goal of {goal.name} is missed"), _unit(goal.name, units)
    impacts = [(i, event.surface) for i, event in enumerate(problem.events) if event.impact]
    for (i, surface), row in zip(impacts, impact.contact.numbers, strict=True):
        involved = problem.model.surface_coordinates[surface]
        unit = _unit(names[involved[0]], units) if len(involved) == 1 else ""
        text = f"collision {i + 1} misses {kernels.surfaces[surface]!r}"
        yield np.array([row]), said(text), unit
    for j, q in enumerate(names):
        yield (
            step.momentum.index[:, j],
            said(f"the momentum of {q} jumps at node {{k}}"),
            _unit(f"p_{q}", units),
        )
        for inside in range(nlp.layout.inside):
            column = step.inside.index[:, inside * len(names) + j]
            yield column, said(f"the equation of motion of {q} is violated in step {{k}}"), ""
    yield step.time.numbers, said("the time jumps"), "s"
    for side, block in (("before", impact.arrival), ("after", impact.departure)):
        text = f"the velocity {side} a collision does not fit its momentum"
        yield block.numbers, said(text), ""
    yield laws.hit.within.numbers, said("a velocity within a hit does not fit its momentum"), ""
    yield at_ends.final_time.numbers, said("the final time is missed"), "s"
    for row, r in zip(at_ends.periodic.numbers, at_ends.relations, strict=True):
        whose = "its value" if r.end == r.start else f"the value of {r.start}"
        text = f"{r.end} at the end misses {whose} at the start"
        yield np.array([row]), said(text), _unit(r.end, units)
    for end, block in (("start", at_ends.start_velocity), ("goal", at_ends.goal_velocity)):
        for row, q in zip(block.numbers, names, strict=False):
            text = f"the momentum of {q} at the {end} does not fit the velocity"
            yield np.array([row]), said(text), _unit(f"p_{q}", units)
    for (i, surface), row in zip(impacts, impact.energy.numbers, strict=True):
        text = f"collision {i + 1} ({kernels.surfaces[surface]}) violates its law of restitution"
        yield np.array([row]), said(text), ""
    for j, name in enumerate(kernels.surfaces):
        kept = np.flatnonzero(step.gap.index[:, j] != NOWHERE)
        passes = [f"the motion passes {name} at node {k}" for k in kept]
        yield step.gap.index[kept, j], passes.__getitem__, ""


def _violated(block: Block) -> Callable[[int], str]:
    return lambda k: f"{block.name_of(k)} is violated"


def _unit(name: str, units: dict[str, str]) -> str:
    """Unit of a coordinate, velocity or momentum, "" where the model does not tell."""
    if name in units:
        return units[name]
    if name.startswith("p_"):
        return MOMENTUM_UNITS.get(units.get(name[2:], ""), "")
    return f"{units[name[:-4]]}/s" if name.endswith("_dot") and name[:-4] in units else ""


def _times(nlp: Transcription, x: Array) -> tuple[str, ...]:
    """Phases whose estimated shortest time at full input exceeds what the bounds allow."""
    problem, lay = nlp.problem, nlp.layout
    if (
        not problem.nu
        or problem.held
        or not np.isfinite(problem.input_bounds).all()
        or not problem.model.has_minimal_times
    ):
        return ()
    low, high = problem.duration_bounds.T
    sentences = []
    for i, event in enumerate(problem.events):
        allowed = min(high[i], problem.final_time_bounds[1] - (low.sum() - low[i]))
        at = x.copy()
        if i == 0:  # the start is known: a motion of least violation may have left it
            at[lay.index_q[0]] = np.clip(
                at[lay.index_q[0]], nlp.lower[lay.index_q[0]], nlp.upper[lay.index_q[0]]
            )
        shortest = phase_minimal_time(problem, lay, at * nlp.unit, i)
        if np.isfinite(shortest) and shortest > (1 + CLEARLY) * allowed:
            name = problem.kernels.surfaces[event.hit]
            sentences.append(
                f"phase {i} -> {name!r}: the shortest time at full input is about "
                f"{shortest:.3g} s, the bounds allow {allowed:.3g} s"
            )
    return tuple(sentences)
