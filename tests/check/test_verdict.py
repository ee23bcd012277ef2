"""What is told of ends and paths just beyond their limits, and what is measured of a hit."""

from __future__ import annotations

from math import nan

import pytest
from flights import event_changed, flight

import dmoc
from dmoc.check.path_limits import Excess
from dmoc.check.verdict import PASSING, broken, exceeded, lost_by
from dmoc.codegen.kernels import Kernels


def test_a_path_constraint_may_be_exceeded_by_half_a_percent() -> None:
    within, beyond = (Excess(c, c, "speed", 1.0) for c in (0.00495, 0.00505))
    assert broken([within]) == []
    assert broken([within, beyond]) == [beyond.text]


def test_the_end_of_an_open_loop_run_may_be_off_by_a_quarter() -> None:
    assert lost_by((), (), 0.249) == []
    (sentence,) = lost_by((), (), 0.251)
    assert sentence == "terminal error 0.251 exceeds 0.25"


# Measures -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_energy_that_a_hit_makes_is_measured(cube: Kernels) -> None:
    """(0.55^2 - 0.5^2) / 2 of a largest kinetic energy of (1 + 0.55^2 + 0.5^2) / 2."""
    assert dmoc.verify(flight(cube), cube).passed
    check = dmoc.verify(flight(cube, (-1, 0.55, 0.5)), cube)
    assert check.energy_error == pytest.approx(0.0525 / 1.5525, rel=1e-9)
    assert not check.passed and "energy error 0.033" in check.message


@pytest.mark.slow
def test_an_impulse_that_is_not_the_planned_one_is_measured(cube: Kernels) -> None:
    """2.2 N s of a hit that takes 2 N s; the rate is 1 m/s."""
    check = dmoc.verify(event_changed(0, impulse=2.2)(flight(cube)), cube)
    assert check.impact_error == pytest.approx(0.2, rel=1e-9)
    assert "error of the law of impact 0.2 exceeds 0.02" in check.message


def test_errors_are_told_in_one_order_whoever_measures_them() -> None:
    measured = {name: 2 * limit for name, limit in PASSING.items()}
    turned = dict(reversed(measured.items()))
    assert exceeded(turned) == exceeded(measured) and len(exceeded(measured)) == len(PASSING)
    assert exceeded(PASSING) == [] and exceeded({"step error": nan}) != []
    with pytest.raises(ValueError, match="wrong name"):
        exceeded({"wrong name": 0.0})
