"""What limits the answer of a search, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.motion.trajectory import noun_of
from dmoc.sequences.candidates import DEARER, Candidates
from dmoc.sequences.comparison import CONFIRMED
from dmoc.sequences.nodes import Node, Verdict
from dmoc.sequences.tree import Tree

# Proposals that a note names.
MOST_NAMED = 5


def notes_of(tree: Tree, nodes: Sequence[Node], best: Node | None, stopped: str) -> tuple[str, ...]:
    """Notes on what limits the answer."""
    switches = tree.problem.touch.contacts.switches
    noun = noun_of((word for n in nodes for word in n.sequence), switches)
    notes = []
    if stopped:
        waiting = _counted(tree.waiting, "known sequence")
        notes.append(f"{stopped}: {waiting} {_were(tree.waiting)} not looked at")
    if tree.passed_over:
        notes.append(f"the beam passed over {_counted(tree.passed_over, 'sequence')}")
    if tree.refused:
        sequence, reason = next(iter(tree.refused.items()))
        notes.append(
            f"{_counted(len(tree.refused), 'sequence')} {_were(len(tree.refused))} left out that "
            "no problem can have, such as "
            f"{', '.join(sequence)}: {reason}"
        )
    notes += _note_of_depth(tree, nodes, best, noun)
    if best is None and not stopped and any(n.verdict is Verdict.INFEASIBLE for n in nodes):
        starts = tree.settings.starts
        notes.append(
            f"no sequence has a confirmed motion, from {_counted(starts, 'random start')} each at "
            f"most: where few starts lead to a motion, as to a gait, starts={max(64, 8 * starts)} "
            "may find one"
        )
    for verdict, meaning in (
        (Verdict.FAILED, "came to no answer"),
        (Verdict.UNVERIFIED, "{were} solved and not confirmed by simulation"),
    ):
        count = sum(n.verdict is verdict for n in nodes)
        if count:
            what = meaning.format(were=_were(count))
            better = "one of them" if count > 1 else "it"
            notes.append(f"{_counted(count, 'sequence')} {what}: {better} might be better")
    held = [n for n in nodes if n.shortest]
    if held:
        are, their = ("are", "their") if len(held) > 1 else ("is", "its")
        notes.append(
            f"{_counted(len(held), 'motion')} {are} held by the shortest duration of a phase: "
            f"{their} {noun}s would rather merge"
        )
    return tuple(notes)


def _note_of_depth(tree: Tree, nodes: Sequence[Node], best: Node | None, noun: str) -> list[str]:
    """Whether more events than the search allows may cost less."""
    depth = tree.settings.max_collisions
    if best is None or not len(best.sequence) == depth > 0:
        return []
    by_depth = [
        min(
            (
                n.cost
                for n in nodes
                if len(n.sequence) == d and n.verdict in CONFIRMED and n.cost is not None
            ),
            default=np.inf,
        )
        for d in range(depth + 1)
    ]
    least = min(by_depth[:-1])
    if not by_depth[depth] < least:
        return []
    every = f"all {depth} {noun}s" if depth > 1 else f"the one {noun}"
    fewer = f"with fewer {least:.6g}" if np.isfinite(least) else "none with fewer is confirmed"
    return [
        f"the best sequence has {every} (cost {by_depth[depth]:.6g}, {fewer}): more may cost less"
    ]


def notes_of_proposals(candidates: Candidates) -> list[str]:
    """Notes on the sequences that relaxed motions have proposed, and on those that were not
    solved."""
    proposals, best = candidates.proposals, candidates.best()
    every = proposals.ranked()
    some = "; ".join(map(str, every[:MOST_NAMED]))
    more = f"; {len(every) - MOST_NAMED} more" if len(every) > MOST_NAMED else ""
    notes = [
        f"{proposals.led} of {_counted(proposals.starts, 'relaxed start')} led to "
        f"{_counted(len(every), 'sequence')}" + (f": {some}{more}" if some else "")
    ]
    if ignored := candidates.proposals.relaxation.passed:
        notes.append(
            f"{', '.join(ignored)}: ignored, and closed in no relaxed motion, which could as well "
            "pass; strategy 'tree' tries to land there"
        )
    left = [s for s in dict.fromkeys(candidates.left) if s not in candidates.nodes]
    if left:
        names = "; ".join(", ".join(s) or "no event" for s in left[:MOST_NAMED])
        notes.append(
            f"{_counted(len(left), 'proposal')} {_were(len(left))} not solved, whose relaxed "
            f"motions cost over {DEARER:.0%} more than the best: {names}"
        )
    if proposals.problem.contacts != proposals.relaxation.problem.contacts:
        notes.append(
            f"the motion begins with contacts={list(proposals.problem.contacts)}, as the cheapest "
            "relaxed one does"
        )
    if every and best is not None and not best.sequence:
        touches = "touches" if candidates.problem.touch.modes[0].free else "changes its contacts"
        notes.append(
            f"of the sequences that were tried none costs less than the motion in which nothing "
            f"{touches}; what no relaxed start has led to was not tried: strategy 'both' goes on "
            "with the tree"
        )
    if not every:
        notes.append(
            "no relaxed motion says a sequence, and none was tried but the empty one: strategy "
            "'tree' tries all"
        )
    return notes


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' * (count != 1)}"


def _were(count: int) -> str:
    return "was" if count == 1 else "were"
