"""Linkages that are built body by body: the same numbers as Lagrangians by hand, as SymPy's
mechanics, and as a composite-rigid-body computation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import sympy as sp
from linkages import arm, composite_mass, legged, nested_frames
from sympy.physics.mechanics import KanesMethod, LagrangesMethod, Lagrangian, dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError
from dmoc.codegen.text import c_files
from dmoc.inspection.kernel_check import kernel_errors
from dmoc.models.registry import find
from dmoc.symbolic.continuous import energy, mass_matrix, readable, right_hand_side
from dmoc.symbolic.families import model_spec
from dmoc.symbolic.graph import Graph
from dmoc.symbolic.traversal import evaluated

T = dynamicsymbols._t
m, l, g = sp.symbols("m l g")
VALUES = {m: 0.5, l: 0.4, g: 9.81}
a, b, c, u, x, y, r = dynamicsymbols("a b c u x y r")


def dynamics(system: dmoc.MechanicalSystem) -> list[np.ndarray]:
    """M, F and the energy at random states, of what kernels are made of."""
    f = readable(system).to_nodes(Graph())
    rng = np.random.default_rng(0)
    states = [rng.uniform(-1, 1, (size, 6)) for size in (len(f.q), len(f.v), len(f.u))]
    par = [float(x) for x in system.parameters.values() if x is not None]
    values = dict(zip((*f.q, *f.v, *f.u, *f.par), (*np.concatenate(states), *par), strict=True))
    M, F = [e for row in mass_matrix(f) for e in row], right_hand_side(f)
    numbers = [np.broadcast_to(e, 6) for e in evaluated([*M, *F, energy(f)], values, np)]
    return [np.array(part).T for part in (numbers[: len(M)], numbers[len(M) : -1], numbers[-1])]


def assert_same(ours: dmoc.MechanicalSystem, expected: dmoc.MechanicalSystem) -> None:
    for one, other in zip(dynamics(ours), dynamics(expected), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-13)


def chain(absolute: bool, angles: Sequence[Any] = (a, b, c)) -> dmoc.MechanicalSystem:
    """Slender rods, a torque in the last joint, and a stop for the first rod."""
    world = dmoc.planar.World(gravity=g)
    link: dmoc.planar.Body = world
    for angle in angles:
        link = link.hinge(
            angle, length=l, mass=m, zero=-sp.pi / 2, absolute=absolute or angle == a,
            torque=u if angle == angles[-1] else 0,
        )  # fmt: skip
    return world.system(
        "chain", VALUES, inputs=[u], cost=u**2, surfaces={"stop": a <= sp.Rational(1, 2)}
    )


def chain_by_hand(absolute: bool, angles: Sequence[Any] = (a, b, c)) -> dmoc.MechanicalSystem:
    X = Y = total = kinetic = potential = sp.S.Zero
    for angle in angles:
        total = angle if absolute else angle + total - (sp.pi / 2 if angle != a else 0)
        centre = (X + l * sp.sin(total) / 2, Y - l * sp.cos(total) / 2)
        speed = sum(e.diff(T) ** 2 for e in centre)
        kinetic += m * speed / 2 + m * l**2 / 12 * total.diff(T) ** 2 / 2
        potential += m * g * centre[1]
        X, Y = X + l * sp.sin(total), Y - l * sp.cos(total)
    *_, before, last = angles
    forces = {before: -u, last: u} if absolute else {last: u}
    return dmoc.MechanicalSystem(
        "chain", angles, kinetic - potential, VALUES, inputs=[u], forces=forces, cost=u**2,
        surfaces={"stop": a <= sp.Rational(1, 2)},
    )  # fmt: skip


@pytest.mark.parametrize("absolute", [False, True])
def test_a_chain_of_three_is_its_lagrangian_by_hand(absolute: bool) -> None:
    assert_same(chain(absolute), chain_by_hand(absolute))


@pytest.mark.slow
def test_a_solve_of_a_chain_is_that_of_its_lagrangian_by_hand() -> None:
    costs = []
    for system in (chain(True, (a, b)), chain_by_hand(True, (a, b))):
        problem = dmoc.Problem(
            system, start={"a": 0.3, "b": 0.0, "a_dot": 1.0, "b_dot": 0}, goal={"b": 1.0},
            sequence=["stop"], steps=10, final_time=0.6, restitution=0.5,
        )  # fmt: skip
        solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
        assert solution.status == "solved"
        costs.append(solution.cost)
    assert costs[0] == pytest.approx(costs[1], rel=1e-9)


@pytest.mark.slow
def test_a_cart_pole_is_the_shipped_model() -> None:
    """The published problem: cost 129.602392."""
    x, alpha, force = dynamicsymbols("x alpha F")
    low, high = sp.symbols("alpha_min alpha_max")
    world = dmoc.planar.World(gravity=10)
    cart = world.slide(x, mass=1, force=force)
    cart.hinge(alpha, length=0.5, mass=1, centre=0.5, inertia=0)
    system = world.system(
        "cart_pole", {low: np.pi / 10, high: 9 * np.pi / 10}, inputs=[force], cost=force**2 / 2,
        surfaces={"lower": alpha >= low, "upper": alpha <= high},
    )  # fmt: skip
    problem = dmoc.Problem(system, **find("cart_pendulum").defaults)
    assert dmoc.solve(problem, verify=False).cost == pytest.approx(129.602392, abs=2e-6)


def test_a_leg_that_slides_is_a_mass_in_polar_coordinates() -> None:
    """A foot on a rail that turns, and a body that nothing holds."""
    world = dmoc.planar.World(gravity=g)
    trunk = world.free((x, y), a, mass=2 * m, inertia=m, box=(0.5, 0.2))
    leg = trunk.hinge(b, at=(l, 0), zero=-sp.pi / 2)
    foot = leg.slide(r, mass=m, force=u)
    system = world.system(
        "hopper", VALUES, inputs=[u], lagrangian=-10 * (r - 1) ** 2, forces={"b": -b.diff()},
        surfaces={"floor": foot.tip[1] >= 0}, cost=u**2,
        drawing=[dmoc.Contact("floor", foot.tip)],
    )  # fmt: skip
    angle = a + b - sp.pi / 2
    place = (x + l * sp.cos(a) + r * sp.cos(angle), y + l * sp.sin(a) + r * sp.sin(angle))
    kinetic = m * (x.diff() ** 2 + y.diff() ** 2) + m * a.diff() ** 2 / 2
    kinetic += m * sum(e.diff(T) ** 2 for e in place) / 2
    expected = dmoc.MechanicalSystem(
        "hopper", [x, y, a, b, r], kinetic - m * g * (2 * y + place[1]) - 10 * (r - 1) ** 2, VALUES,
        inputs=[u], forces={r: u, b: -b.diff()}, cost=u**2, surfaces={"floor": place[1] >= 0},
    )  # fmt: skip
    assert_same(system, expected)
    assert [type(s).__name__ for s in system.drawing] == ["Box", "Point", "Contact"]
    assert system.shapes[-1].normal == (0, 1)
    assert system.units == {"x": "m", "y": "m", "a": "rad", "b": "rad", "r": "m"}


@pytest.mark.slow
def test_an_arm_in_space_is_that_of_kane() -> None:
    """Three hinges with axes z, y and (1, 0, 1), gravity, and torques."""
    ours = dynamics(arm())
    frame, bodies, loads, q = nested_frames()
    speeds = dynamicsymbols("w1:4")
    rates = dict(zip([s.diff(T) for s in q], speeds, strict=True))
    for body in bodies:
        body.frame.set_ang_vel(frame, body.frame.ang_vel_in(frame).subs(rates))
        body.masscenter.set_vel(frame, body.masscenter.vel(frame).subs(rates))
    kinematics = [w - s.diff(T) for w, s in zip(speeds, q, strict=True)]
    kane = KanesMethod(frame, q, speeds, kinematics)
    kane.kanes_equations(bodies, loads)
    rng = np.random.default_rng(0)
    states = [rng.uniform(-1, 1, (3, 6)) for _ in range(3)]
    torques = dynamicsymbols("u1:4")
    forcing = kane.forcing.subs(rates)
    function = sp.lambdify([*q, *speeds, *torques], (kane.mass_matrix, forcing), "numpy")
    for k in range(6):
        M, F = function(*np.concatenate(states)[:, k])
        np.testing.assert_allclose(ours[0][k].reshape(3, 3), M, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(ours[1][k], np.ravel(F), rtol=1e-11, atol=1e-12)


def test_nested_frames_of_sympy_go_through_the_same_graph() -> None:
    frame, bodies, loads, q = nested_frames()
    method = LagrangesMethod(
        Lagrangian(frame, *bodies), q, forcelist=loads[len(bodies) :], frame=frame
    )
    system = dmoc.MechanicalSystem.from_lagranges_method(
        "frames", method, {}, inputs=dynamicsymbols("u1:4"), cost=1
    )
    assert_same(system, arm())


@pytest.mark.slow
def test_masses_of_a_quadruped_are_those_of_composite_bodies() -> None:
    nodes = readable(legged()).to_nodes(Graph())
    entries = [e for row in mass_matrix(nodes) for e in row]
    assert len(nodes.q) == 18
    rng = np.random.default_rng(1)
    for _ in range(3):
        q = rng.uniform(-1, 1, 18)
        values = dict(zip(nodes.q, map(float, q), strict=True))
        masses = np.array(evaluated(entries, values, math)).reshape(18, 18)
        np.testing.assert_allclose(masses, masses.T, rtol=0, atol=1e-13)
        assert np.linalg.eigvalsh(masses)[0] > 1e-4
        np.testing.assert_allclose(masses, composite_mass(q), rtol=1e-12, atol=1e-13)


def planar(**arguments: Any) -> Any:
    return dmoc.planar.World().hinge(**({"angle": a} | arguments))


def sliding(**arguments: Any) -> Any:
    return dmoc.planar.World().slide(**({"distance": x} | arguments))


def spatial(**arguments: Any) -> Any:
    return dmoc.spatial.World().hinge(**({"angle": a, "axis": "z"} | arguments))


@pytest.mark.parametrize(
    ("make", "arguments", "message"),
    [
        (planar, {"angle": sp.Symbol("a")}, "coordinate a of a joint is not a function of time"),
        (planar, {"angle": "a"}, "coordinate 'a' of a joint is not a function of time"),
        (planar, {"length": -1}, "the length of body a = -1: expected 0 or more; sp.pi more in"),
        (planar, {"mass": -0.5}, r"the mass of body a = -0.5\d*: expected 0 or more\."),
        (planar, {"inertia": -sp.Symbol("J", positive=True)}, "the inertia of body a = -J: exp"),
        (spatial, {"mass": -2}, "the mass of body a = -2: expected 0 or more"),
        (spatial, {"inertia": (1, -1, 1)}, "the inertia of body a about y = -1: expected 0 or"),
        (planar, {"length": "l"}, "the length of body a is not a scalar SymPy expression"),
        (planar, {"centre": (1, 2, 3)}, r"the centre of body a = .*expected 2 .* as in \(a, b\)"),
        (planar, {"at": 1}, "at of body a = 1: expected 2 expressions"),
        (planar, {"absolute": "yes"}, "absolute = 'yes': expected True or False"),
        (planar, {"name": "a b"}, "body name 'a b' is not a C identifier"),
        (planar, {"box": 0.1}, "the box of body a = 0.1: expected 2 expressions"),
        (sliding, {"direction": (0, 0)}, r"the direction of body x = \(0, 0\): expected numbers"),
        (sliding, {"direction": (m, 0)}, "expected numbers, not all 0"),
        (sliding, {"force": [1]}, "the force on body x is not a scalar SymPy expression"),
        (spatial, {"axis": "w"}, "the axis of body a = 'w': expected 3 expressions"),
        (spatial, {"axis": (0, 0, 0)}, "expected numbers, not all 0"),
        (spatial, {"inertia": sp.Matrix(3, 3, range(9))}, "expected a symmetric matrix"),
        (spatial, {"inertia": 1}, "the inertia of body a = 1: expected 3 expressions"),
        (spatial, {"tip": (0, 1)}, "the tip of body a = .*expected 3 expressions"),
    ],
)
def test_a_wrong_joint_is_one_sentence_and_leaves_no_trace(
    make: Any, arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(ModelError, match=message) as error:
        make(**arguments)
    assert "\n" not in str(error.value) and str(error.value).endswith(".")
    world = dmoc.planar.World()
    with pytest.raises(ModelError):
        world.hinge(a, mass="heavy")
    assert world.hinge(a, mass=1, length=1).name == "a"


def test_a_size_that_its_parameter_makes_negative_is_refused() -> None:
    world = dmoc.planar.World()
    world.hinge(a, length=l, mass=m)
    with pytest.raises(ModelError, match=r"the length of body a = -0.4\d*: expected 0 or more"):
        world.system("turned", {l: -0.4, m: 1.0}, cost=1)


def rolling(module: Any) -> Any:
    """A wheel of radius l on a shelf that is lifted by b."""
    world = module.World(gravity=g)
    if module is dmoc.planar:
        shelf = world.slide(b, direction=(0, 1))
        return shelf.hinge(a, at=(-l * a, l), mass=m, centre=0, inertia=m * l**2 / 2, torque=u)
    shelf = world.slide(b, "z")
    return shelf.hinge(a, "y", at=(l * a, 0, l), mass=m, inertia=(0, m * l**2 / 2, 0), torque=u)


def geared(module: Any) -> Any:
    """A rotor turned three times as far as the shaft that carries it."""
    axis = () if module is dmoc.planar else ("z",)
    shaft = module.World(gravity=g).hinge(b, *axis, mass=0)
    own = l if module is dmoc.planar else (0, 0, l)
    return shaft.hinge(a, *axis, zero=2 * b, mass=m, inertia=own, torque=u)


def carried(module: Any) -> Any:
    """A slider whose rail is moved along itself by a screw, the coordinate b."""
    axis = () if module is dmoc.planar else ("x",)
    at = (l * b, 0, 0)[: 2 + len(axis)]
    nut = module.World().slide(b, *axis, mass=m)
    return nut.slide(a, *axis, at=at, mass=m, force=u)


def shifted(module: Any) -> Any:
    """A body whose centre of mass is moved along it by a screw of mass m, the coordinate b."""
    centre, axis = ((b, 0), ()) if module is dmoc.planar else ((b, 0, 0), ("z",))
    own = 0 if module is dmoc.planar else (0, 0, 0)
    world = module.World()
    world.slide(b, *axis, mass=m)
    return world.hinge(a, *axis, mass=m, centre=centre, inertia=own, torque=u)


@pytest.mark.parametrize("module", [dmoc.planar, dmoc.spatial])
@pytest.mark.parametrize(
    ("make", "kinetic", "potential", "forces"),
    [
        (
            rolling,
            m * b.diff() ** 2 / 2 + 3 * m * l**2 * a.diff() ** 2 / 4,
            m * g * (b + l),
            {a: u},
        ),
        (geared, l * (a.diff() + 3 * b.diff()) ** 2 / 2, 0, {a: u, b: 2 * u}),
        (
            carried,
            m * b.diff() ** 2 / 2 + m * (a.diff() + (1 + l) * b.diff()) ** 2 / 2,
            0,
            {a: u, b: l * u},
        ),
        (shifted, m * b.diff() ** 2 + m * (b * a.diff()) ** 2 / 2, 0, {a: u}),
    ],
)
def test_a_joint_may_be_moved_by_coordinates(
    module: Any, make: Any, kinetic: Any, potential: Any, forces: dict[Any, Any]
) -> None:
    """Energies in closed form, and forces by their virtual work."""
    linkage = make(module)._linkage
    energy = linkage.lagrangian
    for name, value in reversed(linkage.definitions.items()):
        energy = energy.subs(name, value)
    assert sp.simplify(energy.doit() - kinetic + potential) == 0
    assert linkage.forces == forces


@pytest.mark.parametrize("module", [dmoc.planar, dmoc.spatial])
def test_a_joint_may_follow_others(module: Any) -> None:
    """A gear that a torque drives, whose work is that of its shaft, and what is refused of it."""
    axis = () if module is dmoc.planar else ("z",)
    own = l if module is dmoc.planar else (0, 0, l)
    world = module.World()
    world.hinge(a, *axis, mass=0, inertia=own)
    world.hinge(3 * a + 1, *axis, name="gear", mass=0, inertia=own, torque=u)
    system = world.system("geared", {l: 2.0}, inputs=[u])
    assert system.coordinates == (a,) and system.forces == {a: 3 * u}
    assert sp.simplify(system.mass_matrix[0] - 10 * l) == 0
    with pytest.raises(ModelError, match=r"joint follows 2\*a.* give it a name, such as name="):
        world.hinge(2 * a, *axis)
    with pytest.raises(ModelError, match="body cog follows b, which no joint has yet"):
        world.hinge(a + b, *axis, name="cog", torque=u)
    with pytest.raises(ModelError, match="is not a function of time"):
        world.hinge(2 * l, *axis, name="cog")


@pytest.mark.parametrize("module", [dmoc.planar, dmoc.spatial])
def test_what_a_world_refuses(module: Any) -> None:
    axis = () if module is dmoc.planar else ("z",)
    world = module.World()
    world.hinge(a, *axis, mass=1)
    with pytest.raises(ModelError, match="coordinate a belongs to a joint already"):
        world.hinge(a, *axis)
    with pytest.raises(ModelError, match=r"place of a free body = .*: expected . dynamicsymbols"):
        world.free([x], a)
    with pytest.raises(ModelError, match="'gaps' is no field of a system"):
        world.system("w", gaps={})
    with pytest.raises(ModelError, match="does not contain the velocity of coordinate a"):
        world.system("w")
    with pytest.raises(ModelError, match="definition s_a is a name of the linkage"):
        arm = dmoc.planar.World()
        arm.hinge(a, length=1, mass=1)
        arm.system("w", definitions={dynamicsymbols("s_a"): a})
    with pytest.raises(ModelError, match=r"no definition: .*made before its system"):
        link = dmoc.planar.World().hinge(b, length=1)
        arm.system("w", surfaces={"floor": link.tip[1] >= 0})
    with pytest.raises(ModelError, match="the gravity of the world is not a scalar"):
        module.World("down")


def test_points_have_names_of_their_own() -> None:
    world = dmoc.planar.World()
    link = world.hinge(a, length=4, mass=1)
    assert link.tip == link.point(4) == tuple(dynamicsymbols("x_a y_a"))
    assert link.point(0) == (0, 0) and link.point(2) == tuple(dynamicsymbols("x_a_c y_a_c"))
    assert link.point(0, 1) != link.point(0, -1)
    other = world.hinge(b, length=3, name="a")  # two bodies of one name
    assert len({*link.tip, *other.tip}) == 4
    system = world.system("named", lagrangian=b.diff() ** 2, surfaces={"s": other.tip[0] <= 1})
    assert system.gaps["s"] == dynamicsymbols("x_a_2") - 1


def test_velocities_of_points_in_space_are_those_of_their_frames() -> None:
    """A tip on a turning arm: v = w x r, of which the world's frame has the same length."""
    world = dmoc.spatial.World()
    body = world.hinge(a, "z").hinge(b, "y", tip=(1, 0, 0), mass=1)
    speed = sum(e.diff(T) ** 2 for e in body.tip)
    expected = sp.cos(b) ** 2 * a.diff() ** 2 + b.diff() ** 2
    by_speed = world.system("speed", cost=speed, lagrangian=a.diff() ** 2)
    by_hand = world.system("speed", cost=expected, lagrangian=a.diff() ** 2)
    q, v = np.random.default_rng(0).normal(size=(2, 2, 4))
    costs = []
    for system in (by_speed, by_hand):
        f = readable(system).to_nodes(Graph())
        costs += evaluated([f.C], dict(zip((*f.q, *f.v), (*q, *v), strict=True)), np)
    np.testing.assert_allclose(*costs, rtol=1e-13)


@pytest.mark.slow
def test_compiled_kernels_of_an_arm_in_space_agree_with_90_digits() -> None:
    errors = kernel_errors(arm(2), dmoc.build(arm(2)))
    assert len(errors) > 10 and max(c.error for c in errors) < 1e-11


@pytest.mark.slow
def test_a_leg_is_generated_in_code_that_a_compiler_takes() -> None:
    model = model_spec(legged(("fl",)))
    text = c_files(model)["kernels.c"]
    assert 1e5 < len(text) < 5e5
    assert len(model.facts["coordinates"]) == 9 and len(model.facts["surfaces"]) == 1


def test_an_inertia_that_turns_nothing_is_an_inertia_yet() -> None:
    """Of a body that slides, whose angle is that of the world."""
    x = dynamicsymbols("x")
    for inertia in (x.diff(), sp.Symbol("I"), dynamicsymbols("w")):
        world = dmoc.planar.World()
        world.slide(x, mass=1, inertia=inertia)
        with pytest.raises(ModelError, match=r"inertia of body x = .* expected coordinates, the t"):
            world.system("cart")
    world = dmoc.planar.World()
    world.slide(x, mass=1, inertia=1 + x**2)
    assert world.system("cart").coordinates == (x,)
