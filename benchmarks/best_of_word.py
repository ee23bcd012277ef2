"""How often the best motion of a word is found: sixty problems with one sequence each, solved from
no guess, beside the best motion that anybody has found.

python benchmarks/best_of_word.py --default-only             the default call, without a limit
python benchmarks/best_of_word.py --default-only --problems acrobot "three links, wall"
python benchmarks/best_of_word.py --improve --seeds 1 2 3    looks for better ones, and keeps them

CPU seconds are those of one thread on one core, with built kernels.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isfinite, nan
from typing import Any

import best_of_word_known as known
from best_of_word_known import Best
from best_of_word_problems import WORDS, Word
from common import table

import dmoc

SHARE = 0.01  # of the best known cost, within which one counts as found
MANY = 2000  # starts of a try to improve
PROCESSES = 2
HEADER = ("problem", "status", "cost", "best known", "ratio", "starts", "agreeing", "CPU s")


@dataclass(frozen=True)
class Answer:
    """What one solve says, its starts and its CPU seconds."""

    name: str
    status: str
    cost: float = nan
    starts: int = 0
    agreeing: int = 0
    cpu: float = nan

    def near(self, best: Mapping[str, Best]) -> bool:
        """Whether it is confirmed, and costs hardly more than the best known motion."""
        return self.status == "solved" and best[self.name].within(SHARE, self.cost)

    def row(self, best: Mapping[str, Best]) -> tuple[str, ...]:
        least = best[self.name].cost
        mark = "" if self.near(best) else "**"
        return (
            self.name, f"{mark}{self.status}{mark}", f"{self.cost:.7g}", f"{least:.7g}",
            f"{self.cost / least:.4f}", str(self.starts), str(self.agreeing), f"{self.cpu:.2f}",
        )  # fmt: skip


def by_default(word: Word, **options: Any) -> Answer:
    """The default call."""
    problem = word.problem
    begin = time.process_time()
    try:
        solution = dmoc.solve(problem, **options)
    except dmoc.DmocError as error:
        return Answer(word.name, f"{type(error).__name__}: {error}")
    return Answer(
        word.name, str(solution.status), float(solution.cost), solution.starts or 1,
        solution.agreeing_starts or 0, time.process_time() - begin,
    )  # fmt: skip


# Several processes, a core each -------------------------------------------------------------------


def on_cores(run: Callable[[Word], Any], words: Sequence[Word]) -> Iterator[Any]:
    """What a function says of each word, as it comes; each process has a core of its own."""
    available = sorted(os.sched_getaffinity(0))[:PROCESSES]
    cores = multiprocessing.SimpleQueue()
    for core in available:
        cores.put(core)
    with multiprocessing.Pool(len(available), _on_core, (cores,)) as pool:
        yield from pool.imap_unordered(partial(_run, run), [word.name for word in words])


def _on_core(cores: Any) -> None:
    os.sched_setaffinity(0, {cores.get()})


def _run(run: Callable[[Word], Any], name: str) -> Any:
    return run(next(word for word in WORDS if word.name == name))


# Commands -----------------------------------------------------------------------------------------


def defaults(words: Sequence[Word], best: Mapping[str, Best]) -> None:
    """Print what the default call says of each word, and the share that it finds."""
    answers = dict[str, Answer]()
    for answer in on_cores(by_default, words):
        answers[answer.name] = answer
        sys.stderr.write(f"{' '.join(answer.row(best))}\n")
    ordered = [answers[word.name] for word in words]
    print(table(HEADER, [answer.row(best) for answer in ordered]))
    print("\n" + summary(ordered, best))


def summary(answers: Sequence[Answer], best: Mapping[str, Best]) -> str:
    near = sum(answer.near(best) for answer in answers)
    cpu = sum(answer.cpu for answer in answers if isfinite(answer.cpu))
    return (
        f"{near} of {len(answers)} within {100 * SHARE:g} % of the best known cost, "
        f"{100 * near / len(answers):.0f} %; {cpu:.1f} CPU s"
    )


def improve(words: Sequence[Word], best: Mapping[str, Best], seeds: Sequence[int]) -> None:
    """Look for better motions by the default and from many starts, and keep them."""
    for name, new in on_cores(partial(_improved, best, seeds), words):
        before = best.get(name)
        if new is None or new == before:
            continue
        best = {**known.read(), name: new}
        known.write(best)
        was = f"{before.cost:.7g}" if before else "unknown"
        print(f"{name}: {was} -> {new.cost:.7g}, {new.source}", flush=True)


def _improved(
    best: Mapping[str, Best], seeds: Sequence[int], word: Word
) -> tuple[str, Best | None]:
    problem = word.problem
    tries = [("the default", partial(dmoc.solve, problem))]
    tries += [
        (f"{MANY} starts, seed {seed}", partial(dmoc.solve, problem, starts=MANY, seed=seed))
        for seed in seeds
    ]
    return word.name, known.improved(word, best.get(word.name), tries)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--problems", nargs="+", metavar="NAME", help="all by default")
    parser.add_argument("--default-only", action="store_true", help="the default call alone")
    parser.add_argument("--improve", action="store_true", help="look for better motions")
    parser.add_argument("--seeds", nargs="*", type=int, default=[], help="of the many starts")
    options = parser.parse_args()
    names = [word.name for word in WORDS]
    chosen = options.problems or names
    if unknown := [name for name in chosen if name not in names]:
        parser.error(f"--problems {unknown[0]!r}: expected some of {', '.join(names)}")
    words, best = [word for word in WORDS if word.name in chosen], known.read()
    if options.improve:
        improve(words, best, options.seeds)
    if options.default_only:
        defaults(words, best)


if __name__ == "__main__":
    main()
