"""Steps that keep their mode are gone in compiled code: the motion is that of one step after the
other with every choice made anew, and few steps are."""

from __future__ import annotations

from collections.abc import Callable

import motions
import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from sympy.physics.mechanics import dynamicsymbols
from systems import landing_system

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.results.simulation import Simulation
from dmoc.simulation import contact_motion, given_inputs
from dmoc.simulation.contact_modes import _furthest_along

pytestmark = pytest.mark.slow

T = dynamicsymbols._t
x, y, a, b = dynamicsymbols("x y a b")
g, mu, k, w, f = sp.symbols("g mu k w f")


def two_feet() -> dmoc.MechanicalSystem:
    """A bar on two feet that is pushed at its middle."""
    u = dynamicsymbols("u")
    kinetic = (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 + a.diff(T) ** 2 / 24
    return dmoc.MechanicalSystem(
        "two_feet", [x, y, a], kinetic - g * y, {g: 9.81, mu: 0.3}, [u], {x: u},
        surfaces={"left": y - sp.sin(a) / 2 >= 0, "right": y + sp.sin(a) / 2 >= 0},
        tangents={"left": x - sp.cos(a) / 2, "right": x + sp.cos(a) / 2},
        friction={"left": mu, "right": mu},
    )  # fmt: skip


def table() -> dmoc.MechanicalSystem:
    """A block on a table that goes up and down and to and fro."""
    high, far = sp.sin(5 * T) / 10, sp.cos(3 * T) / 5
    return dmoc.MechanicalSystem(
        "table", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - g * y, {g: 10.0, mu: 0.2},
        surfaces={"top": y >= high}, tangents={"top": x - far}, friction={"top": mu},
    )  # fmt: skip


def swing() -> dmoc.MechanicalSystem:
    """A double pendulum with friction in both joints."""
    s, c = sp.sin, sp.cos
    tip = s(a) + s(b) / 2, -c(a) - c(b) / 2
    speed = sum(p.diff(T) ** 2 for p in tip) + a.diff(T) ** 2
    return dmoc.MechanicalSystem(
        "swing", [a, b], speed / 2 - g * (tip[1] - c(a)), {g: 9.81, f: 0.4},
        tangents={"upper": a, "lower": b - a}, friction={"upper": f, "lower": f / 4},
    )  # fmt: skip


def ladder() -> dmoc.MechanicalSystem:
    """A uniform ladder of 2 m on a floor and against a wall, of which a force pulls the middle."""
    u = dynamicsymbols("u")
    kinetic = (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 + a.diff(T) ** 2 / 6
    return dmoc.MechanicalSystem(
        "pulled_ladder", [x, y, a], kinetic - g * y, {g: 9.81, mu: 0.4}, [u], {x: u},
        surfaces={"floor": y >= sp.sin(a), "wall": x >= sp.cos(a)},
        tangents={"floor": x + sp.cos(a), "wall": y + sp.sin(a)},
        friction={"floor": mu, "wall": mu},
    )  # fmt: skip


LEANS = [np.cos(1.2), np.sin(1.2), 1.2]


RUNS: dict[str, tuple[Callable[[], dmoc.MechanicalSystem], dict[str, object], int]] = {
    # The system, what is simulated, and how many steps need a choice.
    "slides to rest": (
        landing_system,
        {"position": [0, 0], "velocity": [-1.3, 0], "step_size": 0.01, "steps": 300},
        3,
    ),
    "pushed to and fro": (
        motions.rail_system,
        {
            "position": [0.0], "velocity": [1.0], "step_size": 0.02, "steps": 200,
            "inputs": lambda t: [2 * np.sin(3 * t)],
        },
        25,
    ),
    "long steps": (
        landing_system,
        {"position": [0, 1.0], "velocity": [3, 0], "step_size": 0.4, "steps": 20, "every": 3},
        20,
    ),
    "thrown": (
        landing_system,
        {
            "position": [0, 0.8], "velocity": [2.0, 0], "step_size": 0.01, "steps": 300,
            "restitution": 0.5,
        },
        30,
    ),
    "two feet": (
        two_feet,
        {
            "position": [0, 0.8, 0.3], "velocity": [0.5, 0, 0.2], "step_size": 0.01, "steps": 250,
            "restitution": 0.0, "inputs": lambda t: [4 * np.sin(2 * t)],
        },
        40,
    ),
    "two feet, millimetres": (
        two_feet,
        {
            "position": [0, 0.0, 0.0], "velocity": [1e-3, 0, 0], "step_size": 1e-5, "steps": 100,
            "restitution": 0.0,
        },
        5,
    ),
    "a table that moves": (
        table,
        {
            "position": [0.2, 0.0], "velocity": [0, 0.5], "step_size": 0.005, "steps": 400,
            "restitution": 0.0,
        },
        40,
    ),
    "a bead on a ball": (
        motions.ball_system,
        {"position": [np.sin(0.3), np.cos(0.3)], "step_size": 0.01, "steps": 70},
        3,
    ),
    "a ladder that rests": (ladder, {"position": LEANS, "step_size": 0.01, "steps": 300}, 1),
    "a ladder that is pulled away": (
        ladder,
        {
            "position": LEANS, "step_size": 0.01, "steps": 60,
            "inputs": lambda t: [0.0 if t < 0.2 else 1.0 if t < 0.4 else 8.0],
        },
        5,
    ),
    "joints with friction": (
        swing,
        {"position": [1.0, -0.5], "step_size": 0.02, "steps": 400},
        60,
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def kernels() -> Callable[[str], Kernels]:
    made: dict[str, Kernels] = {}

    def build(name: str) -> Kernels:
        if name not in made:
            made[name] = dmoc.build(RUNS[name][0]())
        return made[name]

    return build


def simulated(kernels: Kernels, name: str) -> Simulation:
    fields = dict(RUNS[name][1])
    return dmoc.simulate(kernels, fields.pop("position"), fields.pop("velocity", None), **fields)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_the_motion_is_that_of_single_steps(
    kernels: Callable[[str], Kernels], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = simulated(kernels(name), name)
    monkeypatch.setattr(given_inputs, "AT_ONCE", 0)
    monkeypatch.setattr(given_inputs, "_rests", lambda *_: False)
    single = simulated(kernels(name), name)
    size = np.abs(single.q).max()
    assert run.q == pytest.approx(single.q, abs=1e-9 * size)
    for what in ("normal", "tangential"):
        one, other = getattr(run, what), getattr(single, what)
        assert one == pytest.approx(other, abs=1e-7 * np.abs(other).max(initial=1e-300))
    assert [(s.name, s.friction) for s in run.rubbing] == [
        (s.name, s.friction) for s in single.rubbing
    ]
    assert [s.end for s in run.contacts] == pytest.approx([s.end for s in single.contacts])
    assert [c.impulse for c in run.collisions] == pytest.approx(
        [c.impulse for c in single.collisions], rel=1e-7
    )


@pytest.mark.parametrize("name", RUNS)
def test_few_steps_need_a_choice(
    kernels: Callable[[str], Kernels], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps, real = [], contact_motion.through_step

    def counted(*args: object) -> object:
        steps.append(args)
        return real(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(contact_motion, "through_step", counted)
    simulated(kernels(name), name)
    assert len(steps) <= RUNS[name][2]


@settings(max_examples=100)
# The linear program itself takes what it misses by 1e-7 as met.
@given(
    st.lists(
        st.tuples(st.integers(-3000, 3000).map(lambda n: n / 1000), st.integers(-3, 3)),
        min_size=2, max_size=6,
    )
)  # fmt: skip
def test_forces_that_stay_furthest_from_their_limits(rows: list[tuple[float, int]]) -> None:
    """The least margin along a change of forces is as large as a linear program makes it."""
    least, slopes = np.array(rows).T
    assume(slopes.any())
    most = linprog(
        [0, -1], np.column_stack([-slopes, np.ones(len(rows))]), least,
        bounds=[(None, None), (None, 1.0)],
    )  # fmt: skip
    x = _furthest_along(least, slopes)
    assert min(1.0, (least + x * slopes).min()) == pytest.approx(-most.fun, abs=1e-8)
