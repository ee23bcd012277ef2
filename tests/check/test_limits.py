"""Motions just inside and just outside limits of the check, whose errors are known in closed form:
the worse one is refused by the name of its measure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import motions
import numpy as np
import pytest
import sympy as sp
from flights import Change, flight, one, phase_changed, valued
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.check.verdict import exceeded, is_unstable
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

T = dynamicsymbols._t


LIMITS = {
    "step error": 0.01, "segment error": 0.01, "energy error": 0.02, "penetration": 0.002,
    "excess of a limit": 0.002, "excess of an input": 1e-6, "error of the law of impact": 0.02,
    "error of the law of impact relative to its own rates": 0.05, "error of a contact force": 0.05,
    "error of the cost": 0.02, "error of an integral": 0.02, "error of a peak": 0.02,
}  # fmt: skip


@pytest.mark.parametrize(("name", "limit"), LIMITS.items())
def test_a_measure_passes_up_to_its_limit(name: str, limit: float) -> None:
    assert not exceeded({name: 0.99 * limit})
    (text,) = exceeded({name: 1.01 * limit})
    assert text.startswith(name)
    assert exceeded({name: np.nan}) and exceeded({name: np.inf})


@pytest.mark.parametrize(
    ("worst", "amplified", "predicted"),
    [(0.0051, 1e3, 1.0), (1e-3, 89.0, 1.0), (1e-3, 1e3, 0.178)],
)
def test_an_end_is_excused_up_to_each_limit(
    worst: float, amplified: float, predicted: float
) -> None:
    """Of an end off by 0.9: segments to 0.005, an amplification of 90, a prediction of 0.18."""
    assert not is_unstable(worst, amplified, 0.9, predicted)
    assert is_unstable(min(worst, 0.0049), max(amplified, 91.0), 0.9, max(predicted, 0.182))


def bouncing(e: float) -> Change:
    return lambda motion: replace(motion, restitution={"wall": e})


def limited(which: int, low: float, high: float) -> Change:
    """Bounds of x, which goes from 0 to 1 and back, or of y, which goes from 0 to 1."""
    bounds = np.tile([-np.inf, np.inf], (3, 1))
    bounds[which] = low, high
    return lambda motion: replace(motion, coordinate_bounds=bounds)


def held(low: float, high: float) -> Change:
    """Bounds of the speed along y, which is 0.5 m/s."""
    return lambda motion: replace(motion, limits={"y_dot": (0.5 * low, 0.5 * high)})


def moved(by: float) -> Change:
    """The whole motion moved along x, off the wall."""

    def change(motion: Trajectory) -> Trajectory:
        (hit,), shift = motion.collisions, np.array([by, 0.0, 0.0])
        for i in (0, 1):
            motion = phase_changed(i, q=lambda p: p.q + shift)(motion)
        return replace(motion, collisions=(replace(hit, position=hit.position + shift),))

    return change


@pytest.mark.parametrize(
    ("inside", "outside", "reason"),
    [
        (one(0, 3, 0.009), one(0, 3, 0.011), "step error 0.011 exceeds"),
        (one(0, 4, 0.009), one(0, 4, 0.011), "segment error 0.011 exceeds"),
        # half a per cent of both together, the speed and its bound
        (held(0, 0.991), held(0, 0.989), "the bound of y_dot is exceeded by 0.5"),
        (held(1.009, 2), held(1.011, 2), "the bound of y_dot is exceeded by 0.5"),
        # with e = 1 - s the energy after the hit is s of 0.75 J more, and the rate s of 1 m/s
        (bouncing(0.9855), bouncing(0.984), "energy error 0.02"),
        (bouncing(0.9855), bouncing(0.979), "error of the law of impact 0.021 exceeds"),
        (limited(1, -1, 0.9981), limited(1, -1, 0.9979), "excess of a limit 0.0021 exceeds"),
        # at the end of x, in the middle of its way, and of the last coordinate
        (limited(0, 0.0019, 2), limited(0, 0.0021, 2), "excess of a limit 0.0021 exceeds"),
        (limited(0, -1, 0.9981), limited(0, -1, 0.9979), "excess of a limit 0.0021 exceeds"),
        # at the first node
        (limited(1, 0.0019, 2), limited(1, 0.0021, 2), "excess of a limit 0.0021 exceeds"),
        (limited(2, 0.0019, 2), limited(2, 0.0021, 2), "excess of a limit 0.0021 exceeds"),
        (limited(2, -1, 0.9981), limited(2, -1, 0.9979), "excess of a limit 0.0021 exceeds"),
        (moved(-0.9e-6), moved(-1.1e-6), "the collision with 'wall' is -1.1e-06 off it"),
    ],
)
def test_a_motion_is_refused_beyond_a_limit(
    cube: Kernels, inside: Change, outside: Change, reason: str
) -> None:
    good, bad = (dmoc.verify(change(flight(cube)), cube) for change in (inside, outside))
    assert good.passed, good.message
    assert not bad.passed and reason in bad.message, bad.message


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("end", ["first", "last"])
def test_both_ends_of_a_motion_keep_its_limits_and_surfaces(order: int, end: str) -> None:
    """A metre from rest to rest, beside a limit, and a surface, that is a share of it inside."""
    x, u = dynamicsymbols("x u")
    c, s = sp.symbols("c s")
    system = dmoc.MechanicalSystem(
        "ended", [x], x.diff(T) ** 2 / 2, {c: -9.0, s: 1.0}, [u], {x: u}, cost=u**2,
        surfaces={"wall": s * (x - c) >= 0},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0.0}, goal={"x": 1.0, "x_dot": 0.0},
        final_time=1.0, steps=10,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    motion, sign = solution.trajectory, 1.0 if end == "first" else -1.0
    for share, passed in ((0.0019, True), (0.0021, False)):
        at = share if end == "first" else 1 - share
        bounds = np.array([[at, np.inf] if end == "first" else [-np.inf, at]])
        limit = dmoc.verify(replace(motion, coordinate_bounds=bounds), problem.kernels)
        surface = dmoc.verify(valued(c=at, s=sign)(motion), problem.kernels)
        assert limit.passed is passed and ("penetration" in surface.message) is not passed
        for check, excess in ((limit, limit.limit_excess), (surface, surface.penetration)):
            assert excess == pytest.approx(share, rel=1e-6), check.message


# Motions along a surface, exact with an acceleration in each step ---------------------------------


@pytest.fixture(scope="module")
def lift() -> Kernels:
    y, u = dynamicsymbols("y u")
    return dmoc.build(
        dmoc.MechanicalSystem(
            "lift", [y], y.diff(T) ** 2 / 2, {}, [u], {y: u}, surfaces={"roof": y <= 0}
        )
    )


def driven(kernels: Kernels, y: float, v: float, h: float, forces: np.ndarray) -> Trajectory:
    """A unit mass from a place with a velocity, under a force in each step."""
    states = [(y, v)]
    for a in forces:
        y, v = y + h * v + a * h**2 / 2, v + h * a
        states.append((y, v))
    steps = len(forces)
    piece = motions.Piece(
        steps * h, lambda t: np.array(states), lambda t: np.append(forces, 0.0)[:, None]
    )
    motion = motions.trajectory(kernels, [piece], [], steps, {"roof": 1.0})
    constant = replace(motion.phases[0], u=forces[:, None])
    return replace(motion, phases=(constant,), controls="constant")


def weaving(kernels: Kernels, depth: float, below: float = 0.0) -> Trajectory:
    """One metre up in a second to nodes at or a little below the roof, which the path enters in
    every other step, by a depth less what it is below."""
    h = 0.05
    b = 4 * depth / h  # the rate at the nodes, in turn up and down
    up = np.repeat([4 - b, 3 * b - 4], 10)
    return driven(kernels, -1 - below, 0.0, h, np.append(up, np.tile([-2 * b / h, 2 * b / h], 10)))


def thrown(kernels: Kernels, steps: int) -> Trajectory:
    """A throw with the two nodes in the middle at the roof: of its range it enters it by
    1 / (N^2 - 1)."""
    h, a = 1 / steps, -1.0
    return driven(kernels, a * h**2 * (steps**2 - 1) / 8, 0.5, h, np.full(steps, a))


@pytest.mark.parametrize(
    ("inside", "outside", "reason"),
    [
        (lambda k: weaving(k, 0.0019), lambda k: weaving(k, 0.0021), "penetration 0.0021 exceeds"),
        (
            lambda k: weaving(k, 0.0015, 2.9e-4),
            lambda k: weaving(k, 0.0015, 3.1e-4),
            "the simulation meets a contact with 'roof' at 1.0",
        ),
        (
            lambda k: thrown(k, 101),  # 0.98e-4
            lambda k: thrown(k, 88),  # 1.3e-4, with a bounce of 1 % where it is 1e-4 deep
            "the simulation meets a contact with 'roof' at 0.49",
        ),
    ],
)
def test_a_simulation_may_enter_a_surface_that_a_motion_lies_on(
    lift: Kernels,
    inside: Callable[[Kernels], Trajectory],
    outside: Callable[[Kernels], Trajectory],
    reason: str,
) -> None:
    """By 0.2 % where nodes in a row lie on it, three up to 0.01 % or five up to 0.03 %, and by
    0.01 % where it only touches."""
    good, bad = (dmoc.verify(make(lift), lift) for make in (inside, outside))
    assert good.passed, good.message
    assert not bad.passed and reason in bad.message, bad.message


def pushed_linearly(
    kernels: Kernels, first: float, last: float, low: float, high: float
) -> Trajectory:
    """A unit mass from rest for one second under a linear force with bounds."""
    rate = last - first
    piece = motions.Piece(
        1.0, lambda t: (first * t**2 / 2 + rate * t**3 / 6 - 9, first * t + rate * t**2 / 2),
        lambda t: first + rate * t,
    )  # fmt: skip
    motion = motions.trajectory(kernels, [piece], [], 20, {"roof": 1.0})
    return replace(motion, input_bounds=np.array([[low, high]]))


@pytest.mark.parametrize(("first", "last"), [(0.0, 1.0), (1.0, 0.0)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_input_keeps_its_bounds_at_both_ends_of_a_motion(
    lift: Kernels, first: float, last: float, sign: float
) -> None:
    """To a millionth of the largest input."""

    def check(beyond: float) -> dmoc.Verification:
        low, high = sorted([sign * (1 - beyond), -9.0 * sign])
        motion = pushed_linearly(lift, sign * first, sign * last, low, high)
        return dmoc.verify(motion, lift)

    good, bad = check(0.9e-6), check(1.1e-6)
    assert good.passed, good.message
    assert "excess of an input 1.1e-06 exceeds 1e-06" in bad.message


# Rates, forces, path constraints ------------------------------------------------------------------


@pytest.mark.slow
def test_a_slow_hit_counts_by_its_own_rates() -> None:
    """A wall that is met at 0.2 m/s by something at 1.3 m/s: 5 % of the one are below 2 % of the
    other."""
    x, y = dynamicsymbols("x y")
    kernels = dmoc.build(
        dmoc.MechanicalSystem(
            "inclined", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2, {},
            surfaces={"wall": x - y <= sp.Rational(1, 5)},
        )
    )  # fmt: skip

    pieces = [
        motions.Piece(1.0, lambda t: (t, 0.8 * t, 1, 0.8)),
        motions.Piece(2.0, lambda t: (1 + 0.8 * (t - 1), 0.8 + (t - 1), 0.8, 1)),
    ]
    hit = {"surface": "wall", "impulse": 0.2}
    motion = motions.trajectory(kernels, pieces, [hit], 20, {"wall": 1.0})
    good, bad = (dmoc.verify(bouncing(e)(motion), kernels) for e in (0.951, 0.949))
    assert good.passed, good.message
    assert bad.message.startswith("error of the law of impact relative to its own rates 0.051")


def test_a_contact_force_is_right_to_a_twentieth(floor: Kernels) -> None:
    motion = motions.pushed_block(floor, 20, True)

    def pressed(by: float) -> Trajectory:
        phases = [replace(phase, normal=by * phase.normal) for phase in motion.phases]
        return replace(motion, phases=tuple(phases))

    good, bad = (dmoc.verify(pressed(by), floor) for by in (1.049, 1.051))
    assert good.passed and good.force_error == pytest.approx(0.049), good.message
    assert bad.message.startswith("error of a contact force 0.051 exceeds")


def test_a_rod_that_nothing_pulls_may_have_the_force_that_rounding_is() -> None:
    """At rest without gravity; rounding errors of its place accelerate it by some 1e-12."""
    x, y, u = dynamicsymbols("x y u")
    system = dmoc.MechanicalSystem(
        "still", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2, {}, [u], {x: u}, cost=u**2,
        constraints={"rod": x**2 + y**2 - 1},
    )  # fmt: skip
    place = {"x": float(np.sin(0.3)), "y": float(np.cos(0.3))}
    problem = dmoc.Problem(system, start=place, goal=place, final_time=1, steps=10)
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.status == "solved", solution.message


@pytest.mark.slow
def test_a_path_constraint_holds_to_half_a_percent_of_its_terms() -> None:
    """v <= c at 1 m/s: 1 - c of 1 + c."""
    x, c = dynamicsymbols("x"), sp.Symbol("c")
    system = dmoc.MechanicalSystem(
        "fast", [x], x.diff(T) ** 2 / 2, {c: 1.0}, path_constraints={"speed": x.diff(T) <= c}
    )
    kernels = dmoc.build(system)
    piece = motions.Piece(1.0, lambda t: (t, 1))
    motion = motions.trajectory(kernels, [piece], [], 20)
    good, bad = (
        dmoc.verify(replace(motion, parameters={"c": (1 - s) / (1 + s)}), kernels)
        for s in (0.0049, 0.0051)
    )
    assert good.passed, good.message
    assert "path constraint 'speed' is exceeded by 0.51 % of its size" in bad.message
