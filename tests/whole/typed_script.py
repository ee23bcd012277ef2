"""What a script with types does with dmoc: not run, but read by mypy, which `make check` calls.

What the public functions return must be known to its type, and what the manual passes accepted.
"""

from __future__ import annotations

from pathlib import Path
from typing import assert_type

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import dmoc
from dmoc.check.verdict import Verification
from dmoc.codegen.kernels import Kernels
from dmoc.motion.states import State
from dmoc.sequences.nodes import Node
from dmoc.sequences.search import SearchResult
from dmoc.solvers.outcome import Status


def stated(system: dmoc.MechanicalSystem) -> dmoc.Problem:
    assert_type(dmoc.build(system), Kernels)
    problem = dmoc.Problem(
        system, start={"x": 0.0}, goal={"x": 0.0, "y": (0.5, None)}, sequence=["wall"],
        final_time=(0.5, None), durations=[None, (0.1, 0.6)], bounds={"u": (-5, 5)},
        restitution={"wall": 0.8},
    )  # fmt: skip
    return assert_type(problem.but(final_time=1.0, restitution=0.5), dmoc.Problem)


def refused(kernels: Kernels) -> None:
    dmoc.Problem(kernels, final_time="soon")  # type: ignore[arg-type]
    dmoc.Problem(kernels, restitution="much")  # type: ignore[arg-type]


def solved(problem: dmoc.Problem) -> dmoc.Solution:
    costs: list[float] = []
    solution = dmoc.solve(problem, "ipm", progress=lambda news: news.cost in costs)
    assert_type(solution.status, Status)
    assert_type(solution.phases[0].q, NDArray[np.float64])
    assert_type(solution.collisions[0].impulse, float)
    assert_type(solution.at(0.3), State)
    assert_type(solution.verify(), Verification)
    assert_type(solution.plot(), Figure)
    assert_type(solution.animate("motion.html"), Path)
    assert_type(solution.save("solution.npz"), Path)
    return assert_type(dmoc.Solution.load("solution.npz"), dmoc.Solution)


def searched(problem: dmoc.Problem) -> None:
    result = assert_type(dmoc.search(problem, max_collisions=2), SearchResult)
    assert_type(result.best, Node | None)
    assert_type(result.plot_best(), Figure)


def varied(problem: dmoc.Problem, solution: dmoc.Solution) -> None:
    batch = dmoc.sweep(problem, {"m": np.linspace(0.5, 1.5, 5)}, guess=solution)
    batch = dmoc.sweep(problem, {"m": [0.5, 1]}, bounds={"u": [(-5, 5), (-9, 9)]}, keep=True)
    assert_type(batch.cost, NDArray[np.float64])
    assert_type(batch.solutions, tuple[dmoc.Solution | None, ...])
    assert_type(dmoc.solve_many([problem], guess=solution), dmoc.Batch)
    assert_type(dmoc.sensitivities(problem, solution)["final_time"], float)
    assert_type(dmoc.certify(problem, solution).proved, bool)
    assert_type(dmoc.prove(problem).bound, float)


def simulated(solution: dmoc.Solution, kernels: Kernels) -> None:
    fallen = dmoc.simulate(kernels, {"x": 0.0}, {"x": 2.0}, step_size=0.01, steps=100)
    assert_type(fallen, dmoc.Simulation)
    assert_type(dmoc.simulate(solution).collisions[0].time, float)
    assert_type(dmoc.animate([solution, fallen], "both.html"), Path)
