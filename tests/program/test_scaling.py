"""Sizes of a problem follow its units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, bryson_denham, there_and_back

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.scaling import scale_of
from dmoc.program.structure_cache import MEMORY

# Powers of length, mass and time of each size.
POWERS = {
    "time": (0, 0, 1),
    "cost": (2, 2, -3),
    "energy": (2, 1, -2),
    "q": (1, 0, 0),
    "v": (1, 0, -1),
    "p": (1, 1, -1),
    "u": (1, 1, -2),
    "gap": (1, 0, 0),
    "rate": (1, 0, -1),
    "lam": (1, 1, -1),
    "h": (0, 0, 1),
}


@pytest.fixture(scope="module")
def block() -> Kernels:
    return dmoc.build(block_system())


def sizes(block: Kernels, units: Sequence[float], still: bool) -> Scale:
    """Of the block on its way to the wall and back, or of one that stands still before it."""
    length, mass, time = units
    place = {"x": -length if still else 0.0}
    problem = there_and_back(
        block, start=place, goal=place | {"x_dot": 0.0}, sequence=[] if still else ["wall"],
        steps=6, final_time=time, parameters={"m": mass, "wall": length},
    )  # fmt: skip
    return scale_of(problem, initial_guesses(problem)[0].x)


@pytest.mark.parametrize("still", [False, True])
@pytest.mark.parametrize("units", [(1e3, 1, 1), (1, 1e-3, 1), (1, 1, 1e3), (1e-4, 1e5, 1e-2)])
def test_each_size_has_its_unit(
    block: Kernels, units: tuple[float, float, float], still: bool
) -> None:
    plain, other = (sizes(block, u, still) for u in ((1.0, 1.0, 1.0), units))
    for name, powers in POWERS.items():
        unit = np.prod(np.array(units) ** np.array(powers, dtype=float))
        assert getattr(other, name) == pytest.approx(unit * getattr(plain, name), rel=1e-9), name


def test_what_a_motion_reaches_is_remembered_for_its_numbers_alone(block: Kernels) -> None:
    """Problems that start with the same motion have the sizes that each of them would have alone,
    whatever they differ in."""
    problem = there_and_back(block, steps=6, parameters={"m": 1.0})
    x = initial_guesses(problem)[0].x
    x[0] *= 1.5  # the step size of the first phase
    others = [
        problem, problem.but(parameters={"m": 3.0}), problem.but(bounds={"u": (-0.5, 0.5)}),
        problem.but(bounds={"x": (-3, 5)}), problem.but(steps=3), problem.but(steps=(4, 8)),
        problem.but(kernels=dmoc.build(replace(block_system(), cost=block_system().cost * 2))),
    ]  # fmt: skip
    points = [x] * 4 + [initial_guesses(others[4])[0].x] + [x] * 2
    together = [scale_of(p, x) for p, x in zip(others, points, strict=True)]
    together.append(scale_of(problem, 2 * x))
    for p, x_p, scale in zip([*others, problem], [*points, 2 * x], together, strict=True):
        MEMORY.clear()
        alone = scale_of(p, x_p)
        assert all(np.array_equal(size, getattr(alone, name)) for name, size in vars(scale).items())
    assert together[0].p != pytest.approx(together[1].p)
    assert together[0].u != pytest.approx(together[2].u)
    assert together[0].q != pytest.approx(together[-1].q)
    assert together[0].h == pytest.approx(together[5].h)
    assert together[0].time != pytest.approx(together[5].time)
    assert together[6].cost == pytest.approx(2 * together[0].cost)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("way", [1e-6, 1e-9])
def test_a_guess_that_hardly_moves_is_no_measure_of_fixed_speeds(order: int, way: float) -> None:
    """Bryson and Denham's problem, which begins with 1 m/s: 4/(9 l) = 4."""
    guess = {"u": way, "x": [0, way, 0]}
    solution = dmoc.solve(bryson_denham(40, order), "ipm", guess=guess)
    assert solution.solved and solution.cost == pytest.approx(4, rel=2e-3)


@pytest.mark.parametrize(
    ("limit", "slope"),
    [
        ("x**2 + y**2 >= 1/100", 0.2),
        ("x**2 + y**2 >= 1/1000000", 0.002),
        ("1 >= 1/(100*(x**2 + y**2))", 20.0),
        ("x**4 + y**4 >= 1/10000", 1.0),  # its root is a distance
        ("(x**4 + y**4 - 1/10000)*(2 + y**2) >= 0", 0.008),
        ("7*x <= 8", 7.0),
        ("x**2 + y**2 <= 100", 1.9),
    ],
    ids=["post", "wire", "inverse", "quartic", "product", "plane", "far away"],
)
def test_an_excess_of_a_path_constraint_is_a_distance(limit: str, slope: float) -> None:
    """Both nodes of a step move its middle by half; of a limit that is far away the slope counts
    where the motion is, in the middle of the last step."""
    x, y, u, w = dynamicsymbols("x y u w")
    lagrangian = x.diff() ** 2 / 2 + y.diff() ** 2 / 2
    system = dmoc.MechanicalSystem(
        "passing", [x, y], lagrangian, inputs=[u, w], forces={x: u, y: w}, cost=u**2 + w**2,
        path_constraints={"post": sp.sympify(limit, {"x": x, "y": y})},
    )  # fmt: skip
    stated = {"goal": {x: 1, y: 0}, "final_time": 1, "steps": 20}
    problem = dmoc.Problem(dmoc.build(system), {x: -1, y: 0, "x_dot": 2}, **stated)
    straight = initial_guesses(problem)[0].x.copy()
    layout = Layout.of(problem)
    straight[layout.index_q] = np.linspace([-1, 0], [1, 0], 21)
    scale = scale_of(problem, straight)
    assert scale.path == pytest.approx([slope / 2 * scale.q[0]], rel=1e-6)


def test_speeds_at_the_ends_are_those_that_were_given() -> None:
    """Also by momenta, of which the mass makes velocities."""
    problem = bryson_denham(4).but(start={"x": 0, "x_dot": 3.0}, parameters={"m": 2.0})
    assert problem.end_speeds.tolist() == [3.0]
    pushed = problem.but(start={"x": 0, "p_x": 10.0})
    assert pushed.end_speeds.tolist() == [5.0]
