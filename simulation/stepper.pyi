"""The variational integrator with collisions, compiled."""

from typing import Any

from dmoc.codegen.kernels import Array, Kernels
from dmoc.simulation.simultaneous_impacts import Impacts

class Stepper:
    nq: int
    nu: int
    nc: int
    ni: int
    collisions: list[list[Any]]
    undecided: list[tuple[int, float, Array, Array, Impacts]]
    unfinished: tuple[int, tuple[Array, Array, Array]]
    def __init__(self, kernels: Kernels, par: Array, restitution: Array) -> None: ...
    def run(
        self, q0: Array, p0: Array, u: Array, h: float, every: int
    ) -> tuple[Array, Array, Array]: ...
