"""The continuous equations of motion, integrated row by row, compiled."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.bound_kernels import Index
from dmoc.mechanics.contact_mode import Mode
from dmoc.simulation.contact_modes import Reaction

class Integrator:
    sizes: Array
    worst: float
    def __init__(
        self,
        kernels: Kernels,
        par: Array,
        size: Array,
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
        mode: Mode | None = None,
        anchors: Array | None = None,
        coarse: bool = False,
        course: Array | None = None,
    ) -> Array: ...
    def grip(
        self, gripped: Sequence[int], strong: Sequence[tuple[tuple[int, ...], float]]
    ) -> None: ...
    def project(
        self, mode: Mode, y: Array, t: Array, anchors: Array, rates: bool = True
    ) -> None: ...
    def reaction(self, mode: Mode, y: Array, u: Array, t: Array) -> Reaction: ...
    def stay(
        self, mode: Mode, y: Array, u: Array, h: float, first: int, shares: Array, largest: Array
    ) -> tuple[Array, Array, Array]: ...
    def between(self, y0: Array, ends: Array, y1: Array, h: Array, shares: Array) -> Array: ...
    def meets(
        self,
        start: Array,
        ends: Array,
        stop: Array,
        t: Array,
        h: Array,
        shares: Array,
        upper: Array,
        near: Array,
    ) -> NDArray[np.bool_]: ...
    def gap(
        self,
        y: Array,
        t: float,
        h: float,
        u0: Array,
        u1: Array,
        surface: int,
        mode: Mode | None = None,
    ) -> float: ...
    def quiet(
        self,
        y: Array,
        t: Array,
        h: Array,
        u0: Array,
        u1: Array,
        first: int,
        last: int,
        shares: Array,
        upper: Array,
        near: Array,
        q_wanted: Array,
        astray: Array,
    ) -> tuple[int, bool]: ...
