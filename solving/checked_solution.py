"""The outcome of a program as a Solution, and what the independent simulation says of it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np

from dmoc.base.deadline import ENDLESS, Deadline
from dmoc.mechanics.algebra import most_of
from dmoc.motion.trajectory import Trajectory
from dmoc.program.active_constraints import active_bounds
from dmoc.program.extraction import loose_peaks, loose_totals, named_multipliers, trajectory
from dmoc.program.transcription import Transcription
from dmoc.program.undefined_values import singular_at, undefined_at
from dmoc.results.notes import Note, Topic
from dmoc.results.solution import Solution
from dmoc.solvers.kkt import duality_gap
from dmoc.solvers.outcome import Status
from dmoc.solving.attempts import UNDECIDED, Attempt
from dmoc.solving.mode_edges import proposal_of

# A peak that lies further above its quantity, in sizes of this, is not limited by it.
FAR_ABOVE = 1.0
# Momenta of a motion that are such a share of what the program expected come from its limits: an
# impulse that is to be 0 is not quite.
NO_MOTION = 1e-4
# An integral with kinks that is so far off that of its integrand, in its size, limits it no more.
OFF = 1e-3


def solution_of(attempt: Attempt, method: str, seconds: Mapping[str, float]) -> Solution:
    """The solution in the user's words and units."""
    nlp, outcome = attempt.nlp, attempt.outcome
    problem = nlp.problem
    motion, status, cause = trajectory(nlp, outcome.x), outcome.status, _cause(attempt)
    notes = _notes(attempt)
    proposal = proposal_of(nlp, outcome) if status is Status.SOLVED else None
    grazes = any(c.grazes for c in motion.collisions) or _stands_still(nlp, motion)
    if status is Status.SOLVED and grazes:
        status, notes = Status.GRAZES, (*notes, Note(Topic.OTHER, without_effect(motion)))
    loose, optimality = _loose(attempt), outcome.left.optimality
    if loose and status in (Status.SOLVED, *UNDECIDED):  # there is none, whatever is left
        status, proposal, cause, notes = Status.STALLED, None, loose, ()
        optimality = np.inf
    return Solution(
        status=status,
        cause=cause,
        method=method,
        trajectory=motion,
        multipliers=named_multipliers(nlp, outcome.duals.y, outcome.duals.w, outcome.duals.z),
        active_bounds=active_bounds(nlp, outcome.x, outcome.duals.w, outcome.duals.z),
        max_violation=outcome.left.violation,
        optimality=optimality,
        iterations=outcome.iterations,
        seconds=seconds,
        unknowns=nlp.physical(outcome.x).copy(),
        scale=nlp.scale.named(problem),
        reference=problem.kernels.reference or problem.kernels.name,
        notes=notes,
        conflicts=attempt.conflicts,
        duality_gap=duality_gap(nlp, outcome.x, outcome.duals),
        proposal=proposal,
        design={name: motion.parameters[name] for name in problem.design},
        periodic={r.end: dict(r.terms) for r in problem.relations},
        kernels=problem.kernels,
    )


def _stands_still(nlp: Transcription, motion: Trajectory) -> bool:
    """Whether there are collisions and nothing moves, so that these have nothing to push."""
    momenta = np.max([most_of(phase.p) for phase in motion.phases], axis=0)
    hit = any(c.impulse > 0 for c in motion.collisions)
    return hit and bool((momenta <= NO_MOTION * nlp.scale.p).all())


