"""Static friction above the kinetic one, in solves, simulations and checks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad
from sliding import block, u, violin, x, y
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError

pytestmark = pytest.mark.slow

# F_s = 2 N and F_k = 1 N: the violin sticks for 2 (F_s - F_k)/(k v), and slips for
# 2 (pi - atan((F_s - F_k) w/(k v)))/w with w = 2/s.
STICKS, SLIPS = 0.5, np.pi - np.arctan(0.5)


@pytest.mark.parametrize("vary", [(), (0, 1), (0,), (1,)])
def test_a_block_sticks_and_slips_on_a_belt(vary: tuple[int, ...]) -> None:
    """Also with one or both of the coefficients varying, by a billionth."""
    pair = tuple(force + 1e-9 * x * int(i in vary) for i, force in enumerate((2, 1)))
    run = dmoc.simulate(violin(pair), {x: 0}, {x: 1}, step_size=0.01, steps=700)
    first, second = run.trajectory.phases[:2]
    assert first.coefficients == pytest.approx(2.0)
    assert second.coefficients == pytest.approx(1.0)
    times = [s.end - s.begin for s in run.rubbing[:4]]
    assert [s.friction for s in run.rubbing[:4]] == [0, -1, 0, -1]
    assert times == pytest.approx([STICKS, SLIPS] * 2, abs=1e-6)


@pytest.mark.parametrize(("order", "error"), [(4, 2e-6), (6, 1e-7)])
@pytest.mark.parametrize("vary", [(), (0, 1), (0,), (1,)])
def test_the_moment_at_which_it_breaks_away_is_found(
    order: int, error: float, vary: tuple[int, ...]
) -> None:
    pair = tuple(force + 1e-12 * x * int(i in vary) for i, force in enumerate((2, 1)))
    problem = dmoc.Problem(
        dmoc.build(violin(pair), order=order), start={x: 0, "x_dot": 1}, goal={},
        contacts=["belt:stick"], sequence=["belt:slip-", "belt:stick"], steps=40,
        final_time=STICKS + SLIPS + 0.3,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed, solution.message
    durations = [phase.duration for phase in solution.phases]
    assert durations == pytest.approx([STICKS, SLIPS, 0.3], abs=error)


def test_a_push_begins_with_the_static_force_and_goes_on_with_the_kinetic_one() -> None:
    """1 m in 4 s against 1 N: 2/3 sqrt(6 d f^3) for the slide as without static friction, but for a
    moment in which the force passes it."""
    system = dmoc.MechanicalSystem(
        "pushed", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, tangents={"rail": x},
        friction={"rail": (sp.S(5) / 2, 1)}, cost=u**2 / 2,
    )  # fmt: skip
    kernels = dmoc.build(system, order=4)
    stated: dict[str, Any] = {"start": {x: 0}, "goal": {x: 1, "x_dot": 0}, "final_time": 4}
    problem = dmoc.Problem(kernels, sequence=["rail:slip+", "rail:stick"], steps=60, **stated)
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed, solution.message
    before, slide = solution.phases[:2]
    assert [before.u[-1, 0], slide.u[0, 0]] == pytest.approx([2.5, 2.5])
    least = 2 / 3 * np.sqrt(6)
    assert least < solution.cost < 1.02 * least


@pytest.mark.parametrize("side", [1, -1])
def test_a_start_at_rest_says_that_it_breaks_away(side: int) -> None:
    """Also where it varies; with a velocity, or without a larger static one, it slides."""
    word = "floor:slip+" if side > 0 else "floor:slip-"
    stated: dict[str, Any] = {"start": {x: 0, y: 0}, "contacts": [word], "final_time": 1}
    for pair in ((0.6, 0.3), (0.6 + x**2, 0.3), (0.6, 0.3 + x / 10)):
        kernels = dmoc.build(block(pair), order=4)
        with pytest.raises(ProblemError, match=r"0.6 is above the kinetic one of 0.3"):
            dmoc.Problem(kernels, **stated)
        moving = dmoc.Problem(kernels, **stated | {"start": {x: 0, y: 0, "x_dot": side}})
        assert moving.words == ()
    assert dmoc.Problem(dmoc.build(block((0.3, 0.3)), order=4), **stated).words == ()


@pytest.mark.parametrize("steps", [10, 40])
@pytest.mark.parametrize("turns", [False, True])
def test_what_turns_is_held_until_the_static_force_is_reached(steps: int, turns: bool) -> None:
    """Pulled back by 1.5 N it stops from 1 m/s at 0.2 m, after 0.4 s, and is held: it is pulled by
    20 N more a second from then on, and passes 2.5 N after 0.05 s.  A motion that turns at once is
    refused, also where the force passes the static one within the first step."""
    t = dynamicsymbols._t
    late = t - sp.S(2) / 5
    pull = sp.S(3) / 2 + 20 * (late + sp.sqrt(late**2 + sp.Rational(1, 10**8))) / 2
    system = dmoc.MechanicalSystem(
        "turned", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, tangents={"rail": x},
        friction={"rail": (sp.S(5) / 2, 1)}, cost=(u + pull) ** 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), start={x: 0, "x_dot": 1}, goal={}, contacts=["rail:slip+"],
        sequence=["rail:slip-"] if turns else ["rail:stick", "rail:slip-"], steps=steps,
        final_time=1.0,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification is not None
    assert solution.verification.passed is not turns, solution.message
    if turns:
        assert "rail begins to slide at 0.4 s, where friction holds it" in solution.message
        return
    assert solution.phases[1].duration == pytest.approx(0.05, abs=2e-3)
    far = quad(lambda at: (0.6 - at) * (0.5 + 20 * at), 0.05, 0.6)[0]
    assert solution.phases[2].q[-1, 0] == pytest.approx(0.2 - far, abs=2e-3)


def test_static_friction_that_depends_on_the_time_alone_makes_the_model_depend_on_it() -> None:
    pair = 2 + sp.sin(dynamicsymbols._t), 1
    system = dmoc.MechanicalSystem("grips", [x], x.diff() ** 2, tangents={"rail": x},
                                   friction={"rail": pair})  # fmt: skip
    assert dmoc.build(system, order=4, backend="numpy").manifest.explicit_time


def test_an_impact_has_the_kinetic_coefficient() -> None:
    """A block that falls from 0.2 m lands with 2 N s and, at 0.5 m/s, could be stopped by static
    friction, 0.6 * 2 > 0.5, and not by kinetic friction, 0.2 * 2 < 0.5."""
    run = dmoc.simulate(
        block((sp.S(3) / 5, sp.S(1) / 5)), {x: 0, y: 0.2}, {x: 0.5}, step_size=0.01, steps=60,
        restitution=0,
    )  # fmt: skip
    landing = run.collisions[0]
    assert landing.impulses["floor"] == pytest.approx(2.0)
    assert landing.tractions["floor"] == pytest.approx(-0.4)
    assert [s.friction for s in run.rubbing] == [1, 0]


@pytest.mark.parametrize(
    ("pair", "says"),
    [
        ((1, 2), "static friction of 'belt' is 1, below the kinetic one, 2"),
        ((1, 2, 3), "has 3 coefficients: expected one, or a pair"),
        (("a", 1), "the static friction of 'belt' is not a scalar"),
        ((1, -1), "expected 0 or a positive number"),
    ],
)
def test_what_is_no_pair_is_refused(pair: Any, says: str) -> None:
    with pytest.raises(ModelError, match=says):
        dmoc.MechanicalSystem(
            "violin", [x], x.diff() ** 2, tangents={"belt": x}, friction={"belt": pair}
        )


def test_pairs_ask_for_order_4_and_for_the_larger_one_first() -> None:
    with pytest.raises(ProblemError, match=r"take the kernels of dmoc.build\(system, order=4\)"):
        dmoc.Problem(dmoc.build(violin((2, 1))), {x: 0, "x_dot": 1}, {}, contacts=["belt"])
    k = sp.Symbol("k")
    system = dmoc.MechanicalSystem(
        "violin", [x], x.diff() ** 2, {k: 1.0}, tangents={"belt": x}, friction={"belt": (k, 2)}
    )
    with pytest.raises(ProblemError, match="static friction of 'belt' is 1, below the kinetic"):
        dmoc.Problem(dmoc.build(system, order=4), {x: 0}, {}, contacts=["belt"])


def test_the_check_refuses_static_friction_that_falls_below_the_kinetic_one() -> None:
    """From 2 - x below 1, at 1 m of a slide of 1.5 m."""
    system = dmoc.MechanicalSystem(
        "pushed", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, tangents={"rail": x},
        friction={"rail": (2 - x, 1)}, cost=u**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {x: 0, "x_dot": 1}, {x: 1.5}, contacts=["rail:slip+"],
        final_time=1, steps=10,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.status == "not_verified"
    assert "the static friction of rail is 0.5 at 1 s, x = 1.5, below the kin" in solution.message
    assert dmoc.solve(problem.but(goal={x: 0.9}), starts=1).status == "solved"
