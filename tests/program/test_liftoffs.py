"""Which lift-offs a program has a law of, and what it says."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from liftoff_problems import (
    Stated,
    corners,
    everything,
    idle,
    loop,
    problem_of,
    pulled,
    ramp,
    spring_lift,
    stopped_ramp,
    twice,
)
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.guess.automatic import initial_guesses
from dmoc.program.blocks import NOWHERE
from dmoc.program.layout import Layout
from dmoc.program.liftoffs import Liftoff
from dmoc.program.transcription import Transcription


def of(problem: dmoc.Problem) -> tuple[Liftoff, ...]:
    return Layout.of(problem).liftoff.of


def test_a_force_that_no_input_changes_says_when_its_contact_leaves() -> None:
    assert of(problem_of(loop, 5, 2)[0]) == (Liftoff(0, (0,)),)
    assert of(problem_of(corners, 5, 2)[0]) == (Liftoff(0, (0, 1)),)
    assert of(spring_lift(5, 2)) == (Liftoff(0, (0,)),)


def test_inputs_that_act_on_what_moves_with_it_leave_it_to_the_cost() -> None:
    """Models that have no other surface lack the equations; an input that acts on something else
    changes nothing."""
    problem = pulled()
    assert of(problem) == () and not problem.kernels.has("forces_point")
    assert of(spring_lift(5, 2)) == (Liftoff(0, (0,)),)
    x, y, u = dynamicsymbols("x y u")
    lagrangian = x.diff() ** 2 + y.diff() ** 2
    for name, mass, force, there in (
        ("apart", 0, {x: u}, True), ("on_it", 0, {y: u}, False), ("joined", 0.5, {x: u}, False),
    ):  # fmt: skip
        system = dmoc.MechanicalSystem(
            f"floor_{name}", [x, y], lagrangian + mass * x.diff() * y.diff(), inputs=[u],
            forces=force, surfaces={"floor": y >= 0},
        )  # fmt: skip
        assert dmoc.build(system).has("forces_point") is there


def test_of_two_surfaces_the_one_that_an_input_pushes_is_left_to_the_cost() -> None:
    x, y, u = dynamicsymbols("x y u")
    system = dmoc.MechanicalSystem(
        "between", [x, y], x.diff() ** 2 + y.diff() ** 2 - x - y, inputs=[u], forces={y: u},
        surfaces={"floor": y >= 0, "wall": x >= 0},
    )  # fmt: skip
    problem = dmoc.Problem(
        system, start={"x": 0, "y": 0}, contacts=["floor", "wall"], sequence=["-floor"],
        steps=2, final_time=1,
    )  # fmt: skip
    assert problem.kernels.has("forces_point") and of(problem) == ()


def test_a_duration_that_is_fixed_says_when_instead() -> None:
    fixed = problem_of(ramp, 5, 2, durations=[(0.3, 0.3), None])[0]
    assert of(fixed) == ()
    assert len(of(fixed.but(durations=[(0.3, 0.4), None]))) == 1


@pytest.mark.parametrize("stated", [twice, idle, stopped_ramp])
def test_nothing_is_asked_where_forces_are_not_determined_or_say_nothing(
    stated: Callable[[], Stated],
) -> None:
    """Of two surfaces that are the same, of one that never presses, and beside an impact."""
    assert of(problem_of(stated, 4, 2)[0]) == ()


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_first_values_obey_the_equations_of_forces(order: int) -> None:
    """And have the names of what they are."""
    problem = everything(order)
    nlp = Transcription(problem)
    x = initial_guesses(problem)[0].x
    rows = nlp.laws.liftoff.forces
    assert rows.count == 5 + 2 + 1 + 1
    sizes = np.abs(x[nlp.layout.liftoff.y_lift_off]).max()
    assert np.abs(nlp.equality(x)[rows.numbers]).max() < 1e-9 * sizes
    y = nlp.layout.liftoff.y_lift_off
    names = [nlp.layout.names()[i] for i in y[y != NOWHERE]]
    assert names[5:] == [
        "normal force of floor before event 1",
        "normal force of beam before event 1",
        "friction force of floor before event 1",
        "force of constraint rod before event 1",
    ]
    forces = nlp.equality(x)[nlp.laws.liftoff.vanishes.numbers]
    assert forces == pytest.approx([x[y[0, 5]] + x[y[0, 6]]])


def test_impulses_at_the_last_station_and_the_first_gap_have_no_bound() -> None:
    nlp = Transcription(problem_of(loop, 5, 4)[0])
    lay, low = nlp.layout, nlp.limits[0]
    P = lay.contact.P[lay.stations.rows(0), 0]
    assert (low[P[:-1]] == 0).all() and low[P[-1]] == -np.inf
    gap, inside = nlp.laws.step.gap.index[:, 0], nlp.laws.step.gap_inside.index[:, 0]
    assert (gap[6] == NOWHERE) and (gap[7:] != NOWHERE).all()
    assert (inside[5] == NOWHERE) and (inside[6:] != NOWHERE).all()


def test_the_rows_say_what_is_missed() -> None:
    laws = Transcription(problem_of(corners, 5, 2)[0]).laws.liftoff
    assert laws.vanishes.missed.words(0) == (
        "the normal force of left, right misses zero at event 1"
    )
    assert laws.vanishes.name_of(0) == "normal force of left, right at event 1"
    assert laws.vanishes.missed.unit(0) == "N"
