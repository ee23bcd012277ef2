"""Motions along plans, step by step."""

from dmoc.codegen.kernels import Array
from dmoc.guess.waypoints import Waypoints
from dmoc.problem.problem import Problem

WINDOW: float
RUNAWAY: float

class Marcher:
    nq: int
    nu: int
    cost: float
    excess: float
    free_steps: int
    def __init__(self, problem: Problem) -> None: ...
    def control(self, q: Array, prescribed: tuple[int, ...]) -> float: ...
    def trials(
        self, plans: Waypoints, steps: tuple[int, ...], prescribed: tuple[int, ...]
    ) -> tuple[Array, Array]: ...
    def motion(
        self, plan: Waypoints, steps: tuple[int, ...], prescribed: tuple[int, ...]
    ) -> tuple[Array, Array, Array, Array, Array, Array, Array] | None: ...
