"""The nonlinear program as C data."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dmoc.codegen.kernels import Array, Kernels
from dmoc.program.arrays import Positions, ProgramData

class Program:
    compiled: bool
    data: ProgramData
    def __init__(
        self, kernels: Kernels, data: ProgramData, like: Program | None = None
    ) -> None: ...
    def capsule(self) -> Any: ...
    def values(self, x: Array) -> Array: ...
    def slopes(self, x: Array) -> Array: ...
    def curvatures(self, x: Array, y: Array, sigma: float) -> Array: ...

def transposed_product(
    start: NDArray[Any], column: NDArray[Any], values: Array, y: Array, columns: int
) -> Array: ...
def strided(at: Positions) -> tuple[int, int] | None: ...
def pattern(
    row: Positions, column: Positions, rows: int, columns: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], Positions]: ...
def products(
    left: Array,
    rows: NDArray[Any],
    right: Array,
    columns: NDArray[Any],
    factors: Array,
    places: NDArray[Any],
) -> Array: ...
def on_limits(x: Array, sizes: Array, lower: Array, upper: Array, rounding: float) -> Array: ...
