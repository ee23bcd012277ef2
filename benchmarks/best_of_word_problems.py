"""Sixty problems of one fixed sequence each, and the best motion that anybody has found of each.

A word is a sequence with its problem.  They are of the ladder, the catalogue and the examples, the
kinds of the campaigns, and of arms (best_of_word_arms.py).  ``results/best_of_word.json`` has the
best known costs, which ``python benchmarks/best_of_word.py --improve`` lowers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cache, partial
from typing import Any

import campaign  # with which come the folders of the examples and of the tests
import campaign_kinds as free
import compass_gait
import contact_kinds as held
import hopper
import numpy as np
import puck
import push_or_flick
import seed
import stance_hopper
import sympy as sp
import transport
import twenty_bodies as bodies
import two_discs
from best_of_word_arms import ARMS
from ladder_problems import acrobot, against_wall, hammer_and_nail, hanging, two_carts
from ladder_smooth import (
    Statement,
    around_disc,
    container_crane,
    hanging_load,
    little_torque,
    quadrotor,
    robot_arm,
    stated,
    t,
    two_links,
)
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.models import catalogue

ORDER, STEPS = 4, 40  # steps of a phase, where the problem says nothing else


@dataclass(frozen=True)
class Word:
    """A problem with one sequence; ``state`` says its system and its fields."""

    name: str
    state: Callable[[], Statement]

    @property
    def statement(self) -> Statement:
        return _kept(self.state)

    @property
    def problem(self) -> dmoc.Problem:
        statement = self.statement
        kernels = dmoc.build(statement.system, order=ORDER)
        return dmoc.Problem(kernels, **{"steps": STEPS, **statement.data})


@cache
def _kept(state: Callable[[], Statement]) -> Statement:
    return state()


def example(
    system: Callable[[], dmoc.MechanicalSystem], problem: Callable[[], dmoc.Problem], **data: Any
) -> Statement:
    """The statement of a problem, with some of its fields replaced."""
    made = problem()
    own = {f.name: getattr(made, f.name) for f in fields(made) if f.name != "kernels"}
    return Statement(system(), {**own, **data})


def drawn(kind: Callable[[np.random.Generator], free.Instance], number: int) -> Statement:
    """An instance of a kind of the campaigns."""
    instance = kind(np.random.default_rng(number))
    return Statement(campaign.system_of(instance), instance.problem)


def masses_on_a_rail() -> Statement:
    """A mass sticks on a rail until a spring to a driven mass moves it; static friction is larger
    than kinetic friction."""
    x, y, u = dynamicsymbols("x y u")
    m, M, k, c, d = sp.symbols("m M k c d")
    return stated(
        "masses_on_a_rail", [x, y], [u],
        (m * x.diff(t) ** 2 + M * y.diff(t) ** 2 - k * (x - y) ** 2) / 2, {y: u},
        parameters={m: 1.21791, M: 0.92809, k: 22.5478, c: 2.7485, d: 1.44952},
        tangents={"rail": x}, friction={"rail": (c, d)}, cost=u**2 / 2,
        contacts=["rail"], sequence=["rail:slip+"], final_time=2.04787, steps=None,
        start={"x": 0.0, "y": 0.0},
        goal={"x": 0.62386, "y": 0.38463, "x_dot": 0.0, "y_dot": 0.0},
    )  # fmt: skip


def simplest_walker() -> Statement:
    """A hip of unit mass on legs without mass but for feet of 1e-4 walks down a slope of 0.009."""
    x, y, a, b = dynamicsymbols("x y a b")
    hip = sp.Matrix([x, y])
    slope, foot, length = sp.symbols("slope foot length")
    gravity = sp.Matrix([sp.sin(slope), -sp.cos(slope)])
    left, right = (hip + held.point(angle, length) for angle in (a, b))
    bodies_of = ((1, hip), (foot, left), (foot, right))
    return stated(
        "simplest_walker", [x, y, a, b], [],
        sum(held.kinetic(mass, place) + mass * gravity.dot(place) for mass, place in bodies_of), {},
        parameters={slope: 0.009, foot: 1e-4, length: 1.0},
        surfaces={"left": left[1] >= 0, "right": right[1] >= 0},
        tangents={"left": left[0], "right": right[0]}, friction={"left": 1, "right": 1},
        start={"x": 0.0}, contacts=["left"], sequence=["+right -left"],
        via=[{"a": (-0.5, -0.05)}], ignored=["left", "right"],
        periodic=held.exchanged({"y": "y", "a": "b", "b": "a"}, None), final_time=(3.0, 5.0),
        durations=[None, 0],
    )  # fmt: skip


def unmeshed(statement: Statement) -> Statement:
    """The same with the steps left open."""
    return Statement(statement.system, {**statement.data, "steps": None})


def seeded() -> Statement:
    return example(lambda: catalogue.system("cart_pendulum"), partial(seed.problem, STEPS))


LADDER: Mapping[str, Callable[[], Statement]] = {
    "pendulum with little torque, least time": little_torque,
    "two-link arm, least time": two_links,
    "robot arm with its Lagrangian": partial(robot_arm, lagrangian=True),
    "container crane": lambda: unmeshed(container_crane()),
    "crane with a hanging load": hanging_load,
    "planar quadrotor, least time": lambda: unmeshed(quadrotor()),
    "around a disc": around_disc,
    "pendulum and wall, goal -pi": against_wall,
    "pendulum and wall, goal -3": partial(against_wall, goal=-3.0),
    "pendulum and wall, goal -2": partial(against_wall, goal=-2.0),
    "pendulum and nearer wall, goal -2.6": partial(against_wall, wall=0.4, goal=-2.6),
    "hammer and nail": hammer_and_nail,
    "two carts, e = 0.5": two_carts,
    "rods driven at the elbow, wall": acrobot,
    "cart-pendulum from hanging": lambda: Statement(
        hanging().system, {**hanging().data, "steps": STEPS}
    ),
}
CATALOGUE: Mapping[str, Callable[[], Statement]] = {
    "cart-pendulum off its limiter": seeded,
    "cart-pendulum, two hits": lambda: Statement(
        seeded().system, {**seeded().data, "sequence": ["lower", "lower"]}
    ),
    "puck off three walls": lambda: example(
        lambda: catalogue.system("puck_table"), partial(puck.problem, STEPS)
    ),
    "two discs": partial(example, two_discs.system, two_discs.problem),
    "a hop": partial(example, hopper.system, partial(hopper.problem, STEPS, ORDER)),
    "a hopper leaves and lands": partial(
        example, stance_hopper.system, partial(stance_hopper.problem, STEPS)
    ),
    "compass gait": partial(example, compass_gait.system, compass_gait.problem),
    "a block is pushed along": partial(
        example, push_or_flick.system, push_or_flick.problem, sequence=["pad rail:slip+", "pad"]
    ),
    "swing-up off a stop": partial(
        example, bodies.stop_system, bodies.stopped_swing_up, sequence=["stop", "stop"]
    ),
    "a ball on a paddle": partial(
        example, bodies.paddle_system, bodies.paddled, sequence=["ball", "ball"]
    ),
    "RABBIT's metre": partial(example, transport.system, transport.problem),
}  # fmt: skip
KINDS: Mapping[str, Callable[[], Statement]] = {
    "campaign: arm and stop": partial(drawn, free.arms, 3),
    "campaign: discs": partial(drawn, free.discs, 3),
    "campaign: moving wall": partial(drawn, free.moving_walls, 1),
    "campaign: rod on the floor": partial(drawn, free.rods, 3),
    "campaign: cart-pendulum": partial(drawn, free.cart_pendulums, 4),
    "campaign: curved wall": partial(drawn, free.curved_walls, 2),
    "campaign: chain": partial(drawn, free.chains, 1),
    "contacts: block that sticks and slides": partial(drawn, held.pushed, 4),
    "contacts: stacked blocks": partial(drawn, held.stacked, 1),
    "contacts: cart-pole on a rail": partial(drawn, held.cart_poles, 1),
    "contacts: thrown ball with spin": partial(drawn, held.balls, 1),
    "contacts: thrown rod": partial(drawn, held.bars, 1),
    "masses on a rail": masses_on_a_rail,
    "simplest walker": simplest_walker,
}
WORDS = tuple(
    Word(name, state) for part in (LADDER, CATALOGUE, KINDS, ARMS) for name, state in part.items()
)
NAMED = {word.name: word for word in WORDS}
