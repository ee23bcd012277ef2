"""Forces of modes that accelerations leave open, what modes keep, and what a record says of them:
closed forms."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.conditions import answers, conditions_of
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.motion.trajectory import Collision
from dmoc.simulation import contact_motion
from dmoc.simulation.contact_modes import (
    Reaction,
    _furthest_along,
    _independent,
    kept,
    names_without_effect,
    nearest,
    slack,
)
from dmoc.simulation.motion_record import MotionRecord, Stretch
from dmoc.simulation.recording import _at_once, _inputs, _kept_impulses, _merged, _Moment, _Side

X, Y = dynamicsymbols("x y")
MU, HIGH = sp.symbols("mu high")
ZERO = np.zeros(1)


@pytest.fixture(scope="module")
def table() -> Model:
    """A puck of 2 kg between a floor that rubs and a ceiling, with a stop at the right."""
    system = dmoc.MechanicalSystem(
        "between", [X, Y], X.diff() ** 2 + Y.diff() ** 2, {MU: 0.25, HIGH: 1.0},
        surfaces={"stop": X <= 3, "floor": Y >= 0, "ceiling": Y <= HIGH},
        tangents={"floor": X}, friction={"floor": MU},
    )  # fmt: skip
    kernels = dmoc.build(system)
    return Model(kernels, parameter_row(kernels, {}))


def test_a_contact_that_slides_pushes_askew(table: Model) -> None:
    """By mu against where it slides; its gap grows downwards, its force acts upwards."""
    q = np.array([[0.5, 0.0]])
    for s in (1, -1):
        both = conditions_of(table, Mode((1,), (), ((0, s),)))
        np.testing.assert_allclose(both.slopes(table, q, ZERO)[..., :-1], [[[0, -1]]], atol=1e-12)
        np.testing.assert_allclose(both.pushes(table, q, ZERO), [[[-0.25 * s, 1]]], atol=1e-12)
        normal, tangential, joint = both.spread(table, np.array([[8.0], [2.0]]))
        np.testing.assert_allclose(normal, [[0, 8, 0], [0, 2, 0]])
        np.testing.assert_allclose(tangential, [[-2.0 * s], [-0.5 * s]])
        assert joint.shape == (2, 0)
    sticks = conditions_of(table, Mode((1,), (0,)))
    slopes, pushes = sticks.slopes(table, q, ZERO)[..., :-1], sticks.pushes(table, q, ZERO)
    np.testing.assert_allclose(slopes, [[[0, -1], [1, 0]]], atol=1e-12)
    np.testing.assert_allclose(pushes, [[[0, 1], [1, 0]]], atol=1e-12)


def test_multipliers_are_the_smallest_with_their_effect() -> None:
    """Masses 1 and 4; twice the same condition shares its force."""
    M = np.diag([1.0, 4.0])[None]
    one = np.array([[[0.0, 2.0]]])
    change, lam = answers(M, one, one, np.array([[3.0]]))
    np.testing.assert_allclose(change, [[0.0, 1.5]])
    np.testing.assert_allclose(lam, [[3.0]])
    twice = np.array([[[0.0, 1.0], [0.0, 1.0]]])
    change, lam = answers(M, twice, twice, np.array([[1.5, 1.5]]))
    np.testing.assert_allclose(change, [[0.0, 1.5]])
    np.testing.assert_allclose(lam, [[3.0, 3.0]])
    both = np.array([[[1.0, 0.0], [1.0, 1.0]]])
    change, lam = answers(M, both, both, np.array([[1.0, 3.0]]))
    np.testing.assert_allclose(change, [[1.0, 2.0]])
    np.testing.assert_allclose(lam, [[-7.0, 8.0]])


@pytest.mark.parametrize(
    ("columns", "apart"),
    [
        ([[1.0, 0.0], [0.0, 1.0]], True),
        ([[1.0, 1.0], [0.0, 1e-2]], True),
        ([[1.0, 1.0], [0.0, 1e-4]], False),  # alike
        ([[1.0, 0.0], [0.0, 2e-3]], True),
        ([[1.0, 0.0], [0.0, 5e-4]], False),  # one is much shorter
        ([[5e-4, 0.0], [0.0, 1.0]], False),
    ],
)
def test_columns_are_far_from_dependent_by_their_angle(
    columns: list[list[float]], apart: bool
) -> None:
    good = np.eye(2)
    assert _independent(np.array([columns])) is apart
    assert _independent(np.array([columns, good])) is apart
    assert _independent(np.array([good, columns])) is apart


@pytest.mark.parametrize(
    ("least", "slopes", "x"),
    [
        ([-0.5, 0.7], [1.0, -1.0], 0.6),  # the two are alike
        ([-0.5, 0.7], [-1.0, 1.0], -0.6),
        ([0.0, 0.4], [1.0, -1.0], 0.2),
        ([-1.0, 5.0], [1.0, 0.0], 2.0),  # 1 is enough
        ([-1.0, 5.0], [1.0, -0.5], 2.0),
        ([-1.0, -1.0], [2.0, 1.0], 2.0),
    ],
)
def test_the_least_margin_becomes_the_largest(
    least: list[float], slopes: list[float], x: float
) -> None:
    assert _furthest_along(np.array(least), np.array(slopes)) == pytest.approx(x)


def test_what_clamps_is_not_determined(table: Model) -> None:
    """A puck that fills its gap is pressed by floor and ceiling alike, or by more of both."""
    kernels = table.kernels
    low = Model(kernels, parameter_row(kernels, {"high": 0.0}))
    q = np.array([0.5, 0.0])
    assert names_without_effect(low, Mode((1, 2), (0,)), q, 0.0) == (["floor", "ceiling"], [])
    assert names_without_effect(low, Mode((1,), (0,)), q, 0.0) == ([], [])
    reaction = Reaction(
        np.zeros((1, 2)), np.array([[0.0, 5.0, 1.0]]), np.array([[0.5]]), np.zeros((1, 0))
    )
    planned = np.array([[9.0, 3.0, 7.0]])  # the friction has an effect, and stays
    made = nearest(low, Mode((1, 2), (0,)), reaction, q[None], ZERO, planned)
    np.testing.assert_allclose(made.normal, [[0, 8, 4]], atol=1e-12)
    np.testing.assert_allclose(made.tangential, [[0.5]], atol=1e-12)


def test_what_modes_keep_above_zero(table: Model) -> None:
    """Gaps of what is open, forces of what is closed, the rest of a cone, the way it slides."""
    q, v = np.array([[0.5, 0.0]]), np.array([[-0.3, 0.0]])
    endless = [np.inf] * 3  # no surface has ends
    reaction = Reaction(
        np.zeros((1, 2)), np.array([[0.0, 8.0, 0.0]]), np.array([[-0.5]]), np.zeros((1, 0))
    )
    sticks = kept(table, Mode((1,), (0,)), reaction, (q, v, ZERO), None)
    np.testing.assert_allclose(sticks, [[2.5, 8.0, 1.0, 1.5, np.inf, *endless]])
    for s in (1, -1):
        slides = kept(table, Mode((1,), (), ((0, s),)), reaction, (q, v, ZERO), None)
        np.testing.assert_allclose(slides, [[2.5, 8.0, 1.0, np.inf, -0.3 * s, *endless]])
    small: Any = SimpleNamespace(
        gap=np.array([1.0, 2.0, 3.0]), force=np.array([10.0, 20.0, 30.0]), hold=np.array([4.0]),
        slide=np.array([5.0]), within=np.array([6.0, 7.0, 8.0]),
    )  # fmt: skip
    np.testing.assert_array_equal(slack(table, Mode((1,), (0,)), small), [1, 20, 3, 4, 5, 6, 7, 8])
    np.testing.assert_array_equal(small.gap, [1, 2, 3])
    # A grip that holds beside what touches is counted by its force.
    beside = slack(table.gripping((2,)), Mode((1,), (0,)), small)
    np.testing.assert_array_equal(beside, [1, 20, 30, 4, 5, 6, 7, 8])


# The record of a run ------------------------------------------------------------------------------


def moment(t: float, number: float, *names: str) -> _Moment:
    sides = [_Side(*[np.array([number + k])] * 3, ZERO, ZERO) for k in (0.0, 0.5)]
    hits = tuple(Collision(n, t, sides[0].q, 1.0, sides[0].p, sides[1].p, 0.0, 0.0) for n in names)
    return _Moment(t, *sides, mode=Mode((int(number),)), collisions=hits)


def test_events_that_follow_closely_are_one_moment() -> None:
    """From before the first to after the last; each within the distance of the one before."""
    events = [moment(t, k) for k, t in enumerate((0.0, 0.9, 1.8, 3.0, 4.01))]
    groups = [[e.t for e in same] for same in _at_once(iter(events), 1.0)]
    assert groups == [[0.0, 0.9, 1.8], [3.0], [4.01]]
    first, second, last = moment(1.0, 1, "a", "b"), moment(1.0, 2), moment(1.0, 3, "c")
    again = _Moment(1.0, first.before, first.after, Mode((9,)), first.collisions[:1])
    merged = _merged([first, second, again, last])
    assert merged.before is first.before and merged.after is last.after
    assert merged.mode == Mode((3,)) and [c.surface for c in merged.collisions] == ["a", "b", "c"]


def test_inputs_between_nodes_are_those_of_their_steps() -> None:
    run: Any = SimpleNamespace(step_size=0.1, u=np.arange(4.0)[:, None])
    t = np.array([0.0, 0.1, 0.15, 0.2, 0.3, 0.4])
    np.testing.assert_array_equal(_inputs(run, t)[:, 0], [0, 1, 1, 2, 3])
    np.testing.assert_array_equal(_inputs(run, np.array([0.3 - 1e-17, 0.35, 0.4]))[:, 0], [3, 3])
    np.testing.assert_array_equal(_inputs(run, np.array([0.4, 0.5]))[:, 0], [3])


def test_a_guide_takes_what_contacts_leave_of_an_impulse() -> None:
    """A bead on the line y = x + t / 2, in a hit with 3 N s on a wall and 1 N s of friction: along
    the line it has (-3 + 2)/2 of both directions, the guide the rest."""
    t = dynamicsymbols._t
    system = dmoc.MechanicalSystem(
        "guided", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, {MU: 0.5},
        surfaces={"wall": X + Y * t <= 1}, tangents={"wall": Y}, friction={"wall": MU},
        constraints={"guide": sp.Eq(Y, X + t / 2)},
    )  # fmt: skip
    kernels = dmoc.build(system)
    model, q, time = Model(kernels, parameter_row(kernels, {})), np.array([-0.5, 0.5]), 2.0
    # The wall's slope is (1, t) = (1, 2): the contacts give (-3, -6 + 1), the guide (R, -R).
    given = np.array([-3.0, -5.0])
    guide = np.array([1.0, -1.0])
    size = -(given @ guide) / 2
    change = given + size * guide
    assert change[0] == pytest.approx(change[1])
    sides = [_Side(q, p, p, ZERO, ZERO) for p in (np.zeros(2), change)]
    event = _Moment(time, *sides)
    (made,) = _kept_impulses(model, event, [], ({"wall": 3.0}, {"wall": 1.0}))
    slope = model.joint_slopes(q, time)[0, :-1]
    np.testing.assert_allclose(made * slope, size * guide, atol=1e-12)


def test_a_record_tells_stretches_of_what_is_closed_and_rubs(floor: Kernels) -> None:
    model, record = Model(floor, parameter_row(floor, {})), MotionRecord()
    slides, sticks = Mode((0,), (), ((0, 1),)), Mode((0,), (0,))
    assert [record.note(model, mode, t) for mode, t in ((slides, 0.5), (slides, 0.7))] == [
        True, False,
    ]  # fmt: skip
    assert record.note(model, sticks, 0.9) and not record.note(model, sticks, 1.0)
    assert record.stretches == [Stretch("floor", 0.5, 0.9, 1)]
    assert record.note(model, None, 1.5) and not record.going
    assert set(record.stretches[1:]) == {
        Stretch("floor", 0.5, 1.5), Stretch("floor", 0.9, 1.5, 0),
    }  # fmt: skip
    assert record.note(model, slides, 2.0) and record.note(model, None, 2.0)
    assert len(record.stretches) == 3  # none that lasts no time


@pytest.mark.parametrize(("number", "apart", "crowded"), [
    (50, 1.9e-6, True), (50, 2.1e-6, False), (49, 1e-9, False), (60, 1.9e-6, True),
])  # fmt: skip
def test_the_last_events_of_a_step_are_many_in_a_short_time(
    number: int, apart: float, crowded: bool
) -> None:
    """50 in 1e-4 of a step of 1 s; what was before them counts for nothing."""
    times = (0.5 + apart * np.arange(number)).tolist()
    assert contact_motion._crowded(times, 1.0) is crowded
    assert contact_motion._crowded([0.0, *times], 1.0) is crowded
