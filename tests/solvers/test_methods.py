"""Every method on every kind of problem: same answers, same statuses; what an infeasible problem is
told."""

from __future__ import annotations

import os
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from answers import answer_of
from methods import SPARSE
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, there_and_back

import dmoc
from dmoc.base.deadline import Deadline
from dmoc.base.errors import MissingExtraError, ProblemError
from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.models.registry import build
from dmoc.program.transcription import Transcription
from dmoc.solvers import ipm, slsqp, slsqp_full
from dmoc.solvers.kkt_layout import kkt_layout
from dmoc.solvers.outcome import Iteration, Options, Status

ROOT = Path(__file__).resolve().parents[2]


def block_problem(block: Kernels) -> dmoc.Problem:
    return there_and_back(block, steps=40)


def puck_problem(puck: Kernels) -> dmoc.Problem:
    return dmoc.Problem(
        puck, start={"x": 1.5, "y": 0.0}, goal={"x": 1.5, "y": 1.0}, sequence=["rim"],
        final_time=1.0, steps=30,
    )  # fmt: skip


# Same answers -------------------------------------------------------------------------------------


def test_starts_end_the_same_in_any_number_of_threads(seed: dmoc.Problem) -> None:
    """As in solves of one each, of which some end at the limit of iterations; without time none is
    tried."""
    programs = [Transcription(seed.but(steps=12)) for _ in range(3)]
    nlp, options, shifts = programs[0], Options(iterations=30), np.random.default_rng(1)
    guess = nlp.scaled(initial_guesses(nlp.problem)[0].x)
    points = [guess + shifts.normal(0, 0.3 * (k % 2), nlp.n) for k in range(7)]
    rooms = kkt_layout(nlp).rooms  # where solves work: one after the other in the same
    rooms.clear()
    alone = [ipm.solve_ipm(nlp, x, options) for x in points]
    assert len({end.status for end in alone}) > 1 and len(rooms) == 1
    with ThreadPoolExecutor(3) as pool:
        for threads in (1, 3):
            ends = ipm.solve_starts(pool, programs[:threads], points, options)
            for end, one in zip(ends, alone, strict=True):
                assert (end.status, end.iterations) == (one.status, one.iterations)
                assert (end.x == one.x).all() and (end.duals.z == one.duals.z).all()
                assert (end.duals.rows == one.duals.rows).all()
        late = Options(deadline=Deadline.after(0.0))
        assert ipm.solve_starts(pool, programs, points, late) == []
    assert len(rooms) == len(set(map(id, rooms))) <= 3


def test_a_start_in_a_hurry_is_given_up_where_its_violation_does_not_fall(
    seed: dmoc.Problem,
) -> None:
    """Above a tenth, to four fifths of the least one of eight iterations before; those that are not
    in a hurry, and those whose violation falls, end as alone."""
    nlp, shifts = Transcription(seed.but(steps=12)), np.random.default_rng(3)
    guess = nlp.scaled(initial_guesses(nlp.problem)[0].x)
    points = [guess + shifts.normal(0, 0.15 * (k % 4), nlp.n) for k in range(16)]
    told = list[tuple[Status, int, bool]]()
    for x in points:
        violation = list[float]()
        options = Options(iterations=40, progress=lambda i, v=violation: v.append(i.violation))
        end = ipm.solve_ipm(nlp, x, options)
        least = np.minimum.accumulate(violation)
        stays = (least[8:] > 0.1) & (least[8:] > 0.8 * least[:-8])
        first = int(np.argmax(stays)) + 9 if stays.any() else end.iterations
        told.append((Status.ITERATION_LIMIT if stays.any() else end.status, first, stays.any()))
    hurried = [k % 2 == 1 for k in range(16)]
    with ThreadPoolExecutor(2) as pool:
        few, programs = Options(iterations=40), [nlp, nlp.beside()]
        every = ipm.solve_starts(pool, programs, points, few, [True] * 16)
        some = ipm.solve_starts(pool, programs, points, few, hurried)
        plain = ipm.solve_starts(pool, programs, points, few)
    assert [(end.status, end.iterations) for end in every] == [one[:2] for one in told]
    given_up = [k for k, one in enumerate(told) if one[2]]
    assert {told[k][1] for k in given_up} > {9} and 4 <= len(given_up) <= 12
    for k, (end, one, other) in enumerate(zip(some, every, plain, strict=True)):
        assert end.iterations == (one if hurried[k] else other).iterations


