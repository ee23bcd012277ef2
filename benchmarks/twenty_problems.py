"""The problems of `twenty.py`: twenty with two to six contacts or more, three whose best motion has
one, all with the best motion that anybody knows, and those of the same collections that are not
stated, with the reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import finger_puck
import hops
import puck
import push_or_flick
import pushed_block
import seed
import stance_hopper
import twenty_bodies as bodies
import twenty_published as published
import walker
from hopper import system as hopper_system

import dmoc
from dmoc.models import catalogue


@dataclass(frozen=True)
class Case:
    """A problem without its sequence, and what is known of it.

    Parameters
    ----------
    name, title : str
    system, problem : callable
    word, contacts : tuple of str
        The best sequence that is known, and the contacts with which it begins.
    cost : float
        Its cost, by the source.
    source : str
        What led to it: a closed form, its words when they are named, or a search by proposals.
    published : float, optional
        The best published cost.
    remark : str
        What is left out of the published statement, or what a published cost counts.
    """

    name: str
    title: str
    system: Callable[[], dmoc.MechanicalSystem]
    problem: Callable[[], dmoc.Problem]
    word: tuple[str, ...]
    cost: float
    source: str
    contacts: tuple[str, ...] = ()
    published: float | None = None
    remark: str = ""

    @property
    def named(self) -> dmoc.Problem:
        """The problem with the best sequence that is known."""
        stated = self.problem()
        contacts = self.contacts or stated.contacts
        return stated.but(sequence=self.word, contacts=contacts)


def _walker() -> dmoc.Problem:
    """The step of the walker with open durations."""
    stated = walker.problem(20, 2)
    return stated.but(sequence=(), durations=None, final_time=walker.TIME)


NAMED, PROPOSED = "its words", "proposals"
CASES = (
    Case(
        "block", "block on a rail with friction, 1 m in 4 s", pushed_block.system,
        lambda: pushed_block.problem(40).but(sequence=()), ("rail:slip+", "rail:stick"),
        2 / 3 * 6**0.5, "closed form",
    ),
    Case(
        "flick", "a block is pushed or flicked", push_or_flick.system, push_or_flick.problem,
        ("pad rail:slip+", "pad"), 3.3418, NAMED,
    ),
    Case(
        "seed", "swing-up between limiters", lambda: catalogue.system("cart_pendulum"),
        lambda: seed.problem(40).but(sequence=()), ("lower", "lower"), 66.16, "tree of six hits",
    ),
    Case(
        "puck", "puck among four walls", lambda: catalogue.system("puck_table"),
        lambda: puck.problem(20).but(sequence=()), puck.SEQUENCE, 0.41502458, "closed form",
    ),
    Case(
        "rail", "swing-up on a rail with friction", published.swing_up,
        published.swing_up_problem, ("rail:slip-", "rail:stick", "rail:slip+"), 87.765, PROPOSED,
        ("rail:slip+",),
    ),
    Case(
        "cpwf", "NOSBENCH CPWF, F = 5", published.cpwf, published.cpwf_problem,
        ("rail:slip-", "rail:stick"), 1270.2, NAMED, ("rail:slip+",), 4914.995,
    ),
    Case(
        "discs", "NOSBENCH DISCM", published.discs, published.discs_problem, ("discs",), 58.930,
        NAMED, (), 2038.85, "counts frozen time",
    ),
    Case(
        "carts", "NOSBENCH 3CPTF", published.carts, published.carts_problem,
        ("+left", "-left", "+right", "-right"), 146.46, NAMED,
    ),
    Case(
        "rough", "NOSBENCH 3CPCLS", published.rough_carts, published.rough_carts_problem,
        ("floor2:slip-", "+left floor1:slip-", "-left", "floor2:slip+", "right floor3:slip+",
         "floor2:slip-", "floor1:stick", "floor3:stick", "floor2:stick"), 212.58, NAMED,
        remark="without friction between the carts",
    ),
    Case(
        "drone", "NOSBENCH DRNLND, flat", published.drone, published.drone_problem,
        ("+left", "-left", "+right"), 33.860, NAMED, remark="reference continuous in time",
    ),
    Case(
        "motor", "NOSBENCH MWFOCP", published.motor, published.motor_problem,
        ("guide:slip-", "guide:slip+"), 0.7687, PROPOSED, ("guide:slip+",),
    ),
    Case(
        "leap", "NOSBENCH HOPOCP", published.hopper, published.hopper_problem,
        ("ground:slip+", "-ground", "+ground", "-ground", "+ground:slip+"), 3.842, PROPOSED,
        remark="reference continuous in time",
    ),
    Case(
        "transport", "CRISP, transport", published.transport, published.transport_problem,
        ("top:slip+",), 2.9067, NAMED, ("top:slip-",), remark="without the cost of the friction",
    ),
    Case(
        "hops", "a hopper goes 1 m", hopper_system, hops.problem, ("ground",) * 3, 76.015, PROPOSED,
    ),
    Case(
        "landing", "a leg lands and stands", stance_hopper.system, bodies.landing, ("+floor",),
        138.38, NAMED,
    ),
    Case(
        # Plastic, because the referee refuses a tip that lands and hits with e > 0: two laws.
        "finger", "a finger pushes a puck", finger_puck.system,
        lambda: finger_puck.problem(40).but(sequence=(), restitution=0.0),
        ("+tip table:slip+", "-tip"), 2.0827e-3, PROPOSED,
    ),
    Case(
        "push", "a box is pushed", lambda: bodies.box_system("pushed"), bodies.box_pushed,
        ("bl:slip+ br:slip+",), 35.435, NAMED,
    ),
    Case(
        "tip", "a box is tipped over", lambda: bodies.box_system("tipped"), bodies.box_tipped,
        ("-bl", "+tr:slip+ -br"), 16.249, "the tree",
    ),
    Case(
        "throw", "a box is thrown up a step", lambda: bodies.box_system("thrown"),
        bodies.box_thrown, ("-bl", "-br", "+bl:slip+", "-bl", "+br:slip+"), 69.249, PROPOSED,
    ),
    Case(
        "bank", "a block is struck against a wall", bodies.bank_system, bodies.bank_shot,
        ("bumper", "wall"), 3.1020665, "closed form",
    ),
    Case(
        "stop", "swing-up off a stop", bodies.stop_system, bodies.stopped_swing_up,
        ("stop", "stop"), 25.345, NAMED,
    ),
    Case(
        "paddle", "a ball on a paddle", bodies.paddle_system, bodies.paddled, ("ball", "ball"),
        38.980, NAMED,
    ),
    Case(
        "walker", "a step of RABBIT", walker.system, _walker, ("+right -left",), 390.7, NAMED,
    ),
)  # fmt: skip
NOT_STATED = (
    ("NOSBENCH DSCSP, DSCOB, DAOBCLS", "their drag divides by zero at a velocity"),
    ("NOSBENCH TFBIB", "the length of the force is limited, not its components"),
    ("NOSBENCH MNPED", "its equations are generated files"),
    ("NOSBENCH 2BCLS, CLS1D", "simulations, without anything to choose"),
    ("CRISP, push box", "quasi-static: it has no masses"),
    ("CRISP, hopper", "its leg has no mass"),
    ("CRISP, waiter", "limits of a contact force, which is an input"),
    ("CRISP, cart-pole with soft walls", "walls that are springs: nothing hits them"),
    ("compass gait", "it scuffs the floor, which the referee does not ignore"),
)
