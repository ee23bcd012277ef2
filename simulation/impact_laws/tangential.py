"""Tangential restitution after Chatterjee and Ruina, from the rates before a hit.

Of the hit that stops all at once, plastic and without sliding, the tangential impulse is T_0.  The
hit itself has T = (1 + e_t) T_0, cut to what friction holds, |T| <= mu lam, and the normal impulse
lam with which the gap opens by Newton's law.  No energy grows for 0 <= e <= 1 and -1 <= e_t <= 1,
whatever the inertia (equation :eq:`tangential-energy` of the theory).

A. Chatterjee and A. Ruina, Journal of Applied Mechanics 65 (1998) 939-951.
"""

from __future__ import annotations

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.motion.friction import STICK, sliding_against
from dmoc.simulation.impact_laws.course import NONE, Coefficients, Impulses


def impulses(rates: Array, response: Array, coefficients: Coefficients) -> Impulses:
    """The impulses of an impact, of which only the whole is known, from the rates before it, of
    separation and of sliding (2,), and the response A (2, 2)."""
    (n, t), (mu, e, e_t) = map(float, rates), coefficients
    if n >= 0:
        return NONE
    A_nn, A_nt, A_tt = (float(response[i]) for i in ((0, 0), (0, 1), (1, 1)))
    free = A_tt - A_nt**2 / A_nn  # what a tangential impulse moves where the gap keeps its rate
    # A tangent that moves with the gap alone has nothing to come back along it.
    T_0 = -(t - A_nt / A_nn * n) / free if free > SAME * A_tt else 0.0
    T = (1 + e_t) * T_0
    lam = (-(1 + e) * n - A_nt * T) / A_nn
    if np.isinf(mu) or abs(T) <= mu * lam:
        return Impulses(lam, T, (STICK,), ())
    back = float(np.sign(T))
    lam = -(1 + e) * n / (A_nn + back * mu * A_nt)
    return Impulses(lam, back * mu * lam, (sliding_against(back),), ())
