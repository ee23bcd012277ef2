"""Nodes of the tree of collision sequences: what is known of one sequence, and on what evidence."""

from __future__ import annotations

import enum
import json
from dataclasses import dataclass, replace
from typing import Any

from dmoc.base.table import Shown, Table
from dmoc.results.schema import (
    Choice,
    Context,
    Either,
    Listed,
    Nothing,
    Number,
    Record,
    Refused,
    Text,
    Whole,
    dumped,
    no_arrays,
    plain,
)
from dmoc.results.solution import Solution
from dmoc.sequences.search_table import table_of_node
from dmoc.solvers.outcome import Status
from dmoc.solving.multistart.rounds import Start

Sequence = tuple[str, ...]


class Verdict(enum.StrEnum):
    """What was found out about a sequence (Kern & Gross 2018, "outer optimisation")."""

    OPTIMAL = "optimal"  # the best of the tree
    FEASIBLE = "feasible"
    # the best motion touches a surface of the sequence without colliding: no motion of this
    # sequence
    GRAZES = "grazes"
    # a phase of its best motion keeps the shortest duration, and a shorter sequence costs no more
    COLLAPSES = "collapses"
    UNVERIFIED = "unverified"  # solved, and the simulation contradicts it
    INFEASIBLE = "infeasible"  # its collisions can be made, the goal cannot be reached after them
    # its last collision cannot be made: no sequence that begins with it is looked at
    UNREACHABLE = "unreachable"
    FAILED = "failed"  # no answer: a limit was reached, or a worker died


@dataclass(frozen=True, repr=False)
class Node(Shown):
    """What is known of one sequence.

    Attributes
    ----------
    sequence : tuple of str
    verdict : Verdict
    cost : float or None
        Of the best motion; None where there is none.
    phases : tuple of float
        Durations of its phases in seconds.
    evidence : tuple of str
        Why the verdict is what it is.
    starts : tuple of Start
        Every start that was tried on the coarse mesh: the parent's motion, automatic guesses,
        random motions.
    minima : tuple of float
        Costs of the different local minima, the least first.
    shortest : tuple of str
        Bounds of durations that hold the motion: its events would rather merge.
    attempts : int
    seconds : float
    solution : Solution or None
        The best motion.
    """

    sequence: Sequence
    verdict: Verdict
    cost: float | None = None
    phases: tuple[float, ...] = ()
    evidence: tuple[str, ...] = ()
    starts: tuple[Start, ...] = ()
    minima: tuple[float, ...] = ()
    shortest: tuple[str, ...] = ()
    attempts: int = 1
    seconds: float = 0.0
    solution: Solution | None = None

    def __repr__(self) -> str:
        cost = "" if self.cost is None else f", cost {self.cost:.6g}"
        return f"<Node {self.name}: {self.verdict}{cost}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        return table_of_node(self)

    @property
    def name(self) -> str:
        return ", ".join(self.sequence) or "no collision"

    def to_dict(self) -> dict[str, Any]:
        """The summary that the command line prints as JSON."""
        facts: dict[str, Any] = NODE.write(self, "", no_arrays)
        return facts

    def to_row(self) -> tuple[str, str, bytes | None]:
        """Sequence, summary and solution, as the journal keeps them."""
        data = None if self.solution is None else self.solution.to_bytes()
        return json.dumps(list(self.sequence)), dumped(NODE, self), data

    @classmethod
    def from_row(cls, sequence: object, summary: object, data: object) -> Node:
        """Return the node of a row; raise Refused or SolutionFileError if it is none."""
        if not (
            isinstance(sequence, str)
            and isinstance(summary, str)
            and isinstance(data, (bytes, type(None)))
        ):
            raise Refused("a row has other types")
        node: Node = NODE.read(plain(summary), "", Context())
        if json.dumps(list(node.sequence)) != sequence:
            raise Refused("a row is that of another sequence")
        node = replace(node, solution=None if data is None else Solution.from_bytes(data))
        wrong = _wrong(node)
        if wrong:
            raise Refused(wrong)
        return node


def _wrong(node: Node) -> str | None:
    """A sentence about parts of a node and its solution that do not fit together."""
    s = node.solution
    if (s is None) != (node.cost is None) or (s is None) != (node.verdict not in WITH_MOTION):
        return "a verdict, its cost and its motion do not fit together"
    if s is not None and (
        s.cost != node.cost or tuple(c.word for c in s.collisions) != node.sequence
    ):
        return "a motion is that of another node"
    return None


WITH_MOTION = (
    Verdict.OPTIMAL,
    Verdict.FEASIBLE,
    Verdict.GRAZES,
    Verdict.COLLAPSES,
    Verdict.UNVERIFIED,
)
# One line for each field in a row of the journal.
START = Record(
    Start,
    {
        "name": Text(),
        "status": Choice(tuple(Status)),
        "cost": Either(Nothing(), Number(special=True)),
    },
)
NODE = Record(
    Node,
    {
        "sequence": Listed(Text()),  # words of events
        "verdict": Choice(tuple(Verdict)),
        "cost": Either(Nothing(), Number()),
        "phases": Listed(Number()),
        "evidence": Listed(Text()),
        "starts": Listed(START),
        "minima": Listed(Number()),
        "shortest": Listed(Text()),
        "attempts": Whole(1),
        "seconds": Number(),
    },
)
