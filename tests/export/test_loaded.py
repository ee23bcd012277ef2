"""dmoc.load_solver: numbers by name, the answers of `ipm`, several starts, the rest of a motion,
batches in threads, and folders that are refused."""

from __future__ import annotations

import errno
import itertools
import multiprocessing
import os
import shutil
import signal
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from carried_problems import design, linkage, stride
from pytest import approx
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import BuildError, OutputError, ProblemError
from dmoc.export import loaded_solver
from dmoc.export.constants import Constants
from dmoc.export.loaded_solver import LoadedSolver, load_solver
from dmoc.export.motion_text import rest_text
from dmoc.export.solver import carried_by

# Seconds after which an answer does not come any more.
WAITS = 60


def thrown() -> dmoc.Problem:
    """A block of unit mass that is thrown at a wall at 1 and comes back with half of its speed."""
    return design().but(design={}, steps=20)


def carried(problem: dmoc.Problem, folder: Path) -> Path:
    dmoc.generate_solver(problem, folder, guess=dmoc.solve(problem, "ipm", starts=1, verify=False))
    return folder


@pytest.fixture(scope="module")
def bob_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return carried(linkage(2), tmp_path_factory.mktemp("loaded") / "bob")


@pytest.fixture(scope="module")
def thrown_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return carried(thrown(), tmp_path_factory.mktemp("loaded") / "thrown")


@pytest.fixture(scope="module")
def solvers(bob_folder: Path, thrown_folder: Path) -> dict[str, LoadedSolver]:
    return {"bob": load_solver(bob_folder), "block": load_solver(thrown_folder)}


def as_exported(solver: LoadedSolver, kept: dict[str, float]) -> Iterator[LoadedSolver]:
    yield solver
    solver.set(**kept)
    solver.solve("answer")


@pytest.fixture
def bob(solvers: dict[str, LoadedSolver]) -> Iterator[LoadedSolver]:
    yield from as_exported(solvers["bob"], solvers["bob"].numbers)


@pytest.fixture
def block(solvers: dict[str, LoadedSolver]) -> Iterator[LoadedSolver]:
    yield from as_exported(solvers["block"], solvers["block"].numbers)


@pytest.mark.slow
def test_numbers_are_set_as_a_problem_has_them(bob: LoadedSolver, bob_folder: Path) -> None:
    """Another goal and another time: the answer of a solve in Python from the same start."""
    before = sorted(p.name for p in bob_folder.iterdir())
    assert bob.numbers["goal.x"] == 0.6 and bob.numbers["bounds.u.high"] == 30
    bob.set(goal={"x": 0.8, "y": -0.6}, final_time=1.2, bounds={"u": (-20, 25)})
    assert bob.numbers["bounds.u.low"] == -20 and bob.numbers["final_time"] == 1.2
    problem = linkage(2).but(goal={"x": 0.8, "y": -0.6}, final_time=1.2, bounds={"u": (-20, 25)})
    own, end = dmoc.solve(problem, "ipm", starts=1, verify=False), bob.solve()
    assert (end.status, end.message) == ("solved", "a local minimum was found")
    assert end.cost == approx(own.cost, rel=1e-9) and end.violation < 1e-10
    assert end.tables["q"] == approx(own.trajectory.phases[0].q, abs=1e-7)
    assert end.tables["reaction"] == approx(own.trajectory.phases[0].reaction, abs=1e-5)
    assert end.t[-1] == approx(1.2) and len(end.multipliers["rows"]) > 12
    unknowns = np.concatenate([end.tables[n].ravel() for n in list(end.tables)[:-3]])
    again = bob.solve(unknowns)
    assert again.cost == approx(own.cost, rel=1e-9) and again.iterations > 0
    assert bob.solve(iterations=1).status == "solved"  # from there
    assert bob.solve("first", iterations=1).status == "iteration_limit"
    assert bob.solve("first", seconds=1e-9).status == "time_limit"
    assert sorted(p.name for p in bob_folder.iterdir()) == before


def test_restitution_is_set_as_a_problem_has_it(block: LoadedSolver) -> None:
    """Of each surface, or one for all: answers of Python; 0 is another law."""
    for stated in (0.6, {"wall": 0.9}):
        block.set(restitution=stated)
        own = dmoc.solve(thrown().but(restitution=stated), "ipm", starts=1, verify=False)
        assert block.solve().cost == approx(own.cost, rel=1e-9)
    ends = block.solve_many([{"restitution": e} for e in (0.9, 0, 1.2)])
    assert [end.status for end in ends] == ["solved", "refused", "refused"]
    assert ends[0].cost == approx(own.cost, rel=1e-9)
    assert ends[1].message == "restitution.wall = 0: expected a coefficient above 0, at most 1."


