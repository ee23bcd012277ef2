"""Stronge's law: the normal impulse of restitution does e^2 times the work that compression takes
(equation :eq:`stronge` of the theory).

W. J. Stronge, Proceedings of the Royal Society A 431 (1990) 169-181.
"""

from __future__ import annotations

import math

from dmoc.codegen.kernels import Array
from dmoc.simulation.impact_laws.course import Coefficients, HitState, Impulses, in_stages


def impulses(rates: Array, response: Array, coefficients: Coefficients) -> Impulses:
    """The impulses of an impact, from the rates before it, shape (2,), and the response, shape (2,
    2) (:func:`~dmoc.simulation.impact_laws.course.in_stages`)."""
    return in_stages(rates, response, coefficients, _left)


def _left(e: float, full: HitState, at: HitState, slope: float) -> float:
    """The impulse after which the rate is the one at which the work is done."""
    done, whole = at.W - full.W, -(e**2) * full.W
    last = math.sqrt(max(at.n**2 + 2 * slope * (whole - done), 0.0))
    return (last - at.n) / slope if slope else (whole - done) / at.n
