"""The inner problem: one sequence, several starts, a verdict with evidence.  Runs in any process.

Every sequence is solved with the law of impact in the rates of the gaps
(:mod:`dmoc.program.laws.impact`). In the energies of the steps beside a collision, phases of very
different lengths, which sequences of many collisions have, come out with rates that no simulation
confirms, if they come out at all.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.contacts import in_contact
from dmoc.guess.extension import impulse_between, with_event
from dmoc.guess.random_motions import FEW_IN_TURN
from dmoc.guess.transfer import equally_long, pieces_of, unknowns_along
from dmoc.problem.attitudes import with_goal_of
from dmoc.problem.design import designed_as
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import MOST_STEPS
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.scaling import scale_of
from dmoc.results.solution import Solution
from dmoc.sequences.comparison import better
from dmoc.sequences.nodes import Node, Verdict
from dmoc.solvers.diagnosis import Diagnosis, diagnose
from dmoc.solvers.judge import INFEASIBLE
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.checked_solution import without_effect
from dmoc.solving.either_sign import ways_of
from dmoc.solving.mesh.one_mesh import on_mesh_of, solved_on_mesh
from dmoc.solving.methods import COMPILED_METHOD, METHODS
from dmoc.solving.multistart.effort import Effort
from dmoc.solving.multistart.exploration import coarse_of, explored
from dmoc.solving.multistart.rounds import Start
from dmoc.solving.request import Request
from dmoc.solving.starts import InitialGuess, restated

# Automatic guesses beside the parent's motion, and minima that are refined at most.  Random starts
# are tried where none of these has led to a minimum: on the 127 sequences of the cart-pendulum with
# at most 6 collisions four of them, or a second guess, led to none that is better.
GUESSES, MOST_REFINED = 1, 3
# Iterations of a start and of a finer mesh, and of a start from the motion of a sequence that
# differs little: those that lead to a motion take fewer than a hundred.
ITERATIONS, NEAR = 300, 100
# What the simulation has found must fall to this share from mesh to mesh, or finer ones are not
# tried: half is what an error of the first order does.
FALLING = 0.7


@record(frozen=True, eq=False)
class NodeTask:
    """One sequence to be solved: the problem, the parent's motion, further starts, method, limit
    in seconds, a motion that proposes it, unknowns of the coarse mesh to start from, and whether
    they are those of a sequence that differs little; or a node that is doubtful, to be looked at on
    meshes so many times finer."""

    problem: Problem
    parent: Solution | None
    method: str
    starts: int
    seed: int
    seconds: float | None
    attempts: int = 1
    proposer: Solution | None = None
    start: Array | None = None
    near: bool = False
    doubtful: Node | None = None
    finer: tuple[int, ...] = ()

    @property
    def sequence(self) -> tuple[str, ...]:
        return tuple(self.problem.sequence)


def solve_node(task: NodeTask) -> Node:
    """Solve from every start; return the node with its verdict.  An error is an answer too: the
    search goes on."""
    try:
        return _solve(task)
    except Exception as error:
        return lost(task, f"{type(error).__name__}: {error}")


def lost(task: NodeTask, why: str) -> Node:
    """A node without an answer."""
    return Node(task.sequence, Verdict.FAILED, evidence=(why,), attempts=task.attempts)


def _solve(task: NodeTask) -> Node:
    begin, task = time.perf_counter(), replace(task, problem=task.problem.in_rates())
    if task.doubtful is not None:
        node = _on_finer_meshes(task, task.doubtful)
        return replace(node, seconds=node.seconds + time.perf_counter() - begin)
    tasks = _each_way(task)
    nodes = [_one_way(own) for own in tasks]
    node = nodes[0] if len(nodes) == 1 else _best_way(nodes)
    return replace(node, attempts=task.attempts, seconds=time.perf_counter() - begin)


def _one_way(task: NodeTask) -> Node:
    return _explored(task) if task.problem.kernels.compiled else _from_parent(task)


def _each_way(task: NodeTask) -> list[NodeTask]:
    """The task with each sign of the quaternions at its goal, for its share of the time, and with
    the motions to start from that go that way; unknowns to start from go the near one."""
    ways = ways_of(task.problem) if task.start is None else [task.problem]
    seconds = None if task.seconds is None else task.seconds / len(ways)
    return [
        replace(
            task, problem=way, seconds=seconds, parent=_going(task.parent, way, ways),
            proposer=_going(task.proposer, way, ways),
        )
        for way in ways
    ]  # fmt: skip


def _going(motion: Solution | None, way: Problem, ways: Sequence[Problem]) -> Solution | None:
    """A motion that ends nearest to the goal of this way, if it is one."""
    if motion is None or len(ways) == 1:
        return motion
    end = motion.phases[-1].q[-1]
    nearest = min(ways, key=lambda w: float(np.nansum((w.goal_position - end) ** 2)))
    return motion if way is nearest else None


def _best_way(nodes: Sequence[Node]) -> Node:
    """The best node of several signs of quaternions at the goal, with what the others have led
    to."""
    best = nodes[0]
    for node in nodes[1:]:
        best = better(best, node) if best.solution or node.solution else best
    costs = [n.cost for n in nodes if n is not best and n.cost is not None]
    cost = f"it costs {min(costs):.6g}" if costs else "no motion was found"
    return replace(
        best,
        evidence=(*best.evidence, f"with the other sign of a quaternion at the goal {cost}"),
        starts=tuple(start for n in nodes for start in n.starts),
        minima=tuple(sorted({cost for n in nodes for cost in n.minima})),
    )


def _from_parent(task: NodeTask) -> Node:
    """Solve from the parent's motion, else from the automatic guesses, by a method that needs no
    compiled kernels."""
    starts: list[Start] = []
    deadline = Deadline.after(task.seconds)
    guesses: list[tuple[str, Array | None]] = [("automatic", None)]
    if task.parent is not None:
        guesses.insert(0, ("parent", extended(task.parent, task.problem)))
    if task.proposer is not None:
        guesses.insert(0, ("proposal", restated(task.problem, task.proposer)))
    for name, x in guesses:
        s = _solved(task.problem, task.method, x, Options(deadline=deadline))
        starts.append(Start(name, s.status, s.cost if s.converged else None))
        if s.converged:
            return replace(_node(task, [s]), starts=tuple(starts))
        if deadline.passed:
            return _late(task, starts)
    evidence = (f"no start came to an answer ({_ends_of(starts)})",)
    return Node(task.sequence, Verdict.FAILED, evidence=evidence, starts=tuple(starts))


def _explored(task: NodeTask) -> Node:
    """Solve from the best of some starts on a coarse mesh, the parent's motion among them."""
    deadline = Deadline.after(task.seconds)
    coarse = coarse_of(task.problem)
    points = {} if task.start is None else {"relaxed": task.start}
    if task.parent is not None:
        points["parent"] = extended(task.parent, coarse)
    if task.proposer is not None:
        points["proposal"] = restated(coarse, task.proposer)
    more = task.starts if task.start is None else 0
    effort = Effort(
        first=0,
        random=more,
        kinds=FEW_IN_TURN,
        beside=0,
        most=more,
        often=1,
        unseen=1.0,
        unseen_far=1.0,
        refined=1,
        most_refined=MOST_REFINED,
        settles=False,
        widens=False,
        iterations=NEAR if task.near else ITERATIONS,
        guesses=GUESSES if task.start is None else 0,
        seed=task.seed,
    )
    exploration = explored(task.problem, effort, Options(deadline=deadline), points)
    starts, solutions = exploration.starts, list(exploration.solutions)
    if not solutions and task.start is not None:
        evidence = (f"the motion that proposes it leads to none ({_ends_of(starts)})",)
        return Node(task.sequence, Verdict.FAILED, evidence=evidence, starts=tuple(starts))
    if not solutions:
        if exploration.late:
            return _late(task, starts)
        try:
            rest = _without_minimum(task, coarse, starts, deadline)
        except _TimeIsUp:
            return _late(task, starts)
        if isinstance(rest, Node):
            return rest
        solutions = [rest]
    if task.method != solutions[0].method or not on_mesh_of(task.problem, solutions[0]):
        driven = _solved(task.problem, task.method, solutions[0], Options(deadline=deadline))
        solutions = [driven, *solutions[1:]] if driven.converged else solutions
    minima = sorted({s.cost for s in solutions} | {basin.cost for basin in exploration.coarse})
    return replace(_node(task, solutions), starts=starts, minima=tuple(minima))