@pytest.mark.slow
def test_differences_of_both_ends_are_set_as_a_problem_has_them(tmp_path: Path) -> None:
    solver = load_solver(carried(stride(), tmp_path / "stride"))
    periodic = {"x": ("x", 0.7), "x_dot": ("x_dot", (0.1, 0.2))}
    solver.set(periodic=periodic)
    own = dmoc.solve(stride().but(periodic=periodic), "ipm", starts=1, verify=False)
    assert solver.solve().cost == approx(own.cost, rel=1e-9)
    assert solver.numbers["periodic.x_dot.low"] == 0.1
    with pytest.raises(ProblemError, match=r"'periodic' is no number that this solver takes"):
        solver.set(periodic=["x"])


def test_numbers_that_are_none(bob: LoadedSolver) -> None:
    before = bob.numbers
    for fields, message in (
        ({"final_time": 1.1, "goal": {"z": 1}}, r"'goal.z' is no number that .*did you mean"),
        ({"final_time": (1, 2)}, "'final_time.low' is no number that this solver takes"),
        ({"bounds": {"u": 3.0}}, "'bounds.u' is no number that this solver takes"),
        ({"bounds": {"u": (None, 3.0)}}, "bounds.u.low = None: expected a number"),
        ({"goal": {"x": "far"}}, "goal.x = 'far': expected a number"),
        ({"goal": {"x": np.nan}}, "goal.x = nan: expected a finite number"),
    ):
        with pytest.raises(ProblemError, match=message):
            bob.set(**fields)
    assert bob.numbers == before
    bob.set(bounds={"u": (5, -5)})
    with pytest.raises(ProblemError, match=r"bounds.u.high = -5: expected bounds with room"):
        bob.solve()
    for guess in ("last", [1.0, 2.0], np.full(59, np.nan)):
        with pytest.raises(ProblemError, match="expected 'answer', 'first', or the 59 unknowns"):
            bob.solve(guess)


def test_a_batch_is_the_same_for_any_number_of_threads(block: LoadedSolver) -> None:
    """Bit by bit, and as each by itself; one that does not fit stops no other."""
    instances = [
        {"parameters": {"m": 1 + 0.01 * k}, "final_time": 1 + 0.002 * k} for k in range(40)
    ]
    instances[7] = {"parameters": {"m": -1.0}}
    one, three = (block.solve_many(instances, threads=n) for n in (1, 3))
    for a, b in zip(one, three, strict=True):
        assert (a.status, a.message, a.iterations) == (b.status, b.message, b.iterations)
        assert all((a.tables[name] == b.tables[name]).all() for name in a.tables)
    assert one[7].status == "refused"
    assert one[7].message == "parameters.m = -1: expected a positive definite mass matrix."
    assert {end.status for end in one} == {"solved", "refused"}
    block.set(**instances[12])
    assert block.solve("answer").cost == one[12].cost
    late = block.solve_many(instances[:3], seconds=1e-9)
    assert [end.status for end in late] == ["not_tried"] * 3
    with pytest.raises(ProblemError, match="instances has 5 at place 1: expected a mapping"):
        block.solve_many([{}, 5])


def test_an_interrupt_keeps_what_is_done(
    block: LoadedSolver, monkeypatch: pytest.MonkeyPatch
) -> None:
    main, shares, done = threading.main_thread().ident, itertools.count(1), threading.Event()
    assert main is not None
    at = loaded_solver.Ends.at
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in jobs of the background

    def counted(ends: loaded_solver.Ends, first: int) -> Any:
        """The place of a share, which a thread asks for when it begins with it."""
        if next(shares) > 2 + 2:
            done.set()
        return at(ends, first)

    def interrupts() -> None:
        done.wait(60)
        signal.pthread_kill(main, signal.SIGINT)

    monkeypatch.setattr(loaded_solver.Ends, "at", counted)
    other = threading.Thread(target=interrupts)
    other.start()
    ends = block.solve_many([{"final_time": 1 + k / 20_000} for k in range(20_000)], threads=2)
    other.join()
    counts = {status: sum(e.status == status for e in ends) for status in ("solved", "not_tried")}
    assert ends[0].status == "solved" and min(counts.values()) > 0
    assert sum(counts.values()) >= len(ends) - 2  # those that ran
    assert block.solve().status == "solved"


