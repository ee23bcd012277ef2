"""What a solve is asked for beside its problem: read before anything is done; and hits that a model
names and the sequence of the problem does not have, whose additions are always nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from dmoc.base.arguments import shown
from dmoc.base.deadline import Deadline
from dmoc.base.errors import DmocError, ProblemError
from dmoc.base.records import record
from dmoc.problem.problem import Problem
from dmoc.program.totals import surfaces_hit
from dmoc.solvers.outcome import Options
from dmoc.solving.keywords import Keywords
from dmoc.solving.methods import DEFAULT, METHODS, REFINING, Method, ProgramForm, usual

if TYPE_CHECKING:
    from dmoc.solving.beginning import Beginning

GIVEN = "given"  # the name of a start that is a guess
# Tolerance where neither steps nor a tolerance are given.
AUTOMATIC = 1e-3
# The error up to which a motion that the check confirms is a solution where nobody has asked for a
# tolerance and finer meshes do not lead to the usual one: the check itself allows as much.
LOOSE = 1e-2
# Inputs of all steps up to which dense matrices take a second or two: with twice as many they take
# fifteen, where ipm takes half of one.
DENSE = 1000


@record(frozen=True, eq=False)
class Request:
    """How a problem shall be solved; its parts are checked.

    ``verify`` is for the solution, ``ranks_checked`` for the minima among which it is chosen.
    ``most`` are the starts that are tried at most where ``starts`` leaves their number open.
    ``tolerance`` is that of a refinement, None where the mesh of the problem is the only one; where
    finer meshes do not lead there, an error up to ``loose`` that the check confirms is a solution
    too.  ``refining`` is the method of other meshes than that of the answer.  ``thorough`` is
    whether starts go on as long as there is time and better minima may not have been met, and other
    forms of the problem are tried where no start leads to a motion.  ``names_steps`` is whether
    finer meshes are solved for one that the check confirms, where it contradicts the answer on its
    own.  ``given`` names the start that the guess is.  ``begun`` is where the first solve of one
    problem begins, if others have begun with it.
    """

    method: Method
    options: Options
    form: str = ProgramForm.CONDENSED
    verify: bool = True
    ranks_checked: bool = True
    starts: int | None = 1
    seed: int = 0
    tolerance: float | None = None
    loose: float = LOOSE
    most: int | None = None
    refining: Method = METHODS[REFINING]
    thorough: bool = False
    names_steps: bool = True
    given: str = GIVEN
    begun: Beginning | None = None

    def within(self, **limits: Any) -> Request:
        """The same request with other options."""
        return replace(self, options=replace(self.options, **limits))

    def compiled(self) -> Request:
        """The same request for other meshes: silent, by the compiled method if the problem has
        one."""
        return replace(self.within(progress=None), method=self.refining)


def check_problem(problem: Any, error: type[DmocError] = ProblemError) -> None:
    """Refuse what is no Problem."""
    if not isinstance(problem, Problem):
        raise error(
            f"problem = {shown(problem)}: expected a Problem, as dmoc.Problem(system, start=..., "
            "...) states it."
        )


def request_of(problem: Problem, keywords: Keywords) -> Request:
    """The request for a problem, from now on, with its usual method unless one is named; a method
    that cannot solve it is refused."""
    tolerance, loose = keywords.tolerance, keywords.tolerance or LOOSE
    if tolerance is None and problem.steps is None:
        tolerance = AUTOMATIC
    compiled = problem.kernels.compiled
    rubs = bool(problem.open_hits) or any(problem.touch.courses)
    # On peaks the condensed slsqp often stalls after hundreds of iterations, ipm takes a dozen.
    plain = tolerance is None and not (problem.held or rubs or problem.model.peak_names)
    inputs = problem.nu * sum(problem.phase_steps)
    plain &= inputs <= DENSE
    method = METHODS[keywords.method or usual(DEFAULT if plain else REFINING, compiled)]
    method.require(problem.kernels.backend)
    method.check_size(problem.steps, inputs)
    limits = Options(
        keywords.optimality,
        keywords.violation,
        keywords.iterations,
        Deadline.after(keywords.seconds),
    )
    verify, starts, seed = keywords.verify, keywords.starts, keywords.seed
    return Request(
        method, limits, keywords.form, verify, verify, starts, seed,
        tolerance=tolerance, loose=loose, refining=METHODS[usual(REFINING, compiled)],
    )  # fmt: skip


def check_hits(problem: Problem) -> None:
    """Refuse a number beyond the hits of a surface that the sequence hits."""
    for what, surface, number, count in _named(problem):
        if number > count > 0:
            often = "once" if count == 1 else f"{count} times"
            raise ProblemError(
                f"{what} is about hit {number} of {surface!r}, which the sequence hits {often}: "
                "name a hit that there is, or add hits to the sequence."
            )


def without_hits(problem: Problem) -> str:
    """A sentence about surfaces that the model names the hits of and the sequence never hits; empty
    for none."""
    never = dict[str, list[str]]()
    for what, surface, _, count in _named(problem):
        if not count:
            never.setdefault(surface, []).append(what)
    return "; ".join(
        f"the sequence never hits {surface!r}, of which {' and '.join(dict.fromkeys(whats))} "
        f"{'has' if len(whats) == 1 else 'have'} nothing"
        for surface, whats in never.items()
    )


def _named(problem: Problem) -> Iterator[tuple[str, str, int, int]]:
    """Integrals and quantities of hits: in words, their surface, the number of the hit, 0 for all
    of them, and how often the sequence hits the surface."""
    model, kernels = problem.model, problem.kernels
    hit = [j for event in surfaces_hit(problem.touch) for j in event]
    rows = [(f"integral {kernels.integrals[i]!r}", j, n) for i, j, n in model.hit_sums.tolist()]
    rows += [(f"quantity {q!r}", j, n) for q, (j, n) in kernels.manifest.hit_quantities.items()]
    for what, j, number in rows:
        yield what, kernels.surfaces[j], number, hit.count(j)
