"""Models of sympy.physics.mechanics come in without rewriting: the cart-pole of
examples/cart_pole.py in three other ways."""

from __future__ import annotations

import warnings
from typing import Any

import cart_pole
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import (
    Force,
    LagrangesMethod,
    Lagrangian,
    Particle,
    PinJoint,
    Point,
    PrismaticJoint,
    ReferenceFrame,
    RigidBody,
    System,
    dynamicsymbols,
)  # fmt: skip

import dmoc
from dmoc.base.errors import ModelError

m_c, m_p, l, g = sp.symbols("m_c m_p l g")
VALUES = {m_c: 1.0, m_p: 0.3, l: 0.5, g: 9.81}
x, theta, F = dynamicsymbols("x theta F")
t = dynamicsymbols._t


def lagranges_method(**constraints: Any) -> LagrangesMethod:
    N, origin = ReferenceFrame("N"), Point("O")
    origin.set_vel(N, 0)
    pivot = origin.locatenew("P", x * N.x)
    pivot.set_vel(N, x.diff(t) * N.x)
    A = N.orientnew("A", "Axis", [theta, N.z])
    tip = pivot.locatenew("T", -l * A.y)
    tip.v2pt_theory(pivot, N, A)
    cart, bob = Particle("cart", pivot, m_c), Particle("bob", tip, m_p)
    bob.potential_energy = m_p * g * tip.pos_from(origin).dot(N.y)
    return LagrangesMethod(
        Lagrangian(N, cart, bob), [x, theta], forcelist=[(pivot, F * N.x)], frame=N, **constraints
    )


def joints() -> tuple[System, dict[Any, float]]:
    u_x, u_theta = dynamicsymbols("u_x u_theta")
    wall, cart, bob = RigidBody("wall"), RigidBody("cart", mass=m_c), RigidBody("bob", mass=m_p)
    model = System.from_newtonian(wall)
    model.add_joints(
        PrismaticJoint("slider", wall, cart, coordinates=x, speeds=u_x, joint_axis=wall.frame.x),
        PinJoint(
            "pin", cart, bob, coordinates=theta, speeds=u_theta, joint_axis=cart.frame.z,
            child_point=l * bob.frame.y,
        ),
    )  # fmt: skip
    model.apply_uniform_gravity(-g * wall.frame.y)
    model.add_loads(Force(cart.masscenter, F * wall.frame.x))
    return model, VALUES | {sp.Symbol("bob_izz"): 0.0}


def solved(system: dmoc.MechanicalSystem) -> dmoc.Solution:
    problem = cart_pole.problem(20)
    return dmoc.solve(problem.but(kernels=dmoc.build(system)), "ipm", verify=False)


@pytest.mark.slow
def test_lagranges_method() -> None:
    system = dmoc.MechanicalSystem.from_lagranges_method(
        "cart_pole_lm", lagranges_method(), VALUES, inputs=[F], cost=F**2
    )
    difference = system.lagrangian - cart_pole.system().lagrangian
    names = {sp.Symbol(s.name): s for s in VALUES}
    assert sp.simplify(difference.subs(names)) == 0
    assert solved(system).cost == pytest.approx(
        dmoc.solve(cart_pole.problem(20), "ipm", verify=False).cost, rel=1e-9
    )


@pytest.mark.slow
def test_joints_with_loads_and_gravity() -> None:
    """Gravity comes as a load, so that it is a generalised force: the same motion up to the
    discretisation of forces."""
    model, values = joints()
    system = dmoc.MechanicalSystem.from_joints(
        "cart_pole_joints", model, values, inputs=[F], cost=F**2
    )
    assert sp.simplify(system.forces[theta] + m_p * g * l * sp.sin(theta)) == 0
    ours, reference = dmoc.build(system), dmoc.build(cart_pole.system())
    rng = np.random.default_rng(0)
    q, v, u = rng.normal(size=(5, 2)), rng.normal(size=(5, 2)), rng.normal(size=(5, 1))
    par = [
        np.array([[float(value) for value in kernels.parameters.values() if value is not None]])
        for kernels in (ours, reference)
    ]
    pairs = zip(
        ours.call("dynamics", q, v, u, np.zeros((1, 1)), par[0]),
        reference.call("dynamics", q, v, u, np.zeros((1, 1)), par[1]),
        strict=True,
    )
    for a, b in pairs:
        np.testing.assert_allclose(a, b, atol=1e-13)
    assert solved(system).status == "solved"


