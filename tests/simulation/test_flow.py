"""The flow that motions are checked with, between surfaces: closed forms of hits and of rest."""

from __future__ import annotations

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.simulation.flow import Flow, Steps, SurfaceContact
from dmoc.simulation.sizes import Sizes


def flow(kernels: Kernels, restitution: list[float], **parameters: float) -> Flow:
    """A flow of sizes 1, whose surfaces nothing may enter."""
    model = Model(kernels, parameter_row(kernels, parameters))
    q, gaps, tangents = np.ones(model.nq), np.ones(model.nc), np.ones(model.nt)
    sizes = Sizes(q, q, q, gaps, gaps, tangents, tangents, 1.0, 1.0, 1.0, 1.0)
    return Flow(
        model, sizes, np.array(restitution), lambda t: np.zeros((len(t), model.nc)), lambda: None
    )


def driven(h: float, before: list[float], after: list[float]) -> Steps:
    """One step from the time 0 on, under linear inputs."""
    return Steps(np.zeros(1), np.array([h]), np.array([before]), np.array([after]))


AGAIN = (np.sqrt(21) - 1) / 4  # where t^3 - 3/2 (t - 1/2) comes back to 1/8


@pytest.mark.parametrize(
    ("inputs", "wall", "times"),
    [((0.0, 6.0), 0.125, (0.5, AGAIN)), ((6.0, 0.0), 0.625, (0.5,))],
)
def test_a_hit_in_a_step_has_the_inputs_of_both_ends(
    block: Kernels, inputs: tuple[float, float], wall: float, times: tuple[float, ...]
) -> None:
    """From rest, x = t^3 under 6 t and 3 t^2 - t^3 under 6 (1 - t): at half the time 1/8 and 5/8.
    Each hit takes twice the rate."""
    contacts: list[SurfaceContact] = []
    y, (first, last) = np.zeros(2), inputs
    moving = flow(block, [1.0], wall=wall)
    end = moving.through_contacts(y, driven(1.0, [first], [last]), 0, contacts)
    assert [c.time for c in contacts] == pytest.approx(times)
    place, speed = first / 2 + (last - first) / 6, (first + last) / 2
    lost = 0.0
    for contact, t in zip(contacts, times, strict=True):
        jump = 2 * (first * t + (last - first) * t**2 / 2 - lost)
        assert contact.jump == pytest.approx(jump)
        lost, place = lost + jump, place - jump * (1 - t)
    np.testing.assert_allclose(end, [place, speed - lost], rtol=1e-9)


@pytest.fixture(scope="module")
def disc() -> Kernels:
    """A point beside a disc of radius 1 and before a wall, pushed along both axes."""
    x, y, u, w = dynamicsymbols("x y u w")
    return dmoc.build(
        dmoc.MechanicalSystem(
            "point_on_disc", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2, {}, [u, w],
            {x: u, y: w}, surfaces={"wall": x <= 3, "disc": x**2 + y**2 >= 1},
        )
    )  # fmt: skip


@pytest.mark.parametrize(("push", "stays"), [(-0.5, False), (-0.99, False), (-1.01, True)])
@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_a_plastic_surface_holds_what_is_pushed_more_than_it_bends_away(
    disc: Kernels, push: float, stays: bool, speed: float
) -> None:
    """On top of a disc of radius 1 with 1 m/s: it takes 1 N to stay on it."""
    contacts: list[SurfaceContact] = []
    on = flow(disc, [0.0, 0.0])
    y, u = np.array([0.0, 1.0, speed, 0.0]), np.array([[0.0, push]])
    assert on._resting(y, 0.0, u) == (Mode((1,)) if stays else None)
    end = on.through_contacts(y, driven(0.2, [0.0, push], [0.0, push]), 0, contacts)
    height = float(np.hypot(*end[:2])) - 1
    assert height == pytest.approx(0.0, abs=1e-9) if stays else height > 1e-9


@pytest.mark.parametrize(
    ("q", "v", "restitution", "held"),
    [
        ((3.0, 0.0), (0.0, 0.0), [0.0, 1.0], True),
        ((3.0, 0.0), (0.0, 0.0), [1.0, 0.0], False),  # it is not the plastic one
        ((3.0 - 9e-9, 0.0), (0.0, 0.0), [0.0, 0.0], True),
        ((3.0 - 11e-9, 0.0), (0.0, 0.0), [0.0, 0.0], False),
        ((3.0, 0.0), (0.9e-7, 0.0), [0.0, 0.0], True),
        ((3.0, 0.0), (1.1e-7, 0.0), [0.0, 0.0], False),
        ((3.0, 0.0), (-1.1e-7, 0.0), [0.0, 0.0], False),
    ],
)
def test_a_plastic_surface_holds_what_touches_it_without_approaching_it(
    disc: Kernels, q: tuple[float, ...], v: tuple[float, ...], restitution: list[float], held: bool
) -> None:
    """To ten times 1e-9 of the size of the gap, and 1e-7 of that of its rate."""
    u = np.array([[1.0, 0.0]])
    mode = flow(disc, restitution)._resting(np.array([*q, *v]), 0.0, u)
    assert mode == (Mode((0,)) if held else None)


def test_of_surfaces_that_a_step_meets_the_first_is_hit_first(disc: Kernels) -> None:
    """From (-3, 0) with 8 m/s the disc at 1/4 s, then back; from (2, 0) the wall at 1/8 s and the
    disc a quarter of a second later."""
    for x, times, names in ((-3.0, [0.25], ["disc"]), (2.0, [0.125, 0.375], ["wall", "disc"])):
        contacts: list[SurfaceContact] = []
        steps = driven(0.6, [0.0, 0.0], [0.0, 0.0])
        elastic = flow(disc, [1.0, 1.0])
        end = elastic.through_contacts(np.array([x, 0.0, 8.0, 0.0]), steps, 0, contacts)
        assert [c.surface for c in contacts] == names
        assert [c.time for c in contacts] == pytest.approx(times)
        assert abs(end[2]) == pytest.approx(8.0)


def test_surfaces_met_in_one_step_count_in_the_order_of_their_times(disc: Kernels) -> None:
    """Each of both first, whichever stands first in the model; the other one is not met."""
    x, y = dynamicsymbols("x y")
    cross = dmoc.build(
        dmoc.MechanicalSystem(
            "cross", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2, {},
            surfaces={"right": x <= 1, "left": x >= -1, "top": y <= 1},
        )
    )  # fmt: skip
    for v, first in (((2.0, 1.1), "right"), ((-2.0, 1.1), "left"), ((1.1, 2.0), "top")):
        moving = flow(cross, [1.0] * 3)
        contacts: list[SurfaceContact] = []
        y0 = np.array([0.0, 0.0, *v])
        nothing = Steps(np.zeros(1), np.ones(1), np.zeros((1, 0)), np.zeros((1, 0)))
        moving.through_contacts(y0, nothing, 0, contacts)
        assert contacts[0].surface == first and len(contacts) == 2
        assert [c.time for c in contacts] == pytest.approx([0.5, 1 / 1.1])