def test_the_rest_of_a_motion(block: LoadedSolver) -> None:
    """At a node it begins with its state; later costs are those of Python's own solve of the rest,
    and what is spent and left is the whole (principle of optimality) but for the mesh."""
    whole = block.solve()
    h = whole.t[4] / 4
    u = whole.tables["u"][:4, 0]
    block.shift(whole.t[4])
    numbers = block.numbers
    assert numbers["start.x"] == approx(whole.tables["q"][4, 0], abs=1e-14)
    assert numbers["start.x_dot"] == approx(whole.tables["velocities"][4, 0], abs=1e-12)
    assert numbers["final_time"] == approx(1 - whole.t[4], abs=1e-15)
    rest = block.solve()
    start = {"x": numbers["start.x"], "x_dot": numbers["start.x_dot"]}
    own = dmoc.solve(
        thrown().but(start=start, final_time=numbers["final_time"]), "ipm", starts=1, verify=False
    )
    assert rest.status == "solved" and rest.iterations <= 4
    assert rest.cost == approx(own.cost, rel=1e-9)
    assert rest.cost + h * (u**2).sum() / 2 == approx(whole.cost, rel=3e-3)
    block.shift(0.01)  # between nodes, of a plan that has been shifted
    later = block.numbers["start.x"]
    ahead = numbers["start.x"] + 0.01 * numbers["start.x_dot"]
    assert 0 < later - ahead < 1e-3  # it is pushed
    block.set(start={"x": later + 0.01})  # as it was measured
    assert block.solve().status == "solved"
    before = block.numbers
    for elapsed in (-0.1, block.solve().t[20], 5):
        with pytest.raises(ProblemError, match="the first event is over, nothing is left on"):
            block.shift(elapsed)
    block.shift(0)
    assert block.numbers == before


@pytest.mark.slow
def test_problems_that_have_no_rest() -> None:
    """A quantity that the start has a range of too, and a time that could not be shortened."""
    x, u = dynamicsymbols("x u")
    cart = dmoc.MechanicalSystem(
        "watched_cart", [x], x.diff() ** 2 / 2, {}, [u], {x: u}, cost=u**2,
        quantities={"double": 2 * x},
    )  # fmt: skip
    start = {"x": 0.0, "x_dot": 0.0}
    problem = dmoc.Problem(
        dmoc.build(cart), start, {"x": 1.0, "x_dot": 0.0}, steps=6, final_time=1.0
    )
    begins = []
    for p in (problem, problem.but(start=start | {"double": (-1, 1)})):
        parts, _ = carried_by("cart", p, dmoc.solve(p, "ipm", starts=1, verify=False))
        begins.append(rest_text(Constants(), parts.nlp, parts.numbers)[:2])
        kept = replace(parts.numbers, kept=("final_time",))
        assert rest_text(Constants(), parts.nlp, kept).startswith("{0")
    assert begins == ["{1", "{0"]


def test_a_constraint_without_speeds_has_no_rest(bob: LoadedSolver) -> None:
    """They follow from the rod, so that no numbers could be set."""
    with pytest.raises(ProblemError, match="nothing is left on these phases alone"):
        bob.shift(0.1)


@pytest.mark.slow
def test_the_rest_of_a_motion_keeps_its_constraint(tmp_path: Path) -> None:
    """Between nodes of order 4 a bob stays on its rod, to rounding; the cost is that of Python's
    own solve of the rest."""
    rest = {"x_dot": 0.0, "y_dot": 0.0}
    problem = linkage(4).but(start={"x": 0, "y": -1} | rest)
    solver = load_solver(carried(problem, tmp_path / "rod"))
    solver.shift(0.3)
    end, numbers = solver.solve(), solver.numbers
    start = {name: numbers[f"start.{name}"] for name in problem.start}
    assert np.hypot(start["x"], start["y"]) == approx(1, abs=1e-15)
    assert start["x"] * start["x_dot"] + start["y"] * start["y_dot"] == approx(0, abs=1e-15)
    own = dmoc.solve(problem.but(start=start, final_time=0.7), "ipm", starts=1, verify=False)
    assert end.status == "solved" and end.iterations <= 5
    assert end.cost == approx(own.cost, rel=1e-9)


def solved_by(time: float) -> tuple[str, str, list[str]]:
    """In a forked process: how the solver of the parent ends there, in each of its ways."""
    (solver,) = FORKED
    solver.set(final_time=time)
    several = solver.solve_many([{}, {}], threads=2)
    return solver.solve().status, solver.explore(2).status, [end.status for end in several]


