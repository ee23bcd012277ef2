"""Branch and bound over the durations of a problem that is linear between its events."""

from dmoc.codegen.kernels import Array
from dmoc.proving.linear import LinearProblem

LIMITS: tuple[int, int, int, int]

class Branch:
    def __init__(
        self,
        linear: LinearProblem,
        best: float,
        limit: float,
        gap: float,
        least_gap: float,
        scale: float,
    ) -> None: ...
    def run(self, boxes: int) -> bool: ...
    def state(self) -> tuple[Array, Array]: ...
    def restore(self, waiting: Array, numbers: Array) -> None: ...
    @property
    def bound(self) -> float: ...
    @property
    def best(self) -> float: ...
    @property
    def durations(self) -> Array: ...
    @property
    def boxes(self) -> int: ...
    @property
    def waiting(self) -> int: ...
