"""What calls of Python refuse: one sentence with these words, and nothing written."""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from pathlib import Path
from typing import Any

import block_and_wall
import numpy as np
import pytest
import sympy as sp
from contact_problems import floor
from films import motion
from hit_problems import back
from joint_problems import bob
from sympy.physics.mechanics import dynamicsymbols
from systems import dropped_ball

import dmoc
from dmoc.base import errors
from dmoc.cli.option_values import read_guess, read_periodic
from dmoc.mechanics.contacts import Contacts
from dmoc.mechanics.sequence_words import mode_of, touch_along
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
ProblemError: on_floor(...)
    contacts=["floor"], start={"x": 0, "y": 0.1} | 0.1 off it
    contacts=["floor"], start={"x": 0, "y": 0, "y_dot": 1} | velocity leaves or enters it
    contacts=["floor"], start={"x": 0, "y": 0, "x_dot": 1} | velocity slides
    contacts=["floor"], parameters={"mu": -0.1} | friction of 'floor' is -0.1
    contacts=["floor"], sequence=["floor:slip+:stick"] | floor is closed or a rail
    sequence=["-floor"], start={"x": 0, "y": 1} | is not closed
    contacts=["floor"], via=[{}] | via has 1 entries
    contacts=["floor"], sequence=["-floor"], via=[{"z": 1}] | unknown coordinate
    ignored=["roof"] | unknown surface 'roof'
    periodic={"x": ("y", "far")} | the difference of x in periodic
    periodic={"x": ("x", 1, 2)} | or a pair of one of them and a difference such as ('x', 0.5)
    periodic={"x": X**2} | where x(t)**2 is no state times a number
    periodic={"x": 0 * X + 1} | no state at the start enters: state it in the goal
    periodic={"x": X + sp.I} | the difference of x in periodic
    periodic={"x": {"x": -1, "w": 2}} | unknown state 'w' in periodic
    periodic={"x": {"x": "far"}} | the factor of x in periodic = 'far': expected a number
    contacts=["floor:slip+"], start={"x": 0, "y": 0, "x_dot": -1} | 'floor:slip+' begins with a
        sliding velocity of -1 per second, against its direction: say 'floor:slip-'
    sequence=["+floor"], start={"x": 0, "y": 1}, via=[{"x": 9}], bounds={"x": (0, 1)} | via of event
        1: x = 9 lies outside its bounds 0 to 1
    contacts=["floor"], sequence=["+floor"] | floor is closed already
    start={"x": 0, "y": 1}, durations=[0] | durations of phase 0 = 0: expected a positive time
    start={"x": 0, "y": 1}, sequence=["+floor", "-floor"], durations=[None, 0, None] | durations of
        phase 1 = 0: expected a positive time; only the last of several phases may have the duration
        0, which ends the motion with its last event, and what happens at one instant is one event
    contacts=["floor"], sequence=["-floor"], durations=[None, 0] | the motion ends with event 1
        (-floor), at which nothing is hit or lands, so that its state is the same before and after
        it: leave the event out, or give the last phase a duration
    start={"x": 0, "y": 1}, sequence=["+floor"], durations=[None, 0], steps=[9, 9] | steps of phase
        1 = 9: expected 0, because its duration is 0
    start={"x": 0, "y": 1}, sequence=["+floor"], steps=[9, 0] | steps of phase 1 = 0: expected a
        whole number of at least 2
    start={"x": 0, "y": 1}, sequence=["+floor"], durations=[None, (None, 0)] | durations of phase 1
    contacts=["floor"], sequence=["floor:slide"] | expected stick, slip+ or slip-
    contacts=["floor", "floor:slip+"] | contacts names 'floor' twice
ModelError: rubbing(...)
    surface={} | unknown argument 'surface' of MechanicalSystem ... (did you mean 'surfaces'?)
    friction={"rail": F} | has friction but no tangent
    tangents={"rail": X} | has a tangent but no friction
    tangents={"rail": F}, friction={"rail": F} | contains no coordinate
    tangents={"rail": X}, friction={"rail": -1} | expected 0 or a positive
    tangents={"rail": X}, friction={"rail": X.diff()} | the friction of 'rail' contains
