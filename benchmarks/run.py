"""Run the benchmarks and write the report: a section a topic, written whole.

make bench                                  everything, into benchmarks/results
python benchmarks/run.py --quick            few repeats, no slow peers
python benchmarks/run.py --only solve,warm  prints these sections; the report stays as it is
make ladder                                 the ladder of published problems, which takes longest,
                                            into a report of its own
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import ablation
import batches
import build_times
import campaign
import evaluation_times
import exported_solver
import feedback
import fits
import invariance
import ladder
import linear_algebra
import links
import long_runs
import planted_errors
import pruning
import robustness
import schemes
import search_speed
import seeds
import speed
import twenty
import walker_casadi
from common import Section, clocked, filled, machine

HEAD = """# Benchmarks

Written by `make bench`{quick}. Times drift between machines and runs; ratios come from one run,
and so does a section, but not all sections are from the same run. A
solve that failed has no time: how many succeeded stands beside it. Two checkouts are compared by
`benchmarks/compare.py`; errors against known answers are in `docs/known_answers.md`, published
problems from the automatic start in `benchmarks/results/ladder.md`.

Machine: {machine}.
"""

APART = ("ladder", "twenty")  # run only where they are named


def sections(folder: Path) -> dict[str, Callable[[bool], Section]]:
    return {
        "solve": speed.comparison,
        "answer": speed.answer,
        "where": speed.where,
        "contact": speed.contact,
        "linear": linear_algebra.compare,
        "ladder": lambda quick: ladder.ladder(quick, folder),
        "growth": lambda quick: speed.growth(quick, folder),
        "kernels": evaluation_times.compare,
        "links": links.compare,
        "build": build_times.compare,
        "robust": robustness.compare,
        "campaign": partial(campaign.campaign, campaign.FREE),
        "contacts": partial(campaign.campaign, campaign.HELD),
        "invariance": invariance.invariance,
        "planted": planted_errors.compare,
        "schemes": schemes.compare,
        "long": long_runs.compare,
        "seeds": seeds.compare,
        "pruning": pruning.compare,
        "ablation": ablation.compare,
        "warm": speed.warm,
        "batches": batches.compare,
        "carried": exported_solver.compare,
        "threads": exported_solver.batch,
        "fits": fits.compare,
        "feedback": lambda quick: feedback.compare(quick, folder),
        "search": search_speed.compare,
        "twenty": lambda quick: twenty.compare(quick, folder),
        "walker": walker_casadi.walk,
        "transport": walker_casadi.transported,
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few repeats, no slow peers")
    parser.add_argument("--only", default="", help=f"print some of {','.join(sections(Path()))}")
    parser.add_argument(
        "--out", type=Path, default=Path(__file__).parent / "results", help="folder of the report"
    )
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    every = sections(options.out)
    chosen = options.only.split(",") if options.only else [n for n in every if n not in APART]
    if unknown := [name for name in chosen if name not in every]:
        parser.error(
            f"--only {options.only}: no section {unknown[0]}: expected some of {', '.join(every)}"
        )
    texts = []
    for name in chosen:
        sys.stderr.write(f"{name} ... ")
        sys.stderr.flush()
        seconds, section = clocked(lambda n=name: every[n](options.quick))
        texts.append(section.markdown())
        sys.stderr.write(f"{seconds:.0f} s\n")
    if options.only:
        sys.stdout.write("\n".join(texts))
        return
    head = HEAD.format(machine=machine(), quick=" with `--quick`" if options.quick else "")
    head = filled(head.strip()) + "\n"
    path = options.out / "README.md"
    path.write_text("\n".join([head, *texts]), encoding="utf-8")
    sys.stdout.write(f"written: {path}\n")


if __name__ == "__main__":
    main()
