"""Where a function changes its sign."""

from __future__ import annotations

from collections.abc import Callable

MOST_STEPS = 200  # bisection alone needs about 50 to exhaust the digits of a number


def crossing(
    f: Callable[[float], float],
    low: tuple[float, float],
    high: tuple[float, float],
    tolerance: float,
) -> float:
    """A root of f between two points (x, f(x)) of different signs, to a tolerance in x.

    Inverse quadratic interpolation through the last three points where these lie well, bisection
    where they do not (T. R. Chandrupatla, Advances in Engineering Software 28 (1997) 145-149).
    """
    (a, f_a), (b, f_b) = low, high
    share = 0.5
    for _ in range(MOST_STEPS):
        x = a + share * (b - a)
        f_x = f(x)
        if (f_x > 0) == (f_a > 0):
            c, f_c = a, f_a
        else:
            c, f_c, b, f_b = b, f_b, a, f_a
        a, f_a = x, f_x
        least = 0.5 * tolerance / abs(b - a) if b != a else 1.0
        if f_a == 0 or least > 0.5:
            break
        xi, phi = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b)
        if phi**2 < xi and (1 - phi) ** 2 < 1 - xi:
            share = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (
                f_c - f_a
            ) * f_b / (f_c - f_b)
        else:
            share = 0.5
        share = min(max(share, least), 1 - least)
    return a if abs(f_a) < abs(f_b) else b
