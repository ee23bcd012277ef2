"""The description of a mechanical system: coordinates, inputs, Lagrangian, forces, surfaces,
parameters, cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.base.names import check_name, name_of
from dmoc.base.signatures import public
from dmoc.base.table import Shown, Table
from dmoc.symbolic.attitudes import with_attitudes
from dmoc.symbolic.definitions import expanded
from dmoc.symbolic.drawing import Part, with_normal
from dmoc.symbolic.event_sums import integrands_of, quantities_along
from dmoc.symbolic.expressions import slack_of
from dmoc.symbolic.fingerprint import digest
from dmoc.symbolic.grips import functions_of_grips
from dmoc.symbolic.strengths import loads_of
from dmoc.symbolic.surface_ends import inside_of
from dmoc.symbolic.system_checks import check_names, check_parts
from dmoc.symbolic.system_fields import containers_of, entries_of


@public(ModelError)
@dataclass(frozen=True)
class MechanicalSystem(Shown):
    """A mechanical system with inputs and unilateral constraints.

    Parameters
    ----------
    name : str
        Name of the model; a C identifier.
    coordinates : sequence of dynamicsymbols
        Generalised coordinates q, ``nq`` of them.
    lagrangian : Expr
        L(q, q', t), quadratic in the velocities.  The time is ``dynamicsymbols._t`` here and below.
    parameters : mapping of Symbol to float or None, optional
        Every other symbol of the model with its default value; None if a problem must give it.
    inputs : sequence of dynamicsymbols or Symbols, optional
        Inputs u, ``nu`` of them.
    forces : mapping of coordinate to Expr, optional
        By the coordinate or its name.  Generalised forces Q(q, q', u, t): the coefficients of the
        virtual work, dW = Q . dq.
    dissipation : Expr, optional
        Rayleigh function R(q, q'), which adds -dR/dq' to the forces: ``d * x.diff()**2 / 2`` is a
        damper d.
    surfaces : mapping of str to relation, optional
        Unilateral constraints by name, as relations between expressions in q, and in t if they
        move: ``{"left": alpha >= a_min}``.  Each becomes a gap g(q, t) <= 0 whose gradient points
        out of the admissible set.
    within : mapping of str to relation or relations, optional
        Where surfaces that have ends are, as relations in q, t and parameters that hold there:
        ``{"table": (x >= 0, x <= l)}``.  Elsewhere nothing is touched or passed, and a contact that
        comes to an end slips off (equation :eq:`ends-of-surfaces` of the theory).
    grips : mapping of str to Expr or sequence of Expr, optional
        What holds both ways from an event to an event, by name: places phi(q, t) that vanish while
        a hand, a latch or a knee holds, ``{"hand": (x_hand - x_bar, y_hand - y_bar), "knee": a}``,
        or a rate alone, of a clutch: ``{"clutch": a.diff() - b.diff()}``.  ``"+hand"`` in a
        sequence closes it, plastically, where its places vanish; ``"-hand"`` lets go, whatever its
        force.  While it is open it holds nothing back.  Its forces R grad phi have both signs
        (:func:`dmoc.reaction`, of a grip with several places of ``"hand_1"``, ``"hand_2"``, ...).
        Equation :eq:`grips` of the theory.
    strength : mapping of str to Expr, optional
        Force F beyond which a grip lets go by itself, in parameters: ``{"hand": F}``; of one with
        several places it is that of sqrt(R_1^2 + R_2^2 + ...).  A simulation opens the grip there,
        problems keep ``hand_load``, R^2/F^2, at most 1.  Impulses do not count.
    tangents : mapping of str to Expr, optional
        Tangential positions tau(q, t) of what rubs, by name: ``{"floor": x}`` for the contact with
        the surface ``floor``, whose point slides with the velocity tau'; the time where the
        other side moves.  A name that is no surface is a rail or a joint with dry friction.
        A pair ``{"floor": (v_x, v_y)}`` has both directions of a contact in space, as positions or
        as sliding velocities: it is hit as a ball is, and lasts where it sticks.
    friction : mapping of str to Expr or pair of Expr, optional
        Of each tangent, as a smooth expression in q, u, t, parameters and ``dmoc.sliding_speed``,
        the magnitude of the tangent's rate, that is never negative:
        Coulomb's coefficient mu of a surface, or the largest friction force F in the direction of
        tau, in the unit of a force, of a rail or a joint.  ``{"rail": B}`` with an input B is a
        brake.  A pair ``{"floor": (0.5, 0.4)}`` has the static coefficient, up to which it sticks,
        and the kinetic one of sliding and of impacts; what sticks has a single one at the speed 0.
        mu is the ratio of the forces along grad tau
        and grad g, hence Coulomb's where the gap and the tangent are lengths.  Equations
        :eq:`varying-friction` and :eq:`static-friction` of the theory.
    restitution : mapping of str to Expr, optional
        Coefficient of restitution e of surfaces, as an expression in ``dmoc.approach_speed``, the
        rate of the gap before the hit, q, t and parameters: ``{"wall": sp.exp(-v / v_0)}`` with
        ``v = dmoc.approach_speed``.  It is from 0 to 1 at the speeds that occur.  Other surfaces,
        and those for which a problem gives a number, have that of the problem.
    tangential_restitution : mapping of str to Expr, optional
        Coefficient of tangential restitution e_t of surfaces with a tangent, from -1 (smooth) by 0
        (the touching point does not slide after the hit) to 1 (it slides back, as that of a
        superball), in parameters alone.  The friction of such a tangent may be left out: hits have
        the tangential impulse that they need then, contacts that last have none.  Equation
        :eq:`tangential` of the theory.
    impact_laws : mapping of str to str, optional
        Law of the hits of surfaces with friction, ``"poisson"`` where none is stated: how much
        normal impulse restitution has where sliding stops in a hit, e times that of compression, or
        as much as gives e^2 of its work back (``"stronge"``).  Equations :eq:`poisson` and
        :eq:`stronge` of the theory.  A tangent with two directions has ``"ball"``, equation
        :eq:`ball`.
    cost : Expr, optional
        Integrand C(q, q', u, t) of the cost.  Abs and Max with a positive factor and Min with a
        negative one are split into smooth functions, equation :eq:`kink` of the theory.
    terminal_cost : Expr, optional
        Phi(q, q', t) at the final time, which is added to the cost.
    integrals : mapping of str to Expr, optional
        Integrands in q, q', u, t and parameters by name: ``{"effort": u**2}``.  A problem bounds
        their values over the whole motion at the goal, and the objective may contain them.  Terms
        with :func:`dmoc.impulse`, ``approach``, ``departure`` and ``loss`` of a surface are added
        at its hits: ``{"wear": dmoc.impulse("stop") ** 2}``.
    objective : Expr, optional
        What is minimised beside the cost: an expression in parameters, ``dmoc.total(name)`` of an
        integral, ``dmoc.final_time``, ``dmoc.at_start(...)`` and ``dmoc.at_end(...)`` of
        coordinates and velocities, and ``dmoc.peak(name)`` and ``dmoc.largest(name)``, the largest
        value and the largest magnitude of a quantity.
    constraints : mapping of str to equation, optional
        Equations phi(q, t) = 0 that hold in every phase, by name: closed loops, rods, coordinates
        that depend on each other, places that move in a way that is prescribed:
        ``{"rod": sp.Eq(x**2 + y**2, l**2)}``; or expressions that are zero.  Their forces
        R grad phi act on the coordinates.  With velocities they are c(q, q', t) = 0, linear in
        these, whether it can be integrated or not: a wheel or blade that does not move sideways,
        ``{"blade": y.diff() * sp.cos(a) - x.diff() * sp.sin(a)}``.  Its force acts as R dc/dq'.
    switches : mapping of str to Expr, optional
        Expressions w(q, q', t) by name: ``{"gate": x - 1}``.  The word ``gate`` in a sequence is an
        instant at which w vanishes while it grows; ``-w`` has the other direction.  Velocities,
        contacts and friction stay as they are.  Equation :eq:`switch` of the theory.
    path_constraints : mapping of str to relation, optional
        Relations in q, q', u and t that hold along the whole motion.  Relations that ``&`` joins
        become constraints of their own: ``name_1``, ``name_2``, ...
    quantities : mapping of str to Expr, optional
        Smooth expressions in q, q', u, t and parameters by name: ``{"tip_y": y + l * sp.sin(a),
        "power": F * x.diff()}``.  A problem bounds them along the way, at the start, at the goal
        and at events by their names, as it does states; tables, figures and files have them.
    title : str, optional
        One line for lists and figures.
    units : mapping of coordinate, input or quantity to str, optional
        Units for messages and figures: ``{alpha: "rad", x: "m", F: "N"}``.
    drawing : sequence of shapes, optional
        How figures and animations show the model: Link, Point, Disc, Box, Spring, Wall and Contact,
        whose places are expressions in q, t and parameters:
        ``[dmoc.Box((x, 0), 0.2, 0.1), dmoc.Link((x, 0), tip), dmoc.Point(tip)]``; in space the
        shapes of :mod:`dmoc.spatial`, and Link, Point, Spring and Contact with triples.
    definitions : mapping of dynamicsymbols to Expr, optional
        Names for places and velocities, in their order: smooth expressions in q, q', t, parameters
        and earlier definitions.  Other expressions may contain them, as they may contain q and
        q'; the velocity of a place is its ``.diff()``: ``{x1: l * sp.sin(a), y1: ...}`` and
        ``lagrangian=m * (x1.diff() ** 2 + y1.diff() ** 2) / 2``.  Large models are stated so
        without being written out.
    attitudes : mapping of str to sequence of dynamicsymbols, optional
        Coordinates that are unit quaternions, four for each name: ``{"q": (p0, p1, p2, p3)}``, p0
        the cosine of half the angle.  Each brings the constraint ``q_unit``, that its length is 1,
        and the quantities ``q_omega_x``, ``q_omega_y``, ``q_omega_z``, the angular velocity in
        the turned axes, equation :eq:`quaternion` of the theory.  Of three coordinates, yaw, pitch
        and roll, problems bound the pitch.  The joints of :mod:`dmoc.spatial` make theirs.

    Raises
    ------
    ModelError
        If a name cannot be used, a symbol is unknown or unused, the mass matrix is singular, or a
        relation is not of the expected form.

    Notes
    -----
    Expressions are SymPy expressions or real numbers; text is refused, because SymPy would run it
    as Python.  Signs and letters follow Kern & Gross, "A Variational Approach to Optimal Control of
    Underactuated Mechanical Systems with Collisions" (2018).

    Examples
    --------
    >>> import sympy as sp
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> import dmoc
    >>> x, u = dynamicsymbols("x u")
    >>> m = sp.Symbol("m")
    >>> system = dmoc.MechanicalSystem(
    ...     "cart",
    ...     coordinates=[x],
    ...     inputs=[u],
    ...     lagrangian=m * x.diff() ** 2 / 2,
    ...     forces={x: u},
    ...     surfaces={"wall": x <= 1},
    ...     parameters={m: 2.0},
    ...     cost=u**2,
    ... )
    >>> system.gaps, system.mass_matrix
    ({'wall': x(t) - 1}, Matrix([[m]]))
    """

    name: str
    coordinates: Sequence[Any]
    lagrangian: Any
    parameters: Mapping[Any, float | None] = field(default_factory=dict)
    inputs: Sequence[Any] = ()
    forces: Mapping[Any, Any] = field(default_factory=dict)
    surfaces: Mapping[str, Any] = field(default_factory=dict)
    cost: Any = 0
    path_constraints: Mapping[str, Any] = field(default_factory=dict)
    title: str = ""
    units: Mapping[Any, str] = field(default_factory=dict)
    dissipation: Any = 0
    terminal_cost: Any = 0
    tangents: Mapping[str, Any] = field(default_factory=dict)
    friction: Mapping[str, Any] = field(default_factory=dict)
    restitution: Mapping[str, Any] = field(default_factory=dict)
    drawing: Sequence[Part] = ()
    constraints: Mapping[str, Any] = field(default_factory=dict)
    definitions: Mapping[Any, Any] = field(default_factory=dict)
    quantities: Mapping[str, Any] = field(default_factory=dict)
    tangential_restitution: Mapping[str, Any] = field(default_factory=dict)
    impact_laws: Mapping[str, str] = field(default_factory=dict)
    grips: Mapping[str, Any] = field(default_factory=dict)
    strength: Mapping[str, Any] = field(default_factory=dict)
    integrals: Mapping[str, Any] = field(default_factory=dict)
    objective: Any = 0
    switches: Mapping[str, Any] = field(default_factory=dict)
    within: Mapping[str, Any] = field(default_factory=dict)
    attitudes: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_name(self.name, "model")
        self._put(containers_of(self))
        self._put(with_attitudes(self))
        check_names(self)
        self._put(entries_of(self))
        check_parts(self)

    def _put(self, values: Mapping[str, Any]) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        names = ", ".join(map(name_of, self.coordinates))
        return f"<MechanicalSystem {self.name}: coordinates {names}>"

    def summary(self) -> Table:
        """What ``print`` shows."""
        from dmoc.symbolic.derivation.notebook import system_table

        return system_table(self)

    def _repr_html_(self) -> str:
        """Display in a notebook, with formulas."""
        from dmoc.symbolic.derivation.notebook import system_html

        return system_html(self)

    def _repr_latex_(self) -> str:
        """Display where formulas are LaTeX."""
        from dmoc.symbolic.derivation.notebook import system_latex

        return system_latex(self)

    @classmethod
    def from_lagranges_method(
        cls, name: str, method: Any, parameters: Mapping[Any, float | None], **fields: Any
    ) -> MechanicalSystem:
        """Take over a ``sympy.physics.mechanics.LagrangesMethod``: its coordinates, Lagrangian,
        loads, and constraints, as ``constraint_1``, ``constraint_2``, ..., those of velocities
        last.

        ``fields`` are those of MechanicalSystem beside them; ``forces`` are added to the loads.

        Raises
        ------
        ModelError
            For any of the reasons of MechanicalSystem.
        """
        from dmoc.symbolic.interop import from_lagranges_method

        own = from_lagranges_method(method).fields_with(fields, cls.__dataclass_fields__)
        return cls(name, parameters=parameters, **own)

    @classmethod
    def from_joints(
        cls, name: str, model: Any, parameters: Mapping[Any, float | None], **fields: Any
    ) -> MechanicalSystem:
        """Take over a ``JointsMethod`` or a ``System`` of ``sympy.physics.mechanics``: bodies,
        joints, loads, actuators, and constraints, as ``constraint_1``, ..., those of velocities
        last.

        Generalised speeds in ``fields`` (inputs, surfaces, ...) become velocities.

        Raises
        ------
        ModelError
            For any of the reasons of MechanicalSystem.
        """
        from dmoc.symbolic.interop import from_joints

        own = from_joints(model).fields_with(fields, cls.__dataclass_fields__)
        return cls(name, parameters=parameters, **own)

    # Symbols --------------------------------------------------------------------------------------

    @cached_property
    def velocities(self) -> tuple[Any, ...]:
        """Generalised velocities q', in the order of the coordinates."""
        return tuple(q.diff(dynamicsymbols._t) for q in self.coordinates)

    @property
    def force_vector(self) -> tuple[Any, ...]:
        """Generalised forces Q(q, q', u, t) with those of the Rayleigh function, in the order of
        the coordinates."""
        pairs = zip(self.coordinates, self.velocities, strict=True)
        damping = expanded(self.dissipation, self.definitions)
        return tuple(self.forces.get(q, sp.S.Zero) - damping.diff(v) for q, v in pairs)

    @cached_property
    def shapes(self) -> tuple[Part, ...]:
        """The shapes of the drawing, contacts with the directions in which they push."""
        gaps = self.gaps
        return tuple(
            with_normal(p, gaps, self.tangents, self.coordinates, self.definitions)
            for p in self.drawing
        )

    @property
    def gaps(self) -> dict[str, Any]:
        """Gap functions g(q) <= 0 by surface name, and behind them those of the grips, -phi(q),
        by the names of their places."""
        surfaces = {
            name: -slack_of(relation, f"surface {name!r}")
            for name, relation in self.surfaces.items()
        }
        return surfaces | {name: -place for name, place in functions_of_grips(self).items()}

    @property
    def quantities_along(self) -> dict[str, Any]:
        """Quantities that a motion has at any time: not those of its hits alone; and the loads of
        grips with a strength."""
        return quantities_along(self) | loads_of(self)

    @property
    def inside(self) -> dict[str, tuple[Any, ...]]:
        """Functions w(q, t) >= 0 where a surface that has ends is, by its name."""
        return inside_of(self)

    @property
    def integrands(self) -> dict[str, Any]:
        """What of the integrals is integrated, by name: not what hits add to them."""
        return integrands_of(self)

    @property
    def path_functions(self) -> dict[str, Any]:
        """Path constraint functions r(q, q', u) >= 0 by name."""
        return {
            name: slack_of(relation, f"path constraint {name!r}")
            for name, relation in self.path_constraints.items()
        }

    @property
    def mass_matrix(self) -> sp.Matrix:
        """M(q) = d2L/dq'2."""
        return sp.hessian(expanded(self.lagrangian, self.definitions), self.velocities)

    def fingerprint(self) -> str:
        """Return a digest of everything that solutions depend on."""
        return digest(self)


def check_system(system: Any) -> None:
    """Raise ModelError unless the argument of a function is a system."""
    if not isinstance(system, MechanicalSystem):
        raise ModelError(f"system = {shown(system)}: expected a MechanicalSystem.")
