"""Run the benchmarks and write a report: Markdown tables and a plot.  `make bench` calls this; --quick takes a minute and leaves out the slow peers."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import building
import kernels
import robustness
import searching
from common import Section, machine

import solving  # noqa: TID251 - the suite beside this file

HEAD = """# Benchmarks

Written by `make bench`{quick}. Times are medians of several runs on two cores, and drift between machines and runs; ratios come from one run.

Machine: {machine}.
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few repeats, no slow peers")
    parser.add_argument("--only", default="", help="suites, as solve,where,growth,kernels,build,robust,warm,search")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results", help="folder of the report")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    suites: dict[str, Callable[[bool], Section]] = {
        "solve": solving.comparison,
        "where": solving.where,
        "growth": lambda quick: solving.growth(quick, given.out),
        "kernels": kernels.compare,
        "build": building.compare,
        "robust": robustness.campaign,
        "warm": solving.warm,
        "search": searching.compare,
    }
    chosen = given.only.split(",") if given.only else list(suites)
    unknown = [name for name in chosen if name not in suites]
    if unknown:
        parser.error(f"--only {given.only}: expected some of {', '.join(suites)}")
    texts = []
    for name in chosen:
        begin = time.perf_counter()
        sys.stderr.write(f"{name} ... ")
        sys.stderr.flush()
        texts.append(suites[name](given.quick).markdown())
        sys.stderr.write(f"{time.perf_counter() - begin:.0f} s\n")
    head = HEAD.format(machine=machine(), quick=" with `--quick`" if given.quick else "")
    path = given.out / "README.md"
    path.write_text("\n".join([head, *texts]), encoding="utf-8")
    sys.stdout.write("\n".join(texts) + f"\nwritten: {path}\n")


if __name__ == "__main__":
    main()