ProblemError: back(...)
    sequence=["floor:slip+:stick:late"], restitution=0 | leave out ':late'
    sequence=["floor:stick"], parameters={"mu": 0} | the friction of 'floor' is 0
    sequence=["floor:slip+:slip+"] | expected stick, slip+ or slip-
ModelError: bob_with(...)
    {"rod": X <= 1} | constraint 'rod' is not an equation: expected one such as
    {"rod": True} | constraint 'rod' is not an equation: expected one such as
    {"rod": X.diff(T) - 1} | constraint 'rod' contains Derivative(x(t), t), one of the velocit
    {"rod": "x"} | constraint 'rod' is not a scalar SymPy expression: got 'x'
    {"rod": sp.Eq(Y, sp.Abs(X))} | constraint 'rod' contains Abs(x(t)), whose kink no method of
    {"rod": 1} | constraint 'rod' contains no coordinate: expected an equation in x, y
    [X] | constraints = [x(t)]: expected a mapping such as
ProblemError: swing(...)
    start={"x": 0.5, "y": -0.5} | constraint 'rod' does not hold at the start, where it is -0.5
        instead of 0
    start={"x": 0.0, "y": -1.0, "y_dot": 1.0} | constraint 'rod' does not allow the velocity at the
        start, which changes it by -2 per s
    goal={"x": 2.0, "y": 0.0} | constraint 'rod' does not hold at the goal, where it is 3 instead of
        0
ProblemError: walled(...)
    design="wall" | design = 'wall': expected a mapping
    design={"wal": (0.5, 2)} | unknown parameter 'wal' in design: expected one of m, wall (did ...
        'wall'?)
    design={"u": (0, 1)} | unknown parameter 'u' in design
    design={"wall": (2, 1)} | design of wall: the lower bound 2 exceeds the upper bound 1
    design={"wall": (0.5, nan)} | design of wall
    design={"wall": "1:2"} | design of wall = '1:2': expected a number or a pair (lower, upper)
    design={"wall": (1, 2)}, parameters={"m": 1, "wall": 1} | parameter wall is given in parameters
        and in design: give it once
    design={"m": (0, 5)} | the mass matrix is not positive definite at the start where m = 0, a
        bound of its design
    design={"m": (-1, None)} | where m = -1, a bound of its design
    design={"wall": (1, 2)}, minimal_times=True | minimal_times are estimated at fixed parameters
ProblemError: on_floor(...)
    design={"mu": (-0.1, 1)} | the friction of 'floor' is -0.1 where mu = -0.1, a bound of its
        design
SimulationError: simulate(...)
    kernels=None | expected a MechanicalSystem, or the kernels
    kernels="ball" | expected a MechanicalSystem, or the kernels
    positions=[1.0] | unknown argument 'positions' of simulate ... (did you mean 'position'?)
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
GenerationError: forced(...)
    "gamma(q)" | cannot be turned into C
    "besselj(0, q)" | cannot be turned into C
    "erf(q)" | cannot be turned into C
    "Piecewise((q, q > 0))" | has no value elsewhere
ModelError: forced(...)
    "floor(q)" | whose jump no method of smooth functions can follow
    "sign(q)" | whose jump no method of smooth functions can follow
    "f(q)" | neither a coordinate nor an input
    "I*q" | contains the imaginary unit
