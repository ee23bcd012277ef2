"""The outer problem: which sequence of collisions is the best."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dmoc.base.arguments import shown, whole
from dmoc.base.deadline import Deadline
from dmoc.base.errors import SearchError
from dmoc.base.progress import Listener, listener
from dmoc.base.signatures import public
from dmoc.base.table import Shown, Table
from dmoc.motion.trajectory import noun_of
from dmoc.problem.problem import Problem
from dmoc.report.film import Proofs
from dmoc.results.exploration import exploration_of
from dmoc.sequences.candidates import Candidates
from dmoc.sequences.comparison import CONFIRMED, with_optimum
from dmoc.sequences.final_solve import state_best
from dmoc.sequences.identity import identity
from dmoc.sequences.journal import Journal
from dmoc.sequences.keywords import PROPOSING, STARTS
from dmoc.sequences.nodes import Node, Verdict
from dmoc.sequences.notes import notes_of, notes_of_proposals
from dmoc.sequences.pool import workers_of
from dmoc.sequences.proofs import Claim, TreeProof, check_provable, proof_of
from dmoc.sequences.proposals import Proposed, proposals_of
from dmoc.sequences.search_table import best_in_words, table_of_search
from dmoc.sequences.settings import Settings, settings_of
from dmoc.sequences.traversal import INTERRUPTED, Progress, walked
from dmoc.sequences.tree import Tree
from dmoc.solving.keywords import MOST_COUNT
from dmoc.solving.methods import SEARCHING, usual
from dmoc.solving.request import check_problem

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Steps of a phase where the problem leaves them open, in those of its first mesh.
SEARCHED = 2


@public(SearchError)
@dataclass(frozen=True)
class SearchResult(Shown):
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
        What broke the search off, other than its caller and its budgets: a journal that could not
        be written, an executor that took no more work; empty where nothing did.
    proposals : tuple of Proposed
        Sequences that relaxed motions have, with how many starts led to each, the cheapest first;
        none of strategies that try all.
    proof : TreeProof or None
        What is proved of all sequences, where that was asked for.
    """

    nodes: tuple[Node, ...]
    best: Node | None
    complete: bool
    notes: tuple[str, ...]
    seconds: float
    problem: Problem
    broken: str = ""
    proposals: tuple[Proposed, ...] = ()
    proof: TreeProof | None = None

    def __repr__(self) -> str:
        counts = ", ".join(f"{n} {verdict}" for verdict, n in self.counts.items())
        return f"<SearchResult of {self.problem.kernels.name}: {best_in_words(self)}; {counts}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        return table_of_search(self)

    @property
    def noun(self) -> str:
        """What the nodes are sequences of: "collision" where all words are hits, else "event"."""
        switches = self.problem.touch.contacts.switches
        return noun_of((word for n in self.nodes for word in n.sequence), switches)

    @property
    def counts(self) -> dict[str, int]:
        return dict(Counter(n.verdict.value for n in self.nodes))

    def name_of(self, node: Node) -> str:
        """The words of a node with commas between them, "no collision" or "no event"."""
        if not isinstance(node, Node):
            raise SearchError(f"node = {shown(node)}: expected one of the nodes of the search.")
        return node.name if node.sequence else f"no {self.noun}"

    @property
    def _proofs(self) -> Proofs:
        """What is proved, in words."""
        if self.proof is None:
            return Proofs()
        bounded = ((n.sequence, self.proof.of(n.sequence)) for n in self.nodes)
        proved = {s: str(b) for s, b in bounded if b is not None and b.claim is not Claim.OPEN}
        return Proofs(proved, self.proof.in_words)

    def ranked(self) -> list[Node]:
        """Nodes with a confirmed motion, the cheapest first."""
        good = [n for n in self.nodes if n.verdict in CONFIRMED]
        return sorted(good, key=lambda n: (n.cost, len(n.sequence), n.sequence))

    def to_dict(self) -> dict[str, Any]:
        """The summary that the command line prints as JSON; "exploration" is that of the best
        sequence, as a solution has it."""
        motion = None if self.best is None else self.best.solution
        return {
            "model": self.problem.kernels.name,
            "best": [] if self.best is None else list(self.best.sequence),
            "cost": None if self.best is None else self.best.cost,
            "complete": self.complete,
            "counts": self.counts,
            "exploration": None if motion is None else exploration_of(motion),
            "notes": list(self.notes),
            "proposals": [p.to_dict() for p in self.proposals],
            "proof": None if self.proof is None else self.proof.to_dict(),
            "nodes": [n.to_dict() for n in self.nodes],
            "seconds": self.seconds,
        }

    def plot(self, path: str | os.PathLike[str] | None = None, *, style: str = "light") -> Figure:
        """Draw the tree: verdict by colour, cost on the nodes; a black square marks those of which
        something is proved; write it if a path is given.
        ``style`` is "light" or "dark"."""
        from dmoc.report.search_tree import plot_tree

        nodes = [(n.sequence, n.verdict.value, n.cost) for n in self.nodes]
        return plot_tree(nodes, path, style=style, proofs=self._proofs)

    def plot_best(
        self, path: str | os.PathLike[str] | None = None, most: int = 3, *, style: str = "light"
    ) -> Figure:
        """Draw the best motions side by side; write the figure if a path is given.  ``style`` is
        "light" or "dark"."""
        from dmoc.report.search_tree import plot_motions

        most = whole(most, "most", 1, MOST_COUNT, SearchError)
        chosen = [n for n in self.ranked() if n.solution is not None][:most]
        return plot_motions(
            [
                (self.name_of(n), n.cost or 0.0, n.solution.trajectory)
                for n in chosen
                if n.solution is not None
            ],
            path,
            style=style,
        )

    def animate(
        self,
        path: str | os.PathLike[str],
        *,
        speed: float | None = None,
        fps: int = 25,
        style: str = "light",
    ) -> Path:
        """Write the tree as a page in which its nodes show their motions and verdicts, or the best
        motions side by side as a GIF or an mp4; see :func:`dmoc.animate`."""
        from dmoc.report.animation import animate_tree

        nodes = [
            (n.sequence, self.name_of(n), n.verdict.value, n.cost, n.evidence, n.solution)
            for n in self.nodes
        ]
        name = self.problem.kernels.name
        return animate_tree(
            name, nodes, path, speed=speed, fps=fps, style=style, proofs=self._proofs
        )