FORKED: list[LoadedSolver] = []


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_solves_with_the_solver_of_its_parent(bob: LoadedSolver) -> None:
    """The thread of the parent, in which it has solved, is none of the child's."""
    assert bob.solve().status == "solved"
    FORKED[:] = [bob]
    with multiprocessing.get_context("fork").Pool(2) as pool:
        ends = pool.map_async(solved_by, (1.1, 1.2, 1.3)).get(WAITS)
    assert ends == [("solved", "solved", ["solved"] * 2)] * 3
    assert bob.solve().status == "solved"


def test_several_starts(bob: LoadedSolver) -> None:
    """From a bob that goes over the top the shorter way is found; a seed says all."""
    short = bob.solve()
    q = short.tables["q"]
    angle = np.linspace(-np.pi / 2, -np.pi / 2 - (2 * np.pi - 0.6435), len(q))
    parts = [t.ravel().copy() for t in list(short.tables.values())[:-3]]
    parts[1] = np.column_stack([np.cos(angle), np.sin(angle)]).ravel()
    long = bob.solve(np.concatenate(parts))
    assert long.status == "solved" and long.cost > 1.5 * short.cost
    best = bob.explore(4, seed=5)
    assert best.status == "solved" and best.starts == 4 and best.iterations > long.iterations
    assert best.cost == approx(short.cost, rel=1e-9)
    ends = []
    for seed in (5, 5, 6):
        bob.solve("answer")
        ends.append(bob.explore(5, seed=seed))
    assert (ends[0].tables["q"] == ends[1].tables["q"]).all()
    assert ends[0].iterations == ends[1].iterations != ends[2].iterations
    assert bob.explore(1000, seconds=0.05).starts < 1000
    bob.set(bounds={"u": (5, -5)})
    with pytest.raises(ProblemError, match=r"bounds.u.high = -5"):
        bob.explore(3)


def test_mappings_that_hold_themselves_or_nothing_known(bob: LoadedSolver) -> None:
    """The names of a solver end somewhere; an empty mapping of a part that it has says nothing."""
    itself: dict[str, object] = {}
    itself["x"] = itself
    deep: object = 1.0
    for _ in range(5000):
        deep = {"x": deep}
    before = bob.numbers
    cases: tuple[dict[str, object], ...] = (
        {"start": itself}, {"start": deep}, {"nonsense": {}}, {"start": {"z": {}}},
    )  # fmt: skip
    for fields in cases:
        with pytest.raises(ProblemError, match=r"no number that this solver|expected a number\."):
            bob.set(**fields)
        with pytest.raises(ProblemError, match=r"no number that this solver|expected a number\."):
            bob.solve_many([fields])
    bob.set(start={})
    assert bob.numbers == before


@pytest.mark.slow
def test_a_folder_without_the_functions_of_a_solver(bob_folder: Path, tmp_path: Path) -> None:
    for name in ("dmoc_judge.c", "dmoc_starts.c", "dmoc_numbers.c", "kernels.c"):
        folder = shutil.copytree(bob_folder, tmp_path / name[:-2])
        (folder / name).write_text("")
        with pytest.raises(BuildError, match=r"of 'bob' lack functions|the compiler failed"):
            load_solver(folder)


@pytest.mark.slow
def test_the_folder_of_a_planner_has_the_solver_of_the_whole_motion(tmp_path: Path) -> None:
    problem = thrown()
    planner = dmoc.Planner(problem, dmoc.solve(problem, "ipm", starts=1))
    dmoc.generate_solver(planner, tmp_path / "thrown")
    assert load_solver(tmp_path / "thrown").solve().cost == approx(planner.solution.cost, rel=1e-9)


def full_disk(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_for_temporary_files_is_told(
    bob_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Path, "write_text", full_disk)
    with pytest.raises(
        OutputError, match=r"cannot be written \(No space left on device\): set TMP"
    ):
        load_solver(bob_folder)


def test_folders_that_are_none(bob_folder: Path, tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(BuildError, match="holds no solver: expected a folder that"):
            load_solver(folder)
    older = shutil.copytree(bob_folder, tmp_path / "older")
    header = (older / "dmoc_solver.h").read_text()
    (older / "dmoc_solver.h").write_text(header.replace("DMOC_SOLVER_FORMAT = ", "WITHOUT = "))
    with pytest.raises(BuildError, match=r"another version of dmoc \(its sources have form 1, "):
        load_solver(older)
    (older / "dmoc_solver.h").write_text(header)
    (older / "ldl.c").unlink()
    with pytest.raises(BuildError, match="holds no solver"):
        load_solver(older)
