"""How often the best motion of a word is found: sixty problems with one sequence each, solved from
no guess, beside CasADi and IPOPT from random straight lines and the best motion anybody has found.

python benchmarks/best_of_word.py                        all budgets, both; table and figure
python benchmarks/best_of_word.py --figure               table and figure of what was recorded
python benchmarks/best_of_word.py --default-only         the default call, without a limit
python benchmarks/best_of_word.py --improve starts lines --seeds 1 2     looks for better motions
python benchmarks/best_of_word.py --default-only --problems acrobot "three links, wall"

CPU seconds are those of one thread on one core, with built kernels and programs.  Records are
results/best_of_word_runs.json; the best known motions, results/best_of_word.json.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from math import isfinite
from pathlib import Path

import best_of_word_known as known
import best_of_word_runs as runs
from best_of_word_known import Best
from best_of_word_problems import NAMED
from best_of_word_runs import SHARE, Answer
from common import on_cores, table

PROCESSES = 2
BUDGETS = (0.1, 0.3, 1.0, 3.0, 10.0)
HEADER = ("problem", "status", "cost", "best known", "ratio", "starts", "agreeing", "CPU s")


def by_default(names: Sequence[str], best: Mapping[str, Best]) -> list[Answer]:
    """What the default call says of each word; shown as it comes."""
    answers = dict[str, Answer]()
    for answer in on_cores(runs.by_default, names, PROCESSES):
        answers[answer.name] = answer
        sys.stderr.write(f"{' '.join(row(answer, best))}\n")
    return [answers[name] for name in names]


def row(answer: Answer, best: Mapping[str, Best]) -> tuple[str, ...]:
    least = best[answer.name].cost
    mark = "" if answer.near(best) else "**"
    return (
        answer.name, f"{mark}{answer.status}{mark}", f"{answer.cost:.7g}", f"{least:.7g}",
        f"{answer.cost / least:.4f}", str(answer.starts), str(answer.agreeing),
        f"{answer.cpu:.2f}",
    )  # fmt: skip


def summary(answers: Sequence[Answer], best: Mapping[str, Best]) -> str:
    near = sum(answer.near(best) for answer in answers)
    cpu = sum(answer.cpu for answer in answers if isfinite(answer.cpu))
    return (
        f"{near} of {len(answers)} within {100 * SHARE:g} % of the best known cost, "
        f"{100 * near / len(answers):.0f} %; {cpu:.1f} CPU s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--problems", nargs="+", metavar="NAME", help="all by default")
    parser.add_argument(
        "--budgets", nargs="+", type=float, default=BUDGETS, metavar="S", help="CPU seconds"
    )
    parser.add_argument("--default-only", action="store_true", help="the default call alone")
    parser.add_argument("--figure", action="store_true", help="of what was recorded, with a table")
    parser.add_argument(
        "--improve", nargs="+", choices=tuple(known.WAYS), help="ways to look for better motions"
    )
    parser.add_argument("--seeds", nargs="+", type=int, default=[1], help="of starts and lines")
    parser.add_argument("--out", type=Path, default=runs.FOLDER, help="folder of the records")
    options = parser.parse_args()
    names = options.problems or list(NAMED)
    if unknown := [name for name in names if name not in NAMED]:
        parser.error(f"--problems {unknown[0]!r}: expected some of {', '.join(NAMED)}")
    if options.improve:
        found = partial(known.looked_for, options.improve, options.seeds)
        for line in known.improve(on_cores(found, names, PROCESSES)):
            print(line, flush=True)
    elif options.default_only:
        best = known.read()
        answers = by_default(names, best)
        print(table(HEADER, [row(answer, best) for answer in answers]))
        print("\n" + summary(answers, best))
    else:
        if not options.figure:
            runs.on_cpu_clock()
            run = partial(runs.run, tuple(options.budgets))
            runs.keep(on_cores(run, names, PROCESSES), options.out)
        print(runs.report(options.out).markdown())


if __name__ == "__main__":
    main()
