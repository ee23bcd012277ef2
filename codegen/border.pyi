"""The border to compiled kernels."""

from typing import Any

from numpy import float64
from numpy.typing import NDArray

class Function:
    def __call__(self, *arrays: NDArray[float64]) -> None: ...

def functions(capsule: Any) -> dict[str, Function]: ...