@public(SearchError)
def search(
    problem: Problem,
    max_collisions: int = 3,
    *,
    surfaces: Sequence[str] | None = None,
    events: Sequence[str] | None = None,
    strategy: str = "tree",
    beam: int = 4,
    starts: int = STARTS,
    seed: int = 0,
    method: str | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    seconds: float | None = None,
    node_seconds: float | None = None,
    max_nodes: int | None = None,
    shortest_phase: float | None = None,
    journal: str | os.PathLike[str] | None = None,
    resume: bool = False,
    prove: bool = False,
    progress: Listener[Progress] = None,
) -> SearchResult:
    """Search for the best sequence of collisions.

    By default the nodes of a tree are the sequences of surfaces up to a depth, from the empty one
    on, repeated hits included.  Each is solved from its parent's motion, from an automatic guess
    and from random starts on a coarse mesh, and gets a verdict with its evidence; the children of
    one whose last collision cannot be made are not looked at.  The law of impact is stated in the
    rates of the gaps, gamma+ = -e gamma-.  Sequences that would be the best, and that the
    simulation contradicts on their mesh, are solved on finer ones.  The best one is explored once
    more as :func:`dmoc.solve` does, its motion being one of the starts: its cost is that of the
    solve, if that is confirmed, and its evidence says how likely a better motion of it was missed.

    Parameters
    ----------
    problem : Problem
        Its own sequence does not matter; it has one number of steps for every phase, or none and
        gets one, and no durations.
    max_collisions : int
        Depth of the tree.  Sequences that motions propose (see
        :class:`~dmoc.results.proposal.Proposal`) may have up to four events more, those of relaxed
        motions four hits, landings and leavings more, and any changes of friction.
    surfaces : sequence of str, optional
        Surfaces that may be hit, land or leave; all by default.
    events : sequence of str, optional
        Words that may happen, as those of a problem's ``sequence``.  By default all that the
        contacts of a prefix leave possible: landings, contacts that leave and changes of friction
        too, where the problem starts in contact or the model has friction; else hits.  Switches
        are tried only where they are named here: they change nothing by themselves.
    strategy : {"tree", "best-first", "beam", "propose", "both"}
        All nodes; those first whose parents cost least; the children of the ``beam`` best nodes of
        each depth.  "propose" names no sequences: it solves a relaxed program from random starts,
        in which whatever may touch is left open, and then the sequences that its motions have, the
        cheapest first, then the neighbours of the best: those of motions beside it, and with one
        event less, one hit more, two exchanged, other friction, or a contact that opens or closes
        for a while.  Where the problem does not say what is closed at the start, or slides there,
        the cheapest of these motions does, and the ``problem`` of the result has it in its
        ``contacts``.  "both" goes on with all nodes.
    beam : int
    starts : int
        Random starts of each node at most, beside the parent's motion and the automatic guess; a
        sequence that relaxed motions propose begins with theirs alone.
    seed : int
    method : str, optional
        As in :func:`dmoc.solve`; by default "ipm", or "slsqp" if the kernels are not compiled.
    workers : int
        Processes of this machine; with ``prove`` threads that bound boxes, too.
    executor : concurrent.futures.Executor, optional
        Where nodes are solved instead: ``Client(...).get_executor()`` of dask.distributed, for
        example.
    seconds, max_nodes : optional
        Budgets of time and of nodes; nodes of a journal count too.
    node_seconds : float, optional
        Time limit of a node; one that fails is tried once more.  None by default, so that verdicts
        do not depend on the speed of the machine.
    shortest_phase : float, optional
        Shortest duration of a phase that begins or ends with an impact in seconds; by default a
        hundredth of the largest final time, where that is bounded.  Others have that of a solve.
    journal : path, optional
        SQLite file of finished nodes.
    resume : bool
        Go on with the journal's nodes.
    prove : bool
        Bound the cost of all sequences up to the depth afterwards, by what :func:`dmoc.prove` does:
        ``proof`` of the result says that none costs less than the best one by more than a share of
        1e-4, or of which ones nothing is proved.  It has the time that is left of ``seconds``,
        each bound a minute at most.  For motions that are linear between events.
    progress : callable, bool or "lines", optional
        Called with a :class:`Progress` after every node.  True shows it in a line on a terminal or
        in a notebook, "lines" writes it to standard error every second.

    Returns
    -------
    SearchResult
        Also when a budget ran out or Ctrl-C stopped the search: it has what was found until then.

    Raises
    ------
    SearchError
        If an argument does not fit.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> result = dmoc.search(problem.but(steps=20), max_collisions=1)
    >>> result.best.sequence, round(result.best.cost, 2)
    (('east',), 2.82)
    >>> [node.name for node in result.ranked()][:2]
    ['east', 'west']
    """
    keywords = {**locals()}
    check_problem(problem, SearchError)
    stated = problem
    if problem.steps is None:
        problem = problem.but(steps=SEARCHED * max(problem.phase_steps))
    if method is None:
        method = usual(SEARCHING, problem.kernels.compiled)
    if events is not None and surfaces is not None:
        raise SearchError(
            "surfaces and events are both given: give events alone, which names all that may "
            "happen."
        )
    with listener(progress, "first sequence", SearchError) as tell:
        keywords |= {"method": method, "progress": tell}
        settings = settings_of(problem, keywords)
        if settings.prove:
            check_provable(problem)
        return _searched(stated, problem, settings)


