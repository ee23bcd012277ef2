"""What a minimum does not determine: others of it cost the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.transcription import Transcription
from dmoc.results.notes import Note, Topic, with_note
from dmoc.results.solution import Solution
from dmoc.solvers.curvature import SecondOrder
from dmoc.solvers.kkt import cost_size
from dmoc.solving.programs import at_solution

# What is not determined: changed by a tenth of the final time, or of the range of a coordinate, it
# changes the cost by less than a millionth, half of the square times this.
FLAT = 2e-4
# What moves along a direction of size 1 without a change of cost: durations, inputs and the like
# that move by this share are named.
MOVES = 0.5
# Where no more moves than an unknown by so many times 1/N, or the inputs of so many nodes, it
# vanishes with the size of the steps: the discretisation's own error, which a problem cannot help.
RESOLVED = 5.0


def undetermined(problem: Problem, fine: Solution, coarse: Solution | None = None) -> Note | None:
    """A note on what the problem leaves open of a minimum: among the durations, the design and,
    where there is a coarser mesh, the position that has changed most since. None if it determines
    all that."""
    if any(c.grazes for c in fine.collisions):  # they are part of another program
        return None
    nlp, duals = at_solution(problem, fine)
    names = _names(nlp)
    at = np.concatenate([nlp.layout.index_h, nlp.layout.index_design])
    steps = np.array(fine.steps[: nlp.layout.stepped])
    reach = np.append(fine.final_time / steps, nlp.scale.design)
    x, sizes = nlp.scaled(fine.unknowns), nlp.physical(np.ones(nlp.n))
    if coarse is not None:
        node, j = _most_changed(coarse, fine)
        places = nlp.layout.index_q[:, j]
        width = np.ptp(fine.unknowns[places])
        if width > SAME * sizes[places[node]]:
            names.append(f"{fine.trajectory.coordinates[j]} on the way")
            at, reach = np.append(at, places[node]), np.append(reach, width)
    second = SecondOrder(nlp, x, duals).of_unknowns(at)
    curvature = second * (reach / sizes[at]) ** 2 / cost_size(nlp, x)
    left_open = [name for name, c in zip(names, curvature, strict=True) if 0 <= c < FLAT]
    return Note(Topic.OPEN, _sentence(left_open)) if left_open else None


def left_open_along(nlp: Transcription, direction: Array) -> str:
    """A sentence on what a direction without curvature leaves open: the durations and the design
    that move, else what moves most; empty where that is not seen or no more than the mesh
    resolves."""
    lay, size, most = nlp.layout, np.abs(direction), ("", 0.0)
    names = _names(nlp)
    moving = size[np.concatenate([lay.index_h, lay.index_design])] >= MOVES
    if moving.any():
        return _sentence([name for name, moves in zip(names, moving, strict=True) if moves])
    resolved = min(RESOLVED / min(lay.steps[: lay.stepped]), MOVES)
    for block in lay.unknowns:
        if not block.count or block.name == "s":  # no result shows the hidden ones
            continue
        moved = size[block.numbers]
        at_nodes = len(block.index) >= lay.total
        open_share = moved.sum() / lay.total if at_nodes else moved.max()
        if open_share > resolved and moved.max() > most[1]:
            most = block.name_of(int(moved.argmax())), float(moved.max())
    return _sentence([most[0]]) if most[0] else ""


def _names(nlp: Transcription) -> list[str]:
    """Durations and design in words."""
    phases = range(nlp.layout.stepped)
    return [f"the duration of phase {i}" for i in phases] + list(nlp.problem.design)


def _sentence(names: list[str]) -> str:
    return f"the problem does not determine {' and '.join(names)}: others cost the same"


def telling(answer: Solution, note: Note | None) -> Solution:
    """An answer with one note on what is left open, in the place of that which it has; that
    something drifts is told where nothing is seen to be open."""
    told = any(n.topic is Topic.OPEN for n in answer.notes)
    if note is None or (told and note.topic is not Topic.OPEN):
        return answer
    return replace(answer, notes=with_note(answer.notes, note))


def _most_changed(coarse: Solution, fine: Solution) -> tuple[int, int]:
    """Node and coordinate whose position has changed most since a coarser mesh."""
    spread = np.ptp(np.vstack([p.q for p in fine.phases]), axis=0)
    spread = np.where(spread > 0, spread, np.inf)
    best, at, first = -1.0, (0, 0), 0
    for a, b in zip(coarse.phases, fine.phases, strict=True):
        ratio = b.steps // a.steps if a.steps else 1
        change = np.abs(b.q[::ratio] - a.q) / spread
        k, j = np.unravel_index(int(change.argmax()), change.shape)
        if change[k, j] > best:
            best, at = float(change[k, j]), (first + ratio * int(k), int(j))
        first += b.steps
    return at
