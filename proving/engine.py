"""Which of the two engines bounds a problem: the same sources with small arrays, which are quicker,
or with large ones, which have room for the prices of more conditions."""

from __future__ import annotations

from dmoc.base.errors import ProblemError
from dmoc.proving.branch import LIMITS, Branch
from dmoc.proving.branch_wide import LIMITS as WIDE_LIMITS
from dmoc.proving.branch_wide import Branch as WideBranch
from dmoc.proving.linear import LinearProblem

# Prices that are left for conditions along phases where all steps have some of their own.
SPARE = 8


def branch_of(linear: LinearProblem) -> type[Branch]:
    """The engine with the smallest arrays that have room for a problem."""
    fits = all(count <= most for _, count, most in _counts(linear, LIMITS))
    return Branch if fits else WideBranch


def run(branch: Branch, boxes: int) -> tuple[Branch, bool]:
    """Look at so many boxes more; the engine that goes on, which has larger arrays where there was
    no room for prices, and whether something is left to do."""
    going_on = branch.run(boxes)
    if not (branch.stuck and isinstance(branch, Branch)):
        return branch, going_on
    wide = WideBranch(*branch.arguments)
    if not branch.missed:
        wide.restore(**branch.state())
    return wide, True


def check_size(linear: LinearProblem) -> None:
    """Refuse a problem for which the arrays of no engine have room."""
    for what, count, most in _counts(linear, WIDE_LIMITS):
        if count > most:
            raise ProblemError(f"the problem has {count} {what.format(most)}.")


def _counts(linear: LinearProblem, limits: tuple[int, ...]) -> tuple[tuple[str, int, int], ...]:
    """What there is, with its words, and how much of it there may be."""
    phases, inputs, state, multipliers, of_step, priced, given = limits
    rows = len(linear.goal_zero.b) + len(linear.goal_most.b)
    rows += sum(len(e.zero.b) + len(e.most.b) for e in linear.events)
    squares, of = linear.definitions, ": proofs take at most {}"
    return (
        (f"phases{of}", len(linear.phases), phases),
        (
            f"inputs and squares of positions and velocities of a step{of}",
            max(len(p.c) for p in linear.phases),
            inputs,
        ),
        (f"numbers of a state{of}", 2 * max(p.size for p in linear.phases), state),
        (
            "squares of positions and velocities in all steps: proofs take at most {}; give fewer "
            "steps",
            squares,
            min(priced - SPARE, multipliers - rows - SPARE) if squares else 0,
        ),
        (f"conditions at events and at the goal{of}", rows, multipliers),
        (f"forces and directions of a step{of}", max(len(p.S) for p in linear.phases), of_step),
        (
            f"places and speeds of what moves while it is touched{of} at one time",
            max(len(p.drives) for p in linear.phases),
            given,
        ),
    )
