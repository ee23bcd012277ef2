"""The sequences that relaxed motions propose, solved exactly: the cheapest first, and the
neighbours of the best (:mod:`dmoc.sequences.neighbours`), and those that relaxed motions beside it
propose."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.codegen.kernels import Array
from dmoc.guess.contacts import in_contact
from dmoc.guess.folded import Folded
from dmoc.guess.transfer import pieces_of
from dmoc.problem.problem import Problem
from dmoc.sequences.neighbours import lifting, neighbours, other_returns, shorter
from dmoc.sequences.node_solve import NodeTask
from dmoc.sequences.nodes import Node, Verdict
from dmoc.sequences.pool import Workers
from dmoc.sequences.proposals import Proposals, Words
from dmoc.sequences.settings import BEYOND, proposed
from dmoc.sequences.tree import FINER, FINEST, TOGETHER, Tree
from dmoc.solving.multistart.exploration import coarse_of

# A proposal that costs so much more than the best, relative to it, is not solved: on their mesh
# relaxed motions of the known answers cost between three quarters and one and a tenth of what their
# sequences cost.
DEARER = 0.35
# What an unconfirmed motion promises to save beside the best, at least, on the mesh of both: what
# is less may be its mesh's error.
WORTH = 0.01


class Candidates(Tree):
    """Sequences that were proposed, and what comes of them."""

    def __init__(self, proposals: Proposals, deadline: Deadline) -> None:
        super().__init__(proposals.problem, proposals.settings)
        self.proposals, self.deadline = proposals, deadline
        self.refused = dict(proposals.refused)
        self.frontier = [p.sequence for p in proposals.ranked()] or [()]
        self.cheapest = self._cheapest(self.frontier[0])
        self.left: list[Words] = []  # too dear to be solved
        self.around: set[Words] = set()  # those whose motions others were looked for from
        self.again: set[Words] = set()  # to be solved from starts of their own
        self.hits: list[Words] = []  # neighbours of the best with other hits
        self.ways: dict[Words, Folded] = {}  # motions of the others, from that of the best
        self.promised: set[Words] = set()  # proposals in detail, and what lifts while others land
        # Whether proposals in detail, and those with one event less, have joined.
        self.detailed = self.shortened = False
        self.first: dict[Words, float] = {}  # costs on the mesh of the search

    def surrounded(self) -> Tree:
        """The tree of all sequences, which knows what is confirmed of these: it solves them from
        their parents' motions too, which may be nearer to a better one."""
        tree = Tree(self.problem, self.settings)
        tree.journal, tree.recorded, tree.before = self.journal, self.recorded, self.nodes
        return tree

    def rounds(self) -> Iterator[list[Words]]:
        """The cheapest first, then the neighbours of the best, until it stays the best; where none
        is confirmed, those of others, after finer meshes have been tried."""
        while self.frontier or self._more():
            self.frontier.sort(key=self._rank)
            least = self.least()
            if least == np.inf:
                least = self.cheapest if self._untried() else self._cheapest(self.frontier[0])
            most = least + DEARER * abs(least) if np.isfinite(least) else np.inf
            near = [s for s in self.frontier if self._cheapest(s) <= most]
            if near:
                yield near[:TOGETHER]
            elif self.best() is None:
                return
            else:
                self.left, self.frontier = [*self.left, *self.frontier], []

    def _add(self, node: Node) -> Node:
        """Add a node. Sequences that the best one proposes, where contacts stay at the edges of
        their modes, join too, and other ways of sequences without a motion."""
        self.nodes[node.sequence] = node
        self.frontier.remove(node.sequence)
        if node.cost is not None:
            self.first.setdefault(node.sequence, node.cost)
        if node.verdict not in (Verdict.OPTIMAL, Verdict.FEASIBLE):
            self._other_ways(node.sequence)
        best = self.best()
        if best is not None and best.sequence == node.sequence:
            words = proposed(self.problem, node.solution, self.settings)
            if words and words not in self.nodes and words not in self.frontier:
                self.proposed[words] = node.solution
                self._join(words)
        return node

    def _other_ways(self, sequence: Words) -> None:
        """Hits with tangential restitution, which relaxed motions have none of, may go other ways
        than there; and what is closed may lift while something lands, after which they may have no
        time left."""
        motion = self.proposals.motions.get(sequence, self.ways.get(sequence))
        if motion is None:
            return
        touch = self.problem_of(sequence).touch
        self._promise(lifting(touch, motion))
        for words in other_returns(touch, sequence):
            if words not in self.nodes and words not in self.frontier:
                self.ways.setdefault(words, motion)
                self._join(words)

    def _more(self) -> bool:
        """Fill the frontier; whether there is anything."""
        if self._untried():
            return False
        return self._otherwise() or self._neighbours() or self._once_more()

    def doubtful(self) -> list[Node]:
        """Doubtful nodes whose first cost promises that they could be the best by more than a small
        share."""
        best = self.best()
        if best is None:
            return super().doubtful()
        first = self.first[best.sequence]
        most = first - WORTH * abs(first)
        return [n for n in super().doubtful() if self.first[n.sequence] < most]

    def refine(self, workers: Workers, deadline: Deadline) -> Iterator[Node]:
        """Look at doubtful nodes on the finest meshes too, also beside a best one: there are few,
        and they promise much."""
        for factors in (FINER, FINEST):
            yield from self._refined(factors, workers, deadline)

    def _untried(self) -> bool:
        """Whether none is confirmed, and some wait for a finer mesh."""
        tried = {sequence for sequence, _ in self.refined}
        return self.best() is None and any(n.sequence not in tried for n in self.doubtful())

    def _otherwise(self) -> bool:
        """Put the proposals as they are read step by step into the frontier, or else with one event
        less, each once, where none is confirmed; the first also where the best costs far more than
        relaxed motions promise."""
        best = self.best()
        if best is not None and not self._dear(best):
            return False
        if not self.detailed:
            self.detailed = True
            self._promise(self.proposals.in_detail())
        if best is None and not self.frontier and not self.shortened:
            self.shortened = True
            for words in (p.sequence for p in self.proposals.ranked()):
                touch = self.problem_of(words).touch
                self._join_moved(shorter(touch, self.proposals.motions[words]))
        return bool(self.frontier)

    def _dear(self, best: Node) -> bool:
        """Whether a node costs far more than the cheapest proposal."""
        least = min((p.cost for p in self.proposals.ranked()), default=np.inf)
        return best.cost is not None and best.cost > least + DEARER * abs(least)

    def _promise(self, ways: Mapping[Words, Folded]) -> None:
        """Let the sequences that relaxed motions may mean join the frontier."""
        self.promised.update(ways)
        self._join_moved(ways)

    def _join_moved(self, ways: Mapping[Words, Folded]) -> None:
        """Let the sequences with a motion that a search may try, and has not, join the frontier."""
        new = {s: way for s, way in ways.items() if self.proposals.fits(s)}
        self.ways = new | self.ways
        seen = {*self.nodes, *self.frontier}
        self.frontier += [s for s in new if s not in seen]

    def _neighbours(self) -> bool:
        """Put what the motion of the best proposes into the frontier; whether there is anything."""
        sequence, way = self._center()
        if way is None or sequence in self.around:
            return False
        self.around.add(sequence)
        new = self.proposals.look_around(way, self.deadline)
        touch, most = self.problem_of(sequence).touch, self.settings.max_collisions
        longest = max(most + BEYOND, len(sequence))
        ways = neighbours(touch, way, self.proposals.relaxation.left_open.surfaces)
        self.hits = [s for s, way in ways.items() if way is None and len(s) <= most]
        self.frontier += [s for s in dict.fromkeys((*new, *self.hits)) if s not in self.nodes]
        self._join_moved({s: w for s, w in ways.items() if w is not None and len(s) <= longest})
        return bool(self.frontier)

    def _center(self) -> tuple[Words, Folded | None]:
        """The best and its motion; where none is confirmed, once, the cheapest that may be, or else
        the cheapest proposal."""
        best = self.best()
        if best is None and not self.around:
            best = next(iter(self.doubtful()), None)
            if best is None and self.proposals.motions:
                words = self.proposals.ranked()[0].sequence
                return words, self.proposals.motions[words]
        if best is None or best.solution is None:
            return (), None
        motion = best.solution.trajectory
        hits = ["" if c.surface in c.lands else c.surface for c in motion.collisions]
        impulses = [c.impulse for c in motion.collisions]
        return best.sequence, Folded(tuple(hits), tuple(pieces_of(motion)), tuple(impulses))

    def _once_more(self) -> bool:
        """Put some that have failed into the frontier, to be solved from starts of their own: those
        with other hits than the best, and what relaxed motions may mean where it is dear; where
        none is confirmed, the cheapest."""
        failed = [s for s, n in self.nodes.items() if n.verdict is Verdict.FAILED]
        best = self.best()
        if best is not None:
            worth = [*self.hits, *(self.promised if self._dear(best) else ())]
            failed = [s for s in failed if s in worth and s not in self.again]
        else:
            failed = [] if self.again else sorted(failed, key=self._rank)[:TOGETHER]
        self.again.update(failed)
        self.frontier = failed
        for s in failed:
            del self.nodes[s]
        return bool(failed)

    def _cheapest(self, sequence: Words) -> float:
        proposed = self.proposals.proposed.get(sequence)
        return -np.inf if proposed is None else proposed.cost

    def _rank(self, sequence: Words) -> tuple[Any, ...]:
        return self._cheapest(sequence), *self.place(sequence)

    def _task(self, sequence: Words) -> NodeTask:
        s, problem = self.settings, self.problem_of(sequence)
        return NodeTask(
            problem, None, s.method, s.starts, s.seed, s.node_seconds,
            proposer=self.proposed.get(sequence), start=self._start(problem, sequence),
            near=self.best() is not None and sequence not in self.proposals.motions,
        )  # fmt: skip

    def _start(self, problem: Problem, sequence: Words) -> Array | None:
        """Unknowns, shape (n,), of a sequence's relaxed motion, or of the motion that it has from
        the best, on its coarse mesh."""
        way = self.proposals.motions.get(sequence, self.ways.get(sequence))
        if way is None or sequence in self.again:
            return None
        coarse = coarse_of(problem)
        with np.errstate(all="ignore"):
            return in_contact(coarse, way.unknowns(coarse))
