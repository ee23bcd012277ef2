"""What statements of models refuse: one sentence with these words."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp
from refusals import refusal_test
from sympy.physics.mechanics import dynamicsymbols

import dmoc

# Below each error and call: arguments, and words of the message; ... stands for anything.
TABLE = r"""
ModelError: rubbing(...)
    surface={} | unknown argument 'surface' of MechanicalSystem ... (did you mean 'surfaces'?)
    friction={"rail": F} | has friction but no tangent
    tangents={"rail": X} | has a tangent but no friction
    tangents={"rail": F}, friction={"rail": F} | contains no coordinate
    tangents={"rail": X}, friction={"rail": -1} | expected 0 or a positive
    tangents={"rail": (X, 2 * X)}, friction={"rail": 1} | 'rail' has two directions but is at no
    tangents={"rail": X}, friction={"rail": X.diff()} | the friction of 'rail' contains
ModelError: bob_with(...)
    {"rod": X <= 1} | constraint 'rod' is not an equation: expected one such as
    {"rod": True} | constraint 'rod' is not an equation: expected one such as
    {"rod": X.diff(T) ** 2 - 1} | constraint 'rod' is not linear in the velocity x_dot: give it as
    {"rod": "x"} | constraint 'rod' is not a scalar SymPy expression: got 'x'
    {"rod": sp.Eq(Y, sp.Abs(X))} | constraint 'rod' contains Abs(x(t)), whose kink no method of
    {"rod": 1} | constraint 'rod' contains no coordinate: expected an equation in x, y
    [X] | constraints = [x(t)]: expected a mapping such as
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
"""

X, Y, U, Q = dynamicsymbols("x y u q")
T, F = dynamicsymbols._t, sp.Symbol("f")


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


@pytest.fixture(scope="module")
def names() -> dict[str, Any]:
    """What the calls of the table take."""
    return {
        "bob_with": lambda value: made("bad", [X, Y], constraints=value), "rubbing": rubbing,
        "kinked": kinked, "forced": forced, "X": X, "Y": Y, "U": U, "T": T, "F": F,
        "v": X.diff(T), "sp": sp, "dmoc": dmoc,
    }  # fmt: skip


test_it_is_refused_in_one_sentence = refusal_test(TABLE)
