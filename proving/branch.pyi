"""Branch and bound over the durations of a problem that is linear between its events."""

from dmoc.codegen.kernels import Array
from dmoc.proving.linear import LinearProblem

MOST_WORKERS: int
LIMITS: tuple[int, int, int, int, int, int]

class Branch:
    def __init__(
        self,
        linear: LinearProblem,
        best: float,
        limit: float,
        gap: float,
        least_gap: float,
        scale: float,
        keep: int = 0,
        workers: int = 1,
    ) -> None: ...
    def run(self, boxes: int) -> bool: ...
    def state(self) -> dict[str, Array]: ...
    def restore(self, waiting: Array, leaves: Array, numbers: Array) -> None: ...
    @property
    def bound(self) -> float: ...
    @property
    def best(self) -> float: ...
    @property
    def durations(self) -> Array: ...
    @property
    def boxes(self) -> int: ...
    @property
    def leaves(self) -> Array | None: ...
    @property
    def waiting(self) -> int: ...
