"""Properties of random small mechanical systems: derivatives, momentum maps, energy through
impacts, and both directions of the same equations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, puck_system

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.program.transcription import Transcription

pytestmark = pytest.mark.slow

T = dynamicsymbols._t
# Each example derives a system of its own.
SOME = settings(max_examples=8, deadline=None, derandomize=True)
FAST = settings(max_examples=15, deadline=None, derandomize=True)


@st.composite
def systems(draw: Any) -> dmoc.MechanicalSystem:
    """Two coordinates with a mass matrix that depends on them, a potential, forces, dissipation,
    time, a surface, costs."""
    q = dynamicsymbols("a b")
    u = dynamicsymbols("u")
    v = [s.diff(T) for s in q]
    number = st.integers(-3, 3).map(lambda k: sp.Rational(k, 4))
    c = [draw(number) for _ in range(10)]
    shape = draw(st.sampled_from([sp.sin, sp.cos, sp.tanh, sp.exp]))
    kinetic = (
        (2 + c[0] * shape(q[1] / 2) ** 2) * v[0] ** 2 / 2
        + v[1] ** 2 * 2
        + c[1] * shape(q[0]) * v[0] * v[1] / 4
    )
    potential = c[2] * q[0] ** 2 + shape(c[3] * q[1]) + c[4] * sp.cos(q[0] - q[1])
    time = int(draw(st.booleans())) * T / 3
    return dmoc.MechanicalSystem(
        "random", coordinates=q, inputs=[u],
        lagrangian=kinetic * (1 + time / 5) - potential + c[5] * shape(time) * v[0],
        forces={q[0]: u * (1 + c[6] * q[1]), q[1]: c[7] * u**2 / 4}, parameters={},
        dissipation=abs(c[8]) * v[0] ** 2 / 2,
        surfaces={"wall": q[0] + c[9] * q[1] ** 2 / 2 <= 1 + time},
        cost=u**2 + c[2] * q[1] ** 2 + time, terminal_cost=c[3] * q[0] * v[1],
        path_constraints={"path": u + v[0] <= 9},
    )  # fmt: skip


@SOME
@given(systems(), st.sampled_from([2, 4]), st.integers(0, 10_000))
def test_derivatives_equal_differences(
    system: dmoc.MechanicalSystem, order: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    problem = dmoc.Problem(
        dmoc.build(system, order=order),
        start={"a": 0.0, "b": (-1, 1), "a_dot": (-1, 1)}, sequence=["wall"], steps=[2, 2],
        final_time=(0.1, 1.0), restitution=rng.uniform(), periodic=["b_dot"],
    )  # fmt: skip
    nlp = Transcription(problem)
    lay = nlp.layout
    x = rng.uniform(-0.4, 0.4, nlp.n)
    x[lay.index_h] = rng.uniform(0.3, 0.5, 2)
    y, w = rng.normal(size=nlp.n_eq), rng.normal(size=nlp.n_in)

    def differences(f: Callable[[np.ndarray], np.ndarray], step: float = 1e-6) -> np.ndarray:
        return np.array([(f(x + step * d) - f(x - step * d)) / (2 * step) for d in np.eye(nlp.n)])

    slopes = np.vstack(
        [
            nlp.cost_gradient(x),
            nlp.equality_jacobian(x).toarray(),
            nlp.inequality_jacobian(x).toarray(),
        ]
    )
    np.testing.assert_allclose(
        slopes, differences(nlp.values).T, atol=1e-7 * max(1.0, np.abs(slopes).max())
    )
    weights = np.concatenate([[0.7], y, -w])
    gradient = nlp.lagrangian_gradient(x, y / 0.7, w / 0.7)
    np.testing.assert_allclose(0.7 * gradient, weights @ slopes, atol=1e-12 * np.abs(slopes).max())
    upper = nlp.lagrangian_hessian(x, y, w, sigma=0.7).toarray()
    second = differences(lambda x: 0.7 * nlp.lagrangian_gradient(x, y / 0.7, w / 0.7))
    np.testing.assert_allclose(
        upper + np.triu(upper, 1).T, second, atol=1e-6 * max(1.0, np.abs(upper).max())
    )


@cache
def chain(order: int) -> Kernels:
    """Three masses on a line with nonlinear springs between them and walls: total momentum is
    conserved in free flight."""
    q = dynamicsymbols("q1:4")
    m, k, c, room = sp.symbols("m k c room")
    stretch = [q[1] - q[0] - 1, q[2] - q[1] - 1]
    potential = sum(k * s**2 / 2 + c * s**4 / 4 for s in stretch)
    return dmoc.build(
        dmoc.MechanicalSystem(
            "chain", q, sum(m * (i + 1) * s.diff(T) ** 2 / 2 for i, s in enumerate(q)) - potential,
            {m: 1.0, k: 1.0, c: 0.3, room: 2.0},
            surfaces={"left": q[0] >= -room, "right": q[2] <= 2 + room},
        ),
        order=order,
    )  # fmt: skip


number = st.floats(-1, 1).map(lambda x: round(x, 3))


@FAST
@given(st.sampled_from([2, 4]), st.lists(number, min_size=6, max_size=6))
def test_momentum_maps_are_conserved_under_symmetry(order: int, values: list[float]) -> None:
    """Translations: the sum of the momenta of the chain.  Rotations: the angular momentum of two
    bodies with a central force."""
    q, v = [values[0] / 5, 1 + values[1] / 5, 2 + values[2] / 5], values[3:]
    run = dmoc.simulate(chain(order), q, v, step_size=0.05, steps=200, parameters={"room": 100.0})
    np.testing.assert_allclose(run.p.sum(axis=1), run.p[0].sum(), atol=1e-11)
    planet = planets(order)
    run = dmoc.simulate(
        planet, [1.0, values[0] / 3], [values[3] / 3, 1 + values[4] / 3], step_size=0.05, steps=200
    )
    angular = run.q[:, 0] * run.p[:, 1] - run.q[:, 1] * run.p[:, 0]
    np.testing.assert_allclose(angular, angular[0], atol=1e-11)


@cache
def planets(order: int) -> Kernels:
    x, y = dynamicsymbols("x y")
    potential = -1 / sp.sqrt(x**2 + y**2 + sp.Rational(1, 4))
    return dmoc.build(
        dmoc.MechanicalSystem(
            "planet", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - potential, {}
        ),
        order=order,
    )


@FAST
@given(st.sampled_from([2, 4]), st.lists(number, min_size=6, max_size=6))
@example(2, [0.0, 0.0, -0.475, 0.0, 0.277, 0.0])
def test_energy_is_kept_through_elastic_impacts(order: int, values: list[float]) -> None:
    """The error does not grow with the number of impacts, and an eighth of the step divides it by
    4 at least: not always by 8^order, because it depends on where in a step the impacts fall.  For
    that reason the coarse step is the worst of three."""
    q, v = [values[0] / 5, 1 + values[1] / 5, 2 + values[2] / 5], [2 * x for x in values[3:]]
    errors = []
    for h in (0.08, 0.075, 0.07, 0.01):
        run = dmoc.simulate(
            chain(order), q, v, step_size=h, steps=round(40 / h), parameters={"room": 0.5}
        )
        errors.append(float(np.abs(run.energy - run.energy[0]).max()))
    scale = 1 + abs(run.energy[0])
    assert errors[-1] < {2: 2e-2, 4: 1e-4}[order] * scale
    assert errors[-1] < max(0.25 * max(errors[:-1]), 1e-9 * scale)


@FAST
@given(
    st.sampled_from([2, 4]), st.sampled_from([1.0, 0.7, 0.2]), number, number, st.floats(0.35, 0.65)
)
def test_forward_and_optimal_control_answers_agree(
    order: int, e: float, goal: float, speed: float, share: float
) -> None:
    """The inputs of an optimal motion through a collision lead the integrator along the same
    nodes, with the same impulse."""
    h, before = 0.025, round(share * 40)
    kernels = dmoc.build(block_system(), order=order)
    problem = dmoc.Problem(
        kernels, start={"x": 0.0, "x_dot": speed}, goal={"x": goal / 2, "x_dot": -speed},
        sequence=["wall"], steps=[before, 40 - before],
        durations=[(before * h, before * h), ((40 - before) * h,) * 2], final_time=1.0,
        restitution=e, controls="constant",
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1)
    u = np.vstack([p.u for p in solution.phases])
    run = dmoc.simulate(kernels, [0.0], [speed], step_size=h, steps=40, inputs=u, restitution=e)
    q = np.vstack([solution.phases[0].q, solution.phases[1].q[1:]])
    np.testing.assert_allclose(run.q, q, atol=1e-8)
    assert len(run.collisions) == 1
    np.testing.assert_allclose(run.collisions[0].impulse, solution.collisions[0].impulse, rtol=1e-7)


@FAST
@given(st.sampled_from([2, 4]), st.floats(0.0, 1.0), st.floats(-0.5, 0.5), st.floats(0.5, 2.0))
def test_impacts_follow_newtons_law_on_curved_surfaces(
    order: int, e: float, offset: float, speed: float
) -> None:
    """Against the round post: w+ = -e w- along the normal, and the tangential velocity is kept;
    the error is that of a step."""
    kernels = dmoc.build(puck_system(), order=order)
    run = dmoc.simulate(
        kernels, [0.0, 0.2 * offset], [speed, 0.0], step_size=0.01, steps=round(0.9 / speed / 0.01),
        restitution=e,
    )  # fmt: skip
    (hit,) = run.collisions
    normal = np.array([1.0, 0.0]) - hit.position
    normal /= np.linalg.norm(normal)
    tangent = np.array([-normal[1], normal[0]])
    assert abs(tangent @ (hit.momentum_after - hit.momentum_before)) < 1e-12
    np.testing.assert_allclose(
        normal @ hit.momentum_after, -e * (normal @ hit.momentum_before), atol=1e-9
    )
