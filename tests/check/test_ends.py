"""The end of an open-loop run is excused by what the errors of the segments predict, not by the
amplification alone."""

from __future__ import annotations

import numpy as np
import pytest
from flights import flight

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.check.amplification import Carried, carried
from dmoc.check.checked_motion import Motion
from dmoc.check.findings import Findings
from dmoc.check.runs import Departures, WholeRun, departures, predicted
from dmoc.check.segments import segments
from dmoc.check.verdict import PASSING, is_unstable, judged
from dmoc.codegen.kernels import Kernels
from dmoc.simulation.flow import SurfaceContact


@pytest.mark.parametrize(
    ("worst", "amplified", "terminal", "predicted", "excused"),
    [
        (1e-3, 957, 0.9, 0.3, True),
        (1e-3, 957, 0.9, 0.1, False),  # the errors are too small for this end
        (1e-3, 957, 50.0, 1.0, True),  # the run leaves the motion altogether, as predicted
        (1e-3, 20, 0.9, 0.3, False),  # nothing is amplified
        (6e-3, 957, 0.9, 0.3, False),  # segments are not right
        (1e-3, np.inf, 0.9, np.inf, False),
        (1e-3, 957, np.inf, 0.1, False),
    ],
)
def test_an_end_is_weighed_with_the_errors_on_the_way(
    worst: float, amplified: float, terminal: float, predicted: float, excused: bool
) -> None:
    assert is_unstable(worst, amplified, terminal, predicted) is excused


@pytest.mark.slow
def test_the_prediction_is_near_the_end_and_misses_no_collision(seed: dmoc.Problem) -> None:
    """With fine steps the linearised flow tells the error at the end within a factor, which falls
    as h^2 with it; a run that meets no contact is not excused by it, though the pendulum amplifies
    957 times."""
    for steps in (200, 400):
        solution = dmoc.solve(seed.but(steps=steps), "ipm", verify=False)
        motion = Motion.of(solution.trajectory, seed.kernels, ENDLESS)
        parts = segments(motion)
        flowed, check = carried(motion, parts), solution.verify()
        assert check.terminal_error / 3 < flowed.end < 10 * check.terminal_error
        followed, stray = (departures(motion, contacts) for contacts in (check.contacts, ()))
        assert not followed and predicted(motion, followed, parts, flowed.deviations)
        assert not predicted(motion, stray, parts, flowed.deviations)


HIT, EARLY, LATE = (SurfaceContact("wall", t, 1.0) for t in (1.0, 0.5, 1.5))


@pytest.mark.parametrize(
    ("contacts", "needed"),
    [
        ((HIT,), 0.0),
        ((), 0.02),  # 1 m/s for 5 % of 2 s
        ((LATE,), 0.02),
        ((EARLY, HIT), 0.1),  # the wall is half a metre away
        ((HIT, LATE), 0.1),
        ((EARLY,), 0.1),
    ],
)
def test_a_departure_is_predicted_up_to_a_fifth_of_its_gap(
    cube: Kernels, contacts: tuple[SurfaceContact, ...], needed: float
) -> None:
    """To a wall at 1 m with 1 m/s, in 2 s there and back, off by a share of the range of 1 m."""
    motion = Motion.of(flight(cube), cube, ENDLESS)
    parts, run = segments(motion), departures(motion, contacts)
    for share, right in ((0.99, needed == 0.0), (1.01, True)):
        off = np.full((len(parts), 6), share * needed)
        assert predicted(motion, run, parts, off) is right


def test_contacts_count_as_planned_within_a_twentieth_of_the_time(cube: Kernels) -> None:
    motion = Motion.of(flight(cube), cube, ENDLESS)
    assert not departures(motion, [SurfaceContact("wall", 1.099, 1.0)])
    run = departures(
        motion, [SurfaceContact("wall", 1.101, 1.0), SurfaceContact("wall", 1.2, 0.009)]
    )
    assert run.missed_texts == ("the collision with 'wall' at 1 s",)
    assert run.extra_texts == ("a contact with 'wall' at 1.101 s",)


def test_one_judgement_excuses_the_end_of_a_run_alone(cube: Kernels) -> None:
    """The end of an open-loop run counts above 25 %, unless the errors on the way explain it; what
    the motion's own segments meet is never excused."""
    motion = Motion.of(flight(cube), cube, ENDLESS)
    parts = segments(motion)
    calm, none = carried(motion, parts), Departures()
    errors = dict.fromkeys(PASSING, 0.0)
    wild = Carried(1000.0, 0.0, lambda: np.full((len(parts) + 1, 6), 0.11))
    stray = Departures(extra=(EARLY,))

    def check(end: float, flowed: Carried, run: Departures, way: Departures) -> dmoc.Verification:
        return judged(motion, Findings(errors), (), parts, flowed, WholeRun(end, (), run, way))

    assert check(0.249, calm, none, none).passed
    assert "terminal error 0.251 exceeds 0.25: too coarse" in check(0.251, calm, none, none).message
    late = np.zeros((len(parts) + 1, 6))
    late[-1] = 0.5  # the end is predicted, what is met before is not
    assert check(0.5, Carried(1000.0, 0.0, lambda: late), none, none).passed
    assert not check(0.5, Carried(1000.0, 0.0, lambda: late), stray, none).passed
    excused = check(0.5, wild, stray, none)
    assert excused.passed and "unstable" in excused.message and not excused.extra_contacts
    for end, run in ((0.5, none), (0.5, stray), (0.0, none)):
        assert not check(end, wild, run, stray).passed
    judgement = check(0.0, wild, stray, stray)
    assert judgement.extra_contacts == ("a contact with 'wall' at 0.5 s",)
    assert judgement.message.startswith("the simulation meets a contact with 'wall' at 0.5 s: too")