@pytest.mark.slow
@pytest.mark.parametrize("method", SPARSE)
@pytest.mark.parametrize("name", ["block", "puck", "seed"])
def test_methods_agree_with_slsqp(
    request: pytest.FixtureRequest, seed: dmoc.Problem, method: str, name: str
) -> None:
    if name == "seed":
        problem = seed.but(steps=50)
    else:
        make = {"block": block_problem, "puck": puck_problem}[name]
        problem = make(request.getfixturevalue(name))
    reference = dmoc.solve(problem, starts=1, verify=False)
    solution = answer_of(problem, method=method, starts=1, verify=False)
    assert solution.cost == pytest.approx(reference.cost, rel=1e-6)
    assert solution.final_time == pytest.approx(reference.final_time, rel=1e-4)
    assert solution.optimality <= 1e-6 and solution.max_violation <= 1e-10
    assert solution.active_bounds == reference.active_bounds
    np.testing.assert_allclose(
        solution.multipliers["momentum"], reference.multipliers["momentum"], rtol=1e-3, atol=1e-3
    )


def test_seed_is_solved_and_verified(seed: dmoc.Problem) -> None:
    solution = answer_of(seed, method="ipm")
    assert solution.cost == pytest.approx(129.6024, abs=1e-4)
    assert [p.duration for p in solution.phases] == pytest.approx([0.09640, 0.90360], abs=1e-5)


def test_a_thousand_steps_a_phase(seed: dmoc.Problem) -> None:
    """The costs of DESIGN's ladder go to 129.986 with the square of the step."""
    solution = answer_of(seed.but(steps=1000), method="ipm", starts=1)
    assert solution.cost == pytest.approx(129.986 - (129.986 - 129.6024) / 100, abs=2e-3)
    with pytest.raises(ProblemError, match="method ipm"):
        dmoc.solve(seed.but(steps=1001), "slsqp")


@pytest.mark.slow
@pytest.mark.parametrize(
    "sequence", [[], ["lower", "lower"], ["lower", "upper", "lower"], ["upper", "lower"]]
)
def test_sequences_from_the_automatic_guess(seed: dmoc.Problem, sequence: list[str]) -> None:
    solution = answer_of(seed.but(sequence=sequence), method="ipm")
    assert [c.surface for c in solution.collisions] == sequence


@pytest.mark.slow
def test_linear_inputs_and_a_fixed_time(seed: dmoc.Problem) -> None:
    assert dmoc.solve(seed.but(controls="linear"), method="ipm").cost == pytest.approx(
        129.50419, rel=1e-6
    )
    assert dmoc.solve(seed.but(final_time=1.0), method="ipm").cost == pytest.approx(
        129.602392, rel=1e-7
    )


@pytest.mark.slow
def test_free_boundary_values_are_found(seed: dmoc.Problem) -> None:
    """Unknowns at the start that no equation of the chain determines end up in the final group
    of the factorisation."""
    problem = seed.but(start={"alpha": (1.1, 1.3), "x": 0.0, "alpha_dot": (-0.5, 0.5)}, steps=40)
    a, b = (dmoc.solve(problem, method=m, starts=1, verify=False) for m in ("ipm", "slsqp"))
    assert a.status == b.status == "solved"
    assert a.cost == pytest.approx(b.cost, rel=1e-5)


def test_a_neighbouring_solution_saves_iterations(seed: dmoc.Problem) -> None:
    first = dmoc.solve(seed, method="ipm", starts=1, verify=False)
    near = seed.but(parameters={"m_c": 1.05})
    cold = dmoc.solve(near, method="ipm", starts=1, verify=False)
    warm = dmoc.solve(near, method="ipm", guess=first, starts=1, verify=False)
    assert warm.status == cold.status == "solved"
    assert warm.cost == pytest.approx(cold.cost, rel=1e-8)
    assert warm.iterations < 0.7 * cold.iterations
    again = answer_of(seed, method="ipm", guess=first, starts=1, verify=False)
    assert again.iterations <= 5


@pytest.mark.slow
def test_a_solution_of_another_mesh_or_order_is_a_guess(seed: dmoc.Problem, block: Kernels) -> None:
    first = dmoc.solve(seed.but(steps=[10, 10]), method="ipm", starts=1, verify=False)
    for problem in (
        seed.but(steps=[12, 8]),
        seed.but(kernels=dmoc.load("cart_pendulum", order=4), steps=12, controls=None),
    ):
        assert (
            dmoc.solve(problem, method="ipm", guess=first, starts=1, verify=False).status
            == "solved"
        )
    with pytest.raises(ProblemError, match="guess has 1 collisions: expected a motion with 2"):
        dmoc.solve(seed.but(sequence=["lower", "lower"]), method="ipm", guess=first)
    with pytest.raises(
        ProblemError,
        match="guess is a motion of alpha, x, F: expected a motion of the coordinates and inputs x",
    ):
        dmoc.solve(
            dmoc.Problem(block, start={"x": 0}, sequence=["wall"]), method="ipm", guess=first
        )
    other = dmoc.solve(
        seed.but(steps=[10, 10], sequence=["upper"]), method="ipm", guess=first, verify=False
    )
    assert other.status == "solved"  # from its unknowns, without its multipliers