ModelError: kinked(...)
    integrals={"i": sp.Abs(U)}, objective=-dmoc.total("i") | the objective falls with total(i),
        whose integrand has kinks: the unknowns in their place are not held from above; give it a
    integrals={"i": sp.Abs(U) + sp.Min(U, 0)} | integral 'i' contains Abs(u), where it cannot be
        split: abs and Max must all raise an integral and Min lower it, or the other way round; use
    cost=sp.Min(U, 0) | the cost contains Min(0, u), where it cannot be split: abs and Max must
        raise a cost, Min must lower it; use a smooth
    cost=-sp.Abs(U) | the cost contains Abs(u), where it cannot be split: abs and Max must raise a
        cost, Min must lower it; use a smooth
    cost=sp.sin(sp.Abs(U)) | the cost contains Abs(u), where it cannot be split: abs and Max must
        raise a cost, Min must lower it; use a smooth
    cost=X * sp.Abs(U) | the cost multiplies Abs(u) by x, whose sign is not known: make its
    cost=U * sp.sign(U) | the cost contains sign(u), which cannot be split into smooth
    cost=sp.floor(U) | the cost contains floor(u), which cannot be split into smooth
    cost=sp.Piecewise((U, U > 0), (0, True)) | the cost contains Piecewise((u, u > 0), (0, True)),
        which cannot be split into smooth
    path_constraints={"a": sp.Abs(U) >= 1} | path constraint 'a' contains Abs(u), where it cannot be
        split: abs and Max must be limited from above, Min from below; use a smooth
    forces={X: U - sp.sign(v)} | the force on x contains sign(Derivative(x(t), t)), whose jump no
        method of smooth
    forces={X: U - sp.Heaviside(v)} | the force on x contains Heaviside(Derivative(x(t), t)), whose
        jump no method of smooth
    lagrangian=v**2 / 2 - sp.floor(X) | the Lagrangian contains floor(x(t)), whose jump no method of
        smooth
    terminal_cost=sp.Abs(X) | the terminal cost contains Abs(x(t)), whose kink no method of smooth
ProblemError: along(...)
    [], ["-left"] | left leaves, but is not closed
    ["left"], ["+left"] | left is closed already
    ["left"], ["left"] | left is closed already
    [], ["left:slip+:slip+"] | expected stick, slip+ or slip-
    [], ["left:stick:slip+"] | expected stick, slip+ or slip-
    [], ["left:slip+:late"] | expected stick, slip+ or slip-
    [], ["left:slip+:stick:soon"] | expected stick, slip+ or slip-
    [], ["+left:slip+:stick:late"] | leave out ':late'
    ["left"], ["left:slip+:stick"] | left is closed or a rail
    [], ["rail:slip+:stick"] | rail is closed or a rail
    ["right:slip+"], ["left:slip+ right:slip-"] | right turns while left is hit with friction
    ["right:slip+"], ["left right:stick"] | right stops sliding while left is hit with friction
    ["right:slip+"], ["+left:slip+:stick right:stick"] | right stops sliding while left lands
    [], ["+left:slip+:stick +right"] | left and right land at once
    [], ["left:slip+ right:slip-"] | hits left and right at once
    [], ["+left -left"] | names 'left' twice
    [], ["wall left"] | hits wall and left at once
    [], ["wall +left"] | hits wall and left at once
    [], ["wall:stick"] | unknown tangent 'wall:stick'
    [], ["+wall:slip+"] | expected stick, slip+ or slip-
    [], ["left:fast"] | expected stick, slip+ or slip-
    [], [" "] | unknown surface
    [], ["+foot"] | unknown surface '+foot'
    ["foot"], [] | unknown contact 'foot'
    ["left", "left"], [] | names 'left' twice
    ["wall:slip+"], [] | a contact with friction
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
ProblemError: walled(...)
    order=4 | unknown argument 'order' of Problem: expected one of kernels, start, ... (an argument
        of dmoc.build, dmoc.derive, dmoc.load)
    step=4 | unknown argument 'step' of Problem ... (did you mean 'steps'?)
    restitution=1.2 | restitution = 1.2: expected a number from 0
    restitution={"wal": 0.5} | restitution of 'wal': unknown surface
    restitution="x" | expected a number
    restitution=nan | finite
    periodic=["z"] | unknown state 'z' in periodic
    controls="linear" | expected one of stages, constant with kernels of order 4
