"""The answer of a search: its best sequence, stated once more as :func:`dmoc.solve` states it.

Nodes are compared with the law of impact in the rates of the gaps
(:mod:`dmoc.sequences.node_solve`); a solve has the discrete energies, and refines its mesh where
the problem leaves it open.  Both tend to one motion; what is told is what a solve from the motion
of the node gives.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.tolerances import SAME_COST
from dmoc.problem.problem import Problem
from dmoc.program.extraction import stated_in_rates
from dmoc.results.solution import Solution
from dmoc.sequences.nodes import Node
from dmoc.sequences.tree import Tree
from dmoc.solvers.outcome import Status
from dmoc.solving.solve import solve

# Seconds that are worth beginning for.
LEAST = 1e-3


def state_best(tree: Tree, stated: Problem, deadline: Deadline) -> list[str]:
    """State the best node of a tree as a solve does, in its place; where it then costs more than
    another one, that one too.  Return what is to be said of it.

    ``stated`` is the problem as the caller has it: perhaps without steps, where the tree has some.
    An interrupted solve raises KeyboardInterrupt.
    """
    notes = dict[tuple[str, ...], str]()
    while (best := tree.best()) is not None and best.sequence not in notes:
        notes[best.sequence] = ""
        problem = _problem(tree, stated, best)
        if problem is None:
            continue
        if deadline.left < LEAST:
            return ["the best has the cost of its node: no time was left to solve it once more"]
        answer = solve(problem, tree.settings.method, guess=best.solution, seconds=deadline.seconds)
        if answer.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        note = _difference(best, answer)
        notes[best.sequence] = f"{best.name}: {note}" if note else ""
        tree.nodes[best.sequence] = _stated(best, answer, note)
    return [] if best is None or not notes[best.sequence] else [notes[best.sequence]]


def _problem(tree: Tree, stated: Problem, node: Node) -> Problem | None:
    """The problem that a solve would state for a node; None where that is the node's own."""
    if node.solution is None:
        return None
    problem = tree.problem_of(node.sequence)
    if stated.steps is None:
        return problem.but(steps=None)
    if not stated_in_rates(problem, node.solution.multipliers):
        return None
    return problem.meshed(node.solution.steps)


def _difference(node: Node, answer: Solution) -> str:
    """How a solve from the motion of a node differs from it; nothing where it does by less than its
    own error."""
    if not answer.minimum or node.cost is None:
        return (
            "with the law of impact in the discrete energies, as dmoc.solve has it, this motion is "
            f"not confirmed, so that its cost is the one in the rates: {answer.message}"
        )
    error = SAME_COST
    if answer.error_estimate is not None and np.isfinite(answer.error_estimate):
        error = max(error, answer.error_estimate)
    if abs(answer.cost - node.cost) <= error * abs(answer.cost):
        return ""
    return (
        f"on the mesh of the search, with the law of impact in the rates of the gaps, it costs "
        f"{node.cost:.6g}"
    )


def _stated(node: Node, answer: Solution, note: str) -> Node:
    """A node with the motion of a solve, if that is confirmed, and how they differ."""
    first, *rest = node.evidence
    if not answer.minimum:
        return replace(node, evidence=(first, note, *rest))
    evidence = (f"cost {answer.cost:.6g}, confirmed by simulation", *([note] if note else []))
    return replace(
        node,
        cost=answer.cost,
        phases=tuple(p.duration for p in answer.phases),
        minima=tuple(sorted({answer.cost, *(c for c in node.minima if c != node.cost)})),
        evidence=(*evidence, *rest),
        solution=replace(answer, kernels=None),
    )