def _on_finer_meshes(task: NodeTask, node: Node) -> Node:
    """A node that the simulation contradicts, from its motion on finer meshes, until that is
    confirmed or its errors do not fall any more."""
    before = node.solution
    if before is None or before.verification is None:
        return node
    task = replace(task, problem=with_goal_of(task.problem, before.phases[-1].q[-1]))
    deadline, steps = Deadline.after(task.seconds), task.problem.phase_steps
    errors = before.verification.excess
    for factor in task.finer:
        mesh = task.problem.meshed([min(factor * n, MOST_STEPS) for n in steps])
        fine = _solved(mesh, task.method, before, Options(iterations=ITERATIONS, deadline=deadline))
        on_it = f"with {factor} times the steps"
        if not fine.converged or fine.verification is None:
            return _doubted(node, f"{on_it} no motion was found: {fine.message}")
        if fine.minimum:
            before_it = (
                f"with {max(steps)} steps a phase it costs {node.cost:.6g}, and {node.evidence[0]}"
            )
            confirmed = _node(task, [fine])
            evidence = (f"{confirmed.evidence[0]}, {on_it}", before_it, *node.evidence[1:])
            minima = tuple(sorted({fine.cost, *(c for c in node.minima if c != node.cost)}))
            return replace(
                confirmed, evidence=evidence, starts=node.starts, minima=minima,
                attempts=node.attempts, seconds=node.seconds,
            )  # fmt: skip
        if fine.verification.excess > FALLING * errors:
            return _doubted(node, f"{on_it} it is no better: {fine.message}")
        before, errors = fine, fine.verification.excess
    return _doubted(node, f"{on_it} it is better, and not yet confirmed: {before.message}")


