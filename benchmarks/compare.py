"""Two checkouts against each other: the same solves in turn, so that the machine's drift meets
both.

    python benchmarks/compare.py OTHER [--rounds 15] [--python PYTHON]

OTHER is the folder of the other checkout, installed in an environment of its own, OTHER/.venv (or
the one of PYTHON).  Each checkout works in a process of its own that stays; every round runs every
task in both, and which comes first changes from round to round.  The table shows the medians, the
ratio of the medians (above 1: this checkout is slower), the quartiles of the rounds' ratios, how
many of the solves failed, and how far the answers are apart.  Public names alone are used, so that
older checkouts take part.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
PYTHON = Path(".venv") / "bin" / "python"
ROUNDS = 15
# Of processes that are measured: modules are compiled when they are installed.
AS_INSTALLED = {n: v for n, v in os.environ.items() if n != "PYTHONDONTWRITEBYTECODE"}


@dataclass(frozen=True)
class Once:
    """One run of a task: seconds, whether it succeeded, and a number that tells answers apart."""

    seconds: float
    good: bool
    answer: float


@dataclass
class Task:
    """What is compared: made once in each process, run in every round or, if slow, in some."""

    name: str
    make: Callable[[Any], Callable[[], Once]]
    every: int = 1
    runs: list[tuple[Once, Once]] = field(default_factory=list)


def seed(dmoc: Any, steps: int = 100, order: int = 2) -> Any:
    """The problem of Kern & Gross (2018): one collision on the limiter of the smallest angle."""
    kernels = dmoc.load("cart_pendulum", order=order)
    return dmoc.Problem(
        kernels, start={"alpha": 0.15 * pi, "x": 0.0}, sequence=kernels.surfaces[:1], steps=steps,
        goal={"alpha": pi / 2, "p_alpha": 0.0, "p_x": 0.0},
        final_time=(None, 1.0), bounds={"F": (-200, 200), "x": (-10, 10)},
    )  # fmt: skip


def clocked(
    work: Callable[[], Any], good: Callable[[Any], bool], answer: Callable[[Any], float]
) -> Callable[[], Once]:
    """Work with its seconds, and what its result says."""

    def run() -> Once:
        begin = time.perf_counter()
        result = work()
        return Once(time.perf_counter() - begin, bool(good(result)), float(answer(result)))

    return run


def is_solved(solution: Any) -> bool:
    return bool(solution.status == "solved")


def solved(method: str, part: str = "solve", **changes: Any) -> Callable[[Any], Callable[[], Once]]:
    """Seconds of one part of a solve from the automatic guess alone."""

    def make(dmoc: Any) -> Callable[[], Once]:
        problem = seed(dmoc, **changes)

        def run() -> Once:
            s = dmoc.solve(problem, method, starts=1, verify=False)
            return Once(s.seconds[part], is_solved(s), s.cost)

        return run

    return make


def answered(**options: Any) -> Callable[[Any], Callable[[], Once]]:
    """Seconds from a problem to a checked answer by `ipm`."""

    def make(dmoc: Any) -> Callable[[], Once]:
        problem = seed(dmoc)
        return clocked(lambda: dmoc.solve(problem, "ipm", **options), is_solved, lambda s: s.cost)

    return make


def checked(dmoc: Any, problem: Any = None) -> Callable[[], Once]:
    solution = dmoc.solve(problem or seed(dmoc), "ipm", verify=False)
    return clocked(solution.verify, lambda c: c.passed, lambda c: c.terminal_error)


def block(dmoc: Any) -> Any:
    """A block on a floor with friction, pushed along."""
    from sympy import symbols
    from sympy.physics.mechanics import dynamicsymbols

    (x, y, u), (m, g, mu) = dynamicsymbols("x y u"), symbols("m g mu")
    t = dynamicsymbols._t
    return dmoc.build(
        dmoc.MechanicalSystem(
            "compared_block", [x, y], m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 - m * g * y,
            {m: 1.0, g: 10.0, mu: 0.1}, [u], {x: u}, {"floor": y >= 0}, cost=u**2,
            tangents={"floor": x}, friction={"floor": mu},
        )
    )  # fmt: skip


def checked_with_contacts(dmoc: Any) -> Callable[[], Once]:
    problem = dmoc.Problem(
        block(dmoc), start={"x": 0.0, "y": 0.0}, goal={"x": 1.0, "x_dot": 0.0}, steps=50,
        contacts=["floor"], sequence=["floor:slip+", "floor:stick"], final_time=4.0,
    )  # fmt: skip
    return checked(dmoc, problem)


def simulated(dmoc: Any) -> Callable[[], Once]:
    kernels, inputs = block(dmoc), 2 * np.sin(np.linspace(0, 9, 500))[:, None]
    options = {"step_size": 0.01, "steps": 500, "inputs": inputs, "restitution": 0.5}
    return clocked(
        lambda: dmoc.simulate(kernels, [0.0, 0.2], [1.0, 0.0], **options),
        lambda motion: True,
        lambda motion: motion.q[-1, 0],
    )


def searched(dmoc: Any) -> Callable[[], Once]:
    problem = seed(dmoc)
    return clocked(
        lambda: dmoc.search(problem, 3),
        lambda result: result.best is not None,
        lambda result: result.best.cost if result.best else np.nan,
    )


def neighbours(verify: bool) -> Callable[[Any], Callable[[], Once]]:
    """Seconds of each of some neighbours of the seed, which differ from it in three numbers by up
    to 2 %, from its minimum, in one process."""

    def make(dmoc: Any) -> Callable[[], Once]:
        base, numbers = seed(dmoc), 1 + 0.02 * np.random.default_rng(2018).uniform(-1, 1, (60, 3))
        first = dmoc.solve(base, "ipm", starts=1)
        problems = [
            base.but(
                start={"alpha": a * 0.15 * pi, "x": 0.0}, final_time=(None, c),
                bounds={"F": (-200.0 * b, 200.0 * b), "x": (-10, 10)},
            )
            for a, b, c in numbers.tolist()
        ]  # fmt: skip

        def run() -> Once:
            begin = time.perf_counter()
            batch = dmoc.solve_many(problems, "ipm", guess=first, verify=verify)
            seconds = (time.perf_counter() - begin) / len(problems)
            return Once(seconds, set(batch.status) == {"solved"}, float(np.sum(batch.cost)))

        return run

    return make


FIRST = """
import json, time
import numpy
import dmoc
kernels = dmoc.load("cart_pendulum")
problem = dmoc.Problem(
    kernels, start={"alpha": 0.4712389, "x": 0.0}, sequence=kernels.surfaces[:1], steps=100,
    goal={"alpha": 1.5707963, "p_alpha": 0, "p_x": 0}, final_time=(None, 1.0),
    bounds={"F": (-200, 200), "x": (-10, 10)},
)
seconds = []
for _ in range(3):
    begin = time.perf_counter()
    solution = dmoc.solve(problem, "ipm", starts=1)
    seconds.append(time.perf_counter() - begin)
