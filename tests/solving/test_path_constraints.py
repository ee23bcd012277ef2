"""Path constraints hold where inputs have values and at the ends of phases, and the check looks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from math import sqrt
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.errors import ProblemError
from dmoc.program.transcription import Transcription

pytestmark = pytest.mark.slow

X, U = dynamicsymbols("x u")
v = X.diff()
T = dynamicsymbols._t
P = sp.Symbol("P")
FORMS = [(order, form) for order, d in DISCRETISATIONS.items() for form in d.controls]
FORMS += [(2, "linear")] * ((2, "linear") not in FORMS)


@cache
def kernels(name: str, order: int) -> Any:
    """A mass of 1 kg that a force pushes, under one of the path constraints."""
    limits: dict[str, dict[str, Any]] = {
        "pushed": {"lim": U <= 1},
        # Else the motion turns within a step, at whose nodes the power is small: see below.
        "power": {"power": U * v <= P, "forward": v >= 0},
        "both": {"power": U * v <= P, "speed": v <= sp.Rational(5, 4), "place": X <= 2},
        "slow": {"speed": v <= sp.Rational(1, 2)},
        "block": {"most": U <= 1, "least": U >= -1},
        "ends": {"power": U * v <= 1, "speed": v <= 2, "place": X >= -1},
    }
    system = dmoc.MechanicalSystem(
        name, [X], v**2 / 2, {P: 1.0} if name in ("power", "both") else {}, [U], {X: U},
        surfaces={"wall": X <= 1} if name in ("block", "ends") else {},
        cost=1 if name == "block" else 0,
        terminal_cost=0 if name == "block" else -v, path_constraints=limits[name],
    )  # fmt: skip
    return dmoc.build(system, order=order)


def furthest_speed(
    name: str, order: int, form: str, steps: int, start: Mapping[str, float], **fields: Any
) -> dmoc.Solution:
    problem = dmoc.Problem(
        kernels(name, order), start, steps=steps, final_time=1.0, controls=form, **fields
    )
    return dmoc.solve(problem, "ipm", starts=1)


@pytest.mark.parametrize(("order", "form"), FORMS)
def test_a_limit_of_the_input_holds_everywhere(order: int, form: str) -> None:
    """u <= 1 for 1 s from rest: v(1) = 1."""
    solution = furthest_speed("pushed", order, form, 20, {"x": 0.0})
    assert solution.status == "solved" and solution.cost == pytest.approx(-1, rel=1e-9)
    assert solution.trajectory.phases[0].u.max() <= 1 + 1e-9
    assert solution.verification is not None and solution.verification.path_excess < 1e-9


@pytest.mark.parametrize(("order", "form"), FORMS)
def test_a_limit_of_the_input_holds_on_both_sides_of_a_collision(order: int, form: str) -> None:
    """To the wall and back, |u| <= 1, in the shortest time: 2 sqrt(2) s."""
    problem = dmoc.Problem(
        kernels("block", order), {"x": 0.0}, {"x": 0.0, "x_dot": 0.0}, sequence=["wall"], steps=20,
        final_time=(0.5, 6.0), controls=form, restitution=1.0,
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1)
    assert solution.cost == pytest.approx(2 * sqrt(2), rel=1e-6)
    assert max(abs(phase.u).max() for phase in solution.trajectory.phases) <= 1 + 1e-9


# The error of v(T) at 40 steps: inputs that are constant are in doubt by a share of h where both
# Gauss points of a step must keep the limit.
POWER = [(2, "linear", 2e-4), (4, "stages", 1e-8), (6, "stages", 1e-4), (4, "constant", 6e-3)]


@pytest.mark.parametrize(("order", "form", "error"), POWER)
def test_power_is_limited(order: int, form: str, error: float) -> None:
    """u v <= P: E(T) = E(0) + P T, v(T) = sqrt(v0^2 + 2 P T)."""
    solution = furthest_speed("power", order, form, 40, {"x": 0.0, "x_dot": 0.5})
    assert solution.status == "solved", solution.message
    assert -solution.cost == pytest.approx(sqrt(0.25 + 2), rel=error)
    last = solution.trajectory.phases[0]
    assert last.u[-1, 0] * last.v[-1, 0] <= 1 + error


def test_power_is_limited_to_second_order() -> None:
    """Both the speed at the end and the excess between nodes fall as h^2."""
    coarse, fine = (
        furthest_speed("power", 2, "linear", n, {"x": 0.0, "x_dot": 0.5}) for n in (40, 80)
    )
    errors = [-s.cost - sqrt(2.25) for s in (coarse, fine)]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)
    assert coarse.verification is not None and fine.verification is not None
    ratio = coarse.verification.path_excess / fine.verification.path_excess
    assert ratio == pytest.approx(4, rel=0.3)


@pytest.mark.parametrize(
    ("start", "goal", "form", "standing"),
    [
        ({"x": 0.0, "x_dot": 0.5}, {"x": 0.0}, "linear", ("p", "ps", "ps", "ps")),
        ({"x": 0.0, "x_dot": (0, 1)}, {}, "linear", ("ps", "ps", "ps", "psx")),
        ({"x": (0, 0.5), "x_dot": 0.5}, {"x": (0, 0.5)}, "linear", ("px", "ps", "ps", "psx")),
        ({"x": 0.0}, {"x": 0.0, "x_dot": 0.0}, "constant", ("", "s", "s", "")),
    ],
)
def test_a_row_stands_at_the_end_of_a_phase_where_it_can_move(
    start: dict[str, Any], goal: dict[str, Any], form: str, standing: tuple[str, ...]
) -> None:
    """1 - u v, 2 - v and x + 1 at any unknowns, before and after a wall; there x is known."""
    problem = dmoc.Problem(
        kernels("ends", 2), start, goal, sequence=["wall"], steps=3, final_time=1.0, controls=form,
        restitution=0.5,
    )  # fmt: skip
    nlp = Transcription(problem)
    lay, scaled = nlp.layout, np.random.default_rng(2).uniform(0.5, 2.0, nlp.n)
    x, rows = nlp.physical(scaled), np.append(nlp.inequality(scaled), np.nan)
    rows *= np.append(nlp.row_sizes[nlp.n_eq :], 1.0)
    places = ((lay.index_v_B, 0, 0), (lay.impact.v_a, 3, 3), (lay.impact.v_c, 3, 4))
    (block,) = (b for b in nlp.inequalities if b.name == "path at ends")
    for (v, node, input_), index, stands in zip(
        (*places, (lay.index_v_E, 6, 7)), block.index, standing, strict=True
    ):
        there = {name: rows[k - nlp.n_eq] for name, k in zip("psx", index, strict=True) if k >= 0}
        rate = x[v[..., 0]].item() if len(v) else np.nan
        u = x[lay.index_u[input_, 0]] if form == "linear" else np.nan
        values = {"p": 1 - u * rate, "s": 2 - rate, "x": x[lay.index_q[node, 0]] + 1}
        assert there == pytest.approx({name: values[name] for name in stands})


@pytest.mark.parametrize(("order", "form"), FORMS)
def test_a_limit_of_the_speed_holds_at_the_end(order: int, form: str) -> None:
    """|u| <= 1 would make the half step after the last quadrature point faster than 1/2."""
    solution = furthest_speed("slow", order, form, 20, {"x": 0.0}, bounds={"u": (-1.0, 1.0)})
    assert solution.status == "solved"
    assert solution.trajectory.phases[0].v[-1, 0] == pytest.approx(0.5, abs=1e-9)


def test_a_limit_of_the_place_holds_at_the_end() -> None:
    """The last quadrature point lies half a step before the end."""
    problem = dmoc.Problem(
        kernels("both", 2), {"x": 1.4, "x_dot": 0.5}, steps=10, final_time=1.0,
        parameters={"P": 10.0}, controls="linear",
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.trajectory.phases[0].q[-1, 0] <= 2 + 1e-9
    assert solution.trajectory.phases[0].v[-1, 0] <= 1.25 + 1e-9


def test_the_check_finds_a_motion_that_turns_within_a_step() -> None:
    """Without `forward`: u is large where the mean speed of a step is zero."""
    system = dmoc.MechanicalSystem(
        "turning", [X], v**2 / 2, {}, [U], {X: U}, terminal_cost=-v,
        path_constraints={"p": U * v <= 1},
    )  # fmt: skip
    start = {"x": 0.0, "x_dot": -1.0}
    problem = dmoc.Problem(dmoc.build(system), start, steps=40, final_time=1.0)
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.status == "not_verified" and "path constraint 'p' is" in solution.message


@pytest.mark.parametrize(("order", "form"), FORMS)
def test_the_check_finds_what_is_exceeded_and_where(order: int, form: str) -> None:
    """The motion at P = 1, judged with P = 0.9: u v exceeds it by a tenth, 5 % of |u v| + P."""
    solution = furthest_speed("power", order, form, 40, {"x": 0.0, "x_dot": 0.5})
    motion = replace(solution.trajectory, parameters={"P": 0.9})
    check = dmoc.verify(motion, kernels("power", order))
    assert not check.passed and "path constraint 'power' is exceeded by" in check.message
    assert check.path_excess > 0.045


def test_the_check_finds_an_input_that_jumps_at_the_end() -> None:
    """u = 5 at the last node alone, where 1 is allowed: 4 / (1 + 5) of its size."""
    motion = furthest_speed("pushed", 2, "linear", 100, {"x": 0.0}).trajectory
    u = motion.phases[0].u.copy()
    u[-1] = 5.0
    wrong = replace(motion, phases=(replace(motion.phases[0], u=u),))
    check = dmoc.verify(wrong, kernels("pushed", 2))
    assert check.path_excess == pytest.approx(4 / 6, rel=1e-12)
    assert "path constraint 'lim' is exceeded by 66.7 % of its size at 1 s" in check.message


def test_a_place_is_measured_in_the_ranges_of_the_motion() -> None:
    """x from 1.75 to 2.25 where x <= 2: a half of the range."""
    solution = furthest_speed(
        "both", 2, "linear", 10, {"x": 1.25, "x_dot": 0.5}, bounds={"u": (-1e-6, 1e-6)}
    )
    motion = solution.trajectory
    moved = replace(motion.phases[0], q=motion.phases[0].q + 0.5)
    check = dmoc.verify(replace(motion, phases=(moved,)), kernels("both", 2))
    assert check.path_excess == pytest.approx(0.5, rel=1e-5)


def test_the_same_structure_serves_problems_that_fix_other_things() -> None:
    """A start that is free has a row more at the start."""
    fixed = furthest_speed("slow", 2, "constant", 10, {"x": 0.0}, bounds={"u": (-1.0, 1.0)})
    free = furthest_speed(
        "slow", 2, "constant", 10, {"x": 0.0, "x_dot": (0.0, 3.0)}, bounds={"u": (-1.0, 1.0)}
    )
    assert fixed.cost == pytest.approx(-0.5, abs=1e-9) == free.cost
    assert free.trajectory.phases[0].v.max() <= 0.5 + 1e-6


@pytest.mark.parametrize("order", list(DISCRETISATIONS))
def test_a_limit_of_places_holds_at_every_node(order: int) -> None:
    """Round a disc of radius 1 from one side to the other: no node lies within it."""
    y, w = dynamicsymbols("y w")
    system = dmoc.MechanicalSystem(
        "round", [X, y], (v**2 + y.diff() ** 2) / 2, inputs=[U, w], forces={X: U, y: w},
        cost=U**2 + w**2, path_constraints={"disc": X**2 + y**2 >= 1},
    )  # fmt: skip
    rest = {"x_dot": 0.0, "y_dot": 0.0}
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {"x": -1.5, "y": 0.3} | rest,
        {"x": 1.5, "y": 0.3} | rest, steps=12, final_time=2.0,
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=8)
    q = solution.trajectory.phases[0].q
    assert np.hypot(*q.T).min() == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize(
    ("field", "state", "words"),
    [
        ("start", {"x": 0, "x_dot": 2.01}, "'speed' is violated by 0.01 at the start"),
        ("goal", {"x": 0, "x_dot": 3}, "'speed' is violated by 1 at the goal"),
        ("start", {"x": -1.5}, "'place' is violated by 0.5 at the start"),
    ],
)
def test_a_fixed_end_that_a_path_constraint_does_not_allow_is_refused(
    field: str, state: dict[str, float], words: str
) -> None:
    """No input makes it another one, and no mesh; at the limit it is allowed."""
    ends = {"start": {"x": 0, "x_dot": 2}, "goal": {"x": 0.5, "x_dot": 2}}
    problem = dmoc.Problem(kernels("ends", 2), **ends, steps=5, final_time=1.0)
    with pytest.raises(ProblemError, match=words):
        problem.but(**{field: state})


@pytest.mark.parametrize(
    ("limit", "fields", "words"),
    [
        (X <= 5 * T - 7, {}, "violated by 7 at the start"),
        (X <= T - 1, {}, "violated by 1 at the start"),
        (v >= 1 - T, {}, "violated by 1 at the start"),
        (X >= 1 - T, {"start": {"x": (0, 0.5)}}, None),
        (X <= T - 1, {"start": {"x": 0, "x_dot": None}}, "violated by 1 at the start"),
        (X <= 2 - T, {}, "violated by 1 at the goal"),
        (X <= 2 - T, {"final_time": (0.5, 3)}, None),
        (X <= 2 - T, {"final_time": 1}, None),
        (X <= 2 - T, {"goal": {}}, None),
        (U <= T - 1, {}, None),
    ],
)
def test_a_fixed_end_is_compared_with_constraints_of_its_time(
    limit: Any, fields: dict[str, Any], words: str | None
) -> None:
    """The time is 0 at the start, and that at the goal where it is fixed."""
    system = dmoc.MechanicalSystem(
        "timed", [X], v**2 / 2, inputs=[U], forces={X: U}, path_constraints={"p": limit}
    )
    stated = {"start": {"x": 0}, "goal": {"x": 1}, "final_time": 2.0, "steps": 5} | fields
    if words is None:
        dmoc.Problem(dmoc.build(system), **stated)
        return
    with pytest.raises(ProblemError, match=words):
        dmoc.Problem(dmoc.build(system), **stated)


def test_a_constraint_on_the_design_is_not_compared_with_a_fixed_end() -> None:
    """The solver chooses P, and with it whether x may be 0; it does not choose the other one."""
    system = dmoc.MechanicalSystem(
        "chosen", [X], v**2 / 2, {P: 1.0}, [U], {X: U}, path_constraints={"p": X >= P, "q": X <= 1}
    )
    dmoc.Problem(system, {"x": 0}, steps=5, design={"P": (-1, 2)})
    with pytest.raises(ProblemError, match="'q' is violated by 1 at the start"):
        dmoc.Problem(system, {"x": 2}, steps=5, design={"P": (-1, 2)})


def test_coordinates_that_a_constraint_leaves_out_may_be_free_at_its_end() -> None:
    """x is fixed at the start, y is not."""
    y = dynamicsymbols("y")
    system = dmoc.MechanicalSystem(
        "beside", [X, y], (v**2 + y.diff() ** 2) / 2, inputs=[U], forces={X: U},
        path_constraints={"p": X >= 1, "q": y >= 1},
    )  # fmt: skip
    kernels = dmoc.build(system)
    with pytest.raises(ProblemError, match="'p' is violated by 1 at the start"):
        dmoc.Problem(kernels, {"x": 0, "y": None}, steps=5)
    dmoc.Problem(kernels, {"x": 1, "y": None}, steps=5)