def _loose(attempt: Attempt) -> str:
    """A sentence about a peak above its quantity, or an integral with kinks above its integrand,
    with which the objective falls; empty without any."""
    nlp, x = attempt.nlp, attempt.outcome.x
    lay, slopes = nlp.layout, nlp.cost_gradient(x)
    peaks = (loose_peaks(nlp, x) > FAR_ABOVE) & (slopes[lay.index_peaks] < 0)
    for name, loose in zip(nlp.problem.model.peak_names, peaks, strict=True):
        if loose:
            return (
                f"the cost has no minimum, it falls as {name} rises, which nothing bounds from "
                "above: give it a positive factor"
            )
    off = loose_totals(nlp, x)
    for name, sense in nlp.kernels.manifest.senses.items():
        i = nlp.problem.model.totals_of.index(name)
        ways = ("rises", "positive") if sense > 0 else ("falls", "negative")
        if sense * off[i] > OFF and sense * slopes[lay.index_totals[i]] < 0:
            return (
                f"the cost falls as {name} {ways[0]}, which unknowns in the place of kinks do "
                f"without end: give it a {ways[1]} factor"
            )
    return ""


def _cause(attempt: Attempt) -> str:
    """A sentence about the end of an attempt, with the detail of the method where no conflict is
    known."""
    outcome = attempt.outcome
    detail = f" ({outcome.detail})" if outcome.detail and not attempt.conflicts else ""
    return f"{outcome.status.sentence}{detail}"


def _notes(attempt: Attempt) -> tuple[Note, ...]:
    """Conflicts, what is left open, and what has no value."""
    marks = (": ", *["; "] * len(attempt.conflicts))
    notes = [Note(Topic.CONFLICT, c, m) for c, m in zip(attempt.conflicts, marks, strict=False)]
    notes += [Note(Topic.OPEN, attempt.leaves_open)] * bool(attempt.leaves_open)
    undefined = ""
    if attempt.outcome.status is not Status.SOLVED:
        undefined = _undefined(attempt)
    return (*notes, *[Note(Topic.OTHER, undefined)] * bool(undefined))


def _undefined(attempt: Attempt) -> str:
    """A sentence about functions that have no value where a solve has ended; empty where all have
    one."""
    nlp, x = attempt.nlp, attempt.outcome.x
    singular = singular_at(nlp, x)
    if singular is not None:
        return (
            "the mass matrix is singular or negative on the way, first at "
            f"{singular:.4g} s: check the parameters and the bounds"
        )
    undefined = undefined_at(nlp, x)
    return undefined and (
        f"{undefined} is not a finite number where it ended: keep the motion away from there by "
        "bounds, or write the expression so that it has a derivative"
    )


def without_effect(motion: Trajectory) -> str:
    """Name the collisions that have no effect, of a motion in which some have none."""
    grazing = [f"{i + 1} ({c.surface})" for i, c in enumerate(motion.collisions) if c.grazes]
    if not grazing:
        return "the collisions have no effect: nothing moves"
    several = len(grazing) > 1
    return (
        f"collision{'s' if several else ''} {' and '.join(grazing)} {'have' if several else 'has'} "
        "no effect: the motion touches the surface without an impulse"
    )


def checked(solution: Solution, deadline: Deadline = ENDLESS) -> Solution:
    """The solution with the result of the independent simulation; one that it contradicts is not
    verified."""
    from dmoc.check.check import verify
    from dmoc.check.checked_motion import OutOfTimeError

    assert solution.kernels is not None
    start, check = time.perf_counter(), None
    with suppress(OutOfTimeError):
        check = verify(solution.trajectory, solution.kernels, deadline.seconds)
    status, found = solution.status, list[Note]()
    if check is None:
        status = Status.TIME_LIMIT
        late = "but the time limit was reached before the simulation had checked it: raise it"
        found.append(Note(Topic.OTHER, late, ", "))
    elif not check.passed:
        status = Status.NOT_VERIFIED
        wrong = f"but an independent simulation contradicts it: {check.message}"
        found.append(Note(Topic.OTHER, wrong, ", "))
        found += [Note(Topic.STEPS, check.advice, ", ")] * bool(check.advice)
    elif check.message:
        found.append(Note(Topic.OTHER, check.message))
    seconds = {**solution.seconds, "verify": time.perf_counter() - start}
    notes = (*solution.notes, *found)
    return replace(solution, status=status, notes=notes, verification=check, seconds=seconds)
