"""Nodes of the tree of collision sequences: what is known of one sequence, and on what evidence."""

from __future__ import annotations

import enum
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from dmoc.solution import Solution

Sequence = tuple[str, ...]


class Verdict(enum.StrEnum):
    """What was found out about a sequence (Kern & Gross 2018, "outer optimisation")."""

    OPTIMAL = "optimal"  # the best of the tree
    FEASIBLE = "feasible"
    UNVERIFIED = "unverified"  # solved, and the simulation contradicts it
    INFEASIBLE = "infeasible"  # its collisions can be made, the goal cannot be reached after them
    UNREACHABLE = "unreachable"  # its last collision cannot be made: no sequence that begins with it is looked at
    FAILED = "failed"  # no answer: a limit was reached, or a worker died


@dataclass(frozen=True)
class Start:
    """One start of a node's solves: its name, how it ended, its cost where solved."""

    name: str
    status: str
    cost: float | None


@dataclass(frozen=True)
class Node:
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
        Every start that was tried; "automatic" is the first guess, from which ``dmoc solve`` starts too.
    minima : tuple of float
        Costs of the different local minima, the least first.
    shortest : tuple of str
        Bounds of durations that hold the motion: its collisions would rather merge.
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

    @property
    def name(self) -> str:
        return ", ".join(self.sequence) or "no collision"

    def to_dict(self) -> dict[str, Any]:
        """The summary that the command line prints as JSON."""
        return {
            "sequence": list(self.sequence),
            "verdict": self.verdict.value,
            "cost": self.cost,
            "phases": list(self.phases),
            "evidence": list(self.evidence),
            "starts": [{"name": s.name, "status": s.status, "cost": s.cost} for s in self.starts],
            "minima": list(self.minima),
            "shortest": list(self.shortest),
            "attempts": self.attempts,
            "seconds": self.seconds,
        }

    @classmethod
    def from_dict(cls, given: Mapping[str, Any], solution: Solution | None) -> Node:
        return cls(
            tuple(given["sequence"]), Verdict(given["verdict"]), given["cost"], tuple(given["phases"]), tuple(given["evidence"]),
            tuple(Start(s["name"], s["status"], s["cost"]) for s in given["starts"]), tuple(given["minima"]), tuple(given["shortest"]),
            given["attempts"], given["seconds"], solution,
        )  # fmt: skip

    def to_row(self) -> tuple[str, str, bytes | None]:
        """Sequence, summary and solution, as the journal keeps them."""
        data = None if self.solution is None else self.solution.to_bytes()
        return json.dumps(list(self.sequence)), json.dumps(self.to_dict()), data

    @classmethod
    def from_row(cls, summary: str, data: bytes | None) -> Node:
        return cls.from_dict(json.loads(summary), None if data is None else Solution.from_bytes(data))

    def judged(self, verdict: Verdict) -> Node:
        return replace(self, verdict=verdict)
