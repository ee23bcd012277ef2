"""The tree of sequences: nodes found so far, and those that come next."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.problem.problem import Problem
from dmoc.results.solution import Solution
from dmoc.sequences.comparison import best_of, better
from dmoc.sequences.journal import Journal
from dmoc.sequences.node_solve import NodeTask
from dmoc.sequences.nodes import Node, Verdict
from dmoc.sequences.pool import Workers
from dmoc.sequences.settings import Settings, children, hits_alone, proposed, refusal

# Nodes that best-first looks at before it chooses again: a fixed number, so that the answer does
# not depend on the number of workers.
ROUND = 8
# Nodes that are looked at together on finer meshes, for the same reason.
TOGETHER = 2
# So many times finer are the meshes where the simulation contradicts a motion that would be the
# best, and where it has confirmed none.
FINER, FINEST = (2, 4), (8, 16)


class Tree:
    """Nodes found so far, and the sequences that come next."""

    def __init__(self, problem: Problem, settings: Settings) -> None:
        self.problem, self.settings = problem, settings
        self.nodes: dict[tuple[str, ...], Node] = {}
        self.recorded: dict[tuple[str, ...], Node] = {}
        # Those of a search that this one goes on with.
        self.before: dict[tuple[str, ...], Node] = {}
        self.journal: Journal | None = None
        self.frontier: list[tuple[str, ...]] = [()]
        self.passed_over = 0
        self.refused: dict[tuple[str, ...], str] = {}
        # What motions propose, and all that these begin with; the motion whose proposal it is.
        self.proposed: dict[tuple[str, ...], Solution | None] = {}
        self.refined: set[tuple[tuple[str, ...], tuple[int, ...]]] = set()

    def keep(self, journal: Journal) -> None:
        """Record nodes in a journal; its own count, but failed ones get another chance."""
        self.journal = journal
        finished = journal.finished()
        self.recorded = {s: n for s, n in finished.items() if n.verdict is not Verdict.FAILED}

    @property
    def waiting(self) -> int:
        return len(self.frontier)

    @property
    def count(self) -> int:
        """Nodes that were looked at."""
        return len(self.nodes | self.before)

    def counts(self) -> dict[str, int]:
        return dict(Counter(n.verdict.value for n in self.nodes.values()))

    def best(self) -> Node | None:
        return best_of((*self.nodes.values(), *self.before.values()))

    def joined(self) -> dict[tuple[str, ...], Node]:
        """The better ones of its nodes and of those before."""
        return self.before | {s: self._better(node) for s, node in self.nodes.items()}

    def _better(self, node: Node) -> Node:
        return better(node, self.before.get(node.sequence, node))

    def least(self) -> float:
        """The cost of the best, infinite where there is none."""
        best = self.best()
        return np.inf if best is None or best.cost is None else best.cost

    def rounds(self) -> Iterator[list[tuple[str, ...]]]:
        """Sequences to look at next, in an order that does not depend on who solves them."""
        strategy, beam = self.settings.strategy, self.settings.beam
        while self.frontier:
            self.frontier.sort(key=self._rank if strategy == "best-first" else self.place)
            count = len(self.frontier) if strategy != "best-first" else ROUND
            if strategy == "beam" and len(self.frontier[0]) > 1:
                parents = sorted({s[:-1] for s in self.frontier}, key=lambda s: self._cost(s))[
                    :beam
                ]
                chosen = [s for s in self.frontier if s[:-1] in parents]
                self.passed_over += len(self.frontier) - len(chosen)
                self.frontier, count = chosen, len(chosen)
            yield self.frontier[:count]

    def solve(
        self, sequences: list[tuple[str, ...]], workers: Workers, deadline: Deadline
    ) -> Iterator[Node]:
        """Solve sequences; each finished node is recorded and its children join the frontier."""
        most = self.settings.max_nodes
        room = len(sequences) if most is None else max(most - self.count, 0)
        sequences = sequences[:room]
        for s in sequences:
            if s in self.recorded:
                yield self._add(self.recorded[s])
        tasks = [self._task(s) for s in sequences if s not in self.nodes]
        for node in workers(tasks, deadline):
            self._add(node)
            if self.journal is not None:
                self.journal.add(self._better(node))
            yield node

    def _add(self, node: Node) -> Node:
        self.nodes[node.sequence] = node
        self.frontier.remove(node.sequence)
        if node.verdict is not Verdict.UNREACHABLE:
            self._branch(node.sequence)
        words = proposed(self.problem, node.solution, self.settings)
        beginnings = [words[:n] for n in range(1, len(words) + 1)]
        for s in beginnings:
            self.proposed.setdefault(s, node.solution if s == words else None)
        new = next((s for s in beginnings if s not in self.nodes), None)
        if new is not None and self.nodes[new[:-1]].verdict is not Verdict.UNREACHABLE:
            self._join(new)
        return node

    def _branch(self, sequence: tuple[str, ...]) -> None:
        """The children of a sequence join the frontier: all within the depth, and what motions
        propose."""
        if len(sequence) < self.settings.max_collisions:
            for word in children(self.problem, sequence, self.settings):
                self._join((*sequence, word))
        for child in sorted(s for s in self.proposed if s[:-1] == sequence):
            self._join(child)

    def _join(self, child: tuple[str, ...]) -> None:
        """A sequence joins the frontier, unless it is there or was, or no problem can have it."""
        if child in self.proposed and (child in self.nodes or child in self.frontier):
            return
        simple = hits_alone(self.problem, self.settings)
        if reason := "" if simple else refusal(self.problem, child):
            self.refused[child] = reason
        else:
            self.frontier.append(child)

    def problem_of(self, sequence: tuple[str, ...]) -> Problem:
        """The problem of a sequence, whose phases beside impacts keep the shortest duration."""
        problem, shortest = self.problem.but(sequence=sequence), self.settings.shortest_phase
        if not (shortest and sequence):
            return problem
        hit = [False, *problem.touch.impacts.tolist(), False]
        beside = (before or after for before, after in pairwise(hit))
        return problem.but(durations=[(shortest, None) if b else None for b in beside])

    def _task(self, sequence: tuple[str, ...]) -> NodeTask:
        parent = self.nodes[sequence[:-1]].solution if sequence else None
        s, proposer = self.settings, self.proposed.get(sequence)
        problem = self.problem_of(sequence)
        return NodeTask(
            problem, parent, s.method, s.starts, s.seed, s.node_seconds, proposer=proposer
        )

    # Finer meshes ---------------------------------------------------------------------------------

    def doubtful(self) -> list[Node]:
        """Nodes that the simulation contradicts on their mesh and that would be the best, the
        cheapest first."""
        least = self.least()
        nodes = [
            n
            for n in self.nodes.values()
            if n.verdict is Verdict.UNVERIFIED and n.cost is not None and n.cost < least
        ]
        return sorted(nodes, key=lambda n: self._cost(n.sequence))

    def refine(self, workers: Workers, deadline: Deadline) -> Iterator[Node]:
        """Look at doubtful nodes on finer meshes, until none of them is cheaper than the best; on
        the finest where there is none."""
        yield from self._refined(FINER, workers, deadline)
        if self.best() is None:
            yield from self._refined(FINEST, workers, deadline)

    def _refined(
        self, factors: tuple[int, ...], workers: Workers, deadline: Deadline
    ) -> Iterator[Node]:
        while not deadline.passed:
            nodes = [n for n in self.doubtful() if (n.sequence, factors) not in self.refined]
            if not nodes:
                return
            nodes = nodes[:TOGETHER]
            self.refined |= {(n.sequence, factors) for n in nodes}
            tasks = [replace(self._task(n.sequence), doubtful=n, finer=factors) for n in nodes]
            for node in workers(tasks, deadline):
                if node.solution is not None:
                    self.nodes[node.sequence] = node
                    if self.journal is not None:
                        self.journal.add(self._better(node))
                yield node

    def place(self, sequence: tuple[str, ...]) -> tuple[int, list[tuple[int, str]]]:
        """Shorter ones first, then in the order of the surfaces, hits before other words."""
        surfaces = self.settings.surfaces
        order = {name: i for i, name in enumerate(surfaces)}
        return len(sequence), [(order.get(word, len(surfaces)), word) for word in sequence]

    def _cost(self, sequence: tuple[str, ...]) -> tuple[float, int, list[tuple[int, str]]]:
        node = self.nodes.get(sequence)
        return np.inf if node is None or node.cost is None else node.cost, *self.place(sequence)

    def _rank(self, sequence: tuple[str, ...]) -> tuple[Any, ...]:
        return (*self._cost(sequence[:-1]), *self.place(sequence))
