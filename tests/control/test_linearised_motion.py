"""A motion linearised along itself, at its own places, times and inputs: closed forms."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.check.checked_motion import Motion
from dmoc.control.linearisation import GAUSS, PARTS, input_sizes, linear_phase, projection
from dmoc.mechanics.contact_mode import FREE

X, U, T = dynamicsymbols("x"), dynamicsymbols("u"), dynamicsymbols._t


def test_slopes_are_those_of_the_times_of_their_places() -> None:
    """x'' = -(1 + 4 t) x + (2 + t) u, in steps of 0.3 s of four intervals each."""
    lagrangian = X.diff() ** 2 / 2 - (1 + 4 * T) * X**2 / 2
    system = dmoc.MechanicalSystem(
        "stiffening", [X], lagrangian, {}, [U], {X: (2 + T) * U}, cost=U**2
    )
    kernels = dmoc.build(system)
    run = dmoc.simulate(kernels, [0.7], [0.2], step_size=0.3, steps=3, inputs=lambda t: [t])
    linear = linear_phase(Motion.of(run.trajectory, kernels, ENDLESS), 0)
    h = 0.3 / PARTS
    begins = h * np.arange(3 * PARTS)
    np.testing.assert_allclose(linear.t, h * np.arange(3 * PARTS + 1), atol=1e-12)
    np.testing.assert_allclose(linear.u[:, 0], np.repeat([0.15, 0.45, 0.75], PARTS), rtol=1e-9)
    for i, c in enumerate(GAUSS):
        t = begins + c * h
        np.testing.assert_allclose(linear.A[:, i, 1, 0], -(1 + 4 * t), rtol=1e-9)
        np.testing.assert_allclose(linear.B[:, i, 1, 0], 2 + t, rtol=1e-9)
        assert (linear.A[:, i, 0] == [0, 1]).all() and not linear.B[:, i, 0].any()


@pytest.mark.parametrize("rows", [1, 2, 3, 4, 5])
def test_where_nothing_is_held_deviations_stay_as_they_are(rows: int) -> None:
    motion: Any = SimpleNamespace(model=SimpleNamespace(nj=0))
    y = np.arange(4.0 * rows).reshape(rows, 4)
    kept = projection(motion, FREE, y, np.zeros(rows))
    np.testing.assert_array_equal(kept @ y[..., None], y[..., None])


@pytest.mark.parametrize(
    ("used", "needed", "size"),
    [
        ((0.5, -3.0), 2.0, 3.0),
        ((0.0, 0.0), 2.0, 2.0),
        ((1e-7, 0.0), 2.0, 2.0),  # of a millionth of what would be needed
        ((1e-5, 0.0), 2.0, 1e-5),
        ((0.0, 0.0), np.inf, 1.0),
        ((0.0, 4.0), np.inf, 4.0),
    ],
)
def test_an_input_that_is_never_used_has_the_size_that_would_be_needed(
    used: tuple[float, float], needed: float, size: float
) -> None:
    class Inputs(SimpleNamespace):
        def __len__(self) -> int:
            return len(self.u0)

    steps = [Inputs(u0=np.array([[one]]), u1=np.array([[other]])) for one, other in (used, (0, 0))]
    empty = Inputs(u0=np.zeros((0, 1)), u1=np.zeros((0, 1)))
    motion: Any = SimpleNamespace(steps=[*steps, empty], needed_inputs=np.array([needed]))
    assert input_sizes(motion) == pytest.approx([size])


def test_what_would_be_needed_accelerates_as_the_forces_do() -> None:
    """A spring of 8 N/m, 0.5 m from its rest, pulls with 4 N; the input acts twice."""
    m, k = sp.symbols("m k")
    system = dmoc.MechanicalSystem(
        "spring", [X], m * X.diff() ** 2 / 2 - k * X**2 / 2, {m: 2.0, k: 8.0}, [U],
        {X: 2 * U}, cost=U**2,
    )  # fmt: skip
    kernels = dmoc.build(system)
    run = dmoc.simulate(kernels, [0.5], step_size=0.01, steps=20)
    motion = Motion.of(run.trajectory, kernels, ENDLESS)
    assert motion.needed_inputs == pytest.approx([2.0], rel=1e-9)
