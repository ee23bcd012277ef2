"""The statement of an optimal control problem: boundary states, sequence of collisions, steps,
bounds, parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.arguments import (
    Interval,
    Range,
    check_known,
    flag,
    interval,
    limits,
    listed,
    names,
    shown,
    whole,
)
from dmoc.base.discretisation import DISCRETISATIONS, Discretisation
from dmoc.base.errors import ProblemError
from dmoc.base.names import momentum_name, name_of, velocity_name
from dmoc.base.table import Shown, Table
from dmoc.codegen.kernels import Array, Kernels
from dmoc.codegen.system_kernels import kernels_of
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import by_name, parameter_row, restitution_row
from dmoc.mechanics.modes import Contacts, Event, PhaseMode, along, is_open, mode_of, words_along
from dmoc.mechanics.possible_words import courses_of
from dmoc.problem.end_states import check_admissible, check_contacts, check_kinks, check_mass_matrix
from dmoc.problem.statement import statement_in_short, table_of_problem

if TYPE_CHECKING:
    from dmoc.codegen.system_kernels import GivenModel

IN_PHASE = " steps in each phase"
BOX = "expected a pair (lower, upper) such as (-5, 5) or (None, 5), where (5, 5) holds the value 5"

# Order of the kernels of a system, with steps that are given and without; steps of a phase, times
# the degree of the discretisation, of the first mesh of a solve that chooses its own.
DEFAULT_ORDER, AUTOMATIC_ORDER, FIRST_MESH = 2, 4, 100
MOST_STEPS = (
    100_000  # beyond it rounding errors of v = (q_kp1 - q_k)/h outweigh those of the discretisation
)
# Newton steps to the surface where a motion may begin anywhere, and times at which a surface is
# looked at to see how far it moves.
NEWTON, MOVING = 30, 33
# Share of what inertias make of the ways of others below which a coordinate's forces balance.
BALANCED = 1e-8
# Unknowns of all steps; the compiled method takes some 2.5 kB for each of them, 5 GB for so many.
MOST_UNKNOWNS = 2_000_000
# Seconds of a motion; powers of the times of its steps stay within the numbers.
LONGEST_TIME = 1e60


@dataclass(frozen=True)
class Boundary:
    """Bounds of the state at one end: shape (nq, 2) each; equal bounds fix a value, infinite
    ones leave it free."""

    position: Array
    velocity: Array
    momentum: Array
    by_velocity: bool = False  # the momenta stand for velocities that were given

    @property
    def needs_velocity(self) -> bool:
        return bool(np.isfinite(self.velocity).any())


@dataclass(frozen=True)
class Relation:
    """A state at the end is one at the start and a difference between two bounds further."""

    end: str
    start: str
    low: float = 0.0
    high: float = 0.0

    @property
    def fixed(self) -> bool:
        return self.low == self.high


@dataclass(frozen=True)
class Problem(Shown):
    """An optimal control problem for a fixed sequence of collisions.

    Parameters
    ----------
    kernels : Kernels or MechanicalSystem
        The model's kernels, from :func:`dmoc.build` or :func:`dmoc.load`; those of a system are
        built, of order 2 for ``steps`` that are given.
    start, goal : mapping
        State at both ends by name: a coordinate ("alpha"), a velocity ("alpha_dot") or a momentum
        ("p_alpha"); SymPy symbols serve as names.  A number fixes a value, a pair bounds it (None
        for no bound), None leaves it free.  Every position must be given at the start, unless it is
        periodic; a velocity that is not given there is zero.  At the goal, what is not given is
        free.
    sequence : sequence of str
        What happens between the phases, in its order; empty for a motion of one phase.  "wall" is
        hit and released; if the model gives it friction, "wall:slip+" and "wall:slip-" say that it
        slides all along, "wall:slip+:stick" and "wall:slip+:slip-" that sliding stops during
        compression and the contact sticks or turns, ":late" behind these that it stops during
        restitution, "wall:stick" that it sticks from the beginning, and :func:`dmoc.solve` tries
        them all for "wall" alone.  "+foot" lands and stays closed (sticking where the model gives
        it friction, "+foot:slip+" and "+foot:slip-" sliding in one direction, "+foot:slip+:slip-"
        turning while it lands), "-foot" leaves, "foot:stick", "foot:slip+", "foot:slip-" change the
        friction of a closed contact or a rail; several at one event are separated by blanks
        ("+right -left").
    steps : int or sequence of int, optional
        Number of steps N_i of each phase; one phase more than collisions.  Without it a solve
        chooses its mesh: it begins with a coarse one and refines it; and the kernels of a system
        are built of order 4, unless ``controls`` is one of order 2 alone.
    final_time : number or pair, optional
        Final time t_E in seconds, or its bounds (None for no bound).
    durations : sequence of pairs, optional
        Bounds of the duration T_i of each phase in seconds.
    bounds : mapping, optional
        Bounds (lower, upper) of inputs and coordinates by name, at all times; None for no bound.
    parameters : mapping, optional
        Parameter values that replace the model's.
    controls : {"constant", "linear", "stages"}, optional
        Inputs constant in each step, linear between nodes, or linear in each step with values of
        its own at both ends.  Kernels of order 2 take "constant" (default) or "linear" (default
        with contacts that last), those of a higher order "stages" (default) or "constant".
    restitution : number or mapping, optional
        Coefficient e in [0, 1] of all surfaces, or by surface (others are elastic): 1 is elastic
        (default), 0 perfectly plastic, the contact released at once.  Newton's, and Poisson's where
        friction acts in the hit.
    periodic : sequence of str, or mapping, optional
        States (coordinates, velocities, momenta by name) that end as they start; one that ``start``
        does not give is free there.  A mapping from states at the end to states at the start says
        which ends as which, so that a gait may exchange its legs ({"left": "right", "right":
        "left"}); with a difference, ``{"x": ("x", 0.5)}``, the end is that much further, a number,
        a range or None for any.
    minimal_times : bool, optional
        Bound each phase before a collision from below by the estimated shortest time at full input.
    contacts : sequence of str, optional
        Surfaces that are closed at the start, with their friction ("foot", "foot:slip+"), and rails
        that slide then; what rubs and is not said to slide sticks.
    ignored : sequence of str, optional
        Surfaces that hold nothing back where the sequence does not name them: feet without knees,
        which scuff the floor as they swing.
    via : sequence of mappings, optional
        Coordinates at the events by name, one mapping for each (None for nothing): numbers or
        ranges.

    Raises
    ------
    ProblemError
        If a name is unknown, a value is missing, not finite or reversed, the start or goal lies
        outside the admissible set, the mass matrix at the start is not positive definite, or the
        contacts do not fit the sequence or the start.

    Examples
    --------
    A puck among four walls, from one state to another one by way of the wall in the east:

    >>> import dmoc
    >>> problem = dmoc.Problem(
    ...     dmoc.load("puck_table"),
    ...     start={"x": 0.3, "y": 0.2, "x_dot": 1.5},
    ...     goal={"x": 0.4, "y": (0.5, None)},
    ...     sequence=["east"],
    ...     steps=20,
    ...     final_time=(0.5, 2.0),
    ... )
    >>> problem.phases
    2
    >>> problem.but(sequence=["east", "north"]).phases
    3
    """

    kernels: Kernels
    start: Mapping[Any, Any] = field(default_factory=dict)
    goal: Mapping[Any, Any] = field(default_factory=dict)
    sequence: Sequence[str] = ()
    steps: int | Sequence[int] | None = None
    final_time: Interval = (None, None)
    durations: Sequence[Interval] | None = None
    bounds: Mapping[Any, Any] = field(default_factory=dict)
    parameters: Mapping[Any, float] = field(default_factory=dict)
    controls: str | None = None
    restitution: float | Mapping[str, float] = 1.0
    periodic: Sequence[str] | Mapping[Any, Any] = ()
    minimal_times: bool = True
    contacts: Sequence[str] = ()
    via: Sequence[Mapping[Any, Any] | None] | None = None
    ignored: Sequence[str] = ()

    if TYPE_CHECKING:
        # The fields again, for what may be given in place of kernels.
        def __init__(
            self,
            kernels: GivenModel,
            start: Mapping[Any, Any] = ...,
            goal: Mapping[Any, Any] = ...,
            sequence: Sequence[str] = ...,
            steps: int | Sequence[int] | None = ...,
            final_time: Interval = ...,
            durations: Sequence[Interval] | None = ...,
            bounds: Mapping[Any, Any] = ...,
            parameters: Mapping[Any, float] = ...,
            controls: str | None = ...,
            restitution: float | Mapping[str, float] = ...,
            periodic: Sequence[str] | Mapping[Any, Any] = ...,
            minimal_times: bool = ...,
            contacts: Sequence[str] = ...,
            via: Sequence[Mapping[Any, Any] | None] | None = ...,
            ignored: Sequence[str] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        put = object.__setattr__
        order = AUTOMATIC_ORDER if self.steps is None else DEFAULT_ORDER
        others = DISCRETISATIONS[order].controls
        if isinstance(self.controls, str) and self.controls not in others:
            order = DEFAULT_ORDER
        put(self, "sequence", tuple(names(self.sequence, "sequence", "surfaces")))
        put(self, "contacts", tuple(names(self.contacts, "contacts", "surfaces")))
        if says_held(self.kernels, self.contacts, self.sequence):
            order = DEFAULT_ORDER  # the only one for contacts that last and for constraints
        put(self, "kernels", kernels_of(self.kernels, order))
        for name in ("start", "goal", "bounds", "parameters"):
            put(self, name, by_name(getattr(self, name), name))
        if not isinstance(self.control_form, str) or self.control_form not in self.scheme.controls:
            known = ", ".join(self.scheme.controls)
            raise ProblemError(
                f"controls = {shown(self.controls)}: expected one of {known} with kernels of order "
                f"{self.order}."
            )
        put(self, "ignored", tuple(names(self.ignored, "ignored", "surfaces")))
        for name in self.ignored:
            check_known(name, self.kernels.surfaces, "surface", "in ignored")
        put(self, "minimal_times", flag(self.minimal_times, "minimal_times"))
        self._normalise_steps()
        self._normalise_periodic()
        if self.durations is not None:
            put(
                self,
                "durations",
                tuple(listed(self.durations, "durations", "ranges, one for each phase")),
            )
        if self.via is not None:
            put(self, "via", tuple(listed(self.via, "via", "mappings, one for each event")))
        # The properties below check what they read.
        _ = (
            self.modes,
            self.via_bounds,
            self.parameter_values,
            self.restitution_values,
            self.input_bounds,
            self.coordinate_bounds,
            self.final_time_bounds,
            self.duration_bounds,
        )
        _ = self.start_bounds, self.goal_bounds
        check_kinks(self)
        check_mass_matrix(self)
        check_admissible(self, "start", self.start_bounds)
        check_admissible(self, "goal", self.goal_bounds)
        check_contacts(self)

    def __repr__(self) -> str:
        return f"<Problem of {self.kernels.name}: {statement_in_short(self)}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        return table_of_problem(self)

    def but(self, **changes: Any) -> Problem:
        """Return the same problem with some fields replaced."""
        return replace(self, **changes)

    def unchecked(self, **changes: Any) -> Problem:
        """Return the same problem with some fields replaced as they are: small changes may leave
        the admissible set by as little."""
        other = object.__new__(Problem)
        for item in fields(self):
            object.__setattr__(other, item.name, changes.get(item.name, getattr(self, item.name)))
        return other

    def meshed(self, steps: int | Sequence[int]) -> Problem:
        """Return the same problem with other numbers of steps, which nothing else that was checked
        or found depends on."""
        other = object.__new__(Problem)
        other.__dict__.update(self.__dict__, steps=steps)
        other._normalise_steps()
        return other

    # Sizes ----------------------------------------------------------------------------------------

    @property
    def nq(self) -> int:
        return len(self.kernels.coordinates)

    @property
    def nu(self) -> int:
        return len(self.kernels.inputs)

    @property
    def phases(self) -> int:
        return len(self.sequence) + 1

    @property
    def order(self) -> int:
        """Order of the discretisation."""
        return int(self.kernels.manifest["order"])

    @property
    def scheme(self) -> Discretisation:
        """The discretisation of the kernels."""
        return DISCRETISATIONS[self.order]

    @property
    def explicit_time(self) -> bool:
        """Whether the model depends explicitly on the time."""
        return bool(self.kernels.manifest["explicit_time"])

    @property
    def control_form(self) -> str:
        """The form of the inputs: ``controls``, or the default: that of the order, and linear ones
        beside what is held, whose forces would jump with the inputs at every node."""
        if self.controls is not None:
            return self.controls
        linear = self.held and "linear" in self.scheme.controls
        return "linear" if linear else self.scheme.controls[0]

    # Contacts -------------------------------------------------------------------------------------

    @cached_property
    def _along(self) -> tuple[tuple[Event, ...], tuple[PhaseMode, ...]]:
        return along(mode_of(self.contacts, self.touches), self.sequence, self.touches)

    @property
    def events(self) -> tuple[Event, ...]:
        """What happens between the phases."""
        return self._along[0]

    @property
    def modes(self) -> tuple[PhaseMode, ...]:
        """What is in contact in each phase."""
        return self._along[1]

    @cached_property
    def open_hits(self) -> dict[int, list[str]]:
        """Hits with friction whose course is not said, by their places in the sequence, and the
        words that say it."""
        found = {}
        for i, (word, event) in enumerate(zip(self.sequence, self.events, strict=True)):
            if is_open(event, self.touches):
                rest = [part for part in word.split() if part != event.hit]
                ways = courses_of(event.hit, self.touches)
                found[i] = [" ".join([way, *rest]) for way in ways]
        return found

    @cached_property
    def words(self) -> tuple[str, ...]:
        """The events in words that are the same for the same event; those of a motion are, too."""
        return words_along(self.modes, self.events)

    @cached_property
    def lasting(self) -> bool:
        """Whether contacts last in some phase."""
        return not all(mode.free for mode in self.modes)

    @cached_property
    def held(self) -> bool:
        """Whether anything is held along a phase: by contacts that last, or by constraints."""
        return self.lasting or bool(self.kernels.joints)

    @cached_property
    def touches(self) -> Contacts:
        """What can touch in the model."""
        surfaces, tangents = tuple(self.kernels.surfaces), tuple(self.kernels.tangents)
        elastic = dict(zip(surfaces, self.restitution_values, strict=True))
        rubs = dict(zip(tangents, self.model.friction, strict=True))
        return Contacts(
            surfaces,
            tangents,
            tuple(s for s in surfaces if elastic[s] == 0),
            tuple(s for s in surfaces if rubs.get(s, 0.0) > 0),
        )

    @cached_property
    def relations(self) -> tuple[Relation, ...]:
        """What ``periodic`` says of the end and the start."""
        given = self.periodic
        pairs = given.items() if isinstance(given, Mapping) else [(n, n) for n in given]
        return tuple(self._relation(str(end), value) for end, value in pairs)

    def _relation(self, end: str, value: Any) -> Relation:
        start, difference = value, 0.0
        if isinstance(value, (tuple, list)) and len(value) == 2:
            start, difference = value
        elif isinstance(value, (tuple, list)):
            raise ProblemError(
                f"periodic: {end!r} has {shown(value)}: expected a state at the start such as "
                "'x', or a pair of one and a difference such as ('x', 0.5)."
            )
        start = name_of(start)
        for name in (end, start):
            check_known(name, self.states, "state", "in periodic")
        return Relation(end, start, *interval(difference, f"the difference of {end} in periodic"))

    @cached_property
    def via_bounds(self) -> Array:
        """Bounds of the coordinates at the events, shape (events, nq, 2)."""
        given = [None] * len(self.sequence) if self.via is None else self.via
        if len(given) != len(self.sequence):
            raise ProblemError(
                f"via has {len(given)} entries: expected one for each of the {len(self.sequence)} "
                "events of the sequence."
            )
        found = np.tile((-np.inf, np.inf), (len(given), self.nq, 1))
        for i, places in enumerate(given):
            what = f"via of event {i + 1}"
            for name, value in by_name({} if places is None else places, what).items():
                check_known(name, self.kernels.coordinates, "coordinate", f"in {what}")
                j = self.kernels.coordinates.index(name)
                found[i, j] = interval(value, f"{what}: {name}")
                low, high = self.coordinate_bounds[j]
                if found[i, j, 1] < low or found[i, j, 0] > high:
                    raise ProblemError(
                        f"{what}: {name} = {shown(value)} lies outside its bounds {low:g} to "
                        f"{high:g}: move one of them."
                    )
        return found

    # Values ---------------------------------------------------------------------------------------

    @cached_property
    def parameter_values(self) -> Array:
        """Parameter values in the model's order, shape (1, npar)."""
        return parameter_row(self.kernels, self.parameters)

    @cached_property
    def model(self) -> Model:
        """The model with its parameter values."""
        return Model(self.kernels, self.parameter_values)

    @cached_property
    def restitution_values(self) -> Array:
        """Coefficient of restitution of each surface, shape (nc,)."""
        return restitution_row(self.kernels, self.restitution)

    @cached_property
    def start_position(self) -> Array:
        """The position at the start: fixed values, middles of ranges, and for free ones what
        their bounds have nearest to zero; where neither end says anything of a coordinate, it is
        that of the first surface of the sequence."""
        q = midpoints(self.start_bounds.position, np.zeros(self.nq))
        return self._onto_first(q)

    @cached_property
    def unsaid(self) -> Array:
        """1 for coordinates of which neither start nor goal say where they are, else 0."""
        ends = np.hstack([self.start_bounds.position, self.goal_bounds.position])
        return np.where(np.isinf(ends).all(axis=1), 1.0, 0.0)

    def _onto_first(self, q: Array) -> Array:
        """Move the coordinates of which nothing is said onto the first surface of the sequence, as
        it is at the start; the point as it is where that does not lead there."""
        surfaces = [event.surface for event in self.events if event.surface]
        if not surfaces or not self.unsaid.any():
            return q
        j, at = self.model.surface_numbers[surfaces[0]], q.copy()
        inertia = np.abs(np.diagonal(self.model.mass(q)))
        with np.errstate(all="ignore"):
            for _ in range(NEWTON):
                gap, slope = self.model.gaps(at)[j], self.model.gap_slopes(at)[j, :-1] * self.unsaid
                if abs(gap) <= self.model.gap_rounding(at, 0.0)[j]:
                    return at
                at = at - gap * (slope / inertia) / (slope @ (slope / inertia))
        return q

    @property
    def start_is_known(self) -> bool:
        """Whether position and velocity at the start are fixed."""
        b = self.start_bounds
        fixed = [bool((a[:, 0] == a[:, 1]).all()) for a in (b.position, b.velocity, b.momentum)]
        return fixed[0] and (fixed[1] or fixed[2])

    @cached_property
    def inertia(self) -> Array:
        """Diagonal of the mass matrix at the start, shape (nq,)."""
        return np.diagonal(self.model.mass(self.start_position)).copy()

    @cached_property
    def reach(self) -> Array:
        """How far each coordinate may be expected to move: to the goal, to zero, to the surfaces
        of the sequence, or, where that says nothing, what the inertias make of the reach of the
        others, shape (nq,)."""
        start, goal = self.start_position, midpoints(self.goal_bounds.position, self.start_position)
        known = np.max(np.abs([goal - start, start, goal]), axis=0) * (1 - self.unsaid)
        if self.kernels.surfaces:
            slopes, gaps = self.model.gap_slopes(start), np.abs(self.model.gaps(start))
            gaps = np.where(gaps <= self.model.gap_rounding(start), 0.0, gaps)
            for j in {self.model.surface_numbers[e.surface] for e in self.events if e.surface}:
                size = np.abs(slopes[j, :-1])
                with np.errstate(divide="ignore", invalid="ignore"):
                    away = np.where(size > 0, gaps[j] / size, 0.0)
                known = np.where((known == 0) & np.isfinite(away), away, known)
        box = self.coordinate_bounds
        width = np.where(
            np.isfinite(box).all(axis=1), np.ptp(np.where(np.isfinite(box), box, 0.0), axis=1), 0.0
        )
        known = np.where(known > 0, known, width)
        root = np.sqrt(np.abs(self.inertia))
        known = np.where(known > 0, known, (known * root).max() / np.where(root > 0, root, 1.0))
        return known if (known > 0).all() else np.where(known > 0, known, self._swing)

    @property
    def _swing(self) -> Array:
        """How far each coordinate gets in the time that a problem allows where nothing else says
        so, shape (nq,): up and down against its forces in a phase, or as far as surfaces of the
        sequence move; where these balance, what the inertias make of the others; 1 where these
        say nothing either."""
        low, high = self.final_time_bounds
        time = high if np.isfinite(high) else max(low, 0.0)
        with np.errstate(all="ignore"):
            force = np.abs(self.model.acceleration(self.start_position, u=np.zeros(self.nu)))
            swing = np.where(np.isfinite(force), force, 0.0) * (time / self.phases) ** 2 / 8
            times = np.linspace(0.0, time, MOVING)
            gaps = self.model.gaps(np.tile(self.start_position, (MOVING, 1)), times)
            slopes = np.abs(self.model.gap_slopes(self.start_position)[:, :-1])
            for j in {self.model.surface_numbers[e.surface] for e in self.events if e.surface}:
                moved = np.ptp(gaps[:, j]) / slopes[j]
                swing = np.where(np.isfinite(moved), np.maximum(swing, moved), swing)
        root = np.sqrt(np.abs(self.inertia))
        share = (swing * root).max() / np.where(root > 0, root, 1.0)
        swing = np.where(swing > BALANCED * share, swing, share)
        return np.where(swing > 0, swing, 1.0)

    @cached_property
    def start_bounds(self) -> Boundary:
        return self._boundary("start", self.start)

    @cached_property
    def goal_bounds(self) -> Boundary:
        return self._boundary("goal", self.goal)

    @cached_property
    def input_bounds(self) -> Array:
        """Bounds of the inputs, shape (nu, 2)."""
        return self._boxes(self.kernels.inputs)

    @cached_property
    def coordinate_bounds(self) -> Array:
        """Bounds of the coordinates, shape (nq, 2)."""
        return self._boxes(self.kernels.coordinates)

    @cached_property
    def final_time_bounds(self) -> Range:
        return _duration(self.final_time, "final_time")

    @cached_property
    def duration_bounds(self) -> Array:
        """Bounds of the durations T_i, shape (I + 1, 2)."""
        if self.durations is None:
            return np.tile((0.0, np.inf), (self.phases, 1))
        if len(self.durations) != self.phases:
            raise ProblemError(
                f"durations has {len(self.durations)} entries: expected one for each of the "
                f"{self.phases} phases."
            )
        return np.array(
            [_duration(d, f"durations of phase {i}") for i, d in enumerate(self.durations)]
        )

    # Checks ---------------------------------------------------------------------------------------

    def _normalise_steps(self) -> None:
        given = self.steps
        if given is None:
            pass
        elif isinstance(given, (Sequence, np.ndarray)) and not isinstance(given, (str, bytes)):
            values = tuple(
                whole(n, f"steps of phase {i}", 2, MOST_STEPS, unit=IN_PHASE)
                for i, n in enumerate(listed(given, "steps", "numbers"))
            )
            if len(values) != self.phases:
                raise ProblemError(
                    f"steps = {shown(given)}: expected one number, or one for each of the "
                    f"{self.phases} phases."
                )
            object.__setattr__(self, "steps", values)
        else:
            object.__setattr__(self, "steps", whole(given, "steps", 2, MOST_STEPS, unit=IN_PHASE))
        unknowns = sum(self.phase_steps) * (self.nq + self.nu) * self.scheme.degree
        if unknowns > MOST_UNKNOWNS:
            raise ProblemError(
                f"steps = {shown(given or max(self.phase_steps))} makes {unknowns} unknowns in "
                f"{self.phases} phases: expected at most {MOST_UNKNOWNS}, more would not fit in "
                "memory; take fewer steps."
            )

    def _normalise_periodic(self) -> None:
        if isinstance(self.periodic, Mapping):
            object.__setattr__(self, "periodic", by_name(self.periodic, "periodic"))
            _ = self.relations
            return
        states = [name_of(name) for name in listed(self.periodic, "periodic", "states")]
        for i, name in enumerate(states):
            check_known(name, self.states, "state", "in periodic")
            if name in states[:i]:
                raise ProblemError(f"periodic names {name!r} twice: give it once.")
        object.__setattr__(self, "periodic", tuple(states))

    @property
    def phase_steps(self) -> tuple[int, ...]:
        """Steps N_i of each phase; those of the first mesh where they are not given."""
        if self.steps is None:
            return (FIRST_MESH // self.scheme.degree,) * self.phases
        return (
            tuple(self.steps) if isinstance(self.steps, Sequence) else (self.steps,) * self.phases
        )

    @property
    def states(self) -> list[str]:
        """Names of all coordinates, velocities and momenta."""
        names = self.kernels.coordinates
        return [*names, *map(velocity_name, names), *map(momentum_name, names)]

    def _boxes(self, names: Sequence[str]) -> Array:
        for name in self.bounds:
            check_known(
                name,
                [*self.kernels.inputs, *self.kernels.coordinates],
                "input or coordinate",
                "in the bounds",
            )
        boxes = [limits(self.bounds.get(name), f"bounds of {name}", BOX) for name in names]
        return np.array(boxes, dtype=float).reshape(len(names), 2)

    def _boundary(self, end: str, given: Mapping[str, Any]) -> Boundary:
        coordinates = self.kernels.coordinates
        velocities = [velocity_name(q) for q in coordinates]
        momenta = [momentum_name(q) for q in coordinates]
        for name in given:
            check_known(name, self.states, "state", f"at the {end}")
        free, turning = None, {relation.start for relation in self.relations}
        position, velocity, momentum = [], [], []
        for q, v, p in zip(coordinates, velocities, momenta, strict=True):
            if end == "start" and q not in given and q not in turning:
                raise ProblemError(
                    f"the start of {q} is not given: give a number, a range, or None to leave it "
                    "free."
                )
            rest = 0.0 if end == "start" and not {v, p} & {*given, *turning} else free
            position.append(interval(given.get(q, free), f"{end} of {q}"))
            velocity.append(interval(given.get(v, rest), f"{end} of {v}"))
            momentum.append(interval(given.get(p, free), f"{end} of {p}"))
        for q, v, p in zip(coordinates, velocities, momenta, strict=True):
            if all(isinstance(given.get(n), (int, float, np.number)) for n in (v, p)):
                raise ProblemError(
                    f"the {end} of {q} has a fixed velocity ({v}) and a fixed momentum ({p}): give "
                    "one of them."
                )
        boundary = Boundary(np.array(position), np.array(velocity), np.array(momentum))
        for q, (low, high), (below, above) in zip(
            coordinates, boundary.position, self.coordinate_bounds, strict=True
        ):
            if high < below or low > above:
                raise ProblemError(
                    f"the {end} of {q} ({low:g} to {high:g}) lies outside its bounds {below:g} to "
                    f"{above:g}."
                )
        return self._velocity_to_momentum(boundary, end == "start")

    def _velocity_to_momentum(self, boundary: Boundary, at_start: bool) -> Boundary:
        """Express fully fixed velocities at a fully fixed position as momenta, which needs no
        further unknowns.

        The same is done for rest at any position where L has no terms linear in the velocities, so
        that p = M(q) v = 0.  In a model that depends on the time these are known at the start
        alone.
        """
        velocity = boundary.velocity
        if np.isfinite(boundary.momentum).any() or not (velocity[:, 0] == velocity[:, 1]).all():
            return boundary
        if self.explicit_time and (velocity.any() or not at_start):
            return boundary
        fixed = bool((boundary.position[:, 0] == boundary.position[:, 1]).all())
        if not fixed and velocity.any():
            return boundary
        at = midpoints(boundary.position, np.zeros(self.nq))
        momentum = self.model.momentum(at, velocity[:, 0])
        if not np.isfinite(momentum).all() or (not fixed and momentum.any()):
            return boundary
        free, fixed_momentum = (
            np.full_like(velocity, (-np.inf, np.inf)),
            np.repeat(momentum[:, None], 2, axis=1),
        )
        return Boundary(boundary.position, free, fixed_momentum, by_velocity=True)


def says_held(model: Any, contacts: Sequence[str], sequence: Sequence[str]) -> bool:
    """Whether contacts last or constraints hold, where no kernels are known yet that could tell:
    words say so, or a system has constraints, or rails, which rub in every phase."""
    tangents = getattr(model, "tangents", None)
    rails = isinstance(tangents, dict) and bool(set(tangents) - set(getattr(model, "surfaces", ())))
    return rails or says_lasting(contacts, sequence) or bool(getattr(model, "constraints", ()))


def says_lasting(contacts: Sequence[str], sequence: Sequence[str]) -> bool:
    """Whether words say that contacts last."""
    return bool(contacts) or any(part.startswith("+") for word in sequence for part in word.split())


def midpoints(bounds: Array, default: Array) -> Array:
    """A value for each pair of bounds: the middle of two finite ones, else the default moved
    within them."""
    finite = np.isfinite(bounds).all(axis=1)
    with np.errstate(invalid="ignore"):
        middle = (bounds / 2).sum(axis=1)  # the sum of both could overflow
    return np.where(finite, middle, np.clip(default, bounds[:, 0], bounds[:, 1]))


def _duration(value: Any, what: str) -> Range:
    low, high = interval(value, what)
    if high <= 0 or -np.inf < low < 0:
        raise ProblemError(
            f"{what} = {shown(value)}: expected a positive time in seconds, or a range such as "
            "(0.1, None)."
        )
    for time in (low, high):
        if np.isfinite(time) and time > 0 and not 1 / LONGEST_TIME <= time <= LONGEST_TIME:
            raise ProblemError(
                f"{what} = {shown(value)}: expected times from {1 / LONGEST_TIME:g} to "
                f"{LONGEST_TIME:g} s; use another unit of time."
            )
    return max(low, 0.0), high
