"""Where a solve starts: an automatic guess, unknowns that are given, or a motion that is known."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from dmoc.base.arguments import array, shown
from dmoc.base.deadline import ENDLESS, Deadline
from dmoc.base.errors import ProblemError
from dmoc.base.records import record
from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.inverse_dynamics import acting
from dmoc.guess.keyframes import along, courses_of, is_by_name, with_design
from dmoc.guess.transfer import Piece, pieces_of, unknowns_along
from dmoc.problem.problem import Problem
from dmoc.program.extraction import multiplier_vectors
from dmoc.program.layout import Layout
from dmoc.program.transcription import Transcription
from dmoc.results.solution import Solution
from dmoc.solvers.outcome import Duals
from dmoc.solving.only_motion import only_motion

InitialGuess: TypeAlias = (
    Solution
    | str
    | os.PathLike[str]
    | Mapping[Any, Any]
    | Sequence[Mapping[Any, Any]]
    | Array
    | None
)


@record(frozen=True, eq=False)
class Starts:
    """Unknowns to start from, in units of the problem, the best ones first.

    ``minimum`` says that they are those of a solution, ``multipliers`` are its multipliers by kind
    where they fit the mesh.  ``near`` says that it is a minimum of the same events on
    another mesh: the compiled method begins with a small barrier there, without multipliers.
    """

    points: tuple[Array, ...]
    minimum: bool = False
    multipliers: Mapping[str, Array] | None = None
    near: bool = False

    def duals(self, nlp: Transcription) -> Duals | None:
        """The multipliers that were given, as a program takes them."""
        if self.multipliers is None:
            return None
        return Duals(*multiplier_vectors(nlp, self.multipliers))

    def or_acting(self, problem: Problem) -> Starts:
        """The same starts and, where their inputs change no forces, others behind them whose inputs
        do."""
        changed = [(x, acting(problem, x)) for x in self.points]
        others = tuple(other for x, other in changed if other is not x)
        return replace(self, points=(*self.points, *others))


def loaded(guess: InitialGuess) -> InitialGuess:
    """A guess as it is, or the solution of the file that it names."""
    return Solution.load(guess) if isinstance(guess, (str, os.PathLike)) else guess


def starts_of(problem: Problem, guess: InitialGuess, deadline: Deadline = ENDLESS) -> Starts:
    """Read a guess, or make the automatic ones until a deadline; what is no start of the problem is
    refused."""
    problem, guess = with_design(problem, guess)
    if guess is None:
        alone, others = only_motion(problem), initial_guesses(problem, deadline)
        first = () if alone is None else (alone,)
        return Starts((*first, *(g.x for g in others)))
    if isinstance(guess, Solution):
        return _from_solution(problem, guess).or_acting(problem)
    if is_by_name(guess):
        courses = courses_of(problem, guess)
        return Starts((along(problem, courses, initial_guesses(problem, deadline)[0].x),))
    return Starts((acting(problem, _from_array(problem, guess)),))


def _from_solution(problem: Problem, guess: Solution) -> Starts:
    names = [*problem.kernels.coordinates, *problem.kernels.inputs]
    theirs = [*guess.trajectory.coordinates, *guess.trajectory.inputs]
    if theirs != names:
        raise ProblemError(
            f"guess is a motion of {', '.join(theirs)}: expected a motion of the coordinates and "
            f"inputs {', '.join(names)}."
        )
    proposal = guess.proposal
    if proposal is not None and proposal.sequence == problem.words:
        return Starts((restated(problem, guess),), True)
    if len(guess.phases) != problem.phases:
        raise ProblemError(
            f"guess has {len(guess.collisions)} collisions: expected a motion with "
            f"{problem.phases - 1}, as the problem has."
        )
    if problem.phase_steps[-1] and not guess.steps[-1]:
        raise ProblemError(
            "guess ends with its last event: expected a motion that goes on after it, as the "
            "problem has; give one, or courses by name."
        )
    if not _same_mesh(problem, guess):
        impulses = [c.impulse for c in guess.collisions]
        x = unknowns_along(problem, pieces_of(guess.trajectory), impulses)
        near = guess.minimum and tuple(c.word for c in guess.collisions) == problem.words
        return Starts((x,), True, near=near)
    same = tuple(c.word for c in guess.collisions) == problem.words
    return Starts((guess.unknowns.copy(),), True, guess.multipliers if same else None)


def _same_mesh(problem: Problem, guess: Solution) -> bool:
    """Whether the unknowns of a motion are those of the problem."""
    steps, controls = guess.steps, guess.trajectory.controls
    size = Layout.of(problem).size
    same = steps == problem.phase_steps and controls == problem.control_form
    return same and len(guess.unknowns) == size


def _from_array(problem: Problem, guess: Any) -> Array:
    size = Layout.of(problem).size
    x = array(guess)
    if x is None:
        raise ProblemError(
            f"guess = {shown(guess)}: expected a Solution, the path of its file, a "
            f"mapping from names, or an array of {size} unknowns."
        )
    if x.shape != (size,) or not np.isfinite(x).all():
        raise ProblemError(
            f"guess has shape {x.shape}: expected {size} finite unknowns, from a solution of the "
            "same model with the same steps."
        )
    return x


def restated(problem: Problem, solution: Solution) -> Array:
    """Unknowns of a motion, shape (n,), in the phases of the problem that it proposes. Where these
    are one more, the first step becomes a phase."""
    assert solution.proposal is not None
    times, near = np.array(solution.proposal.times), SAME * solution.final_time
    pieces, impulses = list[Piece](), list[float]()
    collisions = [c.impulse for c in solution.collisions]
    for piece, impulse in zip(pieces_of(solution.trajectory), [0.0, *collisions], strict=True):
        events = (np.abs(piece.t[:, None] - times) <= near).any(axis=1)
        inside = [int(k) for k in np.flatnonzero(events[1:-1]) + 1]
        parts = [_part(piece, a, b) for a, b in pairwise([0, *inside, len(piece.t) - 1])]
        if pieces and not events[0]:
            parts[0] = pieces.pop().followed_by(parts[0])
        elif pieces:
            impulses.append(impulse)
        pieces += parts
        impulses += [0.0] * len(inside)
    if len(pieces) < problem.phases:
        pieces[:1] = [_part(pieces[0], 0, 1), _part(pieces[0], 1, len(pieces[0].t) - 1)]
        impulses.insert(0, 0.0)
    return unknowns_along(problem, pieces, impulses)


def _part(piece: Piece, a: int, b: int) -> Piece:
    """A piece from its node a to its node b; it keeps the inputs and the forces of all."""
    nodes = slice(a, b + 1)
    return replace(piece, t=piece.t[nodes], q=piece.q[nodes], v=piece.v[nodes])