def test_a_coordinate_that_is_held_keeps_the_system_sparse(seed: dmoc.Problem) -> None:
    """The pivots of the final group, whose work grows with their cube, do not become more with
    the steps."""
    held = seed.but(bounds={"F": (-200, 200), "x": (0, 0)})
    systems = [kkt_layout(Transcription(held.but(steps=n))) for n in (100, 1000)]
    few, many = (K.size - K.first[-1] for K in systems)
    assert few == many < 10


def test_a_bound_of_a_duration_counts_more_than_the_shortest_phase(seed: dmoc.Problem) -> None:
    """By default a phase keeps a thousandth of the largest final time, here more than what the
    bound allows."""
    problem = seed.but(steps=20, final_time=(None, 100.0), durations=[(None, 0.0966), (None, 2.0)])
    assert (Transcription(problem).lower <= Transcription(problem).upper).all()
    for method in ("ipm", "slsqp"):
        solution = answer_of(problem, method=method, starts=1, verify=False)
        assert solution.phases[0].duration <= 0.0966 + 1e-9
    problem = seed.but(final_time=(None, 100.0), durations=[(0.001, None), (None, 0.9)])
    assert not any(
        "phase 0 >= 0.1" in b
        for b in dmoc.solve(problem, method="ipm", starts=1, verify=False).active_bounds
    )


def test_multipliers_survive_a_file(seed: dmoc.Problem, tmp_path: Path) -> None:
    first = dmoc.solve(seed, method="ipm", starts=1)
    loaded = dmoc.Solution.load(first.save(tmp_path / "s.npz"))
    assert dmoc.solve(seed, method="ipm", guess=loaded, starts=1, verify=False).iterations <= 5


# Limits -------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("method", SPARSE)
def test_limits_are_kept(seed: dmoc.Problem, method: str) -> None:
    few = dmoc.solve(seed, method=method, starts=1, iterations=3)
    assert few.status == "iteration_limit" and few.iterations <= 3
    assert len(few.phases) == 2 and np.isfinite(few.cost)
    late = dmoc.solve(seed.but(steps=300), method=method, starts=1, seconds=1e-3)
    assert late.status == "time_limit"


@pytest.mark.parametrize("method", SPARSE)
def test_progress_is_told_and_an_interruption_keeps_the_iterate(
    seed: dmoc.Problem, method: str
) -> None:
    seen: list[Iteration] = []

    def interrupt(i: Iteration) -> None:
        seen.append(i)
        if i.number == 4:
            raise KeyboardInterrupt

    solution = dmoc.solve(seed.but(steps=50), method=method, starts=1, progress=interrupt)
    assert solution.status == "interrupted"
    assert [i.number for i in seen] == [1, 2, 3, 4]
    assert np.isfinite([i.violation for i in seen]).tolist() == [True] * 4


@pytest.mark.parametrize("form", ["condensed", "full"])
def test_a_system_that_becomes_singular_ends_with_the_best_iterate(
    block: Kernels, monkeypatch: pytest.MonkeyPatch, form: str
) -> None:
    """In both forms of SLSQP; the method that takes over from it solves the problem."""

    def singular(*_: object) -> None:
        raise np.linalg.LinAlgError("by chance")

    for module in (slsqp, slsqp_full):
        monkeypatch.setattr(module, "polish", singular)
    problem = there_and_back(block, steps=8)
    nlp = Transcription(problem)
    x = initial_guesses(problem)[0].x
    solve = slsqp.solve_slsqp if form == "condensed" else slsqp_full.solve_slsqp_full
    ending = solve(nlp, x, Options())
    assert ending.status is Status.STALLED and "singular on the way: by chance" in ending.detail
    assert np.isfinite(ending.x).all() and ending.iterations > 0
    assert dmoc.solve(problem, "slsqp", form=form, starts=1).solved


