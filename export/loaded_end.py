"""What a loaded solver leaves, and room for it."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dmoc.codegen.kernels import Array

COUNTS, HEAD = 4, 3  # of an end, as dmoc_loaded.c has them


@dataclass(frozen=True, eq=False)
class LoadedEnd:
    """How a solve of a loaded solver has ended.

    Attributes
    ----------
    status, message : str
        "solved", "infeasible", "iteration_limit", "time_limit", "stalled" or "interrupted" as those
        of a solution; "outside" where the motion penetrates a surface, leaves what holds it, moves
        where it sticks or slides against its direction; "unphysical" where a mass, friction or
        restitution along it is none; in a batch "refused" where a number does not fit, and
        "not_tried".
    cost, optimality, violation : float
        In the unit of the cost; relative to the cost; relative to the size of the constraint.
    iterations, starts : int
    t : array, shape (nodes,)
        Times in seconds.
    tables : mapping of str to array
        The tables of the header: unknowns, then momenta, velocities and forces, which have a row
        for every node of every phase, two at an event.
    multipliers : mapping of str to array
        "rows" of the constraints (c | d) and "bounds" of the unknowns, in
        L = f + rows . (c | d) - bounds . x.
    """

    status: str
    message: str
    cost: float
    optimality: float
    violation: float
    iterations: int
    starts: int
    t: Array
    tables: Mapping[str, Array]
    multipliers: Mapping[str, Array]

    def __repr__(self) -> str:
        return f"LoadedEnd({self.status}, cost={self.cost:.6g}, iterations={self.iterations})"


class Ends:
    """Room for ends, as dmoc_loaded.c writes them."""

    def __init__(self, count: int, row: int) -> None:
        self.rows, self.counts = np.zeros((count, row)), np.full((count, COUNTS), -1, np.intc)
        self.expected = (ctypes.c_char_p * count)()

    def at(self, k: int) -> tuple[Any, Any, Any]:
        """Where those from number k on are written."""
        words = ctypes.byref(self.expected, k * ctypes.sizeof(ctypes.c_char_p))
        return address(self.rows[k:]), address(self.counts[k:]), words


def address(array: np.ndarray[Any, Any]) -> int:
    """Address of an array of any shape (...), which has to outlive the call."""
    return int(array.ctypes.data)
