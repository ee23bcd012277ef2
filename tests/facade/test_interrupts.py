"""Ctrl-C at any moment, and threads: nothing hangs, nothing is left behind, no traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

import dmoc
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

    problem = seed.but(steps=20)
    dmoc.solve(problem, "ipm", verify=False)  # loads the libraries
    with threadpool_limits(2):
        before = [pool["num_threads"] for pool in ThreadpoolController().info()]
        late = threading.Thread(
            target=dmoc.solve, args=(problem, "ipm"), kwargs={"progress": second, "verify": False}
        )

        def first(i: Iteration) -> None:
            if i.number == 1:
                late.start()
            wait_for(began, i)

        assert dmoc.solve(problem, "ipm", progress=first, verify=False).status == "solved"
        ended.set()
        late.join(60)
        assert [pool["num_threads"] for pool in ThreadpoolController().info()] == before


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

        return dmoc.solve(problem, "ipm", tolerance=0.05, progress=interrupt).status

    def count(_: Iteration) -> None:
        nonlocal heard
        heard += 1

    dmoc.solve(problem, "ipm", tolerance=0.05, progress=count)
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
        kwargs={"step_size": 1e-3, "steps": 200_000, "every": 1000},
    )
    running.start()
    while running.is_alive():
        counted += 1
    assert counted > 10_000


@pytest.mark.parametrize("wait", [0.1, 0.6, 1.2, 2.0])
@pytest.mark.parametrize(
    "command",
    [
        ["search", "puck_table", "--workers", "2", "--max-collisions", "5", "--json", "-"],
        [
            "solve",
            "cart_pendulum",
            "--steps",
            "300",
            "--method",
            "ipm",
            "--tolerance",
            "1e-8",
            "--json",
            "-",
        ],
    ],
    ids=["search", "solve"],
)
def test_ctrl_c_at_any_moment_leaves_no_traceback_and_no_process(
    command: list[str], wait: float, tmp_path: Path
) -> None:
    def listening() -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)

    running = subprocess.Popen(
        [sys.executable, "-c", STARTED, *command],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=listening,
    )
    assert running.stdout is not None and running.stdout.readline() == "started\n"
    time.sleep(wait)
    os.killpg(running.pid, signal.SIGINT)
    # Ends when nobody holds the other ends of the pipes any more.
    _, err = running.communicate(timeout=60)
    assert "Traceback" not in err and "Exception ignored" not in err
    assert running.returncode in (0, 1, 130)


# From here on Ctrl-C is the command's business, not that of the interpreter's start.
STARTED = """
from dmoc.__main__ import main
if __name__ == "__main__":
    print("started", flush=True)
    main()
"""
