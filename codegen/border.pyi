"""The border to compiled kernels."""

from os import PathLike
from typing import Any

from numpy import float64
from numpy.typing import ArrayLike, NDArray

class Function:
    def __call__(self, *arrays: NDArray[float64]) -> None: ...
    def rows(self, inputs: tuple[ArrayLike, ...]) -> tuple[NDArray[float64], ...]: ...

class Library:
    path: str
    code: str
    table: Any
    def __init__(self, path: str | PathLike[str], model: str) -> None: ...
    def functions(self) -> dict[str, Function]: ...
