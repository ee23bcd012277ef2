"""The continuous equations of motion, integrated row by row, compiled."""

from collections.abc import Callable

from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.model import Index

class Integrator:
    def __init__(
        self,
        kernels: Kernels,
        par: Array,
        size: Array,
        small_time: float,
        check_time: Callable[[], None],
    ) -> None: ...
    def advance(
        self,
        y: Array,
        first: Index,
        last: Index,
        t: Array,
        h: Array,
        u0: Array,
        u1: Array,
        held: int = -1,
    ) -> Array: ...
    def gap_acceleration(self, y: Array, a: Array, t: float, j: int) -> float: ...
    def between(self, y0: Array, ends: Array, y1: Array, h: Array, shares: Array) -> Array: ...
    def quiet(
        self,
        y: Array,
        t: Array,
        h: Array,
        u0: Array,
        u1: Array,
        k: int,
        end: int,
        shares: Array,
        upper: Array,
        near: Array,
        q_wanted: Array,
        astray: Array,
    ) -> tuple[int, bool]: ...
