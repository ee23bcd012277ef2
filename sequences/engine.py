"""The outer problem: which sequence of collisions is the best."""

from __future__ import annotations

import hashlib
import os
import sqlite3
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from importlib import metadata
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.arguments import choice, flag, function, names, number, positive, shown, whole
from dmoc.errors import SearchError
from dmoc.nlp.problem import Problem
from dmoc.sequences.inner import Task
from dmoc.sequences.journal import Journal
from dmoc.sequences.nodes import Node, Verdict
from dmoc.sequences.pool import NoMoreWork, Processes, Run, here, in_executor
from dmoc.solving.methods import METHODS, SEARCHING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STRATEGIES = ("exhaustive", "best-first", "beam")
# Nodes that best-first looks at before it chooses again: a fixed number, so that the answer does not depend on the number of workers.
ROUND = 8
# Share of the largest final time that a phase keeps, unless the search is told otherwise: bounces at ever shorter intervals would pump
# energy without limit (Zeno).
SHORTEST = 0.01
DEEPEST = 12
MOST, MOST_WORKERS = 2**31 - 1, 1000  # of what is counted, of processes
CONFIRMED = (Verdict.OPTIMAL, Verdict.FEASIBLE)


@dataclass(frozen=True)
class Progress:
    """How far a search is: counts of verdicts, nodes known to come, the best so far, seconds."""

    counts: dict[str, int]
    waiting: int
    best: Node | None
    seconds: float


@dataclass(frozen=True)
class SearchResult:
    """Result of :func:`dmoc.search`.

    Attributes
    ----------
    nodes : tuple of Node
        By depth, then in the order of the surfaces.
    best : Node or None
        The optimal one.
    complete : bool
        Whether every node of the strategy was looked at.
    notes : tuple of str
        What limits the answer: budgets, shortest phases, the depth.
    seconds : float
    problem : Problem
    broken : str
        What broke the search off, other than its caller and its budgets: a journal that could not be written, an executor that took no more
        work; empty where nothing did.
    """

    nodes: tuple[Node, ...]
    best: Node | None
    complete: bool
    notes: tuple[str, ...]
    seconds: float
    problem: Problem
    broken: str = ""

    @property
    def counts(self) -> dict[str, int]:
        return dict(Counter(n.verdict.value for n in self.nodes))

    def ranked(self) -> list[Node]:
        """Nodes with a confirmed motion, the cheapest first."""
        good = [n for n in self.nodes if n.verdict in CONFIRMED]
        return sorted(good, key=lambda n: (n.cost, len(n.sequence), n.sequence))

    def to_dict(self) -> dict[str, Any]:
        """The summary that the command line prints as JSON."""
        return {
            "model": self.problem.kernels.name,
            "best": [] if self.best is None else list(self.best.sequence),
            "cost": None if self.best is None else self.best.cost,
            "complete": self.complete,
            "counts": self.counts,
            "notes": list(self.notes),
            "nodes": [n.to_dict() for n in self.nodes],
            "seconds": self.seconds,
        }

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """Draw the tree: verdict by colour, cost on the nodes; write it if a path is given."""
        from dmoc.report.tree import plot_tree

        return plot_tree([(n.sequence, n.verdict.value, n.cost) for n in self.nodes], path)

    def plot_best(self, path: str | os.PathLike[str] | None = None, most: int = 3) -> Figure:
        """Draw the best motions side by side; write the figure if a path is given."""
        from dmoc.report.tree import plot_motions

        chosen = [n for n in self.ranked() if n.solution is not None][:most]
        return plot_motions([(n.name, n.cost or 0.0, n.solution.trajectory) for n in chosen if n.solution is not None], path)