def test_the_old_joints_method() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from sympy.physics.mechanics import JointsMethod

        model, values = joints()
        method = JointsMethod(model.bodies[0], *model.joints)
    speed = model.u[0]
    d = sp.Symbol("d")
    # Gravity was a load of the System.
    parameters = {s: value for s, value in values.items() if s != g} | {d: 0.5}
    forces, surfaces = {x: F - d * speed}, {"end": x <= 3}
    system = dmoc.MechanicalSystem.from_joints(
        "cart_pole_jm", method, parameters, inputs=[F], forces=forces, surfaces=surfaces
    )
    assert system.forces[x] == F - sp.Symbol("d") * x.diff(t)


@pytest.mark.slow
def test_holonomic_constraints_come_in() -> None:
    """The cart that its pendulum drives like a rack: x = l theta, in one coordinate less."""
    imported = dmoc.MechanicalSystem.from_lagranges_method(
        "rack", lagranges_method(hol_coneqs=[x - l * theta]), VALUES, inputs=[F], cost=F**2
    )
    model, values = joints()
    model.add_holonomic_constraints(x - l * theta)
    jointed = dmoc.MechanicalSystem.from_joints(
        "rack_j", model, values, inputs=[F], cost=F**2, constraints={"more": sp.Eq(x, 1)}
    )
    assert list(jointed.constraints) == ["constraint_1", "more"]
    assert sp.simplify(jointed.constraints["constraint_1"] - x + l * theta) == 0
    one = cart_pole.system()
    names = {sp.Symbol(s.name): s for s in VALUES}
    rolled = one.lagrangian.subs(names).subs(x, l * theta).doit()
    minimal = dmoc.MechanicalSystem(
        "rack_1", [theta], rolled, VALUES, [F], {theta: l * F}, cost=F**2
    )
    ends = {"theta": 0.0}, {"theta": 1.0, "theta_dot": 0.0}
    costs = [
        dmoc.solve(
            dmoc.Problem(
                dmoc.build(system), start=ends[0] | more, goal=ends[1], steps=20, final_time=0.8,
                controls="linear",
            ),
            "ipm",
        ).cost
        for system, more in ((imported, {"x": 0.0}), (minimal, {}))
    ]  # fmt: skip
    assert costs[0] == pytest.approx(costs[1], rel=1e-9)  # linear: the same discrete equations


def test_constraints_of_velocities_come_in_velocities() -> None:
    rolling = lagranges_method(nonhol_coneqs=[x.diff(t) - theta.diff(t) * x])
    system = dmoc.MechanicalSystem.from_lagranges_method("m", rolling, VALUES, inputs=[F])
    assert system.constraints == {"constraint_1": x.diff(t) - theta.diff(t) * x}
    model, values = joints()
    model.add_nonholonomic_constraints(model.u[0] - 2 * model.u[1])
    system = dmoc.MechanicalSystem.from_joints("m", model, values, inputs=[F])
    (constraint,) = system.constraints.values()
    assert constraint == model.q[0].diff(t) - 2 * model.q[1].diff(t)


def test_other_objects_are_refused() -> None:
    with pytest.raises(ModelError, match="is not a LagrangesMethod"):
        dmoc.MechanicalSystem.from_lagranges_method("m", object(), VALUES)
    with pytest.raises(ModelError, match="expected a JointsMethod or a System"):
        dmoc.MechanicalSystem.from_joints("m", object(), VALUES)