def _doubted(node: Node, why: str) -> Node:
    return replace(node, evidence=(*node.evidence, why))


class _TimeIsUp(Exception):  # noqa: N818 - it is an answer
    """The limit of a node was reached."""


def _late(task: NodeTask, starts: Sequence[Start]) -> Node:
    """The node of a task that is over its time, which leaves some starts untried."""
    return Node(
        task.sequence,
        Verdict.FAILED,
        evidence=(f"the limit of {task.seconds:g} s was reached",),
        starts=(*starts, Start("rest", Status.TIME_LIMIT, None)),
    )


def _solved(
    problem: Problem, method: str, guess: InitialGuess, options: Options, verify: bool = True
) -> Solution:
    """Solve within its limits; Ctrl-C, which ends a solve with a status, ends the search too."""
    request = Request(METHODS[method], options, verify=verify)
    s = solved_on_mesh(problem, guess, request)
    if s.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    return s


def _node(task: NodeTask, solutions: Sequence[Solution]) -> Node:
    """The node of the first of some minima, the best one."""
    s = solutions[0]
    evidence: tuple[str, ...]
    if s.status is Status.NOT_VERIFIED:
        verdict, evidence = Verdict.UNVERIFIED, (s.message,)
    elif s.status is Status.GRAZES:
        verdict = Verdict.GRAZES
        evidence = (f"cost {s.cost:.6g}, and {without_effect(s.trajectory)}",)
    else:
        verdict, evidence = Verdict.FEASIBLE, (confirmed_at(s.cost),)
    cheaper = [o for o in solutions[1:] if o.status is Status.NOT_VERIFIED and o.cost < s.cost]
    if cheaper:
        evidence += (
            f"a motion of cost {cheaper[0].cost:.6g} was not confirmed: {cheaper[0].message}",
        )
    if s.proposal is not None:
        evidence += (str(s.proposal),)
    return Node(
        task.sequence,
        verdict,
        s.cost,
        tuple(p.duration for p in s.phases),
        evidence,
        minima=(s.cost,),
        shortest=limited_by(s),
        solution=replace(s, kernels=None),  # travels without the kernels, which the caller has
    )


