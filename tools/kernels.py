"""Whether answers hang on the last digit: problems under the kernels that OpenBLAS has for several
processors, and once with parameters and final times changed by a part in 1e12.

Run:  .venv/bin/python tools/kernels.py [SET ...] [--runs RUN ...] [--only PART]

    examples  as users run them, without their pictures
    known     those of docs/known_answers.md, each by the default call
    twenty    whose sequence nobody names: that of the best known motion, and proposals
    ladder    published ones, with 50 steps a phase
    words     those of one sequence, by the default call

Without names all sets run, some hours in all.  The runs of a set have processes of their own, with
the environment variable OPENBLAS_CORETYPE; of a BLAS that does not know it all runs are alike.
Statuses have to be equal, and costs as equal as ``SAME`` says.  The exit status is 1 if one
differs.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import runpy
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import chdir, redirect_stdout, suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"
BESIDE = {"example_report", "search_dask"}  # what all share, and what needs a cluster
KERNELS = ("Haswell", "SkylakeX", "Zen", "Sandybridge", "Prescott")
CHANGED = "changed"  # other parameters, and the kernel that this processor has
RUNS = (*KERNELS, CHANGED)
KNOWN_STEPS, LADDER_STEPS = 40, 50  # a phase
SAME = 1e-6  # relative difference of costs
CHANGE = 1e-12  # of all parameters and final times, downwards: a restitution of 1 has none above it


@dataclass(frozen=True)
class Answer:
    """What a problem has ended with; a cost only where it is that of a confirmed motion."""

    status: str
    cost: float | None = None

    def differs(self, other: Answer) -> bool:
        if self.cost is None or other.cost is None:
            return self != other
        near = abs(self.cost - other.cost) <= SAME * max(abs(self.cost), abs(other.cost))
        return self.status != other.status or not near

    def __str__(self) -> str:
        return self.status if self.cost is None else f"{self.status} {self.cost:.9g}"


Ask = Callable[[], Answer]


# Sets: what is asked, by the names of problems ----------------------------------------------------


def examples() -> dict[str, Ask]:
    names = sorted({path.stem for path in EXAMPLES.glob("*.py")} - BESIDE)
    return {name: partial(_example, name) for name in names}


def _example(name: str) -> Answer:
    import dmoc

    dmoc.Solution.plot = lambda *_: None  # pictures, a third of the time, answer nothing
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        sys.argv = [f"{name}.py", folder]
        with suppress(SystemExit):  # of one that is not solved
            runpy.run_path(str(EXAMPLES / sys.argv[0]), run_name="__main__")
        return _answer(dmoc.Solution.load(f"{name}.npz"))


def known() -> dict[str, Ask]:
    from accuracy import CASES, CONTACT_CASES

    from dmoc.base.discretisation import ORDERS

    free = {f"{c.name}, order {o}": (c, (KNOWN_STEPS, o)) for c in CASES for o in ORDERS}
    cases = free | {case.name: (case, (KNOWN_STEPS,)) for case in CONTACT_CASES}
    return {
        name: partial(_solved, partial(case.problem, *mesh), case.quantity)
        for name, (case, mesh) in cases.items()
    }


def twenty() -> dict[str, Ask]:
    from twenty_problems import CASES

    named = {f"{c.name}, named": partial(_solved, partial(getattr, c, "named")) for c in CASES}
    return named | {f"{c.name}, proposed": partial(_proposed, c.problem) for c in CASES}


def ladder() -> dict[str, Ask]:
    from ladder import ORDERS, RUNGS

    return {
        f"{rung.name}, order {order}": partial(_solved, partial(rung.make, LADDER_STEPS, order))
        for rung in RUNGS
        for order in ORDERS
    }


def words() -> dict[str, Ask]:
    from best_of_word_problems import WORDS

    return {word.name: partial(_solved, partial(getattr, word, "problem")) for word in WORDS}


def _solved(make: Callable[[], Any], quantity: Callable[[Any], float] | None = None) -> Answer:
    import dmoc

    return _answer(dmoc.solve(make()), quantity)


def _answer(solution: Any, quantity: Callable[[Any], float] | None = None) -> Answer:
    if not solution.solved:
        return Answer(str(solution.status))
    return Answer(str(solution.status), float(quantity(solution) if quantity else solution.cost))


def _proposed(make: Callable[[], Any]) -> Answer:
    """The best sequence of a search that is told nothing of it."""
    import twenty

    import dmoc

    best = dmoc.search(make(), twenty.DEPTH, strategy="propose").best
    return Answer("none") if best is None else Answer(", ".join(best.sequence), float(best.cost))


SETS = {ask.__name__: ask for ask in (examples, known, twenty, ladder, words)}


# A run: a process of its own, which says a line of JSON for each problem --------------------------


def say(name: str, part: str, changed: bool) -> None:
    """Answer the problems of a set."""
    sys.path += [str(ROOT / folder) for folder in ("benchmarks", "tests", "examples")]
    if changed:
        change_parameters()
    for problem, ask in SETS[name]().items():
        if part in problem:
            with redirect_stdout(sys.stderr):
                answer = _asked(ask)
            print(json.dumps({"problem": problem, **asdict(answer)}), flush=True)


def _asked(ask: Ask) -> Answer:
    try:
        return ask()
    except Exception as error:
        return Answer(f"{type(error).__name__}: {error}")


def change_parameters() -> None:
    """Let all solves and searches have problems with other parameters and final times."""
    import dmoc

    def changed(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(problem: dmoc.Problem, *arguments: Any, **options: Any) -> Any:
            stated = zip(problem.kernels.parameters, problem.parameter_values[0], strict=True)
            values = {n: float((1 - CHANGE) * x) for n, x in stated if n not in problem.design}
            times = _shorter(problem.final_time)
            other = problem.but(parameters=values, final_time=times)
            return function(other, *arguments, **options)

        return call

    for name in ("solve", "search"):
        setattr(dmoc, name, changed(getattr(dmoc, name)))


def _shorter(times: Any) -> Any:
    """A final time, or its range, that is as much shorter."""
    if isinstance(times, tuple | list):
        return tuple(map(_shorter, times))
    return times if times is None else float((1 - CHANGE) * times)


def answers(name: str, run: str, part: str) -> dict[str, Answer] | None:
    """What a run answers; nothing where the processor has no such instructions."""
    environment = {**os.environ, "MPLBACKEND": "agg"}
    if run in KERNELS:
        environment["OPENBLAS_CORETYPE"] = run
    command = (sys.executable, __file__, name, "--say", run, "--only", part)
    ended = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if ended.returncode == -signal.SIGILL:
        return None
    if ended.returncode:
        raise RuntimeError(f"{name}, {run}: {ended.returncode}: {ended.stderr[-2000:]}")
    records = map(json.loads, ended.stdout.splitlines())
    return {r["problem"]: Answer(r["status"], r["cost"]) for r in records}


# Comparison ---------------------------------------------------------------------------------------


def differences(runs: Mapping[str, Mapping[str, Answer]]) -> Iterator[str]:
    """Problems that some runs answer otherwise than the first."""
    first = next(iter(runs.values()))
    for problem, expected in first.items():
        every = {run: found[problem] for run, found in runs.items()}
        if any(expected.differs(answer) for answer in every.values()):
            yield f"! {problem}: " + "; ".join(f"{run}: {answer}" for run, answer in every.items())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run sets and compare."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("sets", nargs="*", metavar="SET", help=", ".join(SETS))
    parser.add_argument("--runs", nargs="+", choices=RUNS, default=RUNS)
    parser.add_argument("--only", default="", metavar="PART", help="of the name of a problem")
    parser.add_argument("--say", choices=RUNS, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    sets = options.sets or list(SETS)
    if unknown := [name for name in sets if name not in SETS]:
        parser.error(f"{unknown[0]}: expected some of {', '.join(SETS)}")
    if options.say:
        say(sets[0], options.only, options.say == CHANGED)
        return 0
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        asked = {
            name: {run: pool.submit(answers, name, run, options.only) for run in options.runs}
            for name in sets
        }
        reports = [
            _told(name, {run: f.result() for run, f in asked[name].items()}) for name in sets
        ]
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{used.ru_utime + used.ru_stime:.0f} CPU s")
    return int(any(reports))


def _told(name: str, every: Mapping[str, Mapping[str, Answer] | None]) -> bool:
    """Print how the runs of a set differ, and say whether they do."""
    runs = {run: found for run, found in every.items() if found is not None}
    for run in every.keys() - runs.keys():
        print(f"{name}: this processor has no instructions of {run}")
    problems = len(next(iter(runs.values()), ()))
    found = list(differences(runs)) if runs else []
    print("\n".join([*found, f"{name}: {problems} problems, {len(found)} hang on the last digit"]))
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
