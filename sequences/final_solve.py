"""The answer of a search: its best sequence, explored once more as :func:`dmoc.solve` does it.

Nodes are compared with the law of impact in the rates of the gaps
(:mod:`dmoc.sequences.node_solve`), and their starts are few; a solve has the discrete energies,
refines its mesh where the problem leaves it open, and tries starts until few minima are likely to
be left.  The motion of the node is one of these starts: what is told is the best that they lead to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.tolerances import SAME_COST
from dmoc.problem.attitudes import with_goal_of
from dmoc.problem.problem import Problem
from dmoc.results.exploration import exploration_in_words
from dmoc.results.solution import Minimum, Solution, saying
from dmoc.sequences.node_solve import confirmed_at, limited_by
from dmoc.sequences.nodes import Node
from dmoc.sequences.tree import Tree
from dmoc.solvers.outcome import Status
from dmoc.solving.answer import answer_of, best_answer
from dmoc.solving.keywords import Keywords
from dmoc.solving.request import GIVEN, request_of

# Seconds that are worth beginning for.
LEAST = 1e-3
# Random starts and motions beside minima: at most such a share of the starts of all nodes, or these
# where that is less; and the share of the time that is left which they may take.
STARTS_SHARE, FEWEST, SHARE = 0.5, 24, 0.6


def state_best(tree: Tree, stated: Problem, deadline: Deadline) -> list[str]:
    """State the best node of a tree as a solve does, in its place; where it then costs more than
    another one, that one too.  Return what is to be said of it.

    ``stated`` is the problem as the caller has it: perhaps without steps, where the tree has some.
    An interrupted solve raises KeyboardInterrupt.
    """
    notes = dict[tuple[str, ...], list[str]]()
    while (best := tree.best()) is not None and best.sequence not in notes:
        notes[best.sequence] = []
        if best.solution is None:
            continue
        if deadline.left < LEAST:
            return ["the best has the cost of its node: no time was left to explore it"]
        answer = _explored(tree, stated, best, best.solution, deadline)
        said = [exploration_in_words(answer)] if answer.starts else []
        said += _difference(best, answer)
        notes[best.sequence] = [f"{best.name}: {note}" for note in said]
        tree.nodes[best.sequence] = _stated(best, answer, said)
    return [] if best is None else notes[best.sequence]


def _explored(
    tree: Tree, stated: Problem, node: Node, motion: Solution, deadline: Deadline
) -> Solution:
    """The best motion that many starts lead to, that of a node among them; or what that leads to
    alone, where it costs less."""
    problem = with_goal_of(tree.problem_of(node.sequence), motion.phases[-1].q[-1])
    problem = problem.meshed(motion.steps) if stated.steps else problem.but(steps=None)
    tried = STARTS_SHARE * sum(len(n.starts) for n in tree.nodes.values())
    request = request_of(problem, Keywords(tree.settings.method, seed=tree.settings.seed))
    request = replace(request, most=max(int(tried), FEWEST))
    explored = best_answer(problem, motion, request.within(deadline=deadline.share(SHARE)))
    _raise_interrupted(explored)
    if explored.solved and (explored.first_start == GIVEN or _at_most(explored, motion)):
        return explored
    alone = answer_of(problem, motion, request.within(deadline=deadline))
    _raise_interrupted(alone)
    if explored.solved and not (alone.minimum and not _at_most(explored, alone)):
        return explored
    return _beside(explored, alone) if alone.minimum and explored.starts else alone


def _raise_interrupted(answer: Solution) -> None:
    if answer.status is Status.INTERRUPTED:
        raise KeyboardInterrupt


def _at_most(one: Solution, other: Solution) -> bool:
    """Whether a solution costs no more than another one."""
    return one.cost - other.cost <= SAME_COST * abs(other.cost)


def _beside(explored: Solution, alone: Solution) -> Solution:
    """The solution to which a motion leads alone, with the other minima to which starts have led;
    no start on the coarse mesh has led to a better one."""
    others = [*explored.others]
    if explored.converged:
        steps, starts = explored.steps, explored.agreeing_starts
        others.append(Minimum(explored.cost, starts, explored.status, steps))
    answer = replace(
        alone,
        starts=explored.starts,
        agreeing_starts=1,
        first_start=GIVEN,
        unseen_share=explored.unseen_share,
        others=tuple(sorted(others, key=lambda m: m.cost)),
    )
    return saying(answer, exploration_in_words(answer))


def _difference(node: Node, answer: Solution) -> list[str]:
    """Sentences on how an answer differs from the motion of a node; none where it differs by less
    than its own error."""
    if not answer.minimum or node.cost is None:
        return [
            "with the law of impact in the discrete energies, as dmoc.solve has it, this motion is "
            f"not confirmed, so that its cost is the one in the rates: {answer.message}"
        ]
    error = SAME_COST
    if answer.error_estimate is not None and np.isfinite(answer.error_estimate):
        error = max(error, answer.error_estimate)
    if abs(answer.cost - node.cost) <= error * abs(answer.cost):
        return []
    if _is_other(answer):
        return [f"the few starts of the search led to one that costs {node.cost:.6g}"]
    return [
        "on the mesh of the search, with the law of impact in the rates of the gaps, it costs "
        f"{node.cost:.6g}"
    ]


def _is_other(answer: Solution) -> bool:
    """Whether the answer is another motion than that of the node."""
    return answer.starts > 0 and answer.first_start != GIVEN


def _stated(node: Node, answer: Solution, said: list[str]) -> Node:
    """A node with the motion of a solve, if that is confirmed, and what is said of it."""
    first, *rest = node.evidence
    if not answer.minimum:
        return replace(node, evidence=(first, *said, *rest))
    confirmed = confirmed_at(answer.cost)
    if node.cost is None or confirmed_at(node.cost) != confirmed:
        first = confirmed
    before = [c for c in node.minima if c != node.cost or _is_other(answer)]
    return replace(
        node,
        cost=answer.cost,
        phases=tuple(p.duration for p in answer.phases),
        minima=tuple(sorted({answer.cost, *before})),
        evidence=(first, *said, *([] if _is_other(answer) else rest)),
        shortest=limited_by(answer),
        solution=replace(answer, kernels=None),
    )