ProblemError: read_periodic(...)
    "x=" | --periodic x=: expected NAME, END=START
    "=x" | --periodic =x: expected NAME, END=START
    "x=x+" | expected NAME, END=START
    "x=y=z+1" | expected NAME, END=START
    "x+1,y=y" | expected NAME, END=START
    "x=x,x=y" | --periodic x=y: expected ... each END once
    "x=x+a" | the difference in --periodic x=x+a = 'a': expected a number, or ... ?
ProblemError: read_guess(...)
    ["alpha=1,up"] | --guess alpha = 'up': expected numbers such as
    ["alpha="] | --guess alpha = '': expected numbers such as
    ["=1"] | --guess =1: expected NAME=V1,V2,..., each name once.
    ["F=1", "F=2"] | --guess F=2: expected NAME=V1,V2,..., each name once.
    ["known.npz", "F=1"] | --guess known.npz stands beside others: give one file
"""

X, Y, U, Q = dynamicsymbols("x y u q")
T, F = dynamicsymbols._t, sp.Symbol("f")
FEET = Contacts(("left", "right", "wall"), ("left", "right", "rail"), (), ("left", "right"))


def rows() -> list[tuple[str, str, str]]:
    """Error, call and words of each row."""
    head, messages = "", list[tuple[str, str, str]]()
    for line in TABLE.strip("\n").replace("\n        ", " ").splitlines():
        if line.startswith(" "):
            arguments, _, words = line.strip().rpartition(" | ")
            error, _, call = head.partition(": ")
            messages.append((error, call.replace("...", arguments), words))
        else:
            head = line
    return messages


def on_floor(**fields: Any) -> dmoc.Problem:
    stated = {"start": {"x": 0, "y": 0}, "steps": 5, "final_time": 1} | fields
    return dmoc.Problem(dmoc.build(floor()), **stated)


def made(name: str, coordinates: list[Any], **fields: Any) -> dmoc.MechanicalSystem:
    parts = {"lagrangian": sum(q.diff(T) ** 2 for q in coordinates) / 2, "parameters": {}} | fields
    return dmoc.MechanicalSystem(name, coordinates, **parts)


def kinked(**fields: Any) -> dmoc.MechanicalSystem:
    return made("kinked", [X], **{"inputs": [U], "forces": {X: U}} | fields)


def rubbing(**fields: Any) -> dmoc.MechanicalSystem:
    return made("wrong", [X], lagrangian=F * X.diff(T) ** 2 / 2, parameters={F: 1.0}, **fields)


def forced(text: str) -> Any:
    force = sp.sympify(text, locals={"q": Q, "f": sp.Function("f")})
    return dmoc.build(made("odd", [Q], inputs=[U], forces={Q: U + force}))


def swing(**fields: Any) -> dmoc.Problem:
    stated = {"start": {"x": 0.0, "y": -1.0}, "steps": 5, "final_time": 1.0} | fields
    return dmoc.Problem(dmoc.build(bob()), **stated)


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
        "bob_with": lambda value: made("bad", [X, Y], constraints=value),
        "along": lambda contacts, words: touch_along(mode_of(contacts, FEET), words, FEET),
        "walled": block.but, "on_floor": on_floor, "rubbing": rubbing, "kinked": kinked,
        "forced": forced, "swing": swing, "simulate": simulate, "animate": animate, "back": back,
        "read_periodic": read_periodic, "read_guess": read_guess,
    }  # fmt: skip
    symbols = {"X": X, "Y": Y, "U": U, "T": T, "F": F, "v": X.diff(T), "nan": nan, "sp": sp}
    return {"dmoc": dmoc, "seed": seed, "block": block} | symbols | calls


@pytest.mark.parametrize(("error", "call", "words"), rows())
def test_it_is_refused_in_one_sentence(
    names: dict[str, Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
    error: str, call: str, words: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    with np.errstate(all="ignore"), pytest.raises(getattr(errors, error)) as refused:
        eval(call, names)
    text, at = str(refused.value), 0
    for part in words.split(" ... "):
        assert part in text[at:], text
        at = text.index(part, at) + len(part)
    assert text.endswith(".") and "\n" not in text and len(text) < 400, text
    assert not list(tmp_path.iterdir())
