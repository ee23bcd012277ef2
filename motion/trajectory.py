"""A motion as plain data: phases between collisions, and the collisions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.discretisation import DISCRETISATIONS, FORMS, InputForm
from dmoc.base.tolerances import SAME
from dmoc.motion.friction import rubbing_word, sticks
from dmoc.motion.impact_laws import second_of
from dmoc.motion.scene import Scene

Array = NDArray[np.float64]
# A contact that changes no momentum by more than this share of its size grazes: the motion touches
# a surface without colliding.
GRAZING = 0.01
# How words begin of what lands, leaves and slips off an end.
OFF = "~"
SIGNS = ("+", "-", OFF)
FORCES = ("normal", "tangential", "reaction")  # kinds of forces along phases


@dataclass(frozen=True, repr=False)
class Phase:
    """A phase of N steps; the last one of a motion that ends with an event has none, and one node,
    with the state after the event.

    Attributes
    ----------
    t : array of shape (N + 1,)
        Times of the nodes in seconds.
    q, p, v : arrays of shape (N + 1, nq)
        Coordinates, momenta and velocities at the nodes; at a collision those of this phase's side.
    u : array of shape (N, nu), (N + 1, nu) or (2 N, nu)
        Inputs of the steps (constant), at the nodes (linear), or at the two ends of each step,
        where they may jump (stages); without rows where there are no steps.
    closed : tuple of str
        Surfaces in lasting contact.
    rubbing : mapping of str to int
        Friction of the tangents that rub: 0 sticks, 1 and -1 slide with that sign of tau'.
    normal : array of shape (N + 1, len(closed))
        Contact forces N >= 0 at the nodes in newton: -N grad g acts on the coordinates.  Those of a
        phase without steps, and T and R, are what its state and the last inputs of the motion ask
        for.
    tangential : array of shape (N + 1, len(rubbing))
        Friction forces T at the nodes: T grad tau acts on the coordinates.
    joints : tuple of str
        The constraints of the model.
    reaction : array of shape (N + 1, len(joints))
        Their forces R at the nodes: R grad phi acts on the coordinates, R dc/dv of constraints c of
        velocities.
    q_inside, p_inside : arrays of shape ((d - 1) N, nq)
        Coordinates and momenta at the nodes inside the steps, one step after the other, of
        polynomials of degree d; none at order 2.
    normal_inside, tangential_inside, reaction_inside : arrays of shape ((d - 1) N, ...)
        Forces N, T and R there.  Where inputs jump at a node, those at the node are the mean of
        both sides.
    quantities : array of shape (3 N, nz)
        Quantities of the model at the start, in the middle and at the end of each step; of a phase
        without steps at its node, with the last inputs of the motion, (1, nz).
    coefficients : array of shape (N + 1, len(rubbing))
        Where the friction of the model varies, or is another where it sticks, that of what rubs at
        the nodes, as in :attr:`Trajectory.friction`; none otherwise.
    """

    t: Array
    q: Array
    p: Array
    v: Array
    u: Array
    closed: tuple[str, ...] = ()
    rubbing: Mapping[str, int] = field(default_factory=dict)
    normal: Array = field(default_factory=lambda: np.zeros((0, 0)))
    tangential: Array = field(default_factory=lambda: np.zeros((0, 0)))
    q_inside: Array = field(default_factory=lambda: np.zeros((0, 0)))
    p_inside: Array = field(default_factory=lambda: np.zeros((0, 0)))
    joints: tuple[str, ...] = ()
    reaction: Array = field(default_factory=lambda: np.zeros((0, 0)))
    normal_inside: Array = field(default_factory=lambda: np.zeros((0, 0)))
    tangential_inside: Array = field(default_factory=lambda: np.zeros((0, 0)))
    reaction_inside: Array = field(default_factory=lambda: np.zeros((0, 0)))
    quantities: Array = field(default_factory=lambda: np.zeros((0, 0)))
    coefficients: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def steps(self) -> int:
        return len(self.t) - 1

    @property
    def free(self) -> bool:
        """Whether nothing touches."""
        return not (self.closed or self.rubbing)

    @property
    def forces(self) -> dict[str, tuple[Array, Array]]:
        """Times, shape (rows,), and forces, shape (rows, size), by kind: at the nodes, and at those
        inside steps where forces are known there."""
        return {
            kind: (self._along(self.t[:, None], len(inside))[:, 0], self._along(nodes, inside))
            for kind in FORCES
            if (nodes := getattr(self, kind)).shape[1]
            for inside in [self.inside(kind)]
        }

    def inside(self, kind: str) -> Array:
        """Values at the nodes inside steps, shape (N inside, size); ``kind`` is "q", "p", or a kind
        of forces."""
        return np.asarray(getattr(self, f"{kind}_inside"))

    def _along(self, nodes: Array, inside: Array | int) -> Array:
        """Rows of the nodes, shape (N + 1, size), and of those inside steps, shape (N inside,
        size), in the order of time. Of the times, a number stands for the rows inside."""
        count = (inside if isinstance(inside, int) else len(inside)) // max(self.steps, 1)
        if not count:
            return nodes
        scheme = DISCRETISATIONS[2 * (count + 1)]
        within = scheme.within(nodes[:-1], nodes[1:]) if isinstance(inside, int) else inside
        rows = np.concatenate([nodes[:-1, None], within.reshape(self.steps, count, -1)], axis=1)
        return np.vstack([rows.reshape(-1, nodes.shape[1]), nodes[-1:]])

    @property
    def mode(self) -> str:
        """What is in contact, and how it rubs, as "left:stick"; "free" where nothing is."""
        return mode_word(self.closed, self.rubbing)

    @property
    def step_size(self) -> float:
        return self.duration / max(self.steps, 1)

    @property
    def duration(self) -> float:
        return float(self.t[-1] - self.t[0])

    def __repr__(self) -> str:
        if not self.steps:
            return f"<State after the last event at {self.t[0]:.6g} s, {self.mode}>"
        times = f"{self.t[0]:.6g} to {self.t[-1]:.6g} s"
        return f"<Phase of {self.steps} steps from {times}, {self.mode}>"


@dataclass(frozen=True, repr=False)
class Collision:
    """What happens between two phases: surface, time (s), position, impulse lam >= 0 along grad g,
    momenta before and after.

    ``rate_before`` >= 0 >= ``rate_after`` are the rates of the gap on both sides; a collision that
    ``grazes`` has no effect: the motion touches the surface and goes on as if it were not there.

    Attributes
    ----------
    surface : str
        The surface that is hit and released, or the first one that lands; empty where nothing is
        hit.
    lands, leaves : tuples of str
        Surfaces that land plastically and stay closed, and contacts that open.
    friction : mapping of str to int
        Friction of tangents from here on, where it changes: 0 sticks, 1 and -1 slide.
    impulses, tractions : mappings of str to float
        Normal impulses P of all contacts that take one, and their tangential impulses S: the
        momentum changes by -P grad g + S grad tau + R grad phi, or R dc/dv.  ``"floor_2"`` is the
        second direction of ``"floor"``, where it has two.
    reactions : mapping of str to float
        Impulses R of the constraints of the model.
    course : str
        How friction acts in the course of the impact, as "slip+:stick"; empty for one way or none.
    switch : str
        The switch of the model that passes zero here; empty where none does.  Nothing else happens.
    off : tuple of str
        Surfaces of those that leave whose contact slips off an end.
    grips : mapping of str to tuple of str
        Grips of the model with their places, which close and open together: ``lands``, ``leaves``
        and ``impulses`` have these, words have the grips.
    """

    surface: str
    time: float
    position: Array
    impulse: float
    momentum_before: Array
    momentum_after: Array
    rate_before: float = 0.0
    rate_after: float = 0.0
    grazes: bool = False
    lands: tuple[str, ...] = ()
    leaves: tuple[str, ...] = ()
    friction: Mapping[str, int] = field(default_factory=dict)
    impulses: Mapping[str, float] = field(default_factory=dict)
    tractions: Mapping[str, float] = field(default_factory=dict)
    course: str = ""
    reactions: Mapping[str, float] = field(default_factory=dict)
    switch: str = ""
    off: tuple[str, ...] = ()
    grips: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def hit(self) -> str:
        """The surface that is hit and released; empty where none is."""
        return "" if self.surface in self.lands else self.surface

    @property
    def word(self) -> str:
        """What happens, as a sequence says it: "wall", "+right -left", "rail:slip+"."""
        lands, leaves = (by_grip(names, self.grips) for names in (self.lands, self.leaves))
        return self.switch or event_word(
            self.hit, lands, leaves, self.friction, self.course, self.off
        )

    def __repr__(self) -> str:
        return f"<Collision {self}>"

    def __str__(self) -> str:
        return f"{self.word} at {self.time:.6g} s{impulses_in_words(self)}"


@dataclass(frozen=True, repr=False)
class Trajectory:
    """A motion with what is needed to draw and to check it.

    Attributes
    ----------
    model, fingerprint : str
        Name and digest of the model.
    coordinates, inputs : tuples of str
    parameters : mapping of str to float, or to a tuple with a value for each phase
    phases : tuple of Phase
    collisions : tuple of Collision
        One between any two phases.
    controls : {"constant", "linear", "stages"}
    input_bounds, coordinate_bounds : arrays of shape (nu, 2), (nq, 2)
    restitution : mapping of str to float or None
        Coefficient of each surface; None where the model states its law.
    order : int
        Order of the discretisation that the motion comes from.
    ignored : tuple of str
        Surfaces that hold nothing back where no event names them.
    friction : mapping of str to float or None
        Coefficient mu of each surface with friction, the kinetic one where there are two; largest
        force in newton of each rail; None where it varies along the motion.
    units : mapping of str to str, of coordinates and inputs where the model names them
    scene : Scene or None
        The drawing of the model along the motion; None where the model has none.
    limits : mapping of str to pair of float
        Bounds of velocities and quantities by name, infinite for none.
    quantities : tuple of str
        Names of the quantities of the model.
    tangential_restitution : mapping of str to float
        Coefficient e_t of each surface that has one.
    grips : mapping of str to tuple of str
        Grips of the model and their places, which stand among its surfaces.
    totals : mapping of str to float
        Integrals of the model over the motion, and the peaks that its objective has.
    cost : float
        What the motion costs; not a number where nothing says it, as of a simulation.
    """

    model: str
    fingerprint: str
    coordinates: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: Mapping[str, Any]
    phases: tuple[Phase, ...]
    collisions: tuple[Collision, ...]
    controls: str
    input_bounds: Array
    coordinate_bounds: Array
    restitution: Mapping[str, float | None]
    order: int
    ignored: tuple[str, ...] = ()
    friction: Mapping[str, float | None] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    scene: Scene | None = None
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    quantities: tuple[str, ...] = ()
    tangential_restitution: Mapping[str, float] = field(default_factory=dict)
    totals: Mapping[str, float] = field(default_factory=dict)
    cost: float = math.nan
    grips: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def __repr__(self) -> str:
        events = "; ".join(map(str, self.collisions)) or "no event"
        return f"<Trajectory of {self.model} in {self.final_time:.6g} s: {events}>"

    @property
    def lasting(self) -> bool:
        """Whether contacts last in some phase."""
        return not all(phase.free for phase in self.phases)

    def friction_limits(self, phase: Phase) -> Array:
        """Largest friction forces at the nodes of a phase, mu N of contacts and those of rails,
        shape (N + 1, len(rubbing)); NaN where the coefficient is not known."""
        normal = dict(zip(phase.closed, phase.normal.T, strict=True))
        normal = {second_of(name): N for name, N in normal.items()} | normal
        one, mu = np.ones(len(phase.t)), phase.coefficients.T
        if not mu.size:
            numbers = [self.friction.get(t) for t in phase.rubbing]
            mu = np.array([np.nan * one if x is None else x * one for x in numbers])
        limits = [a * normal.get(t, one) for a, t in zip(mu, phase.rubbing, strict=True)]
        return np.array(limits).reshape(len(limits), len(one)).T

    def input_ends(self, phase: Phase) -> tuple[Array, Array]:
        """Inputs at the start and at the end of every step of a phase, shape (N, nu) each; in
        between they are linear."""
        at = self.input_form.starts(phase.steps)
        return phase.u[at], phase.u[at + self.input_form.width]

    def input_sides(self, phase: Phase) -> tuple[Array, Array]:
        """Inputs before and after each node of a phase, shape (N + 1, nu) each."""
        if not phase.steps:
            return self.last_inputs[None], self.last_inputs[None]
        u0, u1 = self.input_ends(phase)
        return np.vstack([u0[:1], u1]), np.vstack([u0, u1[-1:]])

    @property
    def last_inputs(self) -> Array:
        """Inputs that the motion ends with, shape (nu,)."""
        return last_inputs(self.phases, self.input_form)

    def input_times(self, phase: Phase) -> Array:
        """Times in seconds that the rows of u of a phase stand for, shape (rows,)."""
        return self.input_form.times(phase.t)

    @property
    def input_form(self) -> InputForm:
        return FORMS[self.controls]

    @property
    def final_time(self) -> float:
        return float(self.phases[-1].t[-1])


def last_inputs(phases: Sequence[Phase], form: InputForm) -> Array:
    """Inputs at the end of the last step of some phases, shape (nu,)."""
    last = [phase for phase in phases if phase.steps][-1]
    return np.asarray(last.u[form.starts(last.steps)[-1] + form.width])


def by_grip(names: Sequence[str], grips: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Names of surfaces, with the name of a grip for all its places."""
    of_place = {place: grip for grip, places in grips.items() for place in places}
    return tuple(dict.fromkeys(of_place.get(name, name) for name in names))