def test_iterations_are_counted_once(seed: dmoc.Problem) -> None:
    """Through restorations too."""
    weak = seed.but(bounds={"F": (-1, 1)}, steps=30)
    nlp = Transcription(weak)
    x = initial_guesses(weak)[0].x
    for limit in range(20, 60, 3):
        seen: list[Iteration] = []
        outcome = ipm.solve_ipm(nlp, x, Options(iterations=limit, progress=seen.append))
        assert ipm.solve_ipm(nlp, x, Options(iterations=limit)).iterations == outcome.iterations
        assert outcome.iterations == limit
        assert [i.number for i in seen] == list(range(1, limit + 1))


@pytest.mark.parametrize("method", SPARSE)
def test_what_a_callback_prints_is_seen(
    seed: dmoc.Problem, capfd: pytest.CaptureFixture[str], method: str
) -> None:
    dmoc.solve(
        seed.but(steps=20),
        method=method,
        starts=1,
        iterations=3,
        progress=lambda i: print(f"iteration {i.number}"),
    )
    assert "iteration 2" in capfd.readouterr().out


def test_two_threads_may_use_uno(block: Kernels) -> None:
    with ThreadPoolExecutor(2) as pool:
        solutions = list(
            pool.map(
                lambda _: dmoc.solve(block_problem(block), method="uno", starts=1, verify=False),
                range(4),
            )
        )
    assert [s.status for s in solutions] == ["solved"] * 4


def test_what_other_threads_write_while_uno_solves_is_not_lost(
    block: Kernels, capfd: pytest.CaptureFixture[str]
) -> None:
    # It goes past Python's own stream, as what compiled libraries and child processes write.
    written, solved = 0, threading.Event()

    def write() -> None:
        nonlocal written
        while not solved.is_set():
            written += os.write(1, b"line of a thread\n") // len(b"line of a thread\n")
            time.sleep(1e-4)

    thread = threading.Thread(target=write)
    thread.start()
    try:
        problem = block_problem(block).but(steps=400)  # so that there is time to write
        solution = dmoc.solve(problem, method="uno", starts=1, verify=False)
    finally:
        solved.set()
        thread.join()
    assert solution.status == "solved"
    assert written > 1 and capfd.readouterr().out.count("line of a thread") == written


@pytest.mark.parametrize("method", SPARSE)
def test_an_error_in_the_callback_is_not_lost(seed: dmoc.Problem, method: str) -> None:
    def fail(_: Iteration) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        dmoc.solve(seed.but(steps=20), method=method, starts=1, progress=fail)


@pytest.mark.parametrize(("method", "package"), [("ipopt", "ipyopt"), ("uno", "unopy")])
def test_a_missing_extra_is_named(
    seed: dmoc.Problem, monkeypatch: pytest.MonkeyPatch, method: str, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=rf"pip install 'dmoc\[{method}\]'"):
        dmoc.solve(seed, method=method)


def test_kernels_on_numpy_give_the_same_program_and_no_interior_point() -> None:
    system_ = block_system()
    compiled, numpy = build(system_), build(system_, backend="numpy")
    problems = [block_problem(k) for k in (compiled, numpy)]
    with pytest.raises(ProblemError, match="needs compiled kernels"):
        dmoc.solve(problems[1], method="ipm")
    a, b = (Transcription(p) for p in problems)
    x = np.random.default_rng(0).uniform(0.1, 1.0, a.n)
    y = np.random.default_rng(1).normal(size=a.n_eq + a.n_in)
    np.testing.assert_allclose(a.program.values(x), b.program.values(x), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(a.program.slopes(x), b.program.slopes(x), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(
        a.program.curvatures(x, y, 0.5), b.program.curvatures(x, y, 0.5), rtol=1e-13, atol=1e-12
    )
    assert dmoc.solve(problems[1], starts=1, verify=False).status == "solved"


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1600, 4000, 8000])
def test_rounding_errors_of_a_fine_mesh_leave_no_step_half_taken(steps: int) -> None:
    """1 m from rest to rest in 1 s: of N equal steps with constant forces, 12/(1 - 1/N^2).  Near it
    no cost tells a step from its half, and the multipliers need the whole one."""
    x, u = dynamicsymbols("x u")
    system = dmoc.MechanicalSystem(
        "straight", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2
    )
    problem = dmoc.Problem(system, {"x": 0}, {"x": 1, "x_dot": 0}, final_time=1, steps=steps)
    solution = dmoc.solve(problem, "ipm", verify=False)
    assert solution.status == "solved" and solution.optimality < 1e-9
    assert solution.iterations <= 6
    assert solution.cost == pytest.approx(12 / (1 - 1 / steps**2), rel=1e-10)
