"""Entry to the interior-point method in C, and to its factorisation."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from dmoc.codegen.kernels import Array
from dmoc.program.assembly import Program
from dmoc.solvers.kkt_layout import KKTLayout

Ints = NDArray[Any]

def interior_point(
    program: Program,
    layout: KKTLayout,
    size: Array,
    stretch: Array,
    x: Array,
    y: Array,
    z_lower: Array,
    z_upper: Array,
    *,
    price: Array | None = None,
    least_violation: bool = False,
    optimality: float,
    demanded: float,
    violation: float,
    least_cost: float,
    infeasible: float,
    mu: float,
    warm: bool,
    iterations: int,
    seconds: float,
    report: Callable[[int, float, float, float, bool], None],
    every: bool,
) -> dict[str, Any]: ...
def interior_points(
    program: Program,
    layout: KKTLayout,
    size: Array,
    stretch: Array,
    mu: Array,
    hurried: Ints,
    x: Array,
    y: Array,
    z_lower: Array,
    z_upper: Array,
    status: Ints,
    iterations: Ints,
    turn: Ints,
    stop: Ints,
    *,
    optimality: float,
    demanded: float,
    violation: float,
    least_cost: float,
    infeasible: float,
    most: int,
    seconds: float,
) -> None: ...

class Rows:
    def __init__(
        self,
        program: Program,
        layout: KKTLayout,
        elements: Sequence[tuple[Ints, ...]],
        numbers: tuple[Array, ...],
        point: tuple[Array, ...],
        ends: tuple[Ints, ...],
        of_form: tuple[Array, Array, Array, int],
        demands: Mapping[str, float],
        limits: Mapping[str, float],
    ) -> None: ...
    def solve(self, seconds: float) -> int: ...

def interior_memory(program: Any, layout: Any) -> int: ...
def kkt_pattern(
    place: Ints,
    size: int,
    hess_start: Ints,
    hess_column: Ints,
    jac_start: Ints,
    jac_column: Ints,
) -> dict[str, Ints]: ...
def left_over(
    slope: Array,
    reach: Array,
    x: Array,
    lower: Array,
    upper: Array,
    z: Array,
    c: Array,
    y: Array,
    d: Array,
    w: Array,
) -> tuple[float, float]: ...
def missed_by(x: Array, lower: Array, upper: Array, c: Array, d: Array) -> float: ...
def entries_of(layout: KKTLayout, hess: Array, jac: Array) -> tuple[Array, Array]: ...
def holding(
    x: Array,
    lower: Array,
    upper: Array,
    z: Array,
    d: Array,
    w: Array,
    equations: int,
    cost: float,
    *,
    clearly: float,
    noise: float,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]: ...
def largest_bend(
    layout: KKTLayout, hess: Array, weights: Array, lower: Array, upper: Array
) -> float: ...
def signs(
    layout: KKTLayout,
    factorisation: Factorisation,
    hess: Array,
    jac: Array,
    active: NDArray[np.bool_],
    curvatures: Array,
    equations: int,
    *,
    fixed: float,
    relaxed: float,
    held: float,
    idle: float,
) -> tuple[int, int]: ...
def left_by_barrier(
    x: Array, lower: Array, upper: Array, z: Array, d: Array, w: Array
) -> float: ...

class Room:
    factorisation: Factorisation
    nbytes: int
    def __init__(self, program: Program, layout: KKTLayout) -> None: ...

class Factorisation:
    size: int
    entries: int
    nbytes: int
    @overload
    def __init__(self, first: Ints, start: Ints, row: Ints) -> None: ...
    @overload
    def __init__(self, *, like: Factorisation) -> None: ...
    def analysis(self) -> dict[str, Any]: ...
    def factor(self, values: Array, tiny: float = ...) -> tuple[int, int, int]: ...
    def solve(self, right: Array) -> Array: ...