def search(
    problem: Problem,
    max_collisions: int = 3,
    *,
    surfaces: Sequence[str] | None = None,
    strategy: str = "exhaustive",
    beam: int = 4,
    starts: int = 0,
    seed: int = 0,
    method: str = SEARCHING,
    workers: int = 1,
    executor: Executor | None = None,
    seconds: float | None = None,
    node_seconds: float = 60.0,
    max_nodes: int | None = None,
    shortest_phase: float | None = None,
    journal: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> SearchResult:
    """Search for the best sequence of collisions.

    The nodes of a tree are the sequences of surfaces up to a depth, from the empty one on, repeated hits included.  Each is solved from
    its parent's motion, from the automatic guesses and from seeded starts, and gets a verdict with its evidence; the children of one whose
    last collision cannot be made are not looked at.

    Parameters
    ----------
    problem : Problem
        Its own sequence does not matter; it has one number of steps for every phase and no durations.
    max_collisions : int
        Depth of the tree.
    surfaces : sequence of str, optional
        Surfaces that may be hit; all by default.
    strategy : {"exhaustive", "best-first", "beam"}
        All nodes; those first whose parents cost least; the children of the ``beam`` best nodes of each depth.
    beam : int
    starts : int
        Seeded starts of each node, beside the parent's motion and the automatic guesses.
    seed : int
    method : str
        As in :func:`dmoc.solve`.
    workers : int
        Processes of this machine.
    executor : concurrent.futures.Executor, optional
        Where nodes are solved instead: ``Client(...).get_executor()`` of dask.distributed, for example.
    seconds, max_nodes : optional
        Budgets of time and of nodes; nodes of a journal count too.
    node_seconds : float
        Time limit of a node; one that fails is tried once more.
    shortest_phase : float, optional
        Shortest duration of a phase in seconds; by default a hundredth of the largest final time, where that is bounded.
    journal : path, optional
        SQLite file of finished nodes.
    resume : bool
        Go on with the journal's nodes.
    progress : callable, optional
        Called with a :class:`Progress` after every node.

    Returns
    -------
    SearchResult
        Also when a budget ran out or Ctrl-C stopped the search: it has what was found until then.

    Raises
    ------
    SearchError
        If an argument does not fit.
    """
    if not isinstance(problem, Problem):
        raise SearchError(f"problem = {shown(problem)}: expected a Problem, as dmoc.Problem(system, start=..., ...) states it.")
    chosen = tuple(problem.kernels.surfaces if surfaces is None else names(surfaces, "surfaces", "surfaces", SearchError))
    shortest = _shortest(problem, shortest_phase)
    _check(
        problem,
        chosen,
        max_collisions,
        strategy,
        beam,
        starts,
        seed,
        method,
        workers,
        executor,
        seconds,
        node_seconds,
        max_nodes,
        resume,
        journal,
        progress,
    )
    begin = time.perf_counter()
    deadline = np.inf if seconds is None else time.monotonic() + seconds
    base = partial(Task, method=method, starts=starts, seed=seed, seconds=node_seconds)
    tree = _Tree(problem, chosen, max_collisions, shortest, base)
    with ExitStack() as stack:
        if journal is not None:
            record = stack.enter_context(Journal(journal, _identity(problem, chosen, method, starts, seed, shortest), resume))
            tree.journal = record
            tree.known = {
                s: n for s, n in record.finished().items() if n.verdict is not Verdict.FAILED
            }  # those get another chance
        run: Run = here
        if executor is not None:
            run = partial(in_executor, executor)
        elif workers > 1:
            processes = Processes(workers)
            stack.callback(processes.stop)
            run = processes
        stopped = broken = ""
        try:
            for round_ in tree.rounds(strategy, beam):
                for _ in tree.solve(round_, run, max_nodes, deadline):
                    if progress is not None:
                        progress(Progress(tree.counts(), tree.waiting, tree.best(), time.perf_counter() - begin))
                    if time.monotonic() > deadline:
                        break
                if seconds is not None and time.monotonic() > deadline and tree.waiting:
                    stopped = f"the time of {seconds:g} s was used up"
                if not stopped and max_nodes is not None and len(tree.nodes) >= max_nodes and tree.waiting:
                    stopped = f"the limit of {max_nodes} nodes was reached"
                if stopped:
                    break
        except KeyboardInterrupt:
            stopped = "the search was interrupted"
        except NoMoreWork as error:
            stopped = broken = f"the executor takes no more work ({error})"
        except sqlite3.Error as error:
            stopped = broken = f"journal {journal} could not be written ({error})"
    return replace(_result(problem, tree, stopped, max_collisions, strategy, time.perf_counter() - begin), broken=broken)


class _Tree:
    """Nodes found so far, and the sequences that come next."""

    def __init__(
        self, problem: Problem, surfaces: tuple[str, ...], depth: int, shortest: float, base: Callable[..., Task]
    ) -> None:
        self.problem, self.surfaces, self.depth, self.shortest, self.base = problem, surfaces, depth, shortest, base
        self.nodes: dict[tuple[str, ...], Node] = {}
        self.known: dict[tuple[str, ...], Node] = {}
        self.journal: Journal | None = None
        self.frontier: list[tuple[str, ...]] = [()]
        self.passed_over = 0

    @property
    def waiting(self) -> int:
        return len(self.frontier)

    def counts(self) -> dict[str, int]:
        return dict(Counter(n.verdict.value for n in self.nodes.values()))

    def best(self) -> Node | None:
        good = [n for n in self.nodes.values() if n.verdict is Verdict.FEASIBLE]
        return min(good, key=lambda n: (n.cost, len(n.sequence), n.sequence), default=None)

    def rounds(self, strategy: str, beam: int) -> Iterator[list[tuple[str, ...]]]:
        """Sequences to look at next, in an order that does not depend on who solves them."""
        while self.frontier:
            self.frontier.sort(key=self._rank if strategy == "best-first" else self._place)
            count = len(self.frontier) if strategy != "best-first" else ROUND
            if strategy == "beam" and len(self.frontier[0]) > 1:
                parents = sorted({s[:-1] for s in self.frontier}, key=lambda s: self._cost(s))[:beam]
                chosen = [s for s in self.frontier if s[:-1] in parents]
                self.passed_over += len(self.frontier) - len(chosen)
                self.frontier, count = chosen, len(chosen)
            yield self.frontier[:count]

    def solve(self, sequences: list[tuple[str, ...]], run: Run, most: int | None, deadline: float) -> Iterator[Node]:
        """Solve sequences; each finished node is recorded and its children join the frontier."""
        room = len(sequences) if most is None else max(most - len(self.nodes), 0)
        sequences = sequences[:room]
        for s in sequences:
            if s in self.known:
                yield self._add(self.known[s])
        tasks = [self._task(s) for s in sequences if s not in self.nodes]
        for node in run(tasks, deadline):
            self._add(node)
            if self.journal is not None:
                self.journal.add(node)
            yield node

    def _add(self, node: Node) -> Node:
        self.nodes[node.sequence] = node
        self.frontier.remove(node.sequence)
        if node.verdict is not Verdict.UNREACHABLE and len(node.sequence) < self.depth:
            self.frontier += [(*node.sequence, s) for s in self.surfaces]
        return node

    def _task(self, sequence: tuple[str, ...]) -> Task:
        parent = self.nodes[sequence[:-1]].solution if sequence else None
        durations = [(self.shortest, None)] * (len(sequence) + 1) if self.shortest and sequence else None
        return self.base(self.problem.but(sequence=sequence, durations=durations), parent)

    def _place(self, sequence: tuple[str, ...]) -> tuple[int, list[int]]:
        return len(sequence), [self.surfaces.index(s) for s in sequence]

    def _cost(self, sequence: tuple[str, ...]) -> tuple[float, int, list[int]]:
        node = self.nodes.get(sequence)
        return np.inf if node is None or node.cost is None else node.cost, *self._place(sequence)

    def _rank(self, sequence: tuple[str, ...]) -> tuple[Any, ...]:
        return (*self._cost(sequence[:-1]), *self._place(sequence))


def _result(problem: Problem, tree: _Tree, stopped: str, depth: int, strategy: str, seconds: float) -> SearchResult:
    best = tree.best()
    if best is not None:
        best = best.judged(Verdict.OPTIMAL)
        tree.nodes[best.sequence] = best
    whole = [
        replace(n, solution=None if n.solution is None else replace(n.solution, kernels=problem.kernels))
        for n in tree.nodes.values()
    ]
    nodes = tuple(sorted(whole, key=lambda n: tree._place(n.sequence)))
    best = None if best is None else next(n for n in nodes if n.sequence == best.sequence)
    notes = [f"{stopped}: {tree.waiting} known sequences were not looked at"] if stopped else []
    if tree.passed_over:
        notes.append(f"the beam passed over {tree.passed_over} sequences")
    by_depth = [
        min((n.cost for n in nodes if len(n.sequence) == d and n.verdict in CONFIRMED and n.cost is not None), default=np.inf)
        for d in range(depth + 1)
    ]
    if best is not None and len(best.sequence) == depth > 0 and by_depth[depth] < min(by_depth[:-1]):
        notes.append(
            f"the best sequence has all {depth} collisions (cost {by_depth[depth]:.6g}, with fewer {min(by_depth[:-1]):.6g}): more may cost less"
        )
    for verdict, meaning in (
        (Verdict.FAILED, "came to no answer"),
        (Verdict.UNVERIFIED, "were solved and not confirmed by simulation"),
    ):
        count = sum(n.verdict is verdict for n in nodes)
        if count:
            notes.append(f"{count} sequences {meaning}: one of them might be better")
    held = [n for n in nodes if n.shortest]
    if held:
        notes.append(
            f"{len(held)} motions are held by the shortest phase of {tree.shortest:g} s: their collisions would rather merge"
        )
    return SearchResult(nodes, best, not stopped and not tree.passed_over, tuple(notes), seconds, problem)


def _shortest(problem: Problem, given: float | None) -> float:
    latest = problem.final_time_bounds[1]
    if given is None:
        return SHORTEST * latest if np.isfinite(latest) else 0.0
    shortest = number(given, "shortest_phase", SearchError)
    if shortest < 0:
        raise SearchError(f"shortest_phase = {shown(given)}: expected a duration in seconds, 0 or more.")
    return shortest


def _check(
    problem: Problem, surfaces: tuple[str, ...], depth: int, strategy: str, beam: int, starts: int, seed: int, method: str, workers: int,
    executor: object, seconds: float | None, node_seconds: float, max_nodes: int | None, resume: bool, journal: object, progress: object,
) -> None:  # fmt: skip
    known = problem.kernels.surfaces
    if not known:
        raise SearchError(f"model {problem.kernels.name!r} has no surfaces: there are no sequences to search.")
    for name in surfaces:
        if name not in known:
            raise SearchError(f"unknown surface {shown(name)} in surfaces: expected some of {', '.join(known)}.")
    if not surfaces or len(set(surfaces)) < len(surfaces):
        raise SearchError(
            f"surfaces = {', '.join(surfaces) or 'none'}: expected each surface once, and at least one of {', '.join(known)}."
        )
    choice(strategy, "strategy", STRATEGIES, SearchError)
    choice(method, "method", tuple(METHODS), SearchError)
    # The tree grows with the power of the depth.
    for what, given, least, most in (
        ("max_collisions", depth, 0, DEEPEST),
        ("beam", beam, 1, MOST),
        ("starts", starts, 0, MOST),
        ("seed", seed, 0, MOST),
        ("workers", workers, 1, MOST_WORKERS),
    ):
        whole(given, what, least, most, SearchError)
    if max_nodes is not None:
        whole(max_nodes, "max_nodes", 1, MOST, SearchError)
    if seconds is not None:
        positive(seconds, "seconds", "expected a positive time, or None", SearchError)
    positive(node_seconds, "node_seconds", "expected a positive time", SearchError)
    flag(resume, "resume", SearchError)
    function(progress, "progress", SearchError)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise SearchError(f"executor = {shown(executor)}: expected a concurrent.futures.Executor, or None.")
    if journal is not None and (not isinstance(journal, (str, os.PathLike)) or "\0" in str(journal)):
        raise SearchError(f"journal = {shown(journal)}: expected the path of a file, or None.")
    METHODS[method].require(problem.kernels.backend, SearchError)
    if not isinstance(problem.steps, int):
        raise SearchError(f"steps = {problem.steps!r}: expected one number for every phase, because sequences differ in length.")
    METHODS[method].check_size(problem.steps, (depth + 1) * problem.steps * problem.nu, SearchError)
    if problem.durations is not None:
        raise SearchError("the problem bounds the durations of its phases, whose number differs in a search: use shortest_phase.")
    problem.but(sequence=surfaces[:1] * depth)  # the longest sequence must be a problem too
    if resume and journal is None:
        raise SearchError("resume needs the journal of the search that shall go on: name it.")


def _identity(problem: Problem, surfaces: tuple[str, ...], method: str, starts: int, seed: int, shortest: float) -> str:
    """Digest of what the answer of a node depends on."""
    facts = [
        problem.kernels.manifest["fingerprint"], problem.start, problem.goal, problem.steps, problem.final_time_bounds, problem.bounds,
        problem.parameter_values.tolist(), problem.restitution_values.tolist(), problem.periodic, problem.control_form, problem.minimal_times,
        problem.kernels.backend, metadata.version("dmoc"), surfaces, method, starts, seed, shortest,
    ]  # fmt: skip
    return hashlib.sha256(repr(facts).encode()).hexdigest()
