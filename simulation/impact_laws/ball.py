"""The hit of a ball with spin: the tangential impulse is opposite to the sliding velocity before
it, which keeps its direction (equation :eq:`ball` of the theory).

It is one of the plane of the normal and this direction, in which no impulse changes the rate of the
other.

R. L. Garwin, American Journal of Physics 37 (1969) 88-92.
"""

from __future__ import annotations

from dmoc.codegen.kernels import Array
from dmoc.motion.friction import SLIP, STICK
from dmoc.simulation.impact_laws.course import NONE, Coefficients, Impulses


def impulses(rates: Array, response: Array, coefficients: Coefficients) -> Impulses:
    """The impulses of an impact, of which only the whole is known, from the rates before it, of
    separation and of sliding (2,), the second one not negative, and the response A (2, 2), which is
    diagonal."""
    (n, s), (mu, e, e_t) = map(float, rates), coefficients
    if n >= 0:
        return NONE
    P, T = -(1 + e) * n / float(response[0, 0]), (1 + e_t) * s / float(response[1, 1])
    if mu * P >= T:
        return Impulses(P, -T, (STICK,), ())
    return Impulses(P, -mu * P, (SLIP,), ())
