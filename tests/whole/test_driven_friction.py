"""Friction on what constraints move: they win, and what contradicts them is no mode."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ProblemError, SimulationError

x, y, a, u = dynamicsymbols("x y a u")
t = dynamicsymbols._t
SPEEDS = {s: s.diff(t) ** 2 / 2 for s in (x, y, a)}


def driven(way: Any, **more: Any) -> dmoc.MechanicalSystem:
    """A unit mass on a rail with 2 N of friction, which a constraint moves."""
    return dmoc.MechanicalSystem(
        "driven", [x], SPEEDS[x], {}, constraints={"drive": sp.Eq(x, way)}, tangents={"rail": x},
        friction={"rail": 2}, **more,
    )  # fmt: skip


def pushed(way: Any) -> dmoc.MechanicalSystem:
    """The same, with a force that helps the constraint."""
    cost = u**2 + x.diff(t) ** 2
    return driven(way, inputs=[u], forces={x: u}, cost=cost)


def slides(run: dmoc.Simulation, name: str = "rail") -> list[tuple[int, float]]:
    """Friction of a tangent and when it ends."""
    parts = sorted((s for s in run.rubbing if s.name == name), key=lambda s: s.begin)
    return [(s.friction, s.end) for s in parts]


WAYS = [t**2, t**3, t**4, 1 - sp.cos(3 * t), sp.sin(4 * t) / 10, sp.sin(4 * t) ** 3 / 10]


@pytest.mark.parametrize("way", WAYS, ids=str)
@pytest.mark.parametrize("h", [0.01, 0.0625])
def test_what_a_constraint_moves_goes_its_way_and_slides(way: sp.Expr, h: float) -> None:
    """Also from rest, where neither the velocity nor the acceleration says that it will."""
    place, rate = (sp.lambdify(t, part) for part in (way, sp.diff(way, t)))
    steps = round(1 / h)
    run = dmoc.simulate(
        driven(way), {x: float(place(0))}, {x: float(rate(0))}, step_size=h, steps=steps
    )
    assert run.q[:, 0] == pytest.approx([place(s) for s in run.t], abs=1e-12)
    assert run.v[:, 0] == pytest.approx([rate(s) for s in run.t], abs=1e-11)
    assert not run.notes
    turns = [s for k in range(8) if 0 < (s := (2 * k + 1) * np.pi / 8) < 1]
    expected = [*turns, 1.0] if way.has(sp.sin) else [1.0]
    assert [end for _, end in slides(run)] == pytest.approx(expected, abs=1e-9)
    assert [s for s, _ in slides(run)] == [1, -1][: len(expected)]
    assert dmoc.verify(run.trajectory, dmoc.build(driven(way))).passed


@pytest.mark.parametrize(
    ("forces", "acceleration"), [((2, 2), (-1, 1)), ((3, 1), (0, 2)), ((1, 3), (-2, 0))]
)
def test_a_jack_between_two_rails_moves_what_holds_less(
    forces: tuple[int, int], acceleration: tuple[int, int]
) -> None:
    """y - x = 1 + t^2: R + F_x = x'' and so on, with the force R of the jack."""
    jack = dmoc.MechanicalSystem(
        "jack", [x, y], SPEEDS[x] + SPEEDS[y], {}, constraints={"jack": sp.Eq(y - x, 1 + t**2)},
        tangents={"p": x, "q": y}, friction=dict(zip("pq", forces, strict=True)),
    )  # fmt: skip
    run = dmoc.simulate(jack, {y: 1}, {}, step_size=0.01, steps=100)
    assert run.v[-1] == pytest.approx(acceleration, abs=1e-11)
    assert dmoc.verify(run.trajectory, dmoc.build(jack)).passed
    with pytest.raises(ProblemError, match="p, q, jack of phase 0 contradict each other: q cannot"):
        dmoc.Problem(jack, start={y: 1}, final_time=1, steps=5)


def test_a_crank_turns_its_slider_round_at_the_dead_centres() -> None:
    """The slider loses 0.2 N times its way; there is no friction that holds it at a dead centre."""
    at = sp.cos(a) + sp.sqrt(4 - sp.sin(a) ** 2)
    crank = dmoc.MechanicalSystem(
        "crank", [x, a], SPEEDS[x] + 5 * SPEEDS[a], {}, constraints={"rod": sp.Eq(x, at)},
        tangents={"rail": x}, friction={"rail": 0.2},
    )  # fmt: skip
    run = dmoc.simulate(crank, {x: 3}, {a: 3}, step_size=0.01, steps=300)
    signs = [s for s, _ in slides(run)]
    assert signs == [-1, 1, -1]
    way = 2 + 2 + 3 - run.q[-1, 0]
    assert run.energy[0] - run.energy[-1] == pytest.approx(0.2 * way, abs=1e-9)


def test_gears_on_rails_share_what_friction_takes() -> None:
    """Masses 1 and 4, friction 1 and 2 seen from the first one: 5 a = 4 - 3; 2.5 N are held."""
    gear = dmoc.MechanicalSystem(
        "gear", [x, y], SPEEDS[x] + SPEEDS[y], {}, inputs=[u], forces={x: u},
        constraints={"gear": sp.Eq(y, 2 * x)}, tangents={"p": x, "q": y}, friction={"p": 1, "q": 1},
    )  # fmt: skip
    runs = [
        dmoc.simulate(gear, {}, {}, step_size=0.01, steps=100, inputs=[force])
        for force in (4.0, 2.5)
    ]
    assert runs[0].v[-1] == pytest.approx([0.2, 0.4], abs=1e-12)
    assert runs[1].v[-1] == pytest.approx([0, 0], abs=1e-12)


def test_a_body_between_belts_goes_with_the_one_that_holds_more() -> None:
    belts = dmoc.MechanicalSystem(
        "belts", [x], SPEEDS[x], {}, tangents={"p": x - t**2 / 2, "q": x + t**2 / 2},
        friction={"p": 3, "q": 1},
    )  # fmt: skip
    run = dmoc.simulate(belts, {}, {}, step_size=0.01, steps=100)
    assert run.v[-1] == pytest.approx([1], abs=1e-11)
    assert slides(run, "p") == [(0, 1.0)] and slides(run, "q") == [(1, 1.0)]


@pytest.mark.parametrize("way", [t**2, t])
def test_what_lands_on_its_feet_while_it_is_driven_slides_at_once(way: sp.Expr) -> None:
    """Friction of mu = 5 would hold any other body in the impact."""
    fallen = dmoc.MechanicalSystem(
        "fallen", [x, y], SPEEDS[x] + SPEEDS[y] - 9.81 * y, {}, surfaces={"floor": y >= 0},
        constraints={"drive": sp.Eq(x, way)}, tangents={"floor": x}, friction={"floor": 5},
    )  # fmt: skip
    begin = {x: float(sp.diff(way, t).subs(t, 0))}
    run = dmoc.simulate(fallen, {y: 0.1}, begin, step_size=0.01, steps=100, restitution=0)
    assert run.q[-1] == pytest.approx([1, 0], abs=1e-12)
    assert slides(run, "floor")[0][0] == 1


@pytest.mark.parametrize(("way", "height"), [(-(t**2), 0.0), (0.5 - t, 0.5)])
def test_a_constraint_that_goes_through_a_surface_is_told(way: sp.Expr, height: float) -> None:
    through = dmoc.MechanicalSystem(
        "through", [x, y], SPEEDS[x] + SPEEDS[y] - 9.81 * y, {}, surfaces={"floor": y >= 0},
        constraints={"drive": sp.Eq(y, way)}, tangents={"floor": x}, friction={"floor": 0.5},
    )  # fmt: skip
    begin = {y: float(sp.diff(way, t).subs(t, 0))}
    with pytest.raises(SimulationError, match=r"constraints \(drive\) drive the motion through"):
        dmoc.simulate(through, {y: height}, begin, step_size=0.01, steps=100, restitution=0)


def test_a_plan_that_slides_is_solved() -> None:
    """The constraint pushes, so that u = 0: what is left is the integral of (2 t)^2."""
    problem = dmoc.Problem(pushed(t**2), start={}, final_time=1, steps=20, contacts=["rail:slip+"])
    solution = dmoc.solve(problem, starts=1)
    assert solution.status == "solved", solution.message
    assert solution.cost == pytest.approx(4 / 3, rel=1e-3)


@pytest.mark.parametrize("contacts", [[], ["rail:stick"]])
def test_a_plan_that_sticks_is_refused(contacts: list[str]) -> None:
    with pytest.raises(ProblemError, match="rail cannot hold together with the others; say how"):
        dmoc.Problem(pushed(t**2), start={}, final_time=1, steps=20, contacts=contacts)


def test_what_a_constraint_turns_round_turns_at_its_time() -> None:
    problem = dmoc.Problem(
        pushed(sp.sin(4 * t) / 10), start={}, final_time=1, steps=20, contacts=["rail:slip+"],
        sequence=["rail:slip-"],
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.status == "solved", solution.message
    assert solution.collisions[0].time == pytest.approx(np.pi / 8, abs=1e-6)
    with pytest.raises(ProblemError, match="rail, drive of phase 1 contradict each other"):
        problem.but(sequence=["rail:stick", "rail:slip-"])


def test_a_motion_that_sticks_where_a_constraint_moves_it_is_refused() -> None:
    """Half the way of the constraint, as the least squares of both would have it."""
    kernels = dmoc.build(driven(t**2))
    run = dmoc.simulate(kernels, {}, {}, step_size=0.01, steps=100)
    assert dmoc.verify(run.trajectory, kernels).passed
    (phase,) = run.trajectory.phases
    still = replace(phase, rubbing={"rail": 0}, q=phase.q / 2, v=phase.v / 2, p=phase.p / 2)
    assert not dmoc.verify(replace(run.trajectory, phases=(still,)), kernels).passed
