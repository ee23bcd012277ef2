"""What expressions of a model may be: scalars, real, finite, in the symbols that belong there."""

from __future__ import annotations

import numbers
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef, UndefinedFunction
from sympy.core.relational import GreaterThan, LessThan, StrictGreaterThan, StrictLessThan
from sympy.logic.boolalg import Boolean
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError

# Constants of an expression must be numbers of C.
LARGEST = sp.Integer(10) ** 307


class ApproachSpeed(sp.Symbol):  # type: ignore[misc]  # SymPy has no types
    """The rate of a gap before a hit, in which a model may state a coefficient of restitution.

    Examples
    --------
    >>> import sympy as sp
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> import dmoc
    >>> z = dynamicsymbols("z")
    >>> ball = dmoc.MechanicalSystem(
    ...     "ball",
    ...     coordinates=[z],
    ...     lagrangian=z.diff() ** 2 / 2 - 9.81 * z,
    ...     surfaces={"floor": z >= 0},
    ...     restitution={"floor": sp.exp(-dmoc.approach_speed / 5)},
    ... )
    >>> run = dmoc.simulate(ball, {"z": 1}, step_size=0.01, steps=60)
    >>> len(run.collisions)
    1
    """


approach_speed = ApproachSpeed("approach_speed", nonnegative=True)


class SlidingSpeed(sp.Symbol):  # type: ignore[misc]  # SymPy has no types
    """The magnitude of the rate of a tangent, in which a model may state its friction.

    Examples
    --------
    >>> import sympy as sp
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> import dmoc
    >>> x = dynamicsymbols("x")
    >>> block = dmoc.MechanicalSystem(
    ...     "block",
    ...     coordinates=[x],
    ...     lagrangian=x.diff() ** 2 / 2,
    ...     tangents={"rail": x},
    ...     friction={"rail": 1 + sp.exp(-dmoc.sliding_speed / 0.1)},
    ... )
    >>> run = dmoc.simulate(block, {"x": 0}, {"x": 1}, step_size=0.01, steps=100)
    >>> round(run.rubbing[0].end, 4)
    0.9307
    """

    def _latex(self, _: Any) -> str:
        return r"|\sigma|"


sliding_speed = SlidingSpeed("sliding_speed", nonnegative=True)


class FinalTime(sp.Symbol):  # type: ignore[misc]  # SymPy has no types
    """The final time of a motion in seconds, in an objective.

    Examples
    --------
    >>> import dmoc
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> x, u = dynamicsymbols("x u")
    >>> sled = dmoc.MechanicalSystem(
    ...     "sled", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, objective=dmoc.final_time
    ... )
    >>> problem = dmoc.Problem(sled, {x: 0}, {x: 1, "x_dot": 0}, bounds={u: (-1, 1)})
    >>> round(dmoc.solve(problem).cost, 4)
    2.0
    """


final_time = FinalTime("final_time", positive=True)


# Expressions of SymPy that are no values: matrices, functions, orders of magnitude, ranges.
NO_VALUES = (sp.MatrixExpr, sp.Lambda, sp.Order, sp.AccumBounds)


def expression_in(value: Any, what: str) -> Any:
    """A scalar, real and finite SymPy expression; raise ModelError for what is none."""
    expression = (
        _number(value) if isinstance(value, numbers.Real) and not isinstance(value, bool) else value
    )
    if not isinstance(expression, sp.Expr) or isinstance(expression, NO_VALUES):
        remedy = (
            "write it with SymPy's symbols" if isinstance(value, str) else "give one, or a number"
        )
        raise ModelError(f"{what} is not a scalar SymPy expression: got {shown(value)}; {remedy}.")
    expression = expression.doit()
    if not isinstance(expression, sp.Expr) or expression.is_commutative is False:
        raise ModelError(
            f"{what} is not a scalar SymPy expression: got {shown(value)}; give one, or a number."
        )
    if expression.has(sp.nan, sp.zoo, sp.oo, -sp.oo):
        raise ModelError(f"{what} contains an infinite or undefined constant: {shown(expression)}.")
    if expression.has(sp.I):
        raise ModelError(
            f"{what} contains the imaginary unit: {shown(expression)}; expected a real expression."
        )
    for constant in expression.atoms(sp.Number):
        if not _fits_in_c(constant):
            raise ModelError(
                f"{what} contains the constant {shown(constant)}: expected 0 or a magnitude from "
                "1e-307 to 1e307."
            )
    return expression


def reference(kind: str, name: Any, what: str, example: str) -> Any:
    """An expression that stands for something of the model by its name, as total(effort)."""
    if not isinstance(name, str) or not name.isidentifier():
        raise ModelError(
            f'{kind}({shown(name)}): expected the name of {what}, such as "{example}".'
        )
    return sp.Function(kind)(sp.Symbol(name))


def _number(value: Any) -> Any:
    """A real number as one of SymPy, exactly; nothing that the number says of itself is asked."""
    if isinstance(value, sp.Expr):
        return sp.S.Zero if value.is_zero else value
    if isinstance(value, numbers.Integral):
        return sp.Integer(int(value))
    if isinstance(value, numbers.Rational):
        return sp.Rational(int(value.numerator), int(value.denominator))
    return sp.Float(float(value)) if value else sp.S.Zero


def _fits_in_c(constant: Any) -> bool:
    if isinstance(constant, sp.Rational):
        return bool(max(abs(constant.p), constant.q) <= LARGEST)
    return bool(constant.is_zero or 1 / LARGEST <= abs(constant) <= LARGEST)


