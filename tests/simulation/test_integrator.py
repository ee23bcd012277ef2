"""The integrator of the check: its method, the work, the linearised flow, surfaces that hold a
motion, compiled and on NumPy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import DOP853, solve_ivp
from sympy.physics.mechanics import dynamicsymbols
from systems import driven_system

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.simulation import dormand_prince
from dmoc.simulation.integrator import Integrator

T = dynamicsymbols._t


@pytest.fixture(scope="module", params=["compiled", "numpy"])
def driven(request: pytest.FixtureRequest) -> Kernels:
    return dmoc.build(driven_system(), backend=request.param)


def integrator(kernels: Kernels, check_time: Callable[[], None] = lambda: None) -> Integrator:
    par = parameter_row(kernels, {})
    size = np.ones(2 * len(kernels.coordinates) + 1)
    return Integrator(kernels, par, size, check_time)


def random_rows(kernels: Kernels, n: int, more: int = 0) -> tuple[np.ndarray, ...]:
    """States, times, durations and inputs of n steps."""
    r = np.random.default_rng(7)
    nq, nu = len(kernels.coordinates), len(kernels.inputs)
    y = np.hstack([r.uniform(-1, 1, (n, 2 * nq)), np.zeros((n, more))])
    inputs = (r.uniform(-1, 1, (n, nu)) for _ in "01")
    return y, r.uniform(0, 2, n), r.uniform(0.01, 0.8, n), *inputs


def once(n: int) -> tuple[np.ndarray, np.ndarray]:
    """The first and the last step of rows of one step each."""
    return np.arange(n), np.arange(1, n + 1)


def test_the_coefficients_are_those_of_the_method() -> None:
    sums = [*DOP853.A[1:], DOP853.B, DOP853.E5, DOP853.E3]
    assert dormand_prince.shares() == tuple(DOP853.C[1:])
    for terms, row in zip(dormand_prince.sums(), sums, strict=True):
        factors = np.zeros(len(row))
        for stage, factor in terms:
            factors[stage] = factor
        assert np.array_equal(factors, row)


def test_the_coarse_method_is_of_order_four(driven: Kernels) -> None:
    def ends(parts: int, coarse: bool) -> np.ndarray:
        y = np.array([[0.3, -0.2, 0.5, 0.1, 0.0]])
        nodes = np.linspace(0.0, 1.0, parts + 1)
        u = np.stack([np.sin(nodes)] * len(driven.inputs), axis=1)
        steps = nodes[:-1].copy(), np.diff(nodes), u[:-1].copy(), u[1:].copy()
        first, last = np.array([0]), np.array([parts])
        integrator(driven).advance(y, first, last, *steps, coarse=coarse)
        return y[0]

    errors = [np.abs(ends(n, True) - ends(n, False)).max() for n in (8, 16, 32)]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(4.0, abs=0.3)


@pytest.mark.slow
def test_states_and_work_are_those_of_another_integrator(driven: Kernels) -> None:
    """More rows than fit side by side, each with parts of its own."""
    model, nq = Model(driven, parameter_row(driven, {})), 2
    y, t, h, u0, u1 = random_rows(driven, 40, more=1)
    states = y.copy()
    ends = integrator(driven).advance(states, *once(len(y)), t, h, u0, u1)
    for k in range(len(y)):

        def slope(s: float, y: np.ndarray, k: int = k) -> np.ndarray:
            share = (s - t[k]) / h[k]
            u = (1 - share) * u0[k] + share * u1[k]
            rows = y[None, :nq], y[None, nq : 2 * nq], u[None], np.array([s])
            M, F, power = model.balance(*rows)
            return np.concatenate([y[nq : 2 * nq], np.linalg.solve(M[0], F[0]), power])

        reference = solve_ivp(slope, (t[k], t[k] + h[k]), y[k], "DOP853", rtol=1e-12, atol=1e-12)
        assert states[k] == pytest.approx(reference.y[:, -1], rel=1e-9, abs=1e-10)
        assert ends[k, 0] == pytest.approx(slope(t[k], y[k])[nq : 2 * nq], rel=1e-12)
        assert ends[k, 1] == pytest.approx(slope(t[k] + h[k], states[k])[nq : 2 * nq], rel=1e-12)


def test_the_linearised_flow_is_that_of_differences(driven: Kernels) -> None:
    m, flow = 4, integrator(driven)
    y, t, h, u0, u1 = random_rows(driven, 20)
    X = np.tile(np.eye(m).ravel(), (len(y), 1))
    linear = np.hstack([y, X])
    flow.advance(linear, *once(len(y)), t, h, u0, u1)
    slopes = linear[:, m:].reshape(-1, m, m)
    for j in range(m):
        ends = []
        for sign in (1, -1):
            near = y.copy()
            near[:, j] += sign * 1e-5
            flow.advance(near, *once(len(y)), t, h, u0, u1)
            ends.append(near)
        differences = (ends[0] - ends[1]) / 2e-5
        assert slopes[:, :, j] == pytest.approx(differences, rel=1e-6, abs=1e-7)


def test_rows_go_over_lists_of_steps_of_different_lengths(driven: Kernels) -> None:
    y, *steps = random_rows(driven, 40)
    first = np.arange(40) // 2
    last = first + np.arange(40) % 5
    states = y.copy()
    integrator(driven).advance(states, first, last, *steps)
    for k in (0, 3, 19, 39):
        row = y[k : k + 1].copy()
        for j in range(first[k], last[k]):
            integrator(driven).advance(row, *once(1), *(s[j : j + 1].copy() for s in steps))
        assert states[k] == pytest.approx(row[0], rel=1e-9, abs=1e-9)


def test_a_closed_surface_holds_the_motion(driven: Kernels) -> None:
    """On the moving floor and on the side, whatever pushes: the motion is that of Lagrange's
    equations of the first kind, the work that of the surfaces too."""
    model, nq = Model(driven, parameter_row(driven, {})), 2
    y, t, h, u0, u1 = random_rows(driven, 10, more=1)
    flow, none = integrator(driven), np.zeros((10, 0))
    on_floor, on_side = y.copy(), y.copy()
    on_floor[:, 1] = 0.8 * np.cos(y[:, 0]) + 0.3 * np.sin(t) - 2
    on_side[:, 0] = 1.5
    for j, states in enumerate((on_floor, on_side)):
        mode = Mode((j,))
        flow.project(mode, states, t, none)
        start = states.copy()
        flow.advance(states, *once(len(y)), t, h, u0, u1, mode)
        for rows, at in ((start, t), (states, t + h)):
            q, v = (np.ascontiguousarray(rows[:, k * nq : (k + 1) * nq]) for k in (0, 1))
            assert np.abs(model.gaps(q, at)[:, j]).max() < 1e-12
            assert np.abs(model.gap_rates(q, v, at)[:, j]).max() < 1e-12
        for k in range(len(y)):

            def slope(s: float, z: np.ndarray, k: int = k, j: int = j) -> np.ndarray:
                share, v, at = (s - t[k]) / h[k], z[None, nq : 2 * nq], np.array([s])
                u = ((1 - share) * u0[k] + share * u1[k])[None]
                M, F, power = (a[0] for a in model.balance(z[None, :nq], v, u, at))
                n = model.gap_slopes(z[None, :nq], at)[0, j, :-1]
                bend = model.gap_accelerations(z[None, :nq], v, at)[0, j]
                rows = np.block([[M, n[:, None]], [n[None], np.zeros((1, 1))]])
                *a, force = np.linalg.solve(rows, [*F, -bend])
                return np.array([*v[0], *a, power - force * (n @ v[0])])

            reference = solve_ivp(
                slope, (t[k], t[k] + h[k]), start[k], "DOP853", rtol=1e-12, atol=1e-12
            )
            assert states[k] == pytest.approx(reference.y[:, -1], rel=1e-8, abs=1e-9)


def test_rows_begin_where_a_mode_may_hold_them(driven: Kernels) -> None:
    """Moved there the shortest way by the masses: what is left of the way is along M^-1 grad g."""
    model, nq = Model(driven, parameter_row(driven, {})), 2
    y, t, *_ = random_rows(driven, 10)
    y[:, 1] = 0.8 * np.cos(y[:, 0]) + 0.3 * np.sin(t) - 2 + 1e-3  # just above the moving floor
    states = y.copy()
    integrator(driven).project(Mode((0,)), states, t, np.zeros((10, 0)), False)
    assert np.abs(model.gaps(states[:, :nq].copy(), t)[:, 0]).max() < 1e-12
    assert (states[:, nq:] == y[:, nq:]).all()
    n = model.gap_slopes(states[:, :nq].copy(), t)[:, 0, :-1]
    pushed = (model.mass(states[:, :nq].copy(), t) @ (states - y)[:, :nq, None])[..., 0]
    turned = pushed[:, 0] * n[:, 1] - pushed[:, 1] * n[:, 0]
    assert np.abs(turned).max() < 1e-3 * np.abs(pushed).max()


@pytest.fixture(scope="module", params=["compiled", "numpy"])
def bar(request: pytest.FixtureRequest) -> Kernels:
    """A bar on two feet, with friction under both, and a rail that holds it along."""
    x, y, a, f = dynamicsymbols("x y a f")
    m, g, mu, hold = sp.symbols("m g mu hold")
    speed = x.diff(T) ** 2 + y.diff(T) ** 2
    system = dmoc.MechanicalSystem(
        "bar", [x, y, a], m * speed / 2 + m * a.diff(T) ** 2 / 24 - m * g * y,
        {m: 2.0, g: 10.0, mu: 0.5, hold: 3.0}, [f], {x: f},
        surfaces={"left": y - sp.sin(a) / 2 >= 0, "right": y + sp.sin(a) / 2 >= 0},
        tangents={"left": x - sp.cos(a) / 2, "right": x + sp.cos(a) / 2, "rail": x},
        friction={"left": mu, "right": mu, "rail": hold},
    )  # fmt: skip
    return dmoc.build(system, backend=request.param)


@pytest.mark.parametrize(
    ("mode", "push", "acceleration", "normal", "tangential"),
    [
        # Both feet stick: of the frictions only the sum is determined, the smallest are equal.
        (Mode((0, 1), (0, 1)), 6.0, [0, 0, 0], [10, 10], [-3, -3, 0]),
        # Feet and rail: three frictions, of which the smallest are equal.
        (Mode((0, 1), (0, 1, 2)), 6.0, [0, 0, 0], [10, 10], [-2, -2, -2]),
        # Both slide, and the rail: 0.5 (10 + 10) + 3 against 20.
        (Mode((0, 1), (), ((0, 1), (1, 1), (2, 1))), 20.0, [3.5, 0, 0], [10, 10], [-5, -5, -3]),
        # Backwards.
        (Mode((0, 1), (), ((0, -1), (1, -1), (2, -1))), -20.0, [-3.5, 0, 0], [10, 10], [5, 5, 3]),
        # Nothing rubs.
        (Mode((0, 1)), 6.0, [3, 0, 0], [10, 10], [0, 0, 0]),
        # One foot alone: m g / (1 + 3) of a bar that tips, and it turns with 12 N (l / 2) / m.
        (Mode((0,)), 0.0, [0, -7.5, -15], [5, 0], [0, 0, 0]),
        (Mode((), (), ((2, 1),)), 6.0, [1.5, -10, 0], [0, 0], [0, 0, -3]),
    ],
)
def test_forces_of_a_mode_are_those_of_statics(
    bar: Kernels, mode: Mode, push: float, acceleration: list[float], normal: list[float],
    tangential: list[float],
) -> None:  # fmt: skip
    y, u = np.zeros((3, 6)), np.full((3, 1), push)
    y[:, 3] = np.sign(push)
    reaction = integrator(bar).reaction(mode, y, u, np.zeros(3))
    for rows, expected in (
        (reaction.acceleration, acceleration),
        (reaction.normal, normal),
        (reaction.tangential, tangential),
    ):
        assert rows == pytest.approx(np.tile(expected, (3, 1)), abs=1e-12)


@pytest.mark.slow
def test_friction_that_is_not_determined_is_the_smallest() -> None:
    """A puck of 2 kg that sticks on four rails in its plane: of all forces that hold it, those of
    the least sum of squares."""
    x, y, f, h = dynamicsymbols("x y f h")
    m, hold = sp.symbols("m hold")
    angles = sp.symbols("angle:4")
    rails = {f"rail{k}": x * sp.cos(c) + y * sp.sin(c) for k, c in enumerate(angles)}
    kernels = dmoc.build(
        dmoc.MechanicalSystem(
            "railed", [x, y], m * (x.diff(T) ** 2 + y.diff(T) ** 2) / 2,
            {m: 2.0, hold: 9.0, **dict.fromkeys(angles, 0.0)}, [f, h], {x: f, y: h},
            tangents=rails, friction=dict.fromkeys(rails, hold),
        )
    )  # fmt: skip
    for seed in range(20):
        r = np.random.default_rng(seed)
        turns, u = r.uniform(0, np.pi, 4), r.uniform(-5, 5, (9, 2))
        values = {f"angle{k}": float(turn) for k, turn in enumerate(turns)}
        flow = Integrator(kernels, parameter_row(kernels, values), np.ones(5), lambda: None)
        reaction = flow.reaction(Mode((), (0, 1, 2, 3)), r.uniform(-1, 1, (9, 4)), u, np.zeros(9))
        forces = -u @ np.linalg.pinv(np.stack([np.cos(turns), np.sin(turns)])).T
        assert reaction.acceleration == pytest.approx(np.zeros((9, 2)), abs=1e-11)
        assert reaction.tangential == pytest.approx(forces, rel=1e-9, abs=1e-9)


def test_what_sticks_stays_at_its_place(bar: Kernels) -> None:
    """For as long as one likes, while the push is below the friction."""
    r, flow = np.random.default_rng(3), integrator(bar)
    y, n = np.zeros((20, 7)), 20
    y[:, 0] = r.uniform(-1, 1, n)
    held = np.stack([y[:, 0] - 0.5, y[:, 0] + 0.5, y[:, 0]], axis=1)
    states, u = y.copy(), r.uniform(-9, 9, (n + 1, 1))
    steps = np.arange(n, dtype=float), np.ones(n), u[:-1].copy(), u[1:].copy()
    first, last = np.zeros(n, dtype=np.intp), np.full(n, n)
    flow.advance(states, first, last, *steps, Mode((0, 1), (0, 1)), held)
    assert states == pytest.approx(y, abs=1e-13)


def test_positions_between_nodes_are_those_of_the_motion(driven: Kernels) -> None:
    flow, nq = integrator(driven), 2
    y, t, h, u0, u1 = random_rows(driven, 5)
    h *= 0.02
    end, middle = y.copy(), y.copy()
    ends = flow.advance(end, *once(len(y)), t, h, u0, u1)
    flow.advance(middle, *once(len(y)), t, h / 2, u0, (u0 + u1) / 2)
    path = flow.between(y, ends, end, h, np.array([0.0, 0.5, 1.0]))
    for q, states, error in zip(path, (y, middle, end), (1e-15, 1e-11, 1e-15), strict=True):
        assert q == pytest.approx(states[:, :nq], abs=error)


def chain(kernels: Kernels) -> tuple[np.ndarray, ...]:
    """Two rows at rest over and before the surfaces, and the steps 0 to 2 and 3 to 6 of a motion
    that they go over."""
    t = 0.1 * np.arange(7)
    u = np.sin(t)[:, None] * np.ones(len(kernels.inputs))
    return np.array([[0.4, -0.2, 0.5, 0.1], [1.3, 0.3, 1.0, -0.5]]), t, np.full(7, 0.1), u, u + 0.1


def test_a_course_has_every_step_on_the_way(driven: Kernels) -> None:
    """As integrated one after the other, whatever rows are beside."""
    flow = integrator(driven)
    y, *steps = chain(driven)
    course, ends = np.full((7, 12), np.nan), y.copy()
    flow.advance(ends, np.array([0, 3]), np.array([3, 7]), *steps, course=course)
    for row, first, last in ((0, 0, 3), (1, 3, 7)):
        state = y[row : row + 1].copy()
        for k in range(first, last):
            before = state.copy()
            a = flow.advance(state, np.array([k]), np.array([k + 1]), *steps)
            expected = np.hstack([before, a.reshape(1, 4), state])[0]
            assert course[k] == pytest.approx(expected, abs=1e-12)
        assert ends[row] == pytest.approx(state[0], abs=1e-12)


def test_steps_that_might_meet_a_surface_are_those_at_which_a_run_stops(driven: Kernels) -> None:
    """The second row comes to a = 1.5 on its way; a row that is no number is told too."""
    flow, shares, near = integrator(driven), np.linspace(0.0, 1.0, 9), np.full(2, -1.0)
    y, *steps = chain(driven)
    course, upper = np.empty((7, 12)), np.zeros((7, 9, 2))
    first, last = np.array([0, 3]), np.array([3, 7])
    flow.advance(y.copy(), first, last, *steps, course=course)
    start, ends, stop = (course[:, 4 * k : 4 * k + 4].copy() for k in range(3))
    ends = ends.reshape(7, 2, 2)

    def meets() -> np.ndarray:
        return flow.meets(start, ends, stop, *steps[:2], shares, upper, near)

    beyond = stop[:, 0] > 1.5
    assert beyond[3:].any() and (meets() | ~beyond).all() and not meets()[:3].any()
    anywhere = np.full((8, 2), np.inf)
    for row, stop_at in ((0, 3), (1, int(np.flatnonzero(meets())[0]))):
        span = int(first[row]), int(last[row])
        run = y[row].copy(), *steps, *span, shares, upper, near, np.zeros((8, 2)), anywhere[0]
        assert flow.quiet(*run) == (stop_at, False)
    stop[1, 3] = np.nan
    assert meets()[1]
    with pytest.raises(ValueError, match="expected"):
        flow.meets(start, ends, stop, *steps[:2], shares, upper[:6], near)


def test_the_gap_after_a_step_is_that_of_the_state(driven: Kernels) -> None:
    flow, model = integrator(driven), Model(driven, parameter_row(driven, {}))
    y, t, h, u0, u1 = random_rows(driven, 4)
    end = y.copy()
    flow.advance(end, *once(4), t, h, u0, u1)
    gaps = model.gaps(end[:, :2], t + h)
    for k, j in np.ndindex(4, 2):
        gap = flow.gap(y[k], t[k], h[k], u0[k], u1[k], j)
        assert gap == pytest.approx(gaps[k, j], abs=1e-10)
    for wrong in ((y[0, :3], u0[0], 0), (y[0], np.ones(3), 0), (y[0], u0[0], 2)):
        with pytest.raises(ValueError, match="expected"):
            flow.gap(wrong[0].copy(), 0.0, 0.1, wrong[1], u1[0], wrong[2])


def test_a_row_that_is_no_number_leaves_the_others_alone(driven: Kernels) -> None:
    y, *steps = random_rows(driven, 3)
    alone, spoilt = y.copy(), y.copy()
    spoilt[1, 0] = np.nan
    integrator(driven).advance(alone, *once(3), *steps)
    integrator(driven).advance(spoilt, *once(3), *steps)
    assert np.isnan(spoilt[1]).all()
    assert spoilt[[0, 2]] == pytest.approx(alone[[0, 2]], abs=1e-10)


def test_shapes_are_checked_before_c_sees_them(driven: Kernels) -> None:
    flow = integrator(driven)
    y, t, h, u0, u1 = random_rows(driven, 3)
    rows = once(3)
    for wrong in (
        (y[:, :3].copy(), *rows, t, h, u0, u1),
        (y[:2].copy(), *rows, t, h, u0, u1),
        (y, rows[0], rows[1] + 1, t, h, u0, u1),
        (y, rows[0] - 1, rows[1], t, h, u0, u1),
        (y, *rows, t[:2], h, u0, u1),
        (y, *rows, t, h, u0[:2], u1),
        (y, *rows, t, h, np.hstack([u0, u0]), u1),
        (y, *rows, t, h, u0, u1, Mode((2,))),
        (y, *rows, t, h, u0, u1, Mode((), (0,))),
        (np.hstack([y, np.ones((3, 16))]), *rows, t, h, u0, u1, Mode((0,))),
        (y, *rows, t, h, u0, u1, None, None, False, np.empty((2, 12))),
        (y, *rows, t, h, u0, u1, None, None, False, np.empty((3, 8))),
    ):
        with pytest.raises(ValueError, match="expected"):
            flow.advance(*wrong)
    for rows_, u, times in ((y[:, :3].copy(), u0, t), (y, u0[:2], t), (y, u0, t[:2])):
        with pytest.raises(ValueError, match="expected"):
            flow.reaction(Mode((0,)), rows_, u, times)
    with pytest.raises(ValueError, match="expected"):
        flow.project(Mode((0,)), y, t[:2], np.zeros((3, 0)))


def test_places_of_what_sticks_are_checked_before_c_sees_them(bar: Kernels) -> None:
    y, t, h, u0, u1 = random_rows(bar, 3)
    flow, sticks = integrator(bar), Mode((0,), (0,))
    for held in (None, np.zeros((2, 3)), np.zeros((3, 2))):
        with pytest.raises(ValueError, match="expected places"):
            flow.advance(y, *once(3), t, h, u0, u1, sticks, held)
    with pytest.raises(ValueError, match="expected closed surfaces"):
        flow.reaction(Mode((), (), ((0, 1),)), y, u0, t)
