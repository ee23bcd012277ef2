"""The check of motions that are free between hits, compiled."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.discretisation import Discretisation
from dmoc.codegen.kernels import Array, Kernels

class FreeMotion:
    sizes: Array
    size_p: Array
    size_gap: Array
    size_rate: Array
    energy_size: float
    acceleration: float
    def __init__(self, kernels: Kernels, scheme: Discretisation) -> None: ...
    def measured(
        self,
        par: Array,
        motion: tuple[Any, ...],
        claim: float,
        check_time: Callable[[], None],
    ) -> tuple[tuple[float, ...], Array, float, list[tuple[int, float, float]]] | None: ...
    def judge(
        self,
        par: Array,
        motions: tuple[Any, ...],
        claims: Array,
        most: Array,
        verdicts: NDArray[np.uint8],
        check_time: Callable[[], None],
    ) -> None: ...
