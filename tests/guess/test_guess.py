"""The slides' three implementation issues, each against an independent calculation."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.tracker import WINDOW
from dmoc.mechanics.model import Model
from dmoc.models.registry import find
from dmoc.program.iterate import Iterate
from dmoc.program.minimal_times import WithMinimalTimes, minimal_time, phase_minimal_time
from dmoc.program.transcription import Transcription

L, G, M_P, M_C = 0.5, 10.0, 1.0, 1.0


def unpack(problem: dmoc.Problem) -> tuple[Transcription, np.ndarray]:
    return Transcription(problem), initial_guesses(problem)[0].x


def test_guess_matches_boundary_and_collision(seed: dmoc.Problem) -> None:
    nlp, x = unpack(seed)
    q = x[nlp.layout.index_q]
    assert q[0] == pytest.approx([0.15 * pi, 0.0])
    assert q[100, 0] == pytest.approx(0.1 * pi, abs=1e-12)
    assert q[-1, 0] == pytest.approx(pi / 2, abs=1e-12)
    assert initial_guesses(seed)[0].prescribed == ("alpha",)


def test_guess_obeys_the_sources_equations_of_motion(seed: dmoc.Problem) -> None:
    """x'' sin(alpha) = l alpha'' + g cos(alpha), and F from the cart's row, with accelerations
    from second differences."""
    nlp, x = unpack(seed)
    h, q, u = x[nlp.layout.index_h], x[nlp.layout.index_q], x[nlp.layout.index_u][:, 0]
    for phase, first in ((0, 0), (1, 100)):
        nodes = q[first : first + 101]
        a = np.diff(nodes, 2, axis=0) / h[phase] ** 2
        v = (nodes[2:] - nodes[:-2]) / (2 * h[phase])
        alpha = nodes[1:-1, 0]
        residual = a[:, 1] * np.sin(alpha) - L * a[:, 0] - G * np.cos(alpha)
        assert np.abs(residual).max() < 2e-2 * np.abs(a).max()
        force = (M_P + M_C) * a[:, 1] - M_P * L * (
            a[:, 0] * np.sin(alpha) + v[:, 0] ** 2 * np.cos(alpha)
        )
        between = (u[first : first + 99] + u[first + 1 : first + 100]) / 2
        assert np.abs(force - between).max() < 3e-2 * np.abs(u).max()


def test_guess_keeps_the_bounds_of_the_inputs_where_a_final_time_does(seed: dmoc.Problem) -> None:
    for bound in (200.0, 150.0):
        guess = initial_guesses(seed.but(bounds={"F": (-bound, bound)}))[0]
        assert guess.input_excess == 0.0
    assert initial_guesses(seed.but(final_time=(0.2, 0.2)))[0].input_excess > 0


def test_a_motion_that_drifts_off_its_goal_is_the_last_guess(pendulum: Kernels) -> None:
    """The cart follows from a swing-up of the pendulum alone, and ends where nobody wants it."""
    rest = {"alpha_dot": 0.0, "x_dot": 0.0}
    problem = dmoc.Problem(
        pendulum, start={"alpha": -pi / 2, "x": 0.0}, goal={"alpha": pi / 2, "x": 0.5, **rest},
        ignored=("lower", "upper"), steps=50, final_time=1.0,
    )  # fmt: skip
    assert [g.prescribed for g in initial_guesses(problem)] == [("alpha", "x"), ("alpha",)]
    free = initial_guesses(problem.but(goal={"alpha": pi / 2, **rest}))
    assert [g.prescribed for g in free] == [("alpha",), ("alpha", "x")]


def test_guess_moves_freely_where_controllability_is_lost() -> None:
    """Inside the window: x'' = 0 and alpha'' = -g cos(alpha)/l; the window is crossed on the way
    up.

    For the cart-pendulum the matrix is m_p l sin(alpha): with inertia scaled to one, the measure of
    controllability is s / sqrt(1 + s^2) with s = |sin(alpha)| / sqrt(2).
    """
    reference = find("cart_pendulum_hanging")
    problem = dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 400})
    guess = initial_guesses(problem)[0]
    nlp = Transcription(problem)
    h, q = guess.x[nlp.layout.index_h], guess.x[nlp.layout.index_q][400:]
    alpha = q[:, 0]
    s = np.abs(np.sin(alpha)) / sqrt(2)
    measure = s / np.sqrt(1 + s * s)
    assert guess.free_steps == (measure < WINDOW).sum() > 0
    inside = np.flatnonzero(measure[:-2] < 0.98 * WINDOW) + 1
    inside = inside[inside < len(q) - 1]
    crossing = inside[np.abs(alpha[inside]) < 0.5]
    assert len(crossing) >= 4
    assert alpha[crossing[0]] < 0 < alpha[crossing[-1]]
    core = crossing[2:-2]
    a = (q[core + 1] - 2 * q[core] + q[core - 1]) / h[1] ** 2
    assert np.abs(a[:, 1]).max() < 1e-6
    np.testing.assert_allclose(a[:, 0], -G * np.cos(alpha[core]) / L, rtol=2e-2)


def test_minimal_time_of_a_mass_is_exact(block: Kernels) -> None:
    """Constant acceleration u/m from rest over a distance d: sqrt(2 d m / u)."""
    h, u, m, d = 0.01, 3.0, 2.0, 0.8
    par, bounds = np.array([[m, d]]), np.array([[-1.0, u]])
    first = np.array([0.5 * u / m * h**2])
    time, slope = minimal_time(Model(block, par), np.zeros(1), first, h, np.array([d]), 0, bounds)
    # From the middle of the first step the state is (q/2, q/h), h/2 after the start, up to h^2.
    assert time == pytest.approx(sqrt(2 * d * m / u), abs=2e-5)
    assert slope.shape == (4,)


@pytest.mark.parametrize("bound", [50.0, 100.0, 200.0])
def test_minimal_time_of_the_pendulum_equals_a_simulation_at_full_force(
    pendulum: Kernels, bound: float
) -> None:
    start, limit = 0.15 * pi, 0.1 * pi

    def motion(t: float, y: np.ndarray) -> list[float]:
        alpha, _, rate, speed = y
        M = np.array([[M_P * L**2, -M_P * L * sin(alpha)], [-M_P * L * sin(alpha), M_P + M_C]])
        a = np.linalg.solve(M, [-M_P * G * L * cos(alpha), -bound + M_P * L * rate**2 * cos(alpha)])
        return [rate, speed, a[0], a[1]]

    def touch(t: float, y: np.ndarray) -> float:
        return float(y[0] - limit)

    touch.terminal = True  # type: ignore[attr-defined]
    exact = solve_ivp(motion, (0, 1), [start, 0, 0, 0], events=touch, rtol=1e-10, atol=1e-12)
    h = 1e-5
    a = motion(0, np.array([start, 0, 0, 0]))[2:]
    q0 = np.array([start, 0.0])
    q1 = q0 + 0.5 * h**2 * np.array(a)
    model = Model(pendulum, np.array([[1, 1, 0.5, 10, limit, 2.8]]))
    estimate, _ = minimal_time(
        model, q0, q1, h, np.array([limit, 0.0]), 0, np.array([[-bound, bound]])
    )
    (time,) = exact.t_events[0]
    assert estimate == pytest.approx(time, rel=0.1) and time < 0.975 * estimate  # no lower bound
    if bound == 200:  # what the theory says of the reference problem
        assert (round(estimate, 4), round(time, 4)) == (0.0554, 0.0526)


def test_minimal_time_has_the_gradient_of_its_differences(pendulum: Kernels, puck: Kernels) -> None:
    cases = [
        (
            pendulum, np.array([0.47, 0.0, 0.46, -0.01, 0.02, 0.3141, -0.1]), 0,
            np.array([[-60.0, 60.0]]), np.array([[1, 1, 0.5, 10, 0.3141, 2.8]]),
        ),
        (
            puck, np.array([0.5, 0.4, 0.55, 0.42, 0.02, 2.9, 0.6]), 0,
            np.array([[-5.0, 5.0], [-4.0, 4.0]]), np.array([[1.0, 3.0, 0.2]]),
        ),
    ]  # fmt: skip
    for kernels, y, surface, bounds, par in cases:
        model = Model(kernels, par)

        def value(
            y: np.ndarray, m: Model = model, s: int = surface, b: np.ndarray = bounds
        ) -> tuple[float, np.ndarray]:
            return minimal_time(m, y[:2], y[2:4], float(y[4]), y[5:], s, b)

        time, slope = value(y)
        assert 0 < time < 10
        step = 1e-6
        reference = [
            (value(y + step * d)[0] - value(y - step * d)[0]) / (2 * step) for d in np.eye(7)
        ]
        np.testing.assert_allclose(slope, reference, rtol=1e-6, atol=1e-7)


def test_minimal_times_bound_the_phases_where_they_are_asked_for(seed: dmoc.Problem) -> None:
    assert not len(WithMinimalTimes(seed).minimal_times)
    seed = seed.but(minimal_times=True)
    nlp = WithMinimalTimes(seed)
    (row,) = nlp.minimal_times
    x = initial_guesses(seed)[0].x
    shortest = phase_minimal_time(Iterate.of(seed, x), 0)
    assert nlp.inequality(x)[row] == pytest.approx(x[0] * 100 - shortest)
    assert 0.04 < shortest < 0.07
    assert not len(WithMinimalTimes(seed.but(bounds={})).minimal_times)


def test_the_program_with_minimal_times_has_the_derivatives_of_its_differences(
    seed: dmoc.Problem,
) -> None:
    nlp = WithMinimalTimes(seed.but(steps=4, minimal_times=True))
    x = initial_guesses(seed.but(steps=4))[0].x
    w = np.zeros(nlp.n_in)
    w[nlp.minimal_times] = 1.3
    step = 1e-6

    def differences(value: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        return np.array(
            [(value(x + step * d) - value(x - step * d)) / (2 * step) for d in np.eye(nlp.n)]
        ).T

    slopes = nlp.inequality_jacobian(x).toarray()
    np.testing.assert_allclose(
        slopes, differences(nlp.inequality), rtol=1e-5, atol=1e-5 * np.abs(slopes).max()
    )
    np.testing.assert_allclose(
        nlp.lagrangian_gradient(x, np.zeros(nlp.n_eq), w), nlp.cost_gradient(x) - slopes.T @ w
    )
    upper = nlp.lagrangian_hessian(x, np.zeros(nlp.n_eq), w, sigma=0.0).toarray()
    wanted = differences(lambda x: -nlp.inequality_jacobian(x).T @ w)
    np.testing.assert_allclose(
        upper + np.triu(upper, 1).T, wanted, atol=1e-4 * np.abs(wanted).max()
    )
