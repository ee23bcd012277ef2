"""Second-order conditions, compared with the eigenvalues of dense reduced Hessians."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

from dmoc.solvers.curvature import FALLS, LEVEL, Curvature, Landscape, SecondOrder, _weights
from dmoc.solvers.kkt_layout import KKTLayout
from dmoc.solvers.outcome import Duals


@dataclass
class Quadratic:
    """Minimise x'Qx/2 + g'x + 1 subject to A x = b, G x >= h, lower <= x <= upper, with g such that
    x is stationary with the multipliers y, w and z.  It stands for a program of a problem."""

    Q: np.ndarray
    x: np.ndarray
    A: np.ndarray
    G: np.ndarray
    h: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    y: np.ndarray
    w: np.ndarray
    z: np.ndarray

    @classmethod
    def of(cls, Q: Any, x: Any, **fields: Any) -> Quadratic:
        n = len(x)
        none = {"A": np.zeros((0, n)), "G": np.zeros((0, n)), "h": (), "y": (), "w": ()}
        none |= {"lower": np.full(n, -np.inf), "upper": np.full(n, np.inf), "z": np.zeros(n)}
        every = {"Q": Q, "x": x} | none | fields
        return cls(**{name: np.array(a, dtype=float) for name, a in every.items()})

    def __post_init__(self) -> None:
        self.n, self.n_eq, self.n_in = len(self.x), len(self.A), len(self.G)
        self.b = self.A @ self.x
        slope = self.A.T @ self.y - self.G.T @ self.w - self.z
        self.g = -self.Q @ self.x - slope
        self.program, self.layout = self, SimpleNamespace(unknowns=(), total=0)
        self.laws = ()
        self.structure = SimpleNamespace(once=lambda key, make: make())
        self.analyses = {"kkt": self._whole()}

    def _whole(self) -> KKTLayout:
        """K as one final group."""
        n, m = self.n, self.n_eq + self.n_in
        kept = np.append(self.lower < self.upper, np.ones(m, dtype=bool))
        place = np.where(kept, np.cumsum(kept) - 1, -1).astype(np.int32)
        starts = np.concatenate([[0], np.cumsum(np.arange(n, 0, -1))])
        columns = np.concatenate([np.arange(i, n) for i in range(n)])
        rows, every = np.arange(m + 1) * n, np.tile(np.arange(n), m)
        patterns = (a.astype(np.int32) for a in (starts, columns, rows, every))
        return KKTLayout.of(place, np.zeros(1, dtype=np.int32), patterns)

    def cost(self, x: np.ndarray) -> float:
        return float(x @ self.Q @ x / 2 + self.g @ x + 1)

    def equality(self, x: np.ndarray) -> np.ndarray:
        return self.A @ x - self.b

    def inequality(self, x: np.ndarray) -> np.ndarray:
        return self.G @ x - self.h

    def values(self, x: np.ndarray) -> np.ndarray:
        return np.concatenate([[self.cost(x)], self.equality(x), self.inequality(x)])

    def slopes(self, x: np.ndarray) -> np.ndarray:
        return np.concatenate([self.Q @ x + self.g, self.A.ravel(), self.G.ravel()])

    def equality_jacobian(self, x: np.ndarray) -> np.ndarray:
        return self.A

    def inequality_jacobian(self, x: np.ndarray) -> np.ndarray:
        return self.G

    def lagrangian_gradient(self, x: np.ndarray, y: np.ndarray, w: np.ndarray) -> np.ndarray:
        return self.Q @ x + self.g + self.A.T @ y - self.G.T @ w

    def curvatures(self, x: np.ndarray, rows: np.ndarray, sigma: float) -> np.ndarray:
        return self.Q[np.triu_indices(self.n)]

    def second(self) -> SecondOrder:
        return SecondOrder(self, self.x, Duals(self.y, self.w, self.z))  # type: ignore[arg-type]

    def curvature(self) -> Curvature:
        return self.second().curvature()


def reduced(p: Quadratic) -> np.ndarray:
    """Eigenvalues of the Hessian among the directions that keep what has a multiplier."""
    fixed = (p.z != 0) | (p.lower == p.upper)
    J = np.vstack([p.A, p.G[p.w > 0], np.eye(p.n)[fixed]])
    N = scipy.linalg.null_space(J) if len(J) else np.eye(p.n)
    return np.linalg.eigvalsh(N.T @ p.Q @ N)


def drawn(number: int) -> Quadratic:
    """A random program with unknowns at bounds, some fixed, inequalities that hold and others, and
    in every second one equations and inequalities that follow from others."""
    rng = np.random.default_rng(number)
    n = int(rng.integers(3, 12))
    Q = rng.normal(size=(n, n))
    Q = Q @ Q.T - rng.uniform(0, 6) * np.eye(n) * rng.integers(0, 2)
    A, G = rng.normal(size=(rng.integers(0, n // 2), n)), rng.normal(size=(rng.integers(0, 3), n))
    if number % 2 and len(A):
        A = np.vstack([A, rng.normal(size=(2, len(A))) @ A])
    x = rng.normal(size=n)
    side = rng.choice([-1, 0, 0, 0, 1, 2], n)  # lower, free, upper, fixed
    lower = np.where((side == -1) | (side == 2), x, x - rng.uniform(0.1, 2, n))
    upper = np.where((side == 1) | (side == 2), x, x + rng.uniform(0.1, 2, n))
    z = np.where(side == -1, 1.0, np.where(side == 1, -1.0, 0.0)) * rng.uniform(0.1, 1, n)
    holds = rng.random(len(G)) < 0.6
    if number % 2 and holds.any():
        G, holds = np.vstack([G, 2 * G[holds]]), np.append(holds, holds[holds])
    return Quadratic.of(
        Q, x, A=A, G=G, h=G @ x - np.where(holds, 0.0, 0.7), lower=lower, upper=upper,
        y=rng.normal(size=len(A)), w=np.where(holds, rng.uniform(0.1, 1, len(G)), 0.0), z=z,
    )  # fmt: skip


@pytest.mark.slow
def test_shapes_are_those_of_dense_eigenvalues() -> None:
    seen = []
    for number in range(300):
        p = drawn(number)
        around, signs = p.curvature(), reduced(p)
        if not len(signs) or signs[0] > 0:
            assert around.shape is Landscape.BOWL, number
        else:
            assert around.shape is Landscape.SADDLE, number
            d = around.direction
            assert np.abs(p.A @ d).max(initial=0.0) < 1e-6
            assert np.abs(p.G[p.w > 0] @ d).max(initial=0.0) < 1e-4
            assert not d[(p.z != 0) | (p.lower == p.upper)].any()
            assert d @ p.Q @ d / (d @ d) == pytest.approx(signs[0], rel=0.2)
        seen.append(around.shape)
    assert min(seen.count(shape) for shape in (Landscape.BOWL, Landscape.SADDLE)) > 50


def test_motions_beside_a_saddle_keep_the_constraints_and_cost_less() -> None:
    count = 0
    for number in range(100):
        p = drawn(number)
        second = p.second()
        beside = second.cheaper(second.curvature())
        for z in beside:
            assert p.cost(z) < p.cost(p.x)
            assert np.abs(p.equality(z)).max(initial=0.0) < 1e-6
            assert p.inequality(z).min(initial=0.0) > -1e-6
            assert (p.lower <= z).all() and (z <= p.upper).all()
        count += len(beside) == 2
    assert count > 15


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e6])
def test_a_direction_without_curvature_is_a_valley(scale: float) -> None:
    """Along (1, 1, 0) nothing changes; with x_0 held only a bowl is left."""
    Q = scale * np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 2.0]])
    around = Quadratic.of(Q, np.ones(3)).curvature()
    assert around.shape is Landscape.VALLEY
    np.testing.assert_allclose(np.abs(around.direction), [1, 1, 0], atol=1e-6)
    held = Quadratic.of(Q, np.ones(3), lower=[1, -9, -9], z=[scale, 0, 0]).curvature()
    assert held.shape is Landscape.BOWL
    assert Quadratic.of(np.zeros((2, 2)), np.ones(2)).curvature().shape is Landscape.VALLEY


def test_bounds_without_multipliers_limit_directions_to_one_side() -> None:
    """-x^2/2 at x = 0 >= 0 falls inwards; -x y with x, y >= 0 does too, x y falls outwards only."""
    edge = {"lower": np.zeros(1)}
    assert Quadratic.of([[-1.0]], [0.0], **edge).curvature().shape is Landscape.SADDLE
    assert Quadratic.of([[1.0]], [0.0], **edge).curvature().shape is Landscape.BOWL
    corner = {"lower": np.zeros(2)}
    off = np.array([[0.0, 1.0], [1.0, 0.0]])
    assert Quadratic.of(-off, np.zeros(2), **corner).curvature().shape is Landscape.SADDLE
    assert Quadratic.of(off, np.zeros(2), **corner).curvature().shape is Landscape.BOWL
    rows = {"G": np.eye(2), "h": np.zeros(2), "w": np.zeros(2)}
    for upper in (np.inf, 9.0):  # a bound of one and a row of the other
        mixed = {"lower": [0.0, -9.0], "upper": [upper, 9.0]}
        mixed |= {name: a[1:] for name, a in rows.items()}
        for sides in (rows, mixed):
            assert Quadratic.of(-off, np.zeros(2), **sides).curvature().shape is Landscape.SADDLE
            assert Quadratic.of(off, np.zeros(2), **sides).curvature().shape is Landscape.BOWL
    mirrored = {"upper": [0.0, 9.0]} | {name: a[1:] for name, a in rows.items()}
    assert Quadratic.of(off, np.zeros(2), **mirrored).curvature().shape is Landscape.SADDLE
    assert Quadratic.of(-off, np.zeros(2), **mirrored).curvature().shape is Landscape.BOWL


@pytest.mark.parametrize(
    ("distance", "force", "idle"),
    [(0.9e-6, 0.0, False), (1.1e-6, 0.0, True), (0.9e-4, 1e-5, False), (1.1e-4, 1e-5, True)],
)
def test_a_bound_is_idle_that_is_far_beside_its_multiplier(
    distance: float, force: float, idle: bool
) -> None:
    """x y falls along (1, -1), out of the corner x, y >= 0, as long as that may hold it."""
    corner = {"lower": np.zeros(2), "z": np.full(2, force)}
    p = Quadratic.of([[0.0, 1.0], [1.0, 0.0]], np.full(2, distance), **corner)
    assert p.curvature().shape is (Landscape.SADDLE if idle else Landscape.BOWL)


@pytest.mark.parametrize(
    ("bend", "off", "y", "cheaper"),
    [
        (1e-7, 0.0, 0.0, True),
        (1e-8, 0.0, 0.0, False),  # at most 0.09 bend
        (0.0, 1e-6, 1.0, False),  # y times the violation
        (1e-7, 1e-6, 1.0, True),
    ],
)
def test_a_fall_counts_beyond_rounding_errors_and_what_a_violation_gives(
    monkeypatch: pytest.MonkeyPatch, bend: float, off: float, y: float, cheaper: bool
) -> None:
    """1 - bend b^2 - y a with a = 0, along b, where a stays violated by a share of b."""
    p = Quadratic.of(np.diag([0.0, -2 * bend]), np.zeros(2), A=[[1.0, 0.0]], y=[y])
    second = p.second()
    monkeypatch.setattr(second, "_onto_constraints", lambda z: z)
    z = second._cheaper(np.array([off, 1.0]), -2 * bend)
    assert (z is not None) is cheaper


def test_numbers_of_a_barrier_tell_what_holds() -> None:
    """Products of distances and multipliers of 1e-8, as an interior point leaves them."""
    for z, shape in ((0.5, Landscape.BOWL), (1e-8, Landscape.SADDLE)):
        x = 1e-8 / z
        p = Quadratic.of([[-1.0]], [x], lower=[0.0], z=[z])
        assert p.curvature().shape is shape


def test_a_fall_of_rounding_errors_is_none() -> None:
    shapes = {
        100 * FALLS: Landscape.SADDLE,
        FALLS / 100: Landscape.BOWL,
        LEVEL / 100: Landscape.VALLEY,
    }
    for least, shape in shapes.items():
        p = Quadratic.of(np.diag([1.0, least]), [0.0, 0.0])
        assert p.curvature().shape is shape


def test_unknowns_of_all_steps_weigh_as_one_together() -> None:
    """Of a motion of four steps: five nodes, four steps, three hits, one duration, and nothing."""
    numbers, blocks, first = [5, 4, 3, 1, 0], list[Any](), 0
    for n in numbers:
        index = np.arange(first, first + n)
        blocks.append(SimpleNamespace(count=n, index=index, numbers=index))
        first += n
    nlp: Any = SimpleNamespace(n=first, layout=SimpleNamespace(unknowns=blocks, total=4))
    weights = np.split(_weights(nlp), np.cumsum(numbers)[:-1])
    for weight, expected in zip(weights, (1 / 5, 1 / 4, 1.0, 1.0, 1.0), strict=True):
        np.testing.assert_array_equal(weight, expected)
