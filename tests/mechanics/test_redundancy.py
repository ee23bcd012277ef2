"""Which conditions follow from others: lines in a plane."""

from __future__ import annotations

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contact_mode import FREE, Mode
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.mechanics.redundancy import _onto, redundancy

X, Y = dynamicsymbols("x y")
LOW, SAME, LEFT, LEAN = range(4)


@pytest.fixture(scope="module")
def model() -> Model:
    """A point before four lines through the origin, of which two are the same."""
    lines = {"low": Y >= 0, "same": 2 * Y >= 0, "left": X >= 0, "lean": X + Y >= 0}
    system = dmoc.MechanicalSystem(
        "before_lines", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, {}, surfaces=lines
    )
    problem = dmoc.Problem(system, {"x": 0, "y": 0}, {}, steps=2, final_time=1.0)
    assert problem.kernels.surfaces == ["low", "same", "left", "lean"]
    return problem.model


@pytest.mark.parametrize(
    ("closed", "first", "follow"),
    [
        ((LOW,), (), ()), ((LOW, LEFT), (), ()), ((LEFT, LEAN), (), ()),
        ((LOW, SAME), (), (SAME,)), ((LOW, SAME), (SAME,), (LOW,)),
        ((LOW, SAME, LEFT), (), (SAME,)), ((LOW, LEFT, LEAN), (), (LEAN,)),
        ((LOW, LEFT, LEAN), (LEAN,), (LEFT,)), ((LOW, SAME, LEFT, LEAN), (), (SAME, LEAN)),
        ((SAME, LEFT, LEAN), (LEFT, LEAN), (SAME,)),
    ],
)  # fmt: skip
@pytest.mark.parametrize("start", [(0.0, 0.0), (1.0, 0.0), (0.3, -0.1), (-0.2, 2.0)])
def test_what_says_nothing_new_follows(
    model: Model,
    closed: tuple[int, ...],
    first: tuple[int, ...],
    follow: tuple[int, ...],
    start: tuple[float, float],
) -> None:
    """And fits, whatever rounding leaves of the places."""
    told = redundancy(model, Mode.of(closed, {}), np.array(start), np.ones(2), 1.0, first)
    assert told.closed == follow and bool(told) == bool(follow)
    assert not (told.sticking or told.joints or told.contradictory or told.loose)


def test_what_is_not_finite_anywhere_says_nothing(model: Model) -> None:
    told = redundancy(model, Mode.of((LOW, SAME), {}), np.zeros(2), np.full(2, np.nan), 1.0)
    assert not told and not told.pressing


def test_forces_that_share_an_effect_are_not_determined(model: Model) -> None:
    """The two lines that are the same; beside them the left one is."""
    told = redundancy(model, Mode.of((LOW, SAME, LEFT), {}), np.zeros(2), np.ones(2), 1.0)
    assert told.pressing == ("low", "same") and told.rubbing == ()


def test_a_rate_keeps_no_place() -> None:
    """A position gets onto a circle along the radius, whose rate is a constraint too; the rate
    follows from the circle, and fits."""
    radial = 10 * (X * X.diff() + Y * Y.diff())
    system = dmoc.MechanicalSystem(
        "on_a_circle", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, {},
        constraints={"circle": X**2 + Y**2 - 1, "radial": radial},
    )  # fmt: skip
    kernels = dmoc.build(system)
    model, start = Model(kernels, parameter_row(kernels, {})), np.array([1.5, 0.4])
    q, kept = _onto(model, conditions_of(model, FREE), start, 0.0, np.ones(2))
    np.testing.assert_allclose(q @ q, 1.0, atol=1e-12)
    assert kept.all()
    told = redundancy(model, FREE, start, np.ones(2), 1.0)
    assert told.joints == (1,) and not told.contradictory
