"""A hit with tangential restitution after Chatterjee and Ruina, from the rates before it.

Of the hit that stops all at once, plastic and without sliding, the tangential impulse is T_0.  The
hit itself has T = (1 + e_t) T_0, cut to what friction holds, |T| <= mu lam, and the normal impulse
lam with which the gap opens by Newton's law.  No energy grows for 0 <= e <= 1 and -1 <= e_t <= 1,
whatever the inertia (equation :eq:`tangential-energy` of the theory).

A. Chatterjee and A. Ruina, Journal of Applied Mechanics 65 (1998) 939-951.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import STICK


class Returned(NamedTuple):
    """Impulses along normal and tangent (2,) of the hit that stops all at once and of the hit, and
    how it ends: it sticks, or slides in a direction."""

    stopping: Array
    impulses: Array
    friction: int


def is_bound(A: Array) -> bool:
    """Whether a tangent moves with the gap alone, so that nothing is left to come back along it."""
    return not A[1, 1] * A[0, 0] - A[0, 1] ** 2 > SAME * A[1, 1] * A[0, 0]


def returned(rates: Array, A: Array, mu: float, e: float, e_t: float) -> Returned:
    """The hit from the rates of separation, negative where the bodies approach, and of sliding
    (2,), and what impulses along normal and tangent change them by, A (2, 2)."""
    n, sigma = float(rates[0]), float(rates[1])
    along = A[0, 1] / A[0, 0]
    T_0 = 0.0 if is_bound(A) else -(sigma - along * n) / (A[1, 1] - along * A[0, 1])
    stopping = np.array([-n / A[0, 0] - along * T_0, T_0])
    T, s = (1 + e_t) * T_0, STICK
    lam = -(1 + e) * n / A[0, 0] - along * T
    if mu < np.inf and abs(T) > mu * lam:
        s = -int(np.sign(T))
        lam = -(1 + e) * n / (A[0, 0] - s * mu * A[0, 1])
        T = -s * mu * lam
    return Returned(stopping, np.array([lam, T]), s)