print(json.dumps([seconds[0] - seconds[-1], solution.cost]))
"""


def first_call(dmoc: Any) -> Callable[[], Once]:
    """By how much the first answer of a process takes longer than a later one."""

    def run() -> Once:
        call = [sys.executable, "-c", FIRST]
        ended = subprocess.run(call, capture_output=True, text=True, env=AS_INSTALLED)
        more, cost = json.loads(ended.stdout) if ended.returncode == 0 else (np.nan, np.nan)
        return Once(more, ended.returncode == 0, cost)

    return run


def command(dmoc: Any) -> Callable[[], Once]:
    """Processor time of a command."""
    call = [sys.executable, "-m", "dmoc", "solve", "cart_pendulum", "--json", "-"]

    def run() -> Once:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        ended = subprocess.run(call, capture_output=True, text=True, env=AS_INSTALLED)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
        good = ended.returncode == 0
        return Once(spent, good, json.loads(ended.stdout)["cost"] if good else np.nan)

    return run


def tasks() -> list[Task]:
    return [
        Task("guess, N = 100 + 100", solved("ipm", "guess")),
        Task("answer from the guess alone", answered(starts=1)),
        Task("answer with the exploration", answered()), Task("ipm, N = 100 + 100", solved("ipm")),
        Task("first answer of a process, beyond a later one", first_call, 3),
        Task("dmoc solve cart_pendulum, processor time", command, 3),
        Task("a neighbour of 60, from the minimum", neighbours(True)),
        Task("the same, not checked", neighbours(False)),
        Task("ipm, order 4, N = 40 + 40", solved("ipm", steps=40, order=4)),
        Task("ipm, N = 1000 + 1000", solved("ipm", steps=1000)),
        Task("slsqp, N = 100 + 100", solved("slsqp"), 3), Task("check, N = 100 + 100", checked),
        Task("check with friction, 3 phases, N = 50", checked_with_contacts),
        Task("simulation with friction, 500 steps", simulated),
        Task("search, at most 3 collisions", searched, 5),
    ]  # fmt: skip


# The two processes --------------------------------------------------------------------------------


def serve() -> None:
    """Run tasks by their numbers, one a line; the first run of a task does not count."""
    import dmoc

    made: dict[int, Callable[[], Once]] = {}
    every = tasks()
    for line in sys.stdin:
        number = int(line)
        if number not in made:
            made[number] = every[number].make(dmoc)
            made[number]()
        once = made[number]()
        print(json.dumps([once.seconds, once.good, once.answer]), flush=True)


@contextmanager
def worker(python: Path) -> Iterator[Callable[[int], Once]]:
    command = [str(python), __file__, "--serve"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd="/"
    ) as running:
        assert running.stdin is not None and running.stdout is not None
        tell, answers = running.stdin, running.stdout

        def ask(number: int) -> Once:
            tell.write(f"{number}\n")
            tell.flush()
            answer = answers.readline()
            if not answer:
                raise SystemExit(
                    f"error: {python} ended in task '{tasks()[number].name}': see above."
                )
            return Once(*json.loads(answer))

        yield ask
        tell.close()


def compare(this: Path, other: Path, rounds: int) -> list[Task]:
    compared = tasks()
    with worker(this) as own, worker(other) as foreign:
        for i in range(rounds):
            for number, task in enumerate(compared):
                if i % task.every:
                    continue
                if i // task.every % 2:
                    b = foreign(number)
                    a = own(number)
                else:
                    a = own(number)
                    b = foreign(number)
                task.runs.append((a, b))
            sys.stderr.write(f"\rround {i + 1} of {rounds}")
    sys.stderr.write("\n")
    return compared


def table(compared: list[Task]) -> str:
    head = [
        "task", "runs", "this, ms", "other, ms", "this / other", "quartiles", "failed: this",
        "other", "answers differ by",
    ]  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for task in compared:
        times = np.array([[a.seconds, b.seconds] for a, b in task.runs])
        this, other = np.median(times, axis=0)
        low, high = np.quantile(times[:, 0] / times[:, 1], (0.25, 0.75))
        failed = [sum(not pair[side].good for pair in task.runs) for side in (0, 1)]
        apart = max(abs(a.answer - b.answer) / max(abs(b.answer), 1e-300) for a, b in task.runs)
        cells = (
            task.name, len(task.runs), f"{1e3 * this:.4g}", f"{1e3 * other:.4g}",
            f"{this / other:.3f}", f"{low:.3f} to {high:.3f}", *failed, f"{apart:.1e}",
        )  # fmt: skip
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("other", type=Path, nargs="?", help="folder of the other checkout")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument(
        "--python",
        type=Path,
        help="interpreter of the other checkout (default: OTHER/.venv/bin/python)",
    )
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve()
        return
    if options.other is None and options.python is None:
        parser.error("name the folder of the other checkout, or its interpreter")
    other = options.python or options.other.resolve() / PYTHON
    if not other.exists():
        parser.error(
            f"{other} does not exist: install the other checkout into an environment of its own"
        )
    print(table(compare(Path(sys.executable), other, max(options.rounds, 1))))


if __name__ == "__main__":
    main()
