"""Certificates of answers: the 23 problems whose sequence nobody names, with their best known
words, and the problem of the source.

python benchmarks/certificates.py                   all, into results/certificates.md
python benchmarks/certificates.py --only puck,hops  some of them, printed

CPU seconds of one process, whose linear algebra has one thread; kernels are built beforehand.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from common import Section, filled, machine
from twenty_problems import CASES

import dmoc
from dmoc.base.files import write_whole
from dmoc.models.registry import find

SECONDS = 25.0  # of a solve
REPORT = Path(__file__).parent / "results" / "certificates.md"


def source() -> dmoc.Problem:
    reference = find("cart_pendulum")
    return dmoc.Problem(reference.kernels(), **reference.defaults)


def problems() -> Iterator[tuple[str, Callable[[], dmoc.Problem]]]:
    yield "source", source
    for case in CASES:
        yield case.name, lambda case=case: case.named


def certified(name: str, problem: dmoc.Problem) -> tuple[tuple[str, ...], str]:
    """A line of the table, and what there is to say."""
    dmoc.solve(problem, starts=1, seconds=SECONDS)  # loads what is loaded once
    begin = time.process_time()
    solution = dmoc.solve(problem, seconds=SECONDS)
    solved = time.process_time()
    certificate = dmoc.certify(problem, solution)
    times = f"{solved - begin:.2f}", f"{time.process_time() - solved:.2f}"
    low, high = certificate.cost or (0.0, 0.0)
    proved = (
        (f"{high - low:.1e}", f"{certificate.radius:.1e}") if certificate.proved else ("no", "-")
    )
    remarks = [*certificate.fails]
    remarks += [f"as they are: {name}" for name in certificate.held]
    remarks += [f"left out: {name}" for name in certificate.left_out]
    row = name, str(solution.status), f"{solution.cost:.7g}", *proved, *times
    return row, "; ".join(remarks)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", help="names of problems, with commas")
    only = parser.parse_args().only
    chosen = [(n, p) for n, p in problems() if not only or n in only.split(",")]
    rows, remarks = [], []
    for name, problem in chosen:
        row, remark = certified(name, problem())
        print(*row, remark, flush=True)
        rows.append(row)
        remarks += [f"- `{name}`: {remark}"] * bool(remark)
    if only:
        return
    proved = sum(row[3] != "no" for row in rows)
    section = Section(
        "Certificates",
        f"`dmoc.certify` of {len(rows)} answers: {proved} are proved to lie near an exact strict "
        "local minimum of their discrete program. Bounds: how far those of the cost are apart. "
        "Radius: no unknown of the minimum is further from the answer, in its size. Seconds are "
        "CPU seconds; those of a certificate have the derivation of the kernels, once more.",
        ["problem", "status", "cost", "bounds", "radius", "solve, s", "certificate, s"],
        rows,
        "\n".join(remarks),
    )
    text = f"# Certificates\n\n{filled(machine())}\n\n{section.markdown()}\n"
    write_whole(REPORT, text.encode())


if __name__ == "__main__":
    main()
