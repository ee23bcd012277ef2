"""How far motions lie beyond path constraints and bounds, as distances: also in the middle of an
obstacle, and between the places at which steps are looked at."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import motions
import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.check.checked_motion import Motion
from dmoc.check.depth import dips, distances
from dmoc.check.limit_functions import LimitFunctions
from dmoc.codegen.kernels import Array

X, Y, U = dynamicsymbols("x y u")
# Middle and radius of a post.
C, B, R = sp.symbols("c b r", positive=True)
SQUARE = (X - C) ** 2 + (Y - B) ** 2


def test_a_dip_between_two_places_is_located() -> None:
    """Parabolas with vertices within steps, near their ends, and none where one only falls."""
    vertices, places = np.array([0.3, 1.02, 2.99]), np.linspace(0, 1, 9)
    times = np.arange(3) + places[:, None]

    def function(step: Any, share: Array) -> Array:
        return np.stack([(step + share - v) ** 2 for v in vertices] + [-(step + share)], axis=1)

    values = np.stack([(times - v) ** 2 for v in vertices] + [-times], axis=2)
    step, share = dips(values, function)
    located = np.unique(np.round(step + share, 5))
    np.testing.assert_allclose(located[np.isin(located, vertices)], vertices)
    assert located.max() == pytest.approx(3, abs=1e-5)  # where what falls ends


@pytest.mark.parametrize(
    ("at", "near", "across"),
    [
        ((0.0, 0.0), 0.1, 0.2),  # in the middle, where the slope is zero
        ((0.06, 0.0), 0.04, 0.2),
        ((0.0, -0.1 + 1e-9), 1e-9, 0.2),
        ((2.0, 0.0), 0.0, 0.0),
    ],
)
def test_a_distance_is_that_to_the_edge_of_a_disc(
    at: tuple[float, float], near: float, across: float
) -> None:
    def limit(z: Array) -> Array:
        return np.asarray((z**2).sum(axis=1) - 0.01)

    ways = np.broadcast_to(np.eye(2), (1, 2, 2))
    found = distances(limit, np.array([at]), ways)
    np.testing.assert_allclose(found, [[near], [across]], rtol=1e-6, atol=1e-12)


def test_what_no_way_leads_out_of_is_infinitely_deep() -> None:
    near, across = distances(lambda z: z[:, 0] * 0 - 1, np.zeros((1, 2)), np.ones((1, 1, 2)))
    assert np.isinf([near, across]).all()


POSTS = {
    "square": SQUARE >= R**2,
    "root": sp.sqrt(SQUARE) >= R,
    "pole": R**2 / SQUARE <= 1,
    "fourth": SQUARE**2 >= R**4,
    "bell": sp.exp(-SQUARE / R**2) <= sp.exp(-1),
}


def past(kind: str, bound: bool, way: float, post: dict[str, float], steps: int) -> Any:
    """The check of a motion from the origin with 1 m/s along x, and ``way`` m/s along y, for a
    second, beside a post that a path constraint, or a bound of a quantity, keeps it from."""
    relation = POSTS[kind]
    stated: dict[str, Any] = {"path_constraints": {"post": relation}}
    if bound:
        stated = {"quantities": {"z": relation.lhs - relation.rhs}}
    system = dmoc.MechanicalSystem(
        f"past_{kind}", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2,
        {C: 0.5, B: 0.5, R: 0.1}, **stated,
    )  # fmt: skip
    kernels = dmoc.build(system)
    motion = motions.trajectory(
        kernels, [motions.Piece(1.0, lambda t: (t, way * t, 1, way))], [], steps
    )
    limits = {"z": (0.0, np.inf) if relation.rel_op == ">=" else (-np.inf, 0.0)} if bound else {}
    return dmoc.verify(replace(motion, parameters=post, limits=limits), kernels)


@pytest.mark.slow
@pytest.mark.parametrize("bound", [False, True])
@pytest.mark.parametrize("kind", POSTS)
def test_a_post_is_as_deep_as_its_radius_however_it_is_stated(kind: str, bound: bool) -> None:
    """Straight through its middle, which no place of the steps is near: the radius, of a width of
    1 m; the terms of a bound may say more."""
    check = past(kind, bound, 0.0, {"c": 0.513, "b": 1e-15, "r": 0.02}, 10)
    assert not check.passed
    what = "the bound of z" if bound else "path constraint 'post'"
    assert f"{what} is exceeded by" in check.message and "at 0.5" in check.message
    if not bound:
        assert "at 0.513 s" in check.message
        assert check.path_excess == pytest.approx(0.02, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("kind", POSTS)
def test_the_edge_of_a_post_is_measured_along_it(kind: str) -> None:
    """Past a post whose middle lies beside the diagonal by 0.1 sqrt(2), and which reaches over it
    by 0.003 sqrt(2): 0.3 % of both widths."""
    post = {"c": 0.613, "b": 0.413, "r": 0.103 * np.sqrt(2)}
    assert past(kind, False, 1.0, post, 10).path_excess == pytest.approx(0.003, rel=1e-3)
    assert past(kind, False, 1.0, post, 10).passed
    more = post | {"r": 0.106 * np.sqrt(2)}
    assert past(kind, False, 1.0, more, 10).path_excess == pytest.approx(0.006, rel=1e-3)
    assert not past(kind, False, 1.0, more, 10).passed


@pytest.mark.slow
@pytest.mark.parametrize("kind", POSTS)
def test_no_motion_gets_through_a_wire(kind: str) -> None:
    """Half of its thickness, in units of 50 times this, however thin it is; its edge may be
    exceeded by a quarter of it."""
    through = past(kind, False, 0.0, {"c": 0.513, "b": 1e-15, "r": 0.004}, 10)
    assert through.path_excess == pytest.approx(0.01, rel=1e-3) and not through.passed
    shallow = past(kind, False, 0.0, {"c": 0.5125, "b": 0.0016, "r": 0.002}, 10)
    assert shallow.path_excess == pytest.approx(0.2 / 2 / 50, rel=1e-2) and shallow.passed


def test_beside_a_straight_way_there_is_as_much_room_as_along_it() -> None:
    """By the masses: a fourfold one moves half as far and half as fast."""
    system = dmoc.MechanicalSystem(
        "straight", [X, Y], (X.diff() ** 2 + 4 * Y.diff() ** 2) / 2,
        path_constraints={"far": X + Y <= 9},
    )  # fmt: skip
    kernels = dmoc.build(system)
    piece = motions.Piece(1.0, lambda t: (3 * t, 0 * t, 3, 0))
    motion = Motion.of(motions.trajectory(kernels, [piece], [], 10), kernels, ENDLESS)
    limits = LimitFunctions.of(motion)
    states = np.array([[0.0, 0, 3, 0, 0], [3.0, 0, 3, 0, 1]])
    assert limits.even_widths(states)[:4] == pytest.approx([3, 1.5, 6, 3])


@pytest.mark.slow
def test_a_speed_that_is_to_be_avoided_is_a_distance_too() -> None:
    """v^2 - 2 v + 1 >= P for 1 m from rest to rest in a second, whose speed rises to 1.5 m/s: at
    v = 1 the terms are 4, the distance is sqrt(P) of a width of 3 m/s."""
    p = sp.Symbol("P")
    system = dmoc.MechanicalSystem(
        "avoiding", [X], X.diff() ** 2 / 2, {p: 0.0}, [U], {X: U}, cost=U**2,
        path_constraints={"speed": X.diff() ** 2 - 2 * X.diff() + 1 >= p},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0}, {"x": 1, "x_dot": 0}, steps=10, final_time=1.0
    )
    motion = answer_of(problem, "ipm", starts=1).trajectory
    check = dmoc.verify(replace(motion, parameters={"P": 0.01}), problem.kernels)
    assert check.path_excess == pytest.approx(0.1 / 3, rel=1e-2) and not check.passed


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["square", "pole"])
def test_no_answer_goes_through_a_post_between_its_nodes(kind: str) -> None:
    """A post of 5 cm, nodes 15 cm apart around it: the check says so, and more steps are tried."""
    w = dynamicsymbols("w")
    post = POSTS[kind].subs({C: 0, B: 0, R: sp.Rational(1, 20)})
    system = dmoc.MechanicalSystem(
        "posted", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, inputs=[U, w], forces={X: U, Y: w},
        cost=U**2 + w**2, path_constraints={"post": post},
    )  # fmt: skip
    rest = {"x_dot": 0, "y_dot": 0}
    problem = dmoc.Problem(
        system, {"x": -1, "y": 0, **rest}, {"x": 1, "y": 0, **rest}, steps=21, final_time=2.0
    )
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.status == "not_verified"
    assert "path constraint 'post' is exceeded by 2.5 % of its size at 1 s" in solution.message
    assert "take more steps" not in solution.message
