"""Ctrl-C at any moment, and threads: nothing hangs, nothing is left behind, no traceback."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

import dmoc
from dmoc.solvers import blas
from dmoc.solvers.blas import ONE_THREAD
from dmoc.solvers.outcome import Iteration

pytestmark = pytest.mark.slow


@pytest.fixture
def ctrl_c() -> Iterator[threading.Timer]:
    """A timer that presses Ctrl-C; a shell that starts the tests in the background has them
    ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    yield timer
    timer.cancel()
    signal.signal(signal.SIGINT, before)


def test_solves_that_overlap_in_threads_leave_the_thread_limit_as_it_was(
    seed: dmoc.Problem,
) -> None:
    """The one that began first ends first."""
    began, ended = threading.Event(), threading.Event()

    def wait_for(event: threading.Event, i: Iteration) -> None:
        if i.number == 1:
            event.wait(60)

    def second(i: Iteration) -> None:
        began.set()
        wait_for(ended, i)

    problem, alone = seed.but(steps=20), {"starts": 1, "verify": False}
    dmoc.solve(problem, "slsqp", **alone)  # loads the libraries
    with threadpool_limits(2):
        before = limits()
        late = threading.Thread(
            target=dmoc.solve, args=(problem, "slsqp"), kwargs=dict(progress=second, **alone)
        )

        def first(i: Iteration) -> None:
            if i.number == 1:
                late.start()
            wait_for(began, i)

        assert dmoc.solve(problem, "slsqp", progress=first, **alone).status == "solved"
        ended.set()
        late.join(60)
        assert limits() == before


def test_threads_that_enter_and_leave_at_random_leave_the_thread_limit_as_it_was() -> None:
    def enter_and_leave(seed: int) -> None:
        rng = random.Random(seed)
        for _ in range(10):
            with ONE_THREAD:
                inside.append(max(limits().values()))
                time.sleep(rng.random() * 2e-4)
            time.sleep(rng.random() * 2e-4)

    before, inside = limits(), list[int]()
    together(enter_and_leave)
    assert limits() == before and set(inside) == {1} and len(inside) == 8 * 10


def test_a_limit_that_each_thread_has_is_restored_in_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """As OpenMP has them: the first to enter is not the last to leave."""

    class PerThread:
        internal_api = "openmp"
        own = threading.local()

        @property
        def num_threads(self) -> int:
            return getattr(self.own, "limit", 8)

        def set_num_threads(self, number: int) -> None:
            self.own.limit = number

    library, inside, left = PerThread(), threading.Event(), threading.Event()
    libraries = SimpleNamespace(lib_controllers=[library])
    monkeypatch.setattr(blas, "ThreadpoolController", lambda: libraries)
    seen: list[int] = []

    def late() -> None:
        with ONE_THREAD:
            seen.append(library.num_threads)
            inside.set()
            left.wait(60)
        seen.append(library.num_threads)

    other = threading.Thread(target=late)
    with ONE_THREAD:
        other.start()
        inside.wait(60)
        assert library.num_threads == 1
    assert library.num_threads == 8
    left.set()
    other.join(60)
    assert seen == [1, 8]


def test_a_limit_that_is_set_meanwhile_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    library = SimpleNamespace(internal_api="blis", num_threads=8)
    library.set_num_threads = lambda number: setattr(library, "num_threads", number)
    libraries = SimpleNamespace(lib_controllers=[library])
    monkeypatch.setattr(blas, "ThreadpoolController", lambda: libraries)
    with ONE_THREAD:
        library.set_num_threads(3)
    assert library.num_threads == 3


@pytest.mark.parametrize("method", ["slsqp", "ipm"])
def test_solves_in_eight_threads_leave_the_thread_limit_as_it_was(
    method: str, seed: dmoc.Problem
) -> None:
    problem, costs = seed.but(steps=12), list[float]()
    options: dict[str, Any] = {"method": method, "starts": 1, "verify": False}
    alone = dmoc.solve(problem, **options)
    before = limits()
    together(lambda _: costs.append(dmoc.solve(problem, **options).cost))
    assert limits() == before and costs == [alone.cost] * 8