def slack_of(relation: Any, what: str) -> Any:
    """The expression that is >= 0 where ``relation`` holds."""
    if isinstance(relation, (GreaterThan, StrictGreaterThan)):
        return expression_in(relation.lhs - relation.rhs, what)
    if isinstance(relation, (LessThan, StrictLessThan)):
        return expression_in(relation.rhs - relation.lhs, what)
    if isinstance(relation, sp.And):
        raise ModelError(
            f"{what} joins {len(relation.args)} relations: give each one a name of its own."
        )
    raise ModelError(
        f"{what} is not an inequality: expected a relation such as `alpha >= a_min`, got "
        f"{shown(relation)}."
    )


def zero_of(equation: Any, what: str) -> Any:
    """The expression that is zero where ``equation`` holds."""
    if isinstance(equation, sp.Eq):
        return expression_in(equation.lhs - equation.rhs, what)
    if isinstance(equation, (Boolean, bool)):
        raise ModelError(
            f"{what} is not an equation: expected one such as `sp.Eq(x**2 + y**2, l**2)`, or an "
            f"expression that is zero, got {shown(equation)}."
        )
    return expression_in(equation, what)


def atoms_of(expression: Any) -> set[Any]:
    """Symbols, functions of time and their derivatives in an expression; a derivative hides what
    it contains."""
    atoms, waiting = set[Any](), [expression]
    while waiting:
        part = waiting.pop()
        if isinstance(part, (sp.Derivative, AppliedUndef, sp.Symbol)):
            atoms.add(part)
        else:
            waiting += part.args
    return {atom for atom in atoms if not isinstance(atom, sp.Dummy)}


def coefficients_of(friction: Any) -> tuple[Any, Any]:
    """The static and the kinetic coefficient of friction; where one is stated, the static one is
    its value at rest."""
    if isinstance(friction, sp.Tuple):
        return tuple(friction)
    return friction.subs(sliding_speed, 0), friction


# What expressions of a model may be made of, and what to do where something else was wanted.
KINDS = ("coordinates", "velocities", "inputs", "the time", "parameters")
REMEDIES = {
    ("surface", "velocities"): "; a limit of a velocity is a path constraint",
    ("surface", "inputs"): "; a limit of an input is a bound or a path constraint",
    ("Lagrangian", "inputs"): "; inputs enter through `forces`",
    ("restitution", "velocities"): "; the speed of the hit is dmoc.approach_speed",
    ("friction", "velocities"): "; the magnitude of the rate of its tangent is dmoc.sliding_speed",
    ("", "forces"): "; forces of contacts and constraints stand in `quantities`",
}
# What names of dmoc's functions stand for, and where they belong.
OF_HITS = "a number of hits: expected it in `integrals` or `quantities`"
OF_MOTIONS = "a number of a whole motion: expected it in `objective`"
REFERENCES = {
    **dict.fromkeys(("impulse", "approach", "departure", "loss"), OF_HITS),
    **dict.fromkeys(("total", "peak", "largest", "at_start", "at_end"), OF_MOTIONS),
}


def unknown_symbol(
    symbol: Any, where: str, kinds: dict[str, set[Any]], allowed: tuple[str, ...]
) -> str:
    """A sentence about a symbol that does not belong where it stands; ``kinds`` are the symbols of
    the model."""
    only = ", ".join(allowed[:-1]) + " and " * (len(allowed) > 1) + allowed[-1]
    if symbol == approach_speed:
        return (
            f"{where} contains dmoc.approach_speed, which is known in a hit alone: expected it in "
            "`restitution`."
        )
    if symbol == sliding_speed:
        return (
            f"{where} contains dmoc.sliding_speed, which is known of what slides alone: expected "
            "it in `friction`, of a pair in the kinetic coefficient."
        )
    for kind, symbols in kinds.items():
        if symbol in symbols:
            subjects = ("surface", "Lagrangian", "friction", "restitution")
            about = next((word for word in subjects if word in where), "")
            own = "velocities" if "velocities" in kind else kind
            ways = ((about, own), (about, ""), ("", own))
            remedy = next((REMEDIES[way] for way in ways if way in REMEDIES), "")
            return f"{where} contains {symbol}, one of the {kind}: expected {only} alone{remedy}."
    if isinstance(symbol, sp.Derivative) and symbol.expr in kinds["definitions of velocities"]:
        return (
            f"{where} contains {symbol}, an acceleration: {symbol.expr} is defined by velocities; "
            f"expected {only} alone."
        )
    if isinstance(symbol, sp.Derivative):
        return (
            f"{where} contains {symbol}, which is not the first derivative of a coordinate: "
            f"expected {only} alone."
        )
    foreign = isinstance(symbol, AppliedUndef) and isinstance(symbol.func, UndefinedFunction)
    if foreign and symbol.func.__name__ in REFERENCES and symbol.args != (dynamicsymbols._t,):
        return f"{where} contains dmoc.{symbol}, {REFERENCES[symbol.func.__name__]}."
    if foreign and kinds["definitions of places"] | kinds["definitions of velocities"]:
        return (
            f"{where} contains {symbol}, which is no coordinate, no input and no definition: "
            "declare it or remove it; points of a linkage are made before its system."
        )
    if foreign:
        return (
            f"{where} contains {symbol}, which is neither a coordinate nor an input: declare it or "
            "remove it."
        )
    if symbol.name == "t":
        return (
            f"{where} contains a symbol t of its own: the time is dynamicsymbols._t of "
            "sympy.physics.mechanics."
        )
    if str(symbol) in {str(s) for symbols in kinds.values() for s in symbols}:
        return (
            f"{where} contains the symbol {symbol}, and the model one of the same name with "
            "other assumptions: use one symbol."
        )
    return (
        f"{where} contains the symbol {symbol}, which is unknown: list it in `parameters` with its "
        "value."
    )
