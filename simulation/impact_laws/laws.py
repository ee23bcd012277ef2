"""The laws of impact by their names."""

from __future__ import annotations

from collections.abc import Callable

from dmoc.codegen.kernels import Array
from dmoc.motion.impact_laws import POISSON, RETURNING
from dmoc.simulation.impact_laws import poisson, tangential
from dmoc.simulation.impact_laws.course import Coefficients, Impulses

LAWS: dict[str, Callable[[Array, Array, Coefficients], Impulses]] = {
    POISSON: poisson.impulses,
    RETURNING: tangential.impulses,
}