def limits() -> dict[str, int]:
    """Threads of each library for linear algebra."""
    return {pool["filepath"]: pool["num_threads"] for pool in ThreadpoolController().info()}


def together(work: Callable[[int], object]) -> None:
    """Let eight threads do something at once."""
    working = [threading.Thread(target=work, args=(i,)) for i in range(8)]
    for thread in working:
        thread.start()
    for thread in working:
        thread.join(120)


def test_an_interrupt_is_told_wherever_it_comes(seed: dmoc.Problem) -> None:
    """At the last iterate too, which is a solution, and in every mesh of a refinement."""
    problem, heard = seed.but(steps=10), 0

    def interrupt_at(number: int) -> str:
        heard = 0

        def interrupt(_: Iteration) -> None:
            nonlocal heard
            heard += 1
            if heard == number:
                raise KeyboardInterrupt

        return dmoc.solve(problem, "ipm", tolerance=0.05, starts=1, progress=interrupt).status

    def count(_: Iteration) -> None:
        nonlocal heard
        heard += 1

    dmoc.solve(problem, "ipm", tolerance=0.05, starts=1, progress=count)
    assert heard > 20
    assert {interrupt_at(number) for number in range(1, heard + 1)} == {"interrupted"}


def test_ctrl_c_ends_a_long_simulation(ctrl_c: threading.Timer) -> None:
    kernels = dmoc.load("bouncing_pendulum")
    ctrl_c.start()
    with pytest.raises(KeyboardInterrupt):
        dmoc.simulate(kernels, [0.5], step_size=1e-3, steps=10**10, every=10**6)


def test_a_simulation_leaves_the_interpreter_to_other_threads() -> None:
    kernels, counted = dmoc.load("bouncing_pendulum"), 0
    running = threading.Thread(
        target=dmoc.simulate,
        args=(kernels, [0.5]),
        kwargs={"step_size": 1e-3, "steps": 100_000, "every": 1000},
    )
    running.start()
    while running.is_alive():
        counted += 1
    assert counted > 5_000


COMMANDS = {
    "search": "search puck_table --workers 2 --max-collisions 5 --json -",
    "solve": "solve cart_pendulum --steps 300 --method ipm --tolerance 1e-8 --json -",
}


@pytest.mark.parametrize("wait", [0.1, 0.8, 1.5])
@pytest.mark.parametrize("name", COMMANDS)
def test_ctrl_c_at_any_moment_leaves_no_traceback_and_no_process(
    name: str, wait: float, tmp_path: Path
) -> None:
    def listening() -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)

    command, pipe = [sys.executable, "-c", STARTED, *COMMANDS[name].split()], subprocess.PIPE
    running = subprocess.Popen(
        command, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True, start_new_session=True,
        preexec_fn=listening,
    )  # fmt: skip
    assert running.stdout is not None and running.stdout.readline() == "started\n"
    time.sleep(wait)
    os.killpg(running.pid, signal.SIGINT)
    # Ends when nobody holds the other ends of the pipes any more.
    _, err = running.communicate(timeout=60)
    assert "Traceback" not in err and "Exception ignored" not in err
    assert running.returncode in (0, 1, 130)


def test_ctrl_c_is_not_lost_in_a_callback() -> None:
    """Where Python would print it and go on, as while it forgets the lock of a module."""
    ended = subprocess.run(
        [sys.executable, "-c", IN_CALLBACK], capture_output=True, text=True, timeout=60
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")


IN_CALLBACK = """
import signal, time, weakref
from dmoc import cli
from dmoc.__main__ import main

class Forgotten:
    pass

def command():
    it = Forgotten()
    told = weakref.ref(it, lambda _: signal.raise_signal(signal.SIGINT))
    del it
    time.sleep(10)
    print("nobody has stopped it")

signal.signal(signal.SIGINT, signal.default_int_handler)
cli.main = command
main()
"""

# From here on Ctrl-C is the command's business, not that of the interpreter's start.
STARTED = """
from dmoc.__main__ import main
if __name__ == "__main__":
    print("started", flush=True)
    main()
"""