def mode_word(closed: Sequence[str], rubbing: Mapping[str, int]) -> str:
    """The contacts that are closed and the tangents that rub, as "left:stick"; "free" for none. Of
    a contact with two tangential directions both do the same."""
    names = [rubbing_word(c, rubbing[c]) if c in rubbing else c for c in closed]
    both = [*closed, *(second_of(c) for c in closed if c in rubbing)]
    names += [rubbing_word(t, s) for t, s in rubbing.items() if t not in both]
    return " ".join(names) or "free"


def event_word(
    hit: str,
    lands: Sequence[str],
    leaves: Sequence[str],
    friction: Mapping[str, int],
    course: str = "",
    off: Sequence[str] = (),
) -> str:
    """What happens at an event in the words of a sequence, the same for the same: what is hit,
    lands, leaves, and rubs otherwise from then on; ``course`` is that of the friction in the
    impact, ``off`` what of that which leaves slips off an end."""
    sliding = {name: rubbing_word("", s) for name, s in friction.items() if not sticks(s)}
    during = f":{course}" if course else ""
    words = [hit + during] if hit else []
    words += [f"+{name}{during or sliding.get(name, '')}" for name in lands]
    words += [f"{OFF if name in off else '-'}{name}" for name in leaves]
    words += [rubbing_word(name, s) for name, s in friction.items() if name not in lands]
    return " ".join(words) or "no change"


def noun_of(words: Iterable[str], switches: Sequence[str] = ()) -> str:
    """Noun for the words of sequences, with the switches of the model: "collision" where all of
    them are hits, else "event"."""
    hits = all(
        not word.startswith(SIGNS) and not {":", " "} & set(word) and word not in switches
        for word in words
    )
    return "collision" if hits else "event"


def impulses_in_words(collision: Collision) -> str:
    """The impulses of an event, each with its contact where they are several or not of a hit
    alone."""
    if collision.grazes:
        return ", grazes"
    if collision.switch:
        return ""
    if collision.word == collision.surface and not collision.tractions:
        return f", impulse {collision.impulse:.6g}"
    values = (*collision.impulses.values(), *collision.tractions.values())
    least = SAME * max(map(abs, values), default=0.0)

    def in_words(what: str, of: Mapping[str, float]) -> str:
        return "".join(f", {what} {v if abs(v) > least else 0:.6g} of {n}" for n, v in of.items())

    along = "tangential" if collision.word == collision.surface else "friction"
    return in_words("impulse", collision.impulses) + in_words(along, collision.tractions)
