"""What calls of Python refuse: one sentence with these words, and nothing written."""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from pathlib import Path
from typing import Any

import block_and_wall
import pytest
import sympy as sp
from films import motion
from refusals import refusal_test
from systems import dropped_ball

import dmoc
from dmoc.cli.option_values import read_guess
from dmoc.models.registry import find

# Below each error and call: arguments, and words of the message; ... stands for anything.
TABLE = r"""
ProblemError: dmoc.solve(seed, ...)
    tolerance="a" | tolerance = 'a': expected a positive number
    seconds="x" | seconds = 'x': expected a positive time limit
    iterations=None | iterations = None: expected a whole number of at least 1
    progress=3 | progress = 3: expected a function
    guess=1j | guess = 1j: expected a Solution
    verbose=True | unknown argument 'verbose' of solve: ... (did you mean 'progress'?)
    timeout=5 | unknown argument 'timeout' of solve ... (did you mean 'seconds'?)
    bounds={} | unknown argument 'bounds' of solve ... (an argument of dmoc.Problem, dmoc.sweep)
    "ipm", 1e-3 | this call of solve does not fit it, too many positional arguments: expected
        solve(problem, method, tolerance=..., ... , reference=...)
    problem=3 | this call of solve does not fit it, multiple values for argument 'problem'
    method="newton" | expected one of slsqp, ipm, ipopt, uno
    form="x" | condensed, full
    iterations=0 | at least 1
    violation=0.0 | positive
ProblemError: many(...)
    problems=[1] | problems has 1 at place 0: expected Problems
    method="imp" | method = 'imp': expected one of
    workers=0 | workers = 0: expected a whole number of at least 1
    seconds=-1 | seconds = -1: expected a positive time limit
    keep="no" | keep = 'no': expected True or False
    progress=1 | progress = 1: expected a function
    reference="x" | unknown argument 'reference' of solve_many: expected one of ... (an argument of
        dmoc.load, dmoc.solve)
    iteration=5 | unknown argument 'iteration' of solve_many ... (did you mean 'iterations'?)
    steps=5 | unknown argument 'steps' of solve_many ... (an argument of dmoc.Problem, dmoc.sim
ProblemError: dmoc.sweep(block, ...)
    parameters={} | nothing is varied
    parameter={"m": [1.0]} | unknown argument 'parameter' of sweep ... (did you mean 'parameters'?)
    verbos=1 | unknown argument 'verbos' of sweep: expected one of problem, parameters, start, goal,
        bounds, design, method, workers, executor, guess, keep, seconds, progress, form, iterations
    parameters={"mass": [1.0]} | unknown parameter 'mass' in parameters
    parameters={"m": 1.0} | parameters of m = 1.0: expected a list of values
    start={"x": []} | start of x has no values
    parameters={"m": range(2000), "wall": range(2000)} | the sweep has 4000000 problems
SearchError: search(...)
    max_collisions=-1 | at least 0
    max_collisions=40 | at most 12
    strategy="random" | tree, best-first, beam
    surface=["east"] | unknown argument 'surface' of search ... (did you mean 'surfaces'?)
    verbose=True | unknown argument 'verbose' of search ... (did you mean 'progress'?)
    surfaces=["up"] | unknown surface 'up'
    workers=0 | at least 1
    method="newton" | slsqp
    resume=True | name it
    node_seconds=0.0 | positive
    shortest_phase=-1.0 | 0 or more
    max_nodes=0 | at least 1
    max_nodes=2.5 | whole number
    seconds=-5.0 | positive
    seconds=nan | positive
    seed=-1 | at least 0
    surfaces=["east", "east"] | each surface once
    surfaces=[] | at least one of
    surfaces="east" | expected a list
SimulationError: simulate(...)
    kernels=None | expected a MechanicalSystem, or the kernels
    kernels="ball" | expected a MechanicalSystem, or the kernels
    positions=[1.0] | unknown argument 'positions' of simulate ... (did you mean 'position'?)
    velocity=[1e150] | velocity of q = 1e+150: expected a magnitude of at most 1e100
    dt=0.1 | unknown argument 'dt' of simulate ... (did you mean 'step_size'?)
    tolerance=0.1 | unknown argument 'tolerance' of simulate ... (an argument of
        dmoc.Planner, dmoc.solve)
    kernels=5 | expected a MechanicalSystem, or the kernels
    position=[-0.1] | lies behind surface 'floor'
    position=[-0.1], step_size=1e6 | lies behind surface 'floor' by 0.1
    position=[1.0, 2.0] | expected 1 finite numbers
    position={"z": 1.0} | unknown coordinate 'z' in position: expected one of q
    step_size=0.0 | positive number of seconds
    steps=0 | at least 1
    parameters={"mass": 1.0} | unknown parameter 'mass'
    parameters={"m": 10**400} | parameter m = 1000 ... : expected a finite number
    parameters={"m": -1.0} | mass matrix at t = 0 s is singular or not positive definite
    parameters="m" | expected a mapping
    position=None | position = None: expected 1 finite numbers
    position="1" | position = '1': expected 1 finite numbers
    position=["1"] | expected 1 finite numbers
    position=[1j] | expected 1 finite numbers
    position=[10**400] | expected 1 finite numbers
    position={"q": None} | expected 1 finite numbers
    velocity=[nan] | velocity = ... expected 1 finite numbers
    step_size=None | step_size = None: expected a positive number
    step_size=True | step_size = True: expected a positive number
    step_size=10**5000 | step_size = a value of type int: expected a positive number
    step_size=1e305, steps=10**5 | a finite time of all steps
    step_size=1e-300, velocity=[1.0] | less than a rounding error of the coordinates
    step_size=1e300, velocity=[1.0] | has no solution: change the step size
    steps=5.0 | steps = 5.0: expected a whole number
    steps=True | steps = True: expected a whole number
    steps=10**30 | steps = 1000000000000000000000000000000: expected at most 1000000000000
    steps=10**9 | recording 1000000001 nodes needs 80 GB of memory
    every=None | every = None: expected a whole number
    inputs="no" | inputs: expected numbers of shape (5, 0) or (0,)
    inputs=[1.0, 2.0] | inputs: expected numbers of shape
    restitution="elastic" | restitution = 'elastic': expected a number from 0
    restitution={"floor": None} | restitution of 'floor' = None: expected a number from 0
    restitution={None: 1.0} | restitution of 'None': unknown surface, expected one of floor
ProblemError: animate(...)
    speed=0 | speed = 0: expected a positive number
    speed="fast" | speed = 'fast'
    fps=0 | fps = 0: expected a whole number of at least 1
    fps=2.5 | fps = 2.5
    motions=[] | there are no motions
    motions=3 | motions = 3: expected solutions
    motions=[3] | motions = 3: expected solutions
OutputError: animate(...)
    style="grey" | style = 'grey'
    path="s.avi" | has no known format: end it in .html, .gif or .mp4
    path="s" | has no known format
    path="s.gif", speed=1e-3, fps=60 | would have 90000 frames
    path="nowhere/s.html" | cannot be written
ProblemError: guessed(...)
    {"beta": 1.0} | unknown coordinate or input 'beta' in the guess
    {"alpha": "up"} | guess: alpha = 'up': expected a number, a list of keyframes
    {"alpha": []} | guess: alpha = []: expected a number, a list of keyframes
    {"alpha": [0, nan]} | guess: alpha, keyframe 1 = nan: expected a finite number
    {"durations": [1.0]} | guess: durations = [1.0]: expected 2 times in seconds
    {"durations": [1.0, 0]} | guess: durations 1 = 0: expected a positive time in seconds
    [{"F": 1}] | guess has 1 parts: expected one mapping, or one for each of the 2 phases
    {} | guess = {}: expected the name of a coordinate or an input
    [{}, {}] | guess = [{}, {}]: expected the name of a coordinate or an input
    [{"F": 1}, 3] | guess of phase 1 = 3: expected a mapping from names
    {"F": lambda t: t[:2]} | guess: F: the function gave array(
    {"F": lambda t: 0 * t / 0} | guess: F: the function gave nan at t =
    {"F": 1, sp.Symbol("F"): 2} | guess gives 'F' twice
ProblemError: read_guess(...)
    ["alpha=1,up"] | --guess alpha = 'up': expected numbers such as
    ["alpha="] | --guess alpha = '': expected numbers such as
    ["=1"] | --guess =1: expected NAME=V1,V2,..., each name once.
    ["F=1", "F=2"] | --guess F=2: expected NAME=V1,V2,..., each name once.
    ["known.npz", "F=1"] | --guess known.npz stands beside others: give one file
"""


