"""Whether answers hang on the last digit: the examples as users run them, under the kernels that
OpenBLAS has for several processors, and once with parameters changed by a part in 1e12.

Run:  .venv/bin/python tools/kernels.py [EXAMPLE ...]

Each run has an environment variable of its own, OPENBLAS_CORETYPE; of a BLAS that does not know it
all runs are alike.  Statuses have to be equal, and costs as equal as ``SAME`` says.  The exit
status is 1 if one differs.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"
BESIDE = {"example_report", "search_dask"}  # what all share, and what needs a cluster
KERNELS = ("Haswell", "SkylakeX", "Zen", "Sandybridge", "Prescott")
SAME = 1e-6  # relative difference of costs
CHANGED = 1e-12  # of all parameters, downwards: a restitution of 1 has none above it
# Runs an example with other parameters: its folder, its script.
AS_CHANGED = f"""
import runpy, sys
import dmoc

def changed(function):
    def call(problem, *arguments, **options):
        stated = zip(problem.kernels.parameters, problem.parameter_values[0].tolist(), strict=True)
        values = {{n: (1 - {CHANGED}) * x for n, x in stated if n not in problem.design}}
        return function(problem.but(parameters=values), *arguments, **options)
    return call

dmoc.solve, dmoc.search = changed(dmoc.solve), changed(dmoc.search)
script, sys.argv = sys.argv[1], sys.argv[1:]
sys.path.insert(0, str(script.rpartition("/")[0]))
runpy.run_path(script, run_name="__main__")
"""


@dataclass(frozen=True)
class Answer:
    """What an example has ended with."""

    status: str
    cost: float

    def differs(self, other: Answer) -> bool:
        return self.status != other.status or not (
            abs(self.cost - other.cost) <= SAME * max(abs(self.cost), abs(other.cost))
        )

    def __str__(self) -> str:
        return f"{self.status} {self.cost:.9g}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run examples under all kernels and compare."""
    every = sorted({path.stem for path in EXAMPLES.glob("*.py")} - BESIDE)
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("examples", nargs="*", metavar="EXAMPLE", help=", ".join(every))
    names = parser.parse_args(arguments).examples or every
    if unknown := [name for name in names if name not in every]:
        parser.error(f"{unknown[0]}: expected some of {', '.join(every)}")
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        reports = list(pool.map(_compared, names))
    for report in filter(None, reports):
        print(report)
    print(f"{len(names)} examples, {sum(map(bool, reports))} that hang on the last digit")
    return int(any(reports))


def _compared(name: str) -> str:
    """What an example has ended with in all runs, where they differ; else nothing."""
    answers = {kernel: _answer(name, kernel) for kernel in KERNELS}
    answers["other parameters"] = _answer(name, KERNELS[0], changed=True)
    first = answers[KERNELS[0]]
    if not any(first.differs(answer) for answer in answers.values()):
        return ""
    return f"! {name}: " + ", ".join(f"{run}: {answer}" for run, answer in answers.items())


def _answer(name: str, kernel: str, changed: bool = False) -> Answer:
    """Run an example."""
    script = str(EXAMPLES / f"{name}.py")
    how = ("-c", AS_CHANGED, script) if changed else (script,)
    with tempfile.TemporaryDirectory() as folder:
        ended = subprocess.run(
            (sys.executable, *how, folder), cwd=folder, capture_output=True, text=True, check=False,
            env={**os.environ, "OPENBLAS_CORETYPE": kernel, "MPLBACKEND": "agg"},
        )  # fmt: skip
        file = Path(folder) / f"{name}.npz"
        if not file.exists():
            return Answer(f"failed: {ended.stderr.splitlines()[-1:]}", 0.0)
        return _read(file)


def _read(file: Path) -> Answer:
    import dmoc

    solution = dmoc.Solution.load(file)
    return Answer(str(solution.status), solution.cost)


if __name__ == "__main__":
    sys.exit(main())
