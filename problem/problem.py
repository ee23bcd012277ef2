"""The statement of an optimal control problem: boundary states, sequence of collisions, steps,
bounds, parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from dmoc.base.arguments import Interval, Range
from dmoc.base.discretisation import DISCRETISATIONS, Discretisation
from dmoc.base.errors import ProblemError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.records import value_class
from dmoc.base.signatures import public
from dmoc.base.table import Shown, Table
from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import ParameterValue
from dmoc.mechanics.phase_models import PhaseModels, check_geometry
from dmoc.problem.attitudes import ends_of
from dmoc.problem.contacts import (
    open_hits_of,
    redundant_of,
    restitution_values_of,
    touch_of,
    words_of,
)
from dmoc.problem.derived import kept, like, unread
from dmoc.problem.design import (
    at_bounds,
    design_bounds_of,
    first_design,
    parameter_values_of,
    unchosen,
)
from dmoc.problem.end_states import check_ends
from dmoc.problem.quantities import quantity_ranges_of, total_bounds_of, total_limits_of
from dmoc.problem.ranges import (
    Boundary,
    boundary_of,
    check_last_event,
    check_size,
    coordinate_bounds_of,
    duration,
    durations_of,
    ends_with_event,
    hit_quantity_bounds_of,
    input_bounds_of,
    limits_of,
    phase_steps_of,
    quantity_bounds_of,
    steps_of,
    velocity_bounds_of,
    via_of,
)
from dmoc.problem.reach import end_speeds_of, inertia_of, operating_inputs_of, reach_of, spread_of
from dmoc.problem.relations import goal_position_of, relations_of, start_position_of, unsaid_of
from dmoc.problem.statement import read, statement_in_short, table_of_problem

if TYPE_CHECKING:
    from dmoc.codegen.system_kernels import GivenModel


@public(ProblemError)
@value_class(frozen=True)
class Problem(Shown):
    """An optimal control problem for a fixed sequence of collisions.

    Parameters
    ----------
    kernels : Kernels or MechanicalSystem
        The model's kernels, from :func:`dmoc.build` or :func:`dmoc.load`; those of a system are
        built, of order 2 for ``steps`` that are given.
    start, goal : mapping
        State at both ends by name: a coordinate ("alpha"), a velocity ("alpha_dot"), a momentum
        ("p_alpha") or a quantity of the model; SymPy symbols serve as names.  A number fixes a
        value, a pair bounds it (None for no bound), None leaves it free; an attitude
        (:func:`dmoc.attitude`) has its own name.  Positions are given at the start, unless they
        are periodic or follow from the constraints; a velocity that is not given there is zero, or
        what they make of the others and of the time.  At the goal, what is not given is free.
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
        Number of steps N_i of each phase; one phase more than collisions, 0 for a last one whose
        duration is 0.  Without it a solve chooses its mesh: it begins with a coarse one and refines
        it; and the kernels of a system are built of order 4, unless ``controls`` is one of order 2
        alone.
    final_time : number or pair, optional
        Final time t_E in seconds, or its bounds (None for no bound).
    durations : sequence of pairs, optional
        Bounds of the duration T_i of each phase in seconds.  The last may be 0: the motion ends
        with its last event, a hit or a landing.  Goal, periodic states and the objective speak of
        the state after it, and the last phase has one node and no steps.
    bounds : mapping, optional
        Bounds (lower, upper) of inputs, states and quantities by name at all times, None for none.
    parameters : mapping, optional
        Parameter values that replace the model's: a number, or one for each phase.  At an event the
        values are those of the phase that it ends; positions and velocities stay as they are where
        values change behind it, and what leaves takes its momentum with it.
    controls : {"constant", "linear", "stages"}, optional
        Inputs constant in each step, linear between nodes, or linear in each step with values of
        its own at both ends.  Kernels of order 2 take "constant" (default) or "linear" (default
        with contacts that last), those of a higher order "stages" (default) or "constant".
    restitution : number or mapping, optional
        Coefficient e in [0, 1] of all surfaces, or by surface: 1 is elastic, 0 perfectly plastic,
        the contact released at once.  Newton's, and Poisson's where friction acts in the hit.
        Surfaces without a number have the restitution of the model, and are elastic where that
        states none.
    periodic : sequence of str, or mapping, optional
        States (coordinates, velocities, momenta by name) that end as they start; one that ``start``
        does not give is free there.  A mapping says which ends as which, so that a gait may
        exchange its legs ({"left": "right", "right": "left"}) or turn round ({"x": "-x"}); as a sum
        of states in symbols ({x: -x, left: right + 0.5}) or in factors ({"x": {"x": -1, "y": 2}}).
        With a difference, ``{"x": ("x", 0.5)}``, the end is that much further; None for any.
    minimal_times : bool, optional
        Guide ``slsqp`` by the estimated shortest times at full input, equation :eq:`minimal-time`
        of the theory: bounds of the phases before collisions, which may hold no answer.
    contacts : sequence of str, optional
        Surfaces that are closed at the start, with their friction ("foot", "foot:slip+"), and rails
        that slide then; what rubs and is not said to slide sticks.
    design : mapping, optional
        Parameters of the model that the solver chooses together with the motion, by name: ranges
        (lower, upper), None for no bound, or a number, which is kept.  A solve begins with the
        model's own value where it lies in the range, else with the middle of the range, or with
        what ``guess`` gives.
    ignored : sequence of str, optional
        Surfaces that hold nothing back where the sequence does not name them: feet without knees,
        which scuff the floor as they swing.  What the sequence leaves opens: its first step away is
        no way through the surface.
    via : sequence of mappings, optional
        Coordinates, and quantities of these, at the events by name, one mapping for each (None for
        nothing): numbers or ranges.

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
    parameters: Mapping[Any, ParameterValue] = field(default_factory=dict)
    controls: str | None = None
    restitution: float | Mapping[str, float] | None = None
    periodic: Sequence[str] | Mapping[Any, Any] = ()
    minimal_times: bool = False
    contacts: Sequence[str] = ()
    via: Sequence[Mapping[Any, Any] | None] | None = None
    ignored: Sequence[str] = ()
    design: Mapping[Any, Any] = field(default_factory=dict)
    measured: ClassVar[bool] = False  # whether the start may lie beyond bounds of quantities

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
            parameters: Mapping[Any, ParameterValue] = ...,
            controls: str | None = ...,
            restitution: float | Mapping[str, float] | None = ...,
            periodic: Sequence[str] | Mapping[Any, Any] = ...,
            minimal_times: bool = ...,
            contacts: Sequence[str] = ...,
            via: Sequence[Mapping[Any, Any] | None] | None = ...,
            ignored: Sequence[str] = ...,
            design: Mapping[Any, Any] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        read(self)
        # The properties below check what they read.
        _ = self.relations, self.touch, self.via_bounds
        _ = self.design_bounds, self.parameter_values, self.restitution_values
        _ = self.input_bounds, self.coordinate_bounds, self.velocity_bounds, self.quantity_bounds
        _ = self.final_time_bounds, self.duration_bounds, self.hit_quantity_bounds
        check_geometry(self.models, ProblemError)
        check_last_event(self)
        _ = self.start_bounds, self.goal_bounds, self.quantity_ranges, self.total_bounds
        check_ends(self)

    def __repr__(self) -> str:
        return f"<Problem of {self.kernels.name}: {statement_in_short(self)}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        return table_of_problem(self)

    def but(self, **changes: Any) -> Problem:
        """Return the same problem with some fields replaced."""
        other = replace(self, **changes)
        return other.in_rates() if self.by_rates else other

    def in_rates(self) -> Problem:
        """Return the same problem, whose programs state the law of impact in the rates of the gaps
        instead of the discrete energies."""
        return like(self, by_rates=True)

    def unchecked(self, **changes: Any) -> Problem:
        """Return the same problem with some fields replaced as they are: small changes may leave
        the admissible set by as little."""
        other = unread(self, changes)
        return other.in_rates() if self.by_rates else other

    def meshed(self, steps: int | Sequence[int]) -> Problem:
        """Return the same problem with other numbers of steps, which nothing else that was checked
        or found depends on."""
        other = like(self, steps=steps)
        object.__setattr__(other, "steps", steps_of(other))
        if self.steps is not None and other.phase_steps == self.phase_steps:
            return self
        check_size(other)
        return other

    def __getstate__(self) -> dict[str, Any]:
        return kept(self)

    # Sizes and kinds ------------------------------------------------------------------------------

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
    def phase_steps(self) -> tuple[int, ...]:
        """Steps N_i of each phase; those of the first mesh where they are not given."""
        return phase_steps_of(self)

    @property
    def ends_with_event(self) -> bool:
        """Whether the motion ends with its last event: the phase after it has no steps."""
        return ends_with_event(self)

    @property
    def states(self) -> list[str]:
        """Names of all coordinates, velocities and momenta."""
        names = self.kernels.coordinates
        return [*names, *map(velocity_name, names), *map(momentum_name, names)]

    @property
    def order(self) -> int:
        """Order of the discretisation."""
        return self.kernels.manifest.order

    @property
    def scheme(self) -> Discretisation:
        """The discretisation of the kernels."""
        return DISCRETISATIONS[self.order]

    @property
    def explicit_time(self) -> bool:
        """Whether the model depends explicitly on the time."""
        return self.kernels.manifest.explicit_time

    @property
    def lasting(self) -> bool:
        """Whether contacts last in some phase."""
        return not self.touch.free

    @cached_property
    def held(self) -> bool:
        """Whether anything is held along a phase: by contacts that last, or by constraints."""
        return self.lasting or bool(self.kernels.joints)

    @property
    def control_form(self) -> str:
        """The form of the inputs: ``controls``, or the default: that of the order, and linear ones
        beside what is held, whose forces would jump with the inputs at every node."""
        if self.controls is not None:
            return self.controls
        linear = self.held and "linear" in self.scheme.controls
        return "linear" if linear else self.scheme.controls[0]

    @cached_property
    def by_rates(self) -> bool:
        """Whether programs state the law of impact in rates; it is set by in_rates."""
        return False

    @cached_property
    def relaxation(self) -> float:
        """Size eps by which complementarity is relaxed; dmoc.problem.derived sets it."""
        return 0.0

    # What follows, each found once; its function says what it is ----------------------------------

    ends = cached_property(ends_of)
    relations = cached_property(relations_of)
    design_bounds = cached_property(design_bounds_of)
    design_values = cached_property(first_design)
    parameter_values = cached_property(parameter_values_of)
    design_ends = cached_property(at_bounds)
    restitution_values = cached_property(restitution_values_of)
    touch = cached_property(touch_of)
    words = cached_property(words_of)
    open_hits = cached_property(open_hits_of)
    redundant = cached_property(redundant_of)
    via_bounds = cached_property(via_of)
    duration_bounds = cached_property(durations_of)
    input_bounds = cached_property(input_bounds_of)
    coordinate_bounds = cached_property(coordinate_bounds_of)
    velocity_bounds = cached_property(velocity_bounds_of)
    quantity_bounds = cached_property(quantity_bounds_of)
    hit_quantity_bounds = cached_property(hit_quantity_bounds_of)
    limits = cached_property(limits_of)
    total_bounds = cached_property(total_bounds_of)
    total_limits = cached_property(total_limits_of)
    quantity_ranges = cached_property(quantity_ranges_of)
    start_position = cached_property(start_position_of)
    goal_position = cached_property(goal_position_of)
    unsaid = cached_property(unsaid_of)
    inertia = cached_property(inertia_of)
    reach = cached_property(reach_of)
    spread = cached_property(spread_of)
    end_speeds = cached_property(end_speeds_of)
    operating_inputs = cached_property(operating_inputs_of)

    # Values ---------------------------------------------------------------------------------------

    @property
    def friction(self) -> Array:
        """Coefficients of friction, (phases, nt); not numbers where they vary or are chosen."""
        return unchosen(self, self.models.friction(self.phases)[0], "bearing")

    @property
    def static_friction(self) -> Array:
        """Static coefficients of friction, as ``friction``."""
        return unchosen(self, self.models.friction(self.phases)[1], "holding")

    @cached_property
    def models(self) -> PhaseModels:
        """The model with its parameter values in each phase."""
        return PhaseModels(self.kernels, self.parameter_values)

    @cached_property
    def model(self) -> Model:
        """The model at the start; what does not change by phase is that of all phases."""
        return self.models[0]

    @cached_property
    def start_bounds(self) -> Boundary:
        return boundary_of(self, "start")

    @cached_property
    def goal_bounds(self) -> Boundary:
        return boundary_of(self, "goal")

    @cached_property
    def final_time_bounds(self) -> Range:
        return duration(self.final_time, "final_time")
