"""Poisson's law: the normal impulse of restitution is e times that of compression (equation
:eq:`poisson` of the theory).

Y. Wang and M. T. Mason, Journal of Applied Mechanics 59 (1992) 635-642.
"""

from __future__ import annotations

from dmoc.codegen.kernels import Array
from dmoc.simulation.impact_laws.course import Coefficients, HitState, Impulses, in_stages


def impulses(rates: Array, response: Array, coefficients: Coefficients) -> Impulses:
    """The impulses of an impact, from the rates before it, shape (2,), and the response, shape (2,
    2) (:func:`~dmoc.simulation.impact_laws.course.in_stages`)."""
    return in_stages(rates, response, coefficients, _left)


def _left(e: float, full: HitState, at: HitState, slope: float) -> float:
    """The normal impulse that is left of restitution, whatever the friction."""
    return (1 + e) * full.P - at.P
