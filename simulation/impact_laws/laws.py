"""The laws of impact by their names."""

from __future__ import annotations

from collections.abc import Callable

from dmoc.codegen.kernels import Array
from dmoc.motion.impact_laws import BALL, POISSON, RETURNING, STRONGE
from dmoc.simulation.impact_laws import ball, poisson, stronge, tangential
from dmoc.simulation.impact_laws.course import Coefficients, Impulses

LAWS: dict[str, Callable[[Array, Array, Coefficients], Impulses]] = {
    POISSON: poisson.impulses,
    STRONGE: stronge.impulses,
    RETURNING: tangential.impulses,
    BALL: ball.impulses,
}
