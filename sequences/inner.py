"""The inner problem: one sequence, several starts, a verdict with evidence.  Runs in any
process."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dmoc.codegen.kernels import COMPILED, Array
from dmoc.nlp.active import BoundKind
from dmoc.nlp.guess import Guess, initial_guesses
from dmoc.nlp.layout import Layout
from dmoc.nlp.march import reflected
from dmoc.nlp.problem import Problem
from dmoc.nlp.scaling import scale_of
from dmoc.nlp.surfaces import onto_surface
from dmoc.nlp.transfer import pieces_of, unknowns_along
from dmoc.sequences.nodes import Node, Start, Verdict
from dmoc.solution import Solution
from dmoc.solvers.diagnosis import Diagnosis, diagnose
from dmoc.solvers.judge import INFEASIBLE
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.result import without_effect
from dmoc.solving.solve import solve

# Relative difference of two costs that belong to the same minimum.
SAME = 1e-5
# Spread of seeded starts: of the logarithm of durations, and of coordinates relative to their
# range.
SPREAD_TIME, SPREAD_PLACE = 0.4, 0.3
# Further automatic guesses are used where the first starts found nothing.
SPARE = "spare"
# Iterations of a start: a motion that needs more is hardly ever a good one.
ITERATIONS = 200


@dataclass(frozen=True)
class Task:
    """One sequence to be solved: the problem, the parent's motion, further starts, method, limit
    in seconds."""

    problem: Problem
    parent: Solution | None
    method: str
    starts: int
    seed: int
    seconds: float
    attempts: int = 1

    @property
    def sequence(self) -> tuple[str, ...]:
        return tuple(self.problem.sequence)


def solve_node(task: Task) -> Node:
    """Solve from every start; return the node with its verdict.  An error is an answer too: the
    search goes on."""
    try:
        return _solve(task)
    except Exception as error:
        return lost(task, f"{type(error).__name__}: {error}")


def lost(task: Task, why: str) -> Node:
    """A node without an answer."""
    return Node(task.sequence, Verdict.FAILED, evidence=(why,), attempts=task.attempts)


def _solve(task: Task) -> Node:
    begin = time.perf_counter()
    guesses = initial_guesses(task.problem)
    tried: list[Start] = []
    solved: list[Solution] = []
    for name, x in _starts(task, guesses):
        if solved and name.startswith(SPARE):
            continue
        left = task.seconds - (time.perf_counter() - begin)
        if left <= 0:
            tried.append(Start(name, Status.TIME_LIMIT, None))
            break
        found = _solve_from(task, x, left)
        tried.append(Start(name, found.status, found.cost if found.minimum else None))
        if found.minimum:
            solved.append(found)
    node = None if solved else _unsolved(task, guesses, tried)
    if isinstance(node, Solution):
        tried.append(Start("least violation", node.status, node.cost))
        solved.append(node)
    solved.sort(key=lambda s: (not s.solved, s.cost))
    if node is None or isinstance(node, Solution):
        node = _confirmed(task, solved)
    return replace(
        node,
        starts=tuple(tried),
        minima=_minima(solved),
        attempts=task.attempts,
        seconds=time.perf_counter() - begin,
    )


def _solve_from(task: Task, x: Array, seconds: float) -> Solution:
    """Solve; an interrupted solve keeps its best iterate, but a search wants to know."""
    found = solve(
        task.problem, task.method, guess=x, iterations=ITERATIONS, seconds=seconds, verify=False
    )
    if found.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    return found


def _starts(task: Task, guesses: Sequence[Guess]) -> Iterator[tuple[str, Array]]:
    problem = task.problem
    if task.parent is not None:
        yield "parent", extended(task.parent, problem)
    yield "automatic", guesses[0].x
    for i, guess in enumerate(guesses[1:]):
        yield f"{SPARE} {i + 1}", guess.x
    order = [problem.kernels.surfaces.index(s) for s in problem.sequence]
    for i in range(task.starts):
        yield (
            f"seeded {i + 1}",
            shaken(problem, guesses[0].x, np.random.default_rng([task.seed, i, *order])),
        )


def extended(parent: Solution, problem: Problem) -> Array:
    """Unknowns of a motion with one more collision: the parent's last phase, bent to touch the
    surface where it comes closest to it."""
    surface = problem.sequence[-1]
    *earlier, last = pieces_of(parent.trajectory)
    steps = len(last.t) - 1
    j = problem.kernels.surfaces.index(surface)
    gaps = problem.model.gaps(last.q, last.t)[:, j]
    inner = slice(max(1, steps // 10), steps - max(1, steps // 10) + 1)
    k = int(np.argmax(gaps[inner])) + inner.start
    met = onto_surface(problem, last.q[k], surface, float(last.t[k]))
    bend = np.zeros(problem.nq) if met is None else met - last.q[k]
    share = np.concatenate([np.linspace(0, 1, k + 1), np.linspace(1, 0, steps - k + 1)[1:]])
    q = last.q + share[:, None] * bend
    rates = [
        last.v[part] + sign * bend / np.ptp(last.t[part])
        for part, sign in ((slice(k + 1), 1), (slice(k, None), -1))
    ]
    before = replace(last, t=last.t[: k + 1], q=q[: k + 1], v=rates[0])
    after = replace(last, t=last.t[k:], q=q[k:], v=rates[1])
    _, impulse = reflected(problem, q[k], rates[0][-1], surface, float(last.t[k]))
    return unknowns_along(
        problem, [*earlier, before, after], [*(c.impulse for c in parent.collisions), impulse]
    )


def shaken(problem: Problem, x: Array, rng: np.random.Generator) -> Array:
    """A guess with other durations and another path; what is fixed stays, because the solver
    clips it to its bounds."""
    lay = Layout.of(problem)
    x = x.copy()
    x[lay.index_h] *= np.exp(SPREAD_TIME * rng.normal(size=lay.phases))
    total = float(x[lay.index_h] @ np.array(lay.steps))
    low, high = problem.final_time_bounds
    x[lay.index_h] *= min(max(total, low), high) / total
    q = x[lay.index_q]
    wave = np.sin(np.outer(np.linspace(0, 1, len(q)), np.pi * np.arange(1, 4)))
    spread = SPREAD_PLACE * np.maximum(np.ptp(q, axis=0), problem.reach / 10)
    x[lay.index_q] = q + (wave @ rng.normal(size=(3, lay.nq))) * spread
    return x


def _minima(solved: list[Solution]) -> tuple[float, ...]:
    costs: list[float] = []
    for s in sorted(solved, key=lambda s: s.cost):
        if not costs or s.cost > costs[-1] + SAME * max(s.scale.get("cost", 1.0), abs(costs[-1])):
            costs.append(s.cost)
    return tuple(costs)


def _confirmed(task: Task, solved: list[Solution]) -> Node:
    """The cheapest motion that the simulation confirms; the cheapest of all where it confirms
    none."""
    first = ""
    for s in solved:
        check = s.verify()
        if check.passed:
            if s.status == Status.GRAZES:
                evidence = f"cost {s.cost:.6g}, and {without_effect(s.trajectory)}"
                return _node(task, s, Verdict.GRAZES, (evidence,))
            confirmed: tuple[str, ...] = (f"cost {s.cost:.6g}, confirmed by simulation",)
            if s is not solved[0]:
                confirmed += (f"a motion of cost {solved[0].cost:.6g} was not confirmed: {first}",)
            return _node(task, s, Verdict.FEASIBLE, confirmed)
        first = first or check.message
    return _node(task, solved[0], Verdict.UNVERIFIED, (f"the simulation contradicts it: {first}",))


def _node(task: Task, s: Solution, verdict: Verdict, evidence: tuple[str, ...]) -> Node:
    shortest = tuple(b for b in s.active_bounds if b.kind is BoundKind.DURATION and b.side == ">=")
    bare = replace(s, kernels=None)  # travels without the kernels, which the caller has
    return Node(
        task.sequence,
        verdict,
        s.cost,
        tuple(p.duration for p in s.phases),
        evidence,
        shortest=shortest,
        solution=bare,
    )


def _unsolved(task: Task, guesses: Sequence[Guess], tried: list[Start]) -> Node | Solution:
    """Infeasible, unreachable, no answer, or a solution from the feasible motion that the search
    for the reason has found."""
    problem = task.problem
    ends = ", ".join(f"{s.name}: {s.status}" for s in tried)
    nothing = Node(
        task.sequence, Verdict.FAILED, evidence=(f"no start came to an answer ({ends})",)
    )
    if not any(s.status == Status.INFEASIBLE for s in tried) or problem.kernels.backend != COMPILED:
        return nothing
    whole = _least(problem, guesses, task.seconds)
    if whole.violation <= INFEASIBLE:
        found = _solve_from(task, whole.x, task.seconds)
        return found if found.minimum else nothing
    if problem.sequence:
        # Only the collisions, and as much time as there is: what happens after them is another
        # matter.
        start = dict.fromkeys(problem.periodic) | dict(problem.start)
        latest = (None, problem.final_time_bounds[1])
        there_only = problem.but(start=start, goal={}, periodic=(), final_time=latest)
        there = _least(there_only, initial_guesses(there_only), task.seconds)
        if there.violation > INFEASIBLE:
            return Node(
                task.sequence,
                Verdict.UNREACHABLE if there.least else Verdict.FAILED,
                evidence=there.sentences,
            )
    return Node(
        task.sequence,
        Verdict.INFEASIBLE if whole.least else Verdict.FAILED,
        evidence=whole.sentences,
    )


def _least(problem: Problem, guesses: Sequence[Guess], seconds: float) -> Diagnosis:
    """The least violation from any of some guesses."""
    found: list[Diagnosis] = []
    for guess in guesses:
        found.append(
            diagnose(problem, scale_of(problem, guess.x), guess.x, Options(seconds=seconds))
        )
        if found[-1].violation <= INFEASIBLE:
            return found[-1]
    return min(found, key=lambda d: (not d.least, d.violation))