def _searched(stated: Problem, problem: Problem, settings: Settings) -> SearchResult:
    begin, deadline = time.perf_counter(), Deadline.after(settings.seconds)
    notes = list[str]()
    try:
        first, stopped = _first_tree(problem, settings, deadline), ""
    except KeyboardInterrupt:
        first, stopped = Tree(problem, settings), INTERRUPTED
    tree, broken, problem = first, "", first.problem
    stated = stated.but(contacts=problem.contacts)
    with ExitStack() as stack:
        if settings.journal is not None:
            tree.keep(
                stack.enter_context(
                    Journal(settings.journal, identity(problem, settings), settings.resume)
                )
            )
        workers = stack.enter_context(workers_of(settings.workers, settings.executor))
        if not stopped:
            stopped, broken = walked(tree, workers, deadline, begin)
        if isinstance(first, Candidates):
            notes = notes_of_proposals(first)
            if settings.strategy == "both" and not stopped:
                tree = first.surrounded()
                stopped, broken = walked(tree, workers, deadline, begin)
                tree.nodes, tree.before = tree.joined(), {}
    try:
        notes += state_best(tree, stated, deadline)
    except KeyboardInterrupt:
        stopped = stopped or INTERRUPTED
    result = _result(tree, stopped, time.perf_counter() - begin)
    proposals = first.proposals.ranked() if isinstance(first, Candidates) else ()
    proof = None
    if settings.prove and not stopped:
        node = result.best
        best = None if node is None else (node.sequence, node.cost or 0.0)
        proof = proof_of(problem, settings, best, deadline)
        result = replace(result, seconds=time.perf_counter() - begin)
    return replace(
        result, broken=broken, notes=(*result.notes, *notes), proposals=proposals, proof=proof
    )


def _first_tree(problem: Problem, settings: Settings, deadline: Deadline) -> Tree:
    """The sequences that relaxed motions propose, or all."""
    if settings.strategy not in PROPOSING:
        return Tree(problem, settings)
    return Candidates(proposals_of(problem, settings, deadline), deadline)


def _result(tree: Tree, stopped: str, seconds: float) -> SearchResult:
    """The result of a search, whose nodes are judged as a whole."""
    problem = tree.problem
    whole = [
        replace(
            n, solution=None if n.solution is None else replace(n.solution, kernels=problem.kernels)
        )
        for n in with_optimum(tree.nodes)
    ]
    nodes = tuple(sorted(whole, key=lambda n: tree.place(n.sequence)))
    best = next((n for n in nodes if n.verdict is Verdict.OPTIMAL), None)
    notes = notes_of(tree, nodes, best, stopped)
    return SearchResult(nodes, best, not stopped and not tree.passed_over, notes, seconds, problem)
