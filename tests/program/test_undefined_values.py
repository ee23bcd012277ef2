"""What of a program is no finite number, in words."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.program.transcription import Transcription
from dmoc.program.undefined_values import undefined_at

X, U = dynamicsymbols("x u")


@pytest.fixture(scope="module")
def nlp() -> Transcription:
    """The root of the input is the cost, the logarithm of the position is bounded."""
    system = unit_mass("undefined", cost=sp.sqrt(U), path_constraints={"log": sp.log(X) <= 1})
    return Transcription(dmoc.Problem(system, start={X: 1.0}, final_time=1.0, steps=3))


@pytest.mark.parametrize(
    ("x", "u", "reason"),
    [
        (1.0, 1.0, ""),
        (1.0, 0.0, "the derivative of the cost in u in step 1"),
        (1.0, -1.0, "the cost"),
        (-2.0, 1.0, "the row 'path constraint log at node 1'"),
        (np.nan, 1.0, ""),
    ],
)
def test_the_first_one_is_named(nlp: Transcription, x: float, u: float, reason: str) -> None:
    at, lay = np.ones(nlp.n), nlp.layout
    at[lay.index_q[1:3]], at[lay.index_u[1]] = x, u
    assert undefined_at(nlp, at) == reason
