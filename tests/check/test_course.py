"""Motions between their nodes: where they are there, which surface they meet first, and what counts
as the size of a limit."""

from __future__ import annotations

from dataclasses import replace

import motions
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.check.integrated_steps import IntegratedSteps
from dmoc.simulation.flow import Steps

T = dynamicsymbols._t


def test_a_course_is_the_polynomial_of_degree_five() -> None:
    """t^5 - 2 t^3 + 3 t from 0.4 to 1.2 s, with inputs from 1 to 3."""
    place = np.polynomial.Polynomial([0, 3, 0, -2, 0, 1])
    rate, bend = place.deriv(), place.deriv(2)
    begin, h = 0.4, 0.8
    steps = Steps(np.array([begin]), np.array([h]), np.array([[1.0]]), np.array([[3.0]]))
    ends = np.array([[[bend(begin)], [bend(begin + h)]]])
    start, stop = (np.array([[place(t), rate(t), 0.0]]) for t in (begin, begin + h))
    course = IntegratedSteps(steps, start, ends, stop)
    for share in (0.0, 0.2, 0.5, 0.9, 1.0):
        q, v, u, t = course.at(share)
        at = begin + share * h
        assert t[0] == pytest.approx(at)
        assert q[0, 0] == pytest.approx(place(at), rel=1e-12)
        assert v[0, 0] == pytest.approx(rate(at), rel=1e-12)
        assert u[0, 0] == pytest.approx(1 + 2 * share)


def straight(
    kernels: dmoc.codegen.kernels.Kernels, steps: int
) -> dmoc.motion.trajectory.Trajectory:
    """From the origin with (1, 1) m/s for a second."""

    return motions.trajectory(kernels, [motions.Piece(1.0, lambda t: (t, t, 1, 1))], [], steps)


def plane(name: str, **fields: object) -> dmoc.codegen.kernels.Kernels:
    x, y = q = dynamicsymbols("x y")
    kinetic = (x.diff(T) ** 2 + y.diff(T) ** 2) / 2
    return dmoc.build(dmoc.MechanicalSystem(name, q, kinetic, **fields))  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("first", ["right", "top"])
def test_of_two_surfaces_in_a_step_the_nearer_one_is_met_first(first: str) -> None:
    """At 0.52 and 0.55 s, in one step of 0.1 s, whichever is named first; a motion that goes on may
    be 2 mm further."""
    x, y = dynamicsymbols("x y")
    near, far = sp.symbols("near far")
    walls = {"right": x <= near, "top": y <= far}
    named = {name: walls[name] for name in sorted(walls, key=lambda name: name != first)}
    kernels = plane(f"corner_{first}", parameters={near: 0.52, far: 0.55}, surfaces=named)
    check = dmoc.verify(replace(straight(kernels, 10), restitution={"right": 1, "top": 1}), kernels)
    assert [c.surface for c in check.contacts] == ["right", "top"]
    assert [c.time for c in check.contacts] == pytest.approx([0.52, 0.55], abs=3e-3)


@pytest.mark.slow
def test_the_size_of_a_limit_that_moves_has_the_time_in_it() -> None:
    """x <= c + 10 t is exceeded by -c at the start, of 1 m and 10 m/s for a second."""
    c = sp.Symbol("c")
    x = dynamicsymbols("x")
    kernels = plane("chased", parameters={c: 0.0}, path_constraints={"place": x <= c + 10 * T})
    motion = replace(straight(kernels, 10), parameters={"c": -0.022})
    check = dmoc.verify(motion, kernels)
    assert check.path_excess == pytest.approx(0.022 / 11, rel=1e-9)
    assert check.passed
