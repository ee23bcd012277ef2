"""The best known motion of each word: kept as keyframes, confirmed by a solve that begins there,
looked for in several ways."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import best_of_word_peer as peer
import numpy as np
from best_of_word_problems import NAMED, Word

import dmoc
from dmoc.base.files import write_whole

FILE = Path(__file__).parent / "results" / "best_of_word.json"
INTERVALS = (10, 20, 40, 100)  # between the keyframes of a phase: as few as lead back to the motion
FINER = (1, 2, 4)  # meshes on which a motion may be confirmed
SAME = 1e-3  # relative difference of two costs that are of one minimum, on meshes of these sizes
CHEAPER = 1e-6  # by more than this share, a cost is a better one
DIGITS = 6
MANY = 2000  # starts of a try
LINE_SECONDS = 20.0  # of CPU, for straight lines from which CasADi begins

Guess = list[dict[str, list[float]]]
Tries = Iterator[tuple[str, Callable[[], dmoc.Solution]]]  # what leads to a motion, and how


@dataclass(frozen=True)
class Best:
    """The least cost that a confirmed motion has, the steps where it has it, what led to it, and
    keyframes of the motion, for each phase, that lead back to it."""

    cost: float
    steps: tuple[int, ...]
    source: str
    guess: Guess | None = None

    def within(self, share: float, cost: float) -> bool:
        """Whether a cost is not dearer by more than a share of it."""
        return cost <= self.cost + share * abs(self.cost)


def read(path: Path = FILE) -> dict[str, Best]:
    """The best known motions by the names of their words."""
    if not path.exists():
        return {}
    records = json.loads(path.read_text(encoding="utf-8"))
    return {name: Best(**{**r, "steps": tuple(r["steps"])}) for name, r in records.items()}


def write(best: Mapping[str, Best], path: Path = FILE) -> None:
    lines = [f"{json.dumps(name)}: {json.dumps(asdict(best[name]))}" for name in sorted(best)]
    write_whole(path, ("{\n" + ",\n".join(lines) + "\n}\n").encode())


def keyframes(problem: dmoc.Problem, solution: dmoc.Solution, intervals: int) -> Guess:
    """Coordinates and inputs of each phase that has steps, at evenly spread times of it."""
    names = [*problem.kernels.coordinates, *problem.kernels.inputs]
    guess, inside = Guess(), np.linspace(0.0, 1.0, intervals + 1).clip(1e-9, 1 - 1e-9)
    for phase in solution.phases:
        if phase.steps:
            state = solution.at(phase.t[0] + inside * phase.duration)
            courses = {n: [float(f"{x:.{DIGITS}g}") for x in np.asarray(state[n])] for n in names}
            guess.append({**courses, "durations": [float(f"{phase.duration:.9g}")]})
    return guess


def confirmed(problem: dmoc.Problem, guess: Any) -> dmoc.Solution | None:
    """The solution from a guess alone, on the mesh of the problem or a finer one where the check
    does not confirm it."""
    for factor in FINER if problem.steps is not None else FINER[:1]:
        finer = problem.meshed([factor * n for n in problem.phase_steps]) if factor > 1 else problem
        solution = dmoc.solve(finer, "ipm", guess=guess, starts=1)
        if solution.status == "solved":
            return solution
    return None


def kept(problem: dmoc.Problem, motion: dmoc.Solution, source: str) -> Best | None:
    """What is kept of a motion, if it is confirmed."""
    if motion.status != "solved":
        again = confirmed(problem, motion)
        if again is None:
            return None
        motion = again
    mesh = problem if problem.steps is None else problem.meshed(motion.steps)
    for intervals in INTERVALS:
        guess = keyframes(problem, motion, intervals)
        back = dmoc.solve(mesh, "ipm", guess=guess, starts=1)
        if back.status == "solved" and back.cost <= motion.cost + SAME * abs(motion.cost):
            return Best(float(back.cost), back.steps, source, guess)
    return Best(float(motion.cost), motion.steps, source)


def improved(
    word: Word, before: Best | None, tries: Iterable[tuple[str, Callable[[], dmoc.Solution]]]
) -> Best | None:
    """The best of what was known and of what some tries lead to."""
    best = before
    for source, run in tries:
        motion = run()
        if best is None or motion.cost < best.cost - CHEAPER * abs(best.cost):
            new = kept(word.problem, motion, source)
            if new is not None and (best is None or new.cost < best.cost):
                best = new
    return best


# Ways to look for better ones ---------------------------------------------------------------------


def default(word: Word, seeds: Sequence[int], best: Best | None) -> Tries:
    """The default call."""
    yield "the default", partial(dmoc.solve, word.problem)


def starts(word: Word, seeds: Sequence[int], best: Best | None) -> Tries:
    """Many starts."""
    for seed in seeds:
        many = partial(dmoc.solve, word.problem, starts=MANY, seed=seed)
        yield f"{MANY} starts, seed {seed}", many


def lines(word: Word, seeds: Sequence[int], best: Best | None) -> Tries:
    """Minima of CasADi and IPOPT from random straight lines that cost less, as these say."""
    for seed in seeds:
        try:
            for motion in peer.motions(word, LINE_SECONDS, MANY, seed):
                if best is None or motion.cost < best.cost - SAME * abs(best.cost):
                    run = partial(dmoc.solve, word.problem, "ipm", guess=motion.guess, starts=1)
                    yield f"a straight line by CasADi, seed {seed}", run
        except peer.NotStatedError:
            return


def neighbours(word: Word, seeds: Sequence[int], best: Best | None) -> Tries:
    """The best known motions of words with the same coordinates, inputs and phases."""
    shape = _shape(word)
    for name, other in read().items():
        if name != word.name and other.guess and _shape(NAMED[name]) == shape:
            run = partial(dmoc.solve, word.problem, "ipm", guess=other.guess, starts=1)
            yield f"the motion of: {name}", run


def _shape(word: Word) -> tuple[object, ...]:
    system, data = word.statement.system, word.statement.data
    return tuple(system.coordinates), tuple(system.inputs), len(data.get("sequence", ()))


WAYS = {"default": default, "starts": starts, "lines": lines, "neighbours": neighbours}


def looked_for(ways: Sequence[str], seeds: Sequence[int], name: str) -> tuple[str, Best | None]:
    """The best motion of a word after looking for better ones in some ways."""
    word, best = NAMED[name], read().get(name)
    for way in ways:
        best = improved(word, best, WAYS[way](word, seeds, best))
    return name, best


def improve(results: Iterable[tuple[str, Best | None]]) -> Iterator[str]:
    """Keep what is better; a line on each."""
    for name, new in results:
        best = read()
        before = best.get(name)
        if new is not None and (before is None or new.cost < before.cost):
            write({**best, name: new})
            was = f"{before.cost:.7g}" if before else "unknown"
            yield f"{name}: {was} -> {new.cost:.7g}, {new.source}"
