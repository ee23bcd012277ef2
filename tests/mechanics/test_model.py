"""A model with its parameter values: shapes, rows, and what the mechanics say about its
functions."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from joint_problems import double_pendulum
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.base.errors import ProblemError, SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.algebra import is_positive
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row, restitution_row

X1, Y1 = dynamicsymbols("x1 y1")

ROOT = Path(__file__).resolve().parents[2]
# Who may name kernels: the model, and the code that makes them.
MAY_CALL = ("mechanics/model.py", "mechanics/cost.py", "mechanics/friction.py", "codegen/")


@pytest.fixture
def model(pendulum: Kernels) -> Model:
    return Model(pendulum, parameter_row(pendulum, {}))


def states(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    return (
        rng.normal(size=(n, 2)),
        rng.normal(size=(n, 2)),
        rng.normal(size=(n, 1)),
        rng.normal(size=n),
    )


@pytest.mark.parametrize("rows", [(), (3,)])
def test_a_model_that_nothing_touches_has_no_contacts(rows: tuple[int, ...]) -> None:
    """Values of none, and slopes of none by all coordinates and the time."""
    kernels = dmoc.build(unit_mass("untouched"))
    free = Model(kernels, parameter_row(kernels, {}))
    q, v, t = np.ones((*rows, 1)), np.ones((*rows, 1)), np.ones(rows)
    for along in (
        free.gap_rates, free.gap_accelerations, free.slide_rates, free.slide_accelerations,
        free.joint_rates, free.joint_accelerations,
    ):  # fmt: skip
        assert along(q, v, t).shape == (*rows, 0)
    for values in (free.gaps, free.joints):
        assert values(q, t).shape == (*rows, 0)
    for slopes in (free.gap_slopes, free.tangent_slopes, free.joint_slopes):
        assert slopes(q, t).shape == (*rows, 0, 2)


def test_rows_of_states_are_evaluated_as_each_of_them_alone(model: Model) -> None:
    q, v, u, t = states(3)
    functions = {
        "equations": (
            model.equations(q, v, u, t), lambda k: model.equations(q[k], v[k], u[k], t[k]),
        ),
        "balance": (
            model.balance(q, v, u, t),
            lambda k: [a[0] for a in model.balance(q[[k]], v[[k]], u[[k]], t[[k]])],
        ),
        "slopes of the equations": (
            (model.equations_slopes(q, v, u, t, a=v),),
            lambda k: (model.equations_slopes(q[k], v[k], u[k], t[k], a=v[k]),),
        ),
        "others": (
            (
                model.acceleration(q, v, u, t), model.input_matrix(q, v, u, t),
                model.momentum(q, v, t), model.energy(q, v, t), model.velocity(q, v, t),
                model.gaps(q, t), model.gap_slopes(q, t), model.gap_rates(q, v, t),
                model.running_cost(q, v, u, t), model.terminal_cost(q, v, t),
                model.terminal_cost_slopes(q, v, t),
            ),
            lambda k: (
                model.acceleration(q[k], v[k], u[k], t[k]),
                model.input_matrix(q[k], v[k], u[k], t[k]), model.momentum(q[k], v[k], t[k]),
                model.energy(q[k], v[k], t[k]), model.velocity(q[k], v[k], t[k]),
                model.gaps(q[k], t[k]), model.gap_slopes(q[k], t[k]),
                model.gap_rates(q[k], v[k], t[k]), model.running_cost(q[k], v[k], u[k], t[k]),
                model.terminal_cost(q[k], v[k], t[k]), model.terminal_cost_slopes(q[k], v[k], t[k]),
            ),
        ),
    }  # fmt: skip
    for name, (rows, alone) in functions.items():
        for k in range(3):
            for a, b in zip(rows, alone(k), strict=True):
                np.testing.assert_allclose(a[k], b, rtol=1e-14, err_msg=name)


def test_shapes_are_those_of_the_mathematics(model: Model) -> None:
    q, v, u, t = states(5)
    nq, nu, nc = 2, 1, 2
    assert (model.nq, model.nu, model.nc) == (nq, nu, nc)
    assert [a.shape for a in model.equations(q, v, u, t)] == [(5, nq, nq), (5, nq)]
    assert model.equations_slopes(q[0], v[0], a=v[0]).shape == (nq, 2 * nq)
    assert model.input_matrix(q).shape == (5, nq, nu)
    assert model.energy(q, v, t).shape == (5,)
    assert [a.shape for a in model.balance(q, v, u, t)] == [(5, nq, nq), (5, nq), (5,)]
    assert model.gap_slopes(q).shape == (5, nc, nq + 1) and model.gap_rates(q, v).shape == (5, nc)


def test_what_is_one_row_or_strided_serves_rows(model: Model) -> None:
    q, v, u, t = states(6)
    np.testing.assert_array_equal(
        model.equations(q, v[0], u[0])[1][3], model.equations(q[3], v[0], u[0])[1]
    )
    np.testing.assert_array_equal(
        model.momentum(q[::2], v[::2], t[::2])[1], model.momentum(q[2], v[2], t[2])
    )


def test_functions_belong_together(model: Model) -> None:
    """p and v are inverse, the energy of rest is -L, rates of gaps are slopes times velocities,
    slopes are derivatives."""
    q, v, u, t = states(4)
    np.testing.assert_allclose(model.velocity(q, model.momentum(q, v, t), t), v, rtol=1e-12)
    M, F = model.equations(q, v, u, t)
    np.testing.assert_allclose(
        np.einsum("kij,kj->ki", M, model.acceleration(q, v, u, t)), F, rtol=1e-12
    )
    kinetic = np.einsum("ki,kij,kj->k", v, M, v) / 2
    np.testing.assert_allclose(model.energy(q, v, t) - model.energy(q, t=t), kinetic, rtol=1e-12)
    ends = np.hstack([v, np.ones((4, 1))])
    np.testing.assert_allclose(
        np.einsum("kji,ki->kj", model.gap_slopes(q, t), ends), model.gap_rates(q, v, t), atol=1e-14
    )
    little = 1e-6
    a = np.array([0.7, -1.3])
    R_D_s = model.equations_slopes(q[0], v[0], u[0], a=a)
    for i in range(4):
        step = little * np.eye(4)[i]
        ahead, behind = (
            model.equations(q[0] + s * step[:2], v[0] + s * step[2:], u[0]) for s in (1, -1)
        )
        change = ahead[1] - behind[1] - (ahead[0] - behind[0]) @ a
        np.testing.assert_allclose(R_D_s[..., i], change / (2 * little), atol=1e-7)


def test_a_unit_impulse_changes_the_momentum_along_its_direction(model: Model) -> None:
    q, v, _, _ = states(1)
    n = model.gap_slopes(q[0])[0, :-1]
    change, inertia = model.impulse_response(q[0], n)
    np.testing.assert_allclose(
        model.momentum(q[0], v[0] + change) - model.momentum(q[0], v[0]), n, atol=1e-12
    )
    assert inertia == pytest.approx(n @ change) and inertia > 0


@pytest.mark.parametrize("error", [ProblemError, SimulationError])
def test_values_are_read_once_for_all_who_take_them(
    pendulum: Kernels, error: type[dmoc.DmocError]
) -> None:
    row = (
        parameter_row(pendulum, {"m_w": 2.0}, error)
        if "m_w" in pendulum.parameters
        else parameter_row(pendulum, {}, error)
    )
    assert row.shape == (1, len(pendulum.parameters))
    np.testing.assert_array_equal(restitution_row(pendulum, {"upper": 0.5}, error), [1.0, 0.5])
    for restitution in ({"lowr": 1.0}, 2.0, {"lower": "soft"}, np.nan):
        with pytest.raises(error, match="restitution"):
            restitution_row(pendulum, restitution, error)
    for changes in ({"no": 1.0}, {next(iter(pendulum.parameters)): None}):
        with pytest.raises(error, match="parameter"):
            parameter_row(pendulum, changes, error)


@pytest.mark.slow
def test_kernels_are_evaluated_by_name_in_one_place() -> None:
    layers = [p for p in ROOT.glob("*/*.py") if (p.parent / "__init__.py").exists()]
    paths = sorted([*layers, *(ROOT / "src" / "dmoc").glob("*.py")])
    assert len(paths) > 50
    for path in paths:
        name = str(path.relative_to(ROOT))
        if name.startswith(MAY_CALL):
            continue
        calls = [
            node.lineno
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and node.func.attr in ("call", "pattern", "has")
            and node.args
            and isinstance(node.args[0], ast.Constant)
        ]
        assert not calls, (
            f"{name} names a kernel in lines {calls}: dmoc.mechanics.model is the place for it"
        )


def test_whether_a_mass_matrix_is_positive_does_not_depend_on_units() -> None:
    """[[1, r], [r, 1]] has the smallest eigenvalue 1 - abs(r)."""
    for unit in (1e-80, 1e-9, 1.0, 1e9, 1e80):
        scale = np.array([[1.0, unit], [unit, unit**2]])
        for r, positive in ((0.0, True), (0.999, True), (1.0, False), (-1.0, False), (2.0, False)):
            assert is_positive(np.array([[1.0, r], [r, 1.0]]) * scale) is positive
    for wrong in (0.0, -1.0, np.nan, np.inf):
        assert not is_positive(np.array([[1.0, 0.0], [0.0, wrong]]))


@pytest.mark.parametrize("shrunk", [1.0, 1e-9])
def test_forces_of_joints_leave_them_alone_whatever_their_units(shrunk: float) -> None:
    """J M^-1 (F + J^T lam) + J_dot v = 0 of two rods, also where one is stated in other units."""
    system, _ = double_pendulum()
    rods = dict(system.constraints)
    rods["first"] = shrunk * (X1**2 + Y1**2 - 1)
    kernels = dmoc.build(replace(system, constraints=rods))
    model, q = Model(kernels, parameter_row(kernels, {})), np.array([[0.6, -0.8, 0.6, -1.6]])
    bent, F = np.array([[2.0 * shrunk, 1.0]]), np.array([[[0.3, -9.81, 0.2, -6.0]]])
    J, lam = model.kept_slopes(q), model.joint_forces(model.mass(q), F, q, 0.0, bent)
    left = J[0] @ np.linalg.solve(model.mass(q)[0], (F + lam @ J)[0, 0]) + bent[0]
    assert left / [shrunk, 1.0] == pytest.approx(0, abs=1e-9)