def simulate(**arguments: Any) -> dmoc.Simulation:
    keywords = {"kernels": dropped_ball(), "position": [1.0], "step_size": 0.1, "steps": 5}
    return dmoc.simulate(**(keywords | arguments))


def animate(**arguments: Any) -> Path:
    return dmoc.animate(**({"motions": motion(), "path": "s.html"} | arguments))


@pytest.fixture(scope="module")
def names(seed: dmoc.Problem) -> dict[str, Any]:
    """What the calls of the table take."""
    block, table = block_and_wall.problem(0.8, 10, 4), find("puck_table")
    pucks = dmoc.Problem(table.kernels(), **{**table.defaults, "steps": 20})
    calls: dict[str, Callable[..., object]] = {
        "many": lambda **a: dmoc.solve_many(**{"problems": [block], **a}),
        "search": lambda **a: dmoc.search(pucks, **{"max_collisions": 1, **a}),
        "guessed": lambda guess: dmoc.solve(seed.but(steps=(8, 12)), "ipm", guess=guess),
        "simulate": simulate, "animate": animate, "read_guess": read_guess,
    }  # fmt: skip
    return {"dmoc": dmoc, "seed": seed, "block": block, "nan": nan, "sp": sp} | calls


test_it_is_refused_in_one_sentence = refusal_test(TABLE)
