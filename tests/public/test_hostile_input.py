"""Input that is made to break something: what holds itself, what is no value, what overflows."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError, SimulationError

x, u = dynamicsymbols("x u")
mu = sp.Symbol("mu")
NO_VALUES = (
    sp.Lambda(mu, mu), sp.Order(x), sp.AccumBounds(0, 1), sp.MatrixSymbol("A", 1, 1),
    sp.Matrix([x]),
)  # fmt: skip


def sled(**fields: Any) -> dmoc.MechanicalSystem:
    stated = {"inputs": [u], "forces": {x: u}, "cost": u**2} | fields
    return dmoc.MechanicalSystem("hostile", [x], x.diff() ** 2 / 2, **stated)


@pytest.mark.parametrize("nothing", NO_VALUES)
@pytest.mark.parametrize("field", ["cost", "force", "friction", "constraint", "place"])
def test_what_stands_for_no_value_is_no_expression(field: str, nothing: Any) -> None:
    fields: dict[str, dict[str, Any]] = {
        "cost": {"cost": nothing}, "force": {"forces": {x: nothing}},
        "friction": {"tangents": {"rail": x}, "friction": {"rail": nothing}},
        "constraint": {"constraints": {"rod": nothing}},
        "place": {"quantities": {"tip": nothing}},
    }  # fmt: skip
    with pytest.raises(ModelError, match=r"is not a scalar SymPy expression|is not an equation"):
        sled(**fields[field])


@pytest.mark.parametrize("size", [1e101, 1e300, -1e300])
def test_parameters_whose_squares_overflow_are_refused_wherever_they_are_changed(
    size: float,
) -> None:
    system = sled(parameters={mu: 0.5}, tangents={"rail": x}, friction={"rail": mu**2})
    problem = dmoc.Problem(system, {x: 0}, {x: 1}, contacts=["rail:slip+"], final_time=1)
    says = r"parameter mu = .*: expected 0 or a magnitude from 1e-100 to 1e100; use other units"
    with pytest.raises(ProblemError, match=says):
        problem.but(parameters={"mu": size})
    with pytest.raises(SimulationError, match=says):
        dmoc.simulate(system, {x: 0}, step_size=0.1, steps=1, parameters={"mu": size})
    with pytest.raises(ModelError, match=says):
        sled(parameters={mu: size}, tangents={"rail": x}, friction={"rail": mu**2})


def test_slopes_whose_squares_overflow_warn_of_nothing() -> None:
    y = dynamicsymbols("y")
    rates = {"tied": sp.Eq(1e300 * x.diff() - 1e300 * y.diff(), 0)}
    kinetic = (x.diff() ** 2 + y.diff() ** 2) / 2
    system = dmoc.MechanicalSystem("steep", [x, y], kinetic, constraints=rates)
    kernels = dmoc.build(system, backend="numpy")
    dmoc.Problem(kernels, {x: 0, y: 0}, {x: 1}, final_time=1)


@pytest.mark.parametrize("octets", [memoryview(b"ab"), bytearray(b"ab"), b"ab"])
@pytest.mark.parametrize("field", ["durations", "steps", "sequence", "contacts", "via"])
def test_bytes_are_no_list(field: str, octets: Any) -> None:
    system = sled(surfaces={"wall": x <= 2})
    problem = dmoc.Problem(system, {x: 0}, {x: 1}, sequence=["wall"], final_time=1)
    with pytest.raises(ProblemError, match=f"^{field} = .*: expected "):
        problem.but(**{field: octets})
    with pytest.raises(SimulationError, match="expected 1 finite numbers"):
        dmoc.simulate(system, octets[:1], step_size=0.1, steps=1)
