"""Motions along plans: the small linear algebra against LAPACK, a step against its equations, and
the same motions with kernels on NumPy."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import driven_system

import dmoc
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.tracker import Marcher
from dmoc.guess.tracking import Tracker
from dmoc.guess.waypoints import Waypoints

ROOT = Path(__file__).resolve().parents[2]
FLAGS = (
    "-std=c11", "-g", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror",
    "-fsanitize=address,undefined", "-fno-sanitize-recover=all",
)  # fmt: skip
CUT = 1e-12


def chain(coordinates: int, inputs: int) -> dmoc.MechanicalSystem:
    """Coupled pendulums, of which each input turns two, by arms that depend on the position."""
    q, u = dynamicsymbols(f"q1:{coordinates + 1}"), dynamicsymbols(f"u1:{inputs + 1}")
    v = [s.diff(dynamicsymbols._t) for s in q]
    kinetic = sum((i + 1) * s**2 for i, s in enumerate(v)) / 2
    kinetic += sum(
        sp.Rational(2, 5) * sp.cos(a - b) * c * d
        for a, b, c, d in zip(q, q[1:], v, v[1:], strict=False)
    )
    g = sp.Symbol("g")
    forces = {s: sp.Integer(0) for s in q}
    for j, s in enumerate(u):
        forces[q[j % coordinates]] += s * (1 + sp.cos(q[0]) / 3)
        forces[q[(j + 1) % coordinates]] += s * sp.sin(q[-1]) / 4
    return dmoc.MechanicalSystem(
        f"chain_{coordinates}_{inputs}", coordinates=q, inputs=u,
        lagrangian=kinetic - sum(g * sp.sin(s) + s**2 / 2 for s in q), forces=forces,
        surfaces={"wall": q[0] <= 1 + sp.sin(q[-1]) / 5}, parameters={g: 9.0},
        cost=sum(s**2 for s in u) / 2 + 1,
    )  # fmt: skip


def chain_problem(coordinates: int, inputs: int) -> dmoc.Problem:
    names = [f"q{i + 1}" for i in range(coordinates)]
    return dmoc.Problem(
        dmoc.build(chain(coordinates, inputs), backend="numpy"),
        start={name: -0.1 * i for i, name in enumerate(names)},
        goal={name: 0.3 + 0.1 * i for i, name in enumerate(names)}, steps=2, final_time=1.0,
    )  # fmt: skip


# Linear algebra -----------------------------------------------------------------------------------


def matrices() -> list[Array]:
    rng = np.random.default_rng(5)
    kinds = [rng.normal(size=(m, n)) for m in range(1, 7) for n in range(1, 7)]
    kinds += [rng.normal(size=(m, 2)) @ rng.normal(size=(2, n)) for m in (3, 5) for n in (3, 4, 6)]
    kinds += [1e200 * rng.normal(size=(3, 2)), 1e-200 * rng.normal(size=(2, 3))]
    kinds += [np.zeros((3, 2)), np.diag([1.0, 1e-6, 1e-3]), np.ones((4, 2)), np.eye(4)[:, 1:3]]
    return kinds


@pytest.mark.slow
def test_small_least_squares_are_those_of_lapack(tmp_path: Path) -> None:
    gcc = shutil.which("gcc")
    if gcc is None:
        pytest.fail("the sanitizers need gcc: install it, with libasan and libubsan.")
    parts = [str(Path(__file__).with_name("least_squares.c")), str(ROOT / "guess/least_squares.c")]
    command = [gcc, *FLAGS, f"-I{ROOT / 'guess'}", *parts, "-lm", "-o", "run"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    text = "".join(
        f"{len(A)} {A.shape[1]} {CUT} {' '.join(map(repr, A.ravel().tolist()))}\n"
        for A in matrices()
    )
    environment = {**os.environ, "ASAN_OPTIONS": "detect_leaks=0"}
    ran = subprocess.run(
        [str(tmp_path / "run")], input=text, env=environment, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    values = iter(map(float, ran.stdout.split()))

    def taken(rows: int, columns: int) -> Array:
        return np.array([next(values) for _ in range(rows * columns)]).reshape(rows, columns)

    for A in matrices():
        m, n = A.shape
        inverse, smallest = np.linalg.pinv(A, rcond=CUT), np.linalg.svd(A, compute_uv=False)[-1]
        pseudo = taken(n, m)
        np.testing.assert_allclose(pseudo, inverse, rtol=1e-9, atol=1e-12 * np.abs(inverse).max())
        assert taken(1, 1)[0, 0] == pytest.approx(smallest, rel=1e-10, abs=1e-14 * np.abs(A).max())
        if m > n:
            rows = taken(m - n, m)
            np.testing.assert_allclose(rows @ rows.T, np.eye(m - n), atol=1e-14)
            np.testing.assert_allclose(rows @ A, 0.0, atol=1e-14 * np.abs(A).max())
    assert next(values, None) is None


# Motions ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("coordinates", "inputs"), [(2, 1), (3, 1), (4, 2), (3, 3), (1, 2)])
def test_a_step_obeys_the_equations_of_motion(coordinates: int, inputs: int) -> None:
    """The accelerations of one step, from both its ends, in M q'' = F + B u at its middle: those
    that are prescribed are the spline's, the residual is what no input can take away, and there is
    none where the others are free to follow."""
    problem = chain_problem(coordinates, inputs)
    rng = np.random.default_rng(7)
    positions, velocities = rng.normal(size=(2, 2, coordinates))
    T = 0.2
    prescribed = tuple(range(min(coordinates, inputs)))
    plan = Waypoints(positions, velocities, np.array([T]))
    march = Marcher(problem).motion(plan, (1,), prescribed)
    assert march is not None
    (q, u, *_), others = march, [i for i in range(coordinates) if i not in prescribed]
    np.testing.assert_allclose(q[1][list(prescribed)], positions[1][list(prescribed)], rtol=1e-12)
    c2 = (3 * (positions[1] - positions[0]) / T - 2 * velocities[0] - velocities[1]) / T
    c3 = (2 * (positions[0] - positions[1]) / T + velocities[0] + velocities[1]) / T**2
    a = 2 * c2 + 3 * T * c3  # of the spline, half-way
    a[others] = (2 * (q[1] - q[0] - T * velocities[0]) / T**2)[others]
    model, begin = problem.model, 2 * c2
    M, F = model.equations(q[0], velocities[0])
    B = model.input_matrix(q[0], velocities[0])
    # At the start of the step the others follow from a linear system in them and the inputs.
    A = np.hstack([M[:, others], -B])
    fixed = list(prescribed)
    begin[others] = np.linalg.lstsq(A, F - M[:, fixed] @ begin[fixed])[0][: len(others)]
    middle, pace = q[0] + T / 2 * velocities[0], velocities[0] + T / 2 * begin
    M, F = model.equations(middle, pace)
    residual = M @ a - F - model.input_matrix(middle, pace) @ u[0]
    np.testing.assert_allclose(residual, 0.0, atol=1e-9 * np.abs(F).max())


@pytest.mark.slow
@pytest.mark.parametrize("sequence", [(), ("wall",)])
def test_control_is_lost_where_the_other_accelerations_do_not_follow(
    sequence: tuple[str, ...],
) -> None:
    problem = chain_problem(4, 2).but(sequence=sequence)
    q, prescribed, others = problem.start_position + 0.3, (0, 2), [1, 3]
    M, B = problem.model.mass(q), problem.model.input_matrix(q)
    root = np.sqrt(problem.inertia)
    rest = np.linalg.svd(B / root[:, None])[0][:, 2:].T / root
    rows = rest @ M / np.sqrt(np.diagonal(M))
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    smallest = np.linalg.svd(rows[:, others], compute_uv=False)[-1]
    assert Marcher(problem).control(q, prescribed) == pytest.approx(smallest, rel=1e-10)
    assert Marcher(problem).control(q, (0, 1, 2, 3)) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("sequence", [(), ("floor",), ("side", "floor")])
def test_kernels_on_numpy_give_the_same_guesses(sequence: tuple[str, ...]) -> None:
    """Time, damping, a surface that moves, and inputs whose effect depends on the position."""
    compiled, slow = (
        dmoc.Problem(
            dmoc.build(driven_system(), backend=backend),
            start={"a": 0.2, "z": 0.0},
            goal={"a": 1.0, "z": 0.1},
            sequence=sequence,
            steps=20,
            final_time=(1.0, 1.5),
            bounds={"u": (-8.0, 8.0)},
            restitution=0.6,
        )
        for backend in ("compiled", "numpy")
    )
    pairs = list(zip(initial_guesses(compiled), initial_guesses(slow), strict=True))
    assert pairs
    for a, b in pairs:
        assert (a.prescribed, a.free_steps) == (b.prescribed, b.free_steps)
        assert a.final_time == pytest.approx(b.final_time, rel=1e-12)
        np.testing.assert_allclose(a.x, b.x, rtol=1e-9, atol=1e-9 * np.abs(a.x).max())


@pytest.mark.parametrize("sequence", [("lower",), ("lower", "upper")])
def test_several_trials_are_those_of_each_final_time(
    seed: dmoc.Problem, sequence: tuple[str, ...]
) -> None:
    tracker, steps = Tracker.of(seed.but(sequence=sequence)), (8,) * (len(sequence) + 1)
    times = np.array([1e-160, 0.3, 0.6, 0.9])
    excesses, costs = tracker.trials((1,), times, steps)
    assert np.isnan(excesses).tolist() == [True, False, False, False]
    for time, excess, cost in list(zip(times, excesses, costs, strict=True))[1:]:
        motion = tracker.march(tracker.plan((1,), float(time)), (1,), steps)
        assert motion is not None and motion.excess == excess
        assert tracker.marcher.cost == cost > 0.0


def test_a_plan_of_other_phases_is_refused(seed: dmoc.Problem) -> None:
    marcher = Marcher(seed)
    plan = Waypoints(np.zeros((2, 2)), np.zeros((2, 2)), np.ones(1))
    with pytest.raises(ValueError, match="expected a plan of 2 phases"):
        marcher.trials(plan[None], (5,), (0,))
