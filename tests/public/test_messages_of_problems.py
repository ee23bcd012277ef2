"""What statements of problems refuse: one sentence with these words."""

from __future__ import annotations

from math import nan
from typing import Any

import block_and_wall
import pytest
import sympy as sp
from contact_problems import floor
from hit_problems import back
from joint_problems import bob
from refusals import refusal_test
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.cli.option_values import read_periodic
from dmoc.mechanics.contacts import Contacts
from dmoc.mechanics.sequence_words import mode_of, touch_along

# Below each error and call: arguments, and words of the message; ... stands for anything.
TABLE = r"""
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
    start={"x": 0, "y": 1e200} | start of y = 1e+200: expected a magnitude of at most 1e100
    start={"x": 0, "y": 1}, goal={"x": (0, -1e101)} | exchange them
    start={"x": 0, "y": 1}, goal={"x_dot": (-1e101, 0)} | goal of x_dot = -1e+101: expected a
        magnitude of at most 1e100; use other units
    sequence=["+floor"], start={"x": 0, "y": 1}, via=[{"x": 1e200}] | via of event 1: x = 1e+200
ProblemError: back(...)
    sequence=["floor:slip+:stick:late"], restitution=0 | leave out ':late'
    sequence=["floor:stick"], parameters={"mu": 0} | the friction of 'floor' is 0
    sequence=["floor:slip+:slip+"] | expected stick, slip+ or slip-
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
"""

X = dynamicsymbols("x")
FEET = Contacts(("left", "right", "wall"), ("left", "right", "rail"), (), ("left", "right"))


def on_floor(**fields: Any) -> dmoc.Problem:
    stated = {"start": {"x": 0, "y": 0}, "steps": 5, "final_time": 1} | fields
    return dmoc.Problem(dmoc.build(floor()), **stated)


def swing(**fields: Any) -> dmoc.Problem:
    stated = {"start": {"x": 0.0, "y": -1.0}, "steps": 5, "final_time": 1.0} | fields
    return dmoc.Problem(dmoc.build(bob()), **stated)


@pytest.fixture(scope="module")
def names() -> dict[str, Any]:
    """What the calls of the table take."""
    block = block_and_wall.problem(0.8, 10, 4)
    return {
        "along": lambda contacts, words: touch_along(mode_of(contacts, FEET), words, FEET),
        "walled": block.but, "on_floor": on_floor, "swing": swing, "back": back,
        "read_periodic": read_periodic, "X": X, "nan": nan, "sp": sp, "dmoc": dmoc,
    }  # fmt: skip


test_it_is_refused_in_one_sentence = refusal_test(TABLE)
