"""Shared fixtures: a kernel cache of the test run's own, kernels, and problems."""

from __future__ import annotations

import gc
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import carried_folder
import gaits
import motions
import pytest
import quick_compiler
import ziglang
from hypothesis import HealthCheck, settings
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from systems import block_system, landing_system, puck_system, satellite_system
from threadpoolctl import ThreadpoolController

import dmoc
from dmoc.codegen import build, compiler
from dmoc.codegen.kernels import Kernels
from dmoc.export import library
from dmoc.export.page import TARGET
from dmoc.models.registry import find
from dmoc.report import canvas
from dmoc.solvers import blas
from dmoc.solving.multistart import parallel
from dmoc.solving.multistart.effort import Effort

# However slow a machine is, its tests are the same.
settings.register_profile(
    "untimed", deadline=None, derandomize="CI" in os.environ,
    suppress_health_check=[HealthCheck.too_slow],
)  # fmt: skip
settings.load_profile("untimed")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update",
        action="store_true",
        help="write the generated sources instead of comparing them",
    )
    parser.addoption(
        "--as-users",
        action="store_true",
        help="starts, flags of the compiler and pictures as users have them, which takes longer",
    )


def pytest_configure() -> None:
    """The garbage collector need not come so often, which would take a sixth of the time."""
    gc.set_threshold(100_000, 50, 100)


