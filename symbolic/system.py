"""The description of a mechanical system: coordinates, inputs, Lagrangian, forces, surfaces,
parameters, cost."""

from __future__ import annotations

import hashlib
import math
import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import listed, shown
from dmoc.base.errors import ModelError
from dmoc.base.names import check_name, momentum_name, name_of, velocity_name
from dmoc.base.table import Shown, Table
from dmoc.symbolic.drawing import Part, parts_in, values_of, with_normal
from dmoc.symbolic.expressions import KINDS, atoms_of, expression_in, slack_of, unknown_symbol
from dmoc.symbolic.kinks import check_smooth, split

if TYPE_CHECKING:
    from dmoc.symbolic.interop import Imported

# A parameter or a mass is also multiplied by itself.
LARGEST_PARAMETER = 1e100
# What places are made of.
PLACE = ("coordinates", "the time", "parameters")


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
    tangents : mapping of str to Expr, optional
        Tangential positions tau(q, t) of what rubs, by name: ``{"floor": x}`` for the contact with
        the surface ``floor``, whose point slides with the velocity tau'; the time where the
        other side moves.  A name that is no surface is a rail or a joint with dry friction.
    friction : mapping of str to Expr, optional
        Of each tangent, in parameters alone: Coulomb's coefficient mu of a surface, or the
        largest friction force F in the direction of tau, in the unit of a force, of a rail or a
        joint.  mu is the ratio of the forces along grad tau and grad g, hence Coulomb's where the
        gap and the tangent are lengths.
    cost : Expr, optional
        Integrand C(q, q', u, t) of the cost.  Abs and Max with a positive factor and Min with a
        negative one are split into smooth functions, equation :eq:`kink` of the theory.
    terminal_cost : Expr, optional
        Phi(q, q', t) at the final time, which is added to the cost.
    path_constraints : mapping of str to relation, optional
        Relations in q, q', u and t that hold along the whole motion.  Relations that ``&`` joins
        become constraints of their own: ``name_1``, ``name_2``, ...
    title : str, optional
        One line for lists and figures.
    units : mapping of coordinate or input to str, optional
        Units for messages and figures: ``{alpha: "rad", x: "m", F: "N"}``.
    drawing : sequence of shapes, optional
        How figures and animations show a planar model: Link, Point, Disc, Box, Spring, Wall and
        Contact, whose places are expressions in q, t and parameters:
        ``[dmoc.Box((x, 0), 0.2, 0.1), dmoc.Link((x, 0), tip), dmoc.Point(tip)]``.

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
    drawing: Sequence[Part] = ()

    def __post_init__(self) -> None:
        put = object.__setattr__
        check_name(self.name, "model")
        for name in ("coordinates", "inputs"):
            put(self, name, _sequence(getattr(self, name), name))
        for name, example in (
            ("parameters", "{m: 1.0}"),
            ("surfaces", '{"wall": x <= 1}'),
            ("path_constraints", '{"speed": v <= 1}'),
            ("forces", "{x: F}"),
            ("units", '{x: "m"}'),
            ("tangents", '{"floor": x}'),
            ("friction", '{"floor": 0.5}'),
        ):
            put(self, name, _mapping(getattr(self, name), name, example))
        put(self, "path_constraints", _relations(self.path_constraints))
        self._check_names()
        put(
            self,
            "parameters",
            {s: _parameter_value(s, value) for s, value in self.parameters.items()},
        )
        put(self, "units", self._named_units())
        if not isinstance(self.title, str) or not self.title.isprintable():
            raise ModelError(f"title = {shown(self.title)}: expected one line of text.")
        put(self, "lagrangian", expression_in(self.lagrangian, "the Lagrangian"))
        put(self, "cost", expression_in(self.cost, "the cost"))
        put(self, "dissipation", expression_in(self.dissipation, "the dissipation"))
        put(self, "terminal_cost", expression_in(self.terminal_cost, "the terminal cost"))
        put(self, "forces", self._normalised_forces())
        for name, what in (("tangents", "the tangent of"), ("friction", "the friction of")):
            given = getattr(self, name)
            put(self, name, {key: expression_in(e, f"{what} {key!r}") for key, e in given.items()})
        put(
            self, "drawing", parts_in(self.drawing, dict.fromkeys((*self.surfaces, *self.tangents)))
        )
        self._check_friction()
        self._check_symbols()
        self._check_kinks()
        self._check_mass_matrix()
        self._check_relations()

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
        """Take over a ``sympy.physics.mechanics.LagrangesMethod``: its coordinates, Lagrangian and
        loads.

        ``fields`` are those of MechanicalSystem beside them: inputs, surfaces, cost, ...;
        ``forces`` are added to the loads.

        Raises
        ------
        ModelError
            If the method has constraint equations, or for any of the reasons of MechanicalSystem.
        """
        from dmoc.symbolic.interop import from_lagranges_method

        return cls._imported(name, from_lagranges_method(method), parameters, fields)

    @classmethod
    def from_joints(
        cls, name: str, model: Any, parameters: Mapping[Any, float | None], **fields: Any
    ) -> MechanicalSystem:
        """Take over a ``JointsMethod`` or a ``System`` of ``sympy.physics.mechanics``: bodies,
        joints, loads and actuators.

        Generalised speeds may appear in ``fields`` (inputs, surfaces, cost, ...); they become
        velocities.

        Raises
        ------
        ModelError
            If the model has constraint equations, or for any of the reasons of MechanicalSystem.
        """
        from dmoc.symbolic.interop import from_joints

        return cls._imported(name, from_joints(model), parameters, fields)

    @classmethod
    def _imported(
        cls,
        name: str,
        model: Imported,
        parameters: Mapping[Any, float | None],
        fields: dict[str, Any],
    ) -> MechanicalSystem:
        def replaced(value: Any) -> Any:
            if isinstance(value, Mapping):
                return {key: replaced(part) for key, part in value.items()}
            return value.xreplace(model.speeds) if isinstance(value, sp.Basic) else value

        for key in fields:
            if key not in cls.__dataclass_fields__ or key in (
                "name",
                "coordinates",
                "lagrangian",
                "parameters",
            ):
                raise ModelError(
                    f"{key!r} cannot be given beside an imported model: expected fields such as "
                    "inputs, surfaces, forces, cost."
                )
        given = {
            key: value if key in ("inputs", "title", "units") else replaced(value)
            for key, value in fields.items()
        }
        forces, named = dict(model.forces), {name_of(q): q for q in model.coordinates}
        for key, force in _mapping(given.pop("forces", {}), "forces", "{x: F}").items():
            q = named.get(key, key) if isinstance(key, str) else key
            forces[q] = forces.get(q, sp.S.Zero) + expression_in(force, f"the force on {shown(q)}")
        return cls(name, model.coordinates, model.lagrangian, parameters, forces=forces, **given)

    # Symbols --------------------------------------------------------------------------------------

    @property
    def velocities(self) -> tuple[Any, ...]:
        """Generalised velocities q', in the order of the coordinates."""
        return tuple(q.diff(dynamicsymbols._t) for q in self.coordinates)

    @property
    def force_vector(self) -> tuple[Any, ...]:
        """Generalised forces Q(q, q', u, t) with those of the Rayleigh function, in the order of
        the coordinates."""
        pairs = zip(self.coordinates, self.velocities, strict=True)
        return tuple(self.forces.get(q, sp.S.Zero) - self.dissipation.diff(v) for q, v in pairs)

    @cached_property
    def shapes(self) -> tuple[Part, ...]:
        """The shapes of the drawing, contacts with the directions in which they push."""
        gaps = self.gaps
        return tuple(with_normal(p, gaps, self.tangents, self.coordinates) for p in self.drawing)

    @property
    def gaps(self) -> dict[str, Any]:
        """Gap functions g(q) <= 0 by surface name."""
        return {
            name: -slack_of(relation, f"surface {name!r}")
            for name, relation in self.surfaces.items()
        }

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
        return sp.hessian(self.lagrangian, self.velocities)

    def fingerprint(self) -> str:
        """Return a digest of everything that solutions depend on."""
        parts = [
            self.name,
            *map(sp.srepr, self.coordinates),
            "|",
            *map(sp.srepr, self.inputs),
            "|",
            *(f"{sp.srepr(s)}={v!r}" for s, v in self.parameters.items()),
            sp.srepr(self.lagrangian),
            *map(sp.srepr, self.force_vector),
            sp.srepr(self.cost),
            sp.srepr(self.terminal_cost),
            *(f"{n}:{sp.srepr(g)}" for n, g in self.gaps.items()),
            "|",
            *(f"{n}:{sp.srepr(r)}" for n, r in self.path_functions.items()),
            "|",
            *(f"{n}:{sp.srepr(e)}:{sp.srepr(self.friction[n])}" for n, e in self.tangents.items()),
        ]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()

    # Checks ---------------------------------------------------------------------------------------

    def _named_units(self) -> dict[str, str]:
        names = [name_of(s) for s in (*self.coordinates, *self.inputs)]
        units = {}
        for symbol, unit in self.units.items():
            name = name_of(symbol) if isinstance(symbol, (str, sp.Basic)) else ""
            if name not in names:
                raise ModelError(
                    f"unit of {shown(symbol)}: expected a coordinate or an input, one of "
                    f"{', '.join(names)}."
                )
            if not isinstance(unit, str) or not unit.isprintable() or not 0 < len(unit) <= 16:
                raise ModelError(
                    f"unit of {name} = {shown(unit)}: expected a short text such as 'rad', 'm' or "
                    "'N'."
                )
            units[name] = unit
        return units

    def _check_names(self) -> None:
        if not self.coordinates:
            raise ModelError(
                f"model {self.name!r} has no coordinates: give at least one dynamicsymbol."
            )
        for q in self.coordinates:
            if not _is_function_of_time(q):
                raise ModelError(
                    f"coordinate {shown(q)} is not a function of time: make it with "
                    "sympy.physics.mechanics.dynamicsymbols."
                )
        for u in self.inputs:
            if not isinstance(u, sp.Symbol) and not _is_function_of_time(u):
                raise ModelError(f"input {shown(u)} is not a dynamicsymbol or a Symbol.")
        for symbol in self.parameters:
            if not isinstance(symbol, sp.Symbol):
                raise ModelError(f"parameter {shown(symbol)} is not a SymPy Symbol.")
            if symbol.is_extended_real is False or not symbol.is_commutative:
                raise ModelError(
                    f"the symbol of parameter {symbol} is assumed not to be a real number: make it "
                    f"as Symbol({symbol.name!r})."
                )
        for name in (*self.surfaces, *self.path_constraints):
            check_name(name, "surface" if name in self.surfaces else "path constraint")
        rails = [name for name in self.tangents if name not in self.surfaces]
        for name in rails:
            check_name(name, "tangent")
        roles = [(q, "coordinate") for q in self.coordinates] + [(u, "input") for u in self.inputs]
        roles += [(s, "parameter") for s in self.parameters] + [
            (s, "surface") for s in self.surfaces
        ]
        roles += [(s, "path constraint") for s in self.path_constraints]
        roles += [(s, "tangent") for s in rails]
        for symbol, role in roles:
            check_name(name_of(symbol), role)
            if name_of(symbol) == "t":
                raise ModelError(f"the {role} 't' has the name of the time: choose another name.")
            if name_of(symbol) == "durations" and role in ("coordinate", "input"):
                raise ModelError(
                    f"the {role} 'durations' has the name of the times of the phases in a guess: "
                    "choose another name."
                )
        _check_distinct(
            [
                (name_of(s), role)
                for s, role in roles
                if role in ("surface", "path constraint", "tangent")
            ]
        )
        derived = [
            (name_of(s), role) for s, role in roles if role in ("coordinate", "input", "parameter")
        ]
        for q in self.coordinates:
            derived.append((velocity_name(name_of(q)), f"velocity of {name_of(q)}"))
            derived.append((momentum_name(name_of(q)), f"momentum of {name_of(q)}"))
        _check_distinct(derived)

    def _normalised_forces(self) -> dict[Any, Any]:
        named = {name_of(q): q for q in self.coordinates}
        forces: dict[Any, Any] = {}
        for key, expression in dict(self.forces).items():
            q = named.get(key, key) if isinstance(key, str) else key
            if q not in self.coordinates:
                raise ModelError(
                    f"the force on {shown(key)} belongs to no coordinate: expected one of "
                    f"{_listed(self.coordinates)}."
                )
            if q in forces:
                raise ModelError(f"the force on {name_of(q)} is given twice: add both.")
            forces[q] = expression_in(expression, f"the force on {name_of(q)}")
        return forces

    def _check_friction(self) -> None:
        for name in self.friction:
            if name not in self.tangents:
                raise ModelError(
                    f"{shown(name)} has friction but no tangent: give the tangential position of "
                    f'its contact, as tangents={{"{name}": x}}.'
                )
        for name, tau in self.tangents.items():
            if name not in self.friction:
                raise ModelError(
                    f"{shown(name)} has a tangent but no friction: give its coefficient mu, or, of "
                    f'a rail, its largest force, as friction={{"{name}": 0.5}}; 0 for none.'
                )
            if not atoms_of(tau) & set(self.coordinates):
                raise ModelError(
                    f"the tangent of {name!r} contains no coordinate: expected a position along "
                    f"the contact in {_listed(self.coordinates)}."
                )
            value = self.friction[name]
            if value.is_number and value < 0:
                raise ModelError(
                    f"the friction of {name!r} is {shown(value)}: expected 0 or a positive number."
                )

    def _check_symbols(self) -> None:
        kinds: dict[str, set[Any]] = dict(
            zip(
                KINDS,
                map(set, (self.coordinates, self.velocities, self.inputs, [dynamicsymbols._t],
                          self.parameters)),
                strict=True,
            )
        )  # fmt: skip
        state, place = ("coordinates", "velocities", "the time", "parameters"), PLACE
        parts: list[tuple[str, Any, tuple[str, ...]]] = [
            ("the Lagrangian", self.lagrangian, state),
            ("the cost", self.cost, KINDS),
            ("the dissipation", self.dissipation, state),
            ("the terminal cost", self.terminal_cost, state),
        ]
        parts += [(f"the force on {name_of(q)}", e, KINDS) for q, e in self.forces.items()]
        parts += [(f"surface {n!r}", g, place) for n, g in self.gaps.items()]
        parts += [(f"path constraint {n!r}", r, KINDS) for n, r in self.path_functions.items()]
        parts += [(f"the tangent of {n!r}", e, place) for n, e in self.tangents.items()]
        parts += [(f"the friction of {n!r}", e, ("parameters",)) for n, e in self.friction.items()]
        parts += [
            (f"a {type(part).__name__} of the drawing", e, place)
            for part in self.shapes
            for e in values_of(part)
        ]
        used: set[Any] = set()
        for where, expression, allowed in parts:
            found = atoms_of(expression)
            used |= found
            for symbol in sorted(found.difference(*(kinds[kind] for kind in allowed)), key=str):
                raise ModelError(unknown_symbol(symbol, where, kinds, allowed))
        for symbol in self.parameters:
            if symbol not in used:
                raise ModelError(
                    f"parameter {symbol} is used nowhere in model {self.name!r}: remove it or use "
                    "it."
                )
        in_forces: set[Any] = set().union(*(atoms_of(e) for e in self.forces.values()))
        for u in self.inputs:
            if u not in in_forces:
                raise ModelError(
                    f"input {name_of(u)} appears in no force of model {self.name!r}: remove it or "
                    "use it."
                )

    def _check_kinks(self) -> None:
        """Refuse functions that jump, and kinks that cannot be split into smooth functions."""
        check_smooth(self.lagrangian, "the Lagrangian")
        check_smooth(self.dissipation, "the dissipation")
        check_smooth(self.terminal_cost, "the terminal cost", kinks=True)
        for q, force in self.forces.items():
            check_smooth(force, f"the force on {name_of(q)}")
        split(self)

    def _check_mass_matrix(self) -> None:
        mass = self.mass_matrix
        for i, q in enumerate(self.coordinates):
            if all(entry == 0 for entry in mass.row(i)):
                raise ModelError(
                    f"the kinetic energy does not contain the velocity of coordinate {name_of(q)}: "
                    "the mass matrix would be singular; give the coordinate inertia or remove it."
                )
        for entry in mass:
            if (
                entry.is_number
                and entry != 0
                and not 1 / LARGEST_PARAMETER <= abs(entry) <= LARGEST_PARAMETER
            ):
                raise ModelError(
                    f"the mass matrix of model {self.name!r} contains {shown(entry)}: expected "
                    "masses from 1e-100 to 1e100; use other units."
                )
        if any(atoms_of(entry) & set(self.velocities) for entry in mass):
            raise ModelError(
                "the kinetic energy is not quadratic in the velocities: the mass matrix depends on "
                "them."
            )
        if _is_singular(mass):
            raise ModelError(
                f"the mass matrix of model {self.name!r} is singular (its determinant is zero "
                f"everywhere): the coordinates {_listed(self.coordinates)} are not independent, or "
                "one lacks inertia."
            )

    def _check_relations(self) -> None:
        for name, gap in self.gaps.items():
            if not atoms_of(gap) & set(self.coordinates):
                raise ModelError(
                    f"surface {name!r} contains no coordinate: expected a relation in "
                    f"{_listed(self.coordinates)}."
                )


def _sequence(value: Any, what: str) -> tuple[Any, ...]:
    if isinstance(value, (str, bytes, sp.Basic)):
        raise ModelError(
            f"{what} = {shown(value)}: expected a list of dynamicsymbols, such as [x]."
        )
    return tuple(listed(value, what, "dynamicsymbols", ModelError))


def _mapping(value: Any, what: str, example: str) -> dict[Any, Any]:
    if not isinstance(value, Mapping):
        raise ModelError(f"{what} = {shown(value)}: expected a mapping such as {example}.")
    return dict(value)


def _relations(constraints: Mapping[Any, Any]) -> dict[Any, Any]:
    """Path constraints by name; those of a conjunction have the numbers 1, 2, ... behind it."""
    found = dict[Any, Any]()
    for name, relation in constraints.items():
        joined = isinstance(relation, sp.And) and isinstance(name, str)
        parts = sorted(relation.args, key=sp.default_sort_key) if joined else [relation]
        names = [f"{name}_{i + 1}" for i in range(len(parts))] if joined else [name]
        for one, part in zip(names, parts, strict=True):
            if one in found:
                raise ModelError(f"two path constraints have the name {one!r}: rename one.")
            found[one] = part
    return found


def _parameter_value(symbol: Any, value: Any) -> float | None:
    """The default value of a parameter as a float that its symbol may have."""
    if value is None:
        return None
    number = math.nan
    if not isinstance(value, bool) and (
        isinstance(value, numbers.Real) or (isinstance(value, sp.Expr) and value.is_comparable)
    ):
        try:
            number = float(value)
        except (OverflowError, ValueError, TypeError):
            number = math.inf
    if not math.isfinite(number):
        raise ModelError(f"parameter {symbol} = {shown(value)}: a finite number was expected.")
    if value != 0 and not 1 / LARGEST_PARAMETER <= abs(number) <= LARGEST_PARAMETER:
        raise ModelError(
            f"parameter {symbol} = {shown(value)}: expected 0 or a magnitude from 1e-100 to 1e100; "
            "use other units."
        )
    for fact in ("positive", "negative", "nonnegative", "nonpositive", "nonzero"):
        if getattr(symbol, f"is_{fact}") and getattr(sp.Float(number), f"is_{fact}") is False:
            raise ModelError(
                f"parameter {symbol} = {shown(value)}: its symbol is assumed to be {fact}; give "
                "such a value, or make the symbol without it."
            )
    return number


def _is_function_of_time(symbol: Any) -> bool:
    return isinstance(symbol, AppliedUndef) and symbol.args == (dynamicsymbols._t,)


def check_system(system: Any) -> None:
    """Raise ModelError unless the argument of a function is a system."""
    if not isinstance(system, MechanicalSystem):
        raise ModelError(f"system = {shown(system)}: expected a MechanicalSystem.")


def _is_singular(mass: sp.Matrix) -> bool:
    """Tell whether M is singular at several fixed generic points, hence everywhere."""
    symbols = sorted(set().union(*(atoms_of(entry) for entry in mass)), key=str)
    for shift in (0.0, 1.7, 4.1):
        point = {
            s: sp.Float(0.4 + (0.618033988749895 * (i + 1) + shift) % 1.0, 30)
            for i, s in enumerate(symbols)
        }
        matrix = mass.xreplace(point).evalf(30)
        # What is singular in one set of units is so in all of them.
        scale = sp.prod([abs(matrix[i, i]) for i in range(matrix.rows)])
        if scale == 0:
            scale = sp.Max(*(abs(entry) for entry in matrix)) ** matrix.rows
        determinant = abs(matrix.det())
        if (
            determinant.is_comparable
            and scale.is_comparable
            and determinant > scale * sp.Float("1e-20")
        ):
            return False
    return True


def _check_distinct(names: list[tuple[str, str]]) -> None:
    seen: dict[str, str] = {}
    for name, role in names:
        if name in seen:
            raise ModelError(
                f"the name {name!r} is used twice, as {seen[name]} and as {role}: rename one."
            )
        seen[name] = role


def _listed(symbols: Sequence[Any]) -> str:
    return ", ".join(name_of(s) for s in symbols)