def confirmed_at(cost: float) -> str:
    """A sentence that a motion is confirmed, with its cost as it is shown."""
    return f"cost {cost:.6g}, confirmed by simulation"


def limited_by(s: Solution) -> tuple[str, ...]:
    """Bounds of durations that hold a motion."""
    return tuple(b for b in s.active_bounds if b.kind is BoundKind.DURATION and b.side == ">=")


def _ends_of(starts: Sequence[Start]) -> str:
    """How starts have ended, with their numbers."""
    counts = Counter(str(s.status) for s in starts)
    return ", ".join(f"{n} {status}" for status, n in counts.items())


def extended(parent: Solution, problem: Problem) -> Array:
    """Unknowns of a motion with one more event: the parent's last phase, bent to touch the surface
    or to pass the switch where it comes closest to it, or cut in its middle where there is neither,
    and all phases equally long, because where it is cut tells little about when the event shall
    be."""
    problem = designed_as(problem, parent.trajectory.parameters)
    event, pieces = problem.touch.events[-1], pieces_of(parent.trajectory)
    surface = event.surface
    pieces = with_event(problem, pieces, len(pieces) - 1, surface, event.switch)
    if not problem.explicit_time:  # else the surface, too, is where it is at its time
        pieces = equally_long(pieces)
    impulse = impulse_between(problem, pieces[-2], pieces[-1], surface)
    x = unknowns_along(problem, pieces, [*(c.impulse for c in parent.collisions), impulse])
    return in_contact(problem, x)


def _without_minimum(
    task: NodeTask, coarse: Problem, starts: Sequence[Start], deadline: Deadline
) -> Node | Solution:
    """Why no start has led to a minimum: infeasible, unreachable; or a solution from the feasible
    motion that the search for the reason has found.  _TimeIsUp, if the deadline comes first."""
    tried = f"no motion was found from {len(starts)} starts ({_ends_of(starts)})"
    node = Node(task.sequence, Verdict.INFEASIBLE, starts=tuple(starts))
    whole = _least(coarse, deadline)
    if whole.violation <= INFEASIBLE:
        options = Options(deadline=deadline)
        on_coarse = _solved(coarse, COMPILED_METHOD.name, whole.x, options, verify=False)
        fine = _solved(task.problem, COMPILED_METHOD.name, on_coarse, options)
        if fine.converged:
            return fine
        if deadline.passed:
            raise _TimeIsUp
        why = (
            f"{tried}; one of {max(coarse.phase_steps)} steps a phase obeys all conditions, "
            f"from which none of {max(task.problem.phase_steps)} was found: {fine.message}"
        )
        infeasible = fine.status is Status.INFEASIBLE
        verdict = Verdict.INFEASIBLE if infeasible else Verdict.FAILED
        return replace(node, verdict=verdict, evidence=(why,))
    evidence = (tried, *whole.sentences)
    if task.problem.sequence and whole.least:
        # Only the collisions, and as much time as there is: what happens after them is another
        # matter.
        start = dict.fromkeys(n for r in coarse.relations for n in r.starts) | dict(coarse.start)
        latest = (None, coarse.final_time_bounds[1])
        there = _least(coarse.but(start=start, goal={}, periodic=(), final_time=latest), deadline)
        if there.violation > INFEASIBLE and there.least:
            evidence = (tried, *there.sentences)
            return replace(node, verdict=Verdict.UNREACHABLE, evidence=evidence)
    return replace(node, evidence=evidence)


def _least(problem: Problem, deadline: Deadline) -> Diagnosis:
    """The least violation from any of the automatic guesses."""
    diagnoses = list[Diagnosis]()
    for guess in initial_guesses(problem, deadline):
        options = Options(deadline=deadline)
        scale = scale_of(problem, guess.x)
        diagnoses.append(diagnose(problem, scale, guess.x, options))
        if diagnoses[-1].violation <= INFEASIBLE:
            return diagnoses[-1]
        if deadline.passed:
            raise _TimeIsUp
    return min(diagnoses, key=lambda d: (not d.least, d.violation))
