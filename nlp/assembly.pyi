"""The nonlinear program as C data."""

from collections.abc import Sequence
from typing import Any

from dmoc.codegen.kernels import Array, Kernels

class Program:
    compiled: bool
    def __init__(
        self,
        kernels: Kernels,
        bounds: tuple[Array, Array],
        equalities: int,
        m: int,
        unit: Array,
        par: Array,
        passes: Sequence[Any],
        jacobian: tuple[Any, Any],
        hessian: tuple[Any, Any],
    ) -> None: ...
    def capsule(self) -> Any: ...
    def values(self, x: Array) -> Array: ...
    def slopes(self, x: Array) -> Array: ...
    def curvatures(self, x: Array, y: Array, sigma: float) -> Array: ...