def pytest_collection_finish() -> None:
    """What has been imported and collected stays: it need not be gone through again and again."""
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Keep built kernels away from the user's cache, in one that all processes of the run share,
    or all runs for which a folder is named."""
    run = tmp_path_factory.getbasetemp()
    own = (run.parent if "PYTEST_XDIST_WORKER" in os.environ else run) / "kernels"
    folder = Path(os.environ.get("DMOC_TEST_KERNELS", own))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DMOC_CACHE", str(folder))
        yield folder


@pytest.fixture(scope="session")
def as_users(pytestconfig: pytest.Config) -> bool:
    """Whether nothing is made quicker than users have it."""
    return bool(pytestconfig.getoption("--as-users"))


@pytest.fixture(scope="session", autouse=True)
def flags(as_users: bool) -> Iterator[tuple[str, ...]]:
    """Compile kernels by a quicker compiler, or without optimisation and with functions inside
    those that call them, which gives the same numbers; the flags of users are handed on."""
    users = compiler.FLAGS
    if as_users:
        yield users
        return
    with pytest.MonkeyPatch.context() as patch:
        inside = "-Dinline=inline __attribute__((always_inline))"
        patch.setattr(compiler, "FLAGS", (*users, "-O0", inside))
        patch.setattr(compiler, "LARGE_FLAGS", ())
        patch.setattr(build, "compile_library", quick_compiler.compile_quickly)
        yield users


@pytest.fixture(scope="session", autouse=True)
def parts_of_solvers(as_users: bool, flags: tuple[str, ...]) -> Iterator[None]:
    """Compile once what all solvers in C have in common, with the flags of the tests."""
    with pytest.MonkeyPatch.context() as patch:
        if not as_users:
            patch.setattr(library, "compile_library", carried_folder.compile_library)
        yield


@pytest.fixture(scope="module")
def without_library(as_users: bool) -> Iterator[None]:
    """Link solvers of pages without C's library for WebAssembly, which takes half a minute where
    it has not been made yet: they ask the page for its functions."""
    headers = Path(ziglang.__file__).parent / "lib" / "libc" / "include"
    folders = [f"-isystem{headers / name}" for name in ("wasm-wasi-musl", "generic-musl")]
    alone = ("-nostdlib", "-Wl,--import-symbols", "-Wl,--no-entry", *folders)
    with pytest.MonkeyPatch.context() as patch:
        if not as_users:
            patch.setattr("dmoc.export.page.TARGET", (*TARGET, *alone))
        yield


@pytest.fixture(scope="session", autouse=True)
def effort(as_users: bool) -> Iterator[Callable[..., Effort]]:
    """Explore from half of the starts that users have where a test names no number: a
    known answer that they meet is met by all; the effort of users is handed on."""
    users = Effort.of
    if as_users:
        yield users
        return
    with pytest.MonkeyPatch.context() as patch:
        few = {"first": 8, "random": 8, "beside": 8, "often": 3, "unseen": 0.08}

        def fewer(*arguments: Any) -> Effort:
            effort = users(*arguments)  # of which a search says how many starts it takes at most
            return replace(effort, most=min(effort.most, 150), **few)

        patch.setattr(Effort, "of", fewer)
        yield users


@pytest.fixture(scope="session", autouse=True)
def threads(as_users: bool) -> Iterator[int]:
    """Solve from several starts in one thread where the tests run in as many processes as there are
    processors; the largest number of threads that users have is handed on."""
    users = parallel.MOST_THREADS
    with pytest.MonkeyPatch.context() as patch:
        if "PYTEST_XDIST_WORKER" in os.environ and not as_users:
            patch.setattr(parallel, "MOST_THREADS", 1)
        yield users


@pytest.fixture(scope="session", autouse=True)
def linear_algebra(as_users: bool) -> Iterator[None]:
    """Look for libraries of linear algebra only where modules have been loaded since: beside some
    hundred libraries of kernels that takes milliseconds, in each solve."""

    @lru_cache
    def loaded(_: int) -> ThreadpoolController:
        return ThreadpoolController()

    with pytest.MonkeyPatch.context() as patch:
        if not as_users:
            patch.setattr(blas, "ThreadpoolController", lambda: loaded(len(sys.modules)))
        yield


@pytest.fixture(scope="session", autouse=True)
def coarse_figures(as_users: bool) -> Iterator[tuple[Callable[..., Any], Callable[..., Any]]]:
    """Draw figures once, with few pixels, without ticks and with axes where they are at first,
    which takes less than a third of what it takes users; their layout and how axes are drawn is
    handed on."""
    users = Figure.get_layout_engine, Axis.draw
    if as_users:
        yield users
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(canvas, "DPI", 60)
        patch.setattr(Figure, "get_layout_engine", lambda _: None)
        patch.setattr(Axis, "draw", lambda axis, renderer: axis.label.draw(renderer))
        yield users


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A clock that goes by a second whenever it is read, and how often it was."""
    count = [0]

    def jumping() -> float:
        count[0] += 1
        return float(count[0])

    monkeypatch.setattr(time, "perf_counter", jumping)
    return count


@pytest.fixture(scope="session")
def pendulum() -> Kernels:
    return dmoc.load("cart_pendulum")


@pytest.fixture(scope="session")
def seed(pendulum: Kernels) -> dmoc.Problem:
    """The problem of the source, N = 100 + 100."""
    return dmoc.Problem(pendulum, **find("cart_pendulum").defaults)


@pytest.fixture(scope="session")
def solution(seed: dmoc.Problem) -> dmoc.Solution:
    return dmoc.solve(seed)


@pytest.fixture(scope="session")
def block() -> Kernels:
    return dmoc.build(block_system())


@pytest.fixture(scope="session")
def puck() -> Kernels:
    return dmoc.build(puck_system())


@pytest.fixture(scope="session")
def ball() -> Kernels:
    return dmoc.build(motions.ball_system())


@pytest.fixture(scope="session")
def compass() -> Kernels:
    return dmoc.build(gaits.compass_system())


@pytest.fixture(scope="session")
def floor() -> Kernels:
    return dmoc.build(landing_system())


@pytest.fixture(scope="session")
def rail() -> Kernels:
    return dmoc.build(motions.rail_system())


@pytest.fixture(scope="session")
def satellite() -> Kernels:
    """A sphere that torques turn, with half their squares as the cost."""
    return dmoc.build(satellite_system(), order=4)
