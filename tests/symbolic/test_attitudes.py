"""Bodies that turn by quaternions: the energies, forces and motions of Euler angles and of closed
forms."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError
from dmoc.motion.attitude import rates, rotation
from dmoc.symbolic.continuous import readable
from dmoc.symbolic.graph import Graph, reverse
from dmoc.symbolic.traversal import evaluated

T = dynamicsymbols._t
torque = dynamicsymbols("T_x T_y T_z")
x, y, z, a, b, c, s = dynamicsymbols("x y z a b c s")
BODY = {"mass": 2, "centre": (0.1, -0.2, 0.3), "inertia": (0.5, 0.4, 0.2), "tip": (0.3, 0.1, 0)}


def hand(body: Any) -> None:
    body.hinge(s, (1, 0, 1), mass=0.7, centre=(0.1, 0.2, 0), inertia=(0.02, 0.03, 0.04))


def by_angles() -> dmoc.MechanicalSystem:
    world = dmoc.spatial.World(gravity=9.81)
    hand(world.free((x, y, z), (a, b, c), **BODY))
    return world.system("angles", cost=1)


def by_quaternion(axes: str = "body") -> dmoc.MechanicalSystem:
    world = dmoc.spatial.World(gravity=9.81)
    hand(world.free((x, y, z), torque=torque, axes=axes, **BODY))
    return world.system("quaternion", inputs=torque, cost=1)


def at(system: dmoc.MechanicalSystem, q: Any, v: Any, u: Any = ()) -> dict[str, Any]:
    """The Lagrangian, the momenta and the forces of a state."""
    f = readable(system).to_nodes(Graph())
    values = dict(zip((*f.q, *f.v, *f.u), (*q, *v, *u), strict=True))
    L, *rest = evaluated([f.L, *reverse(f.L, f.v), *f.Q], values, np)
    return {"L": L, "p": rest[: len(f.q)], "Q": rest[len(f.q) :]}


def states() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A state in angles, and the same in a quaternion; the angles change at once."""
    rng = np.random.default_rng(3)
    q, v = rng.normal(size=(2, 7))

    def quaternion(t: float) -> np.ndarray:
        return np.array(dmoc.attitude(euler=q[3:6] + t * v[3:6]).quaternion)

    p, step = quaternion(0), 1e-5
    speeds = (quaternion(step) - quaternion(-step)) / (2 * step)
    return q, v, np.concatenate([q[:3], p, q[6:]]), np.concatenate([v[:3], speeds, v[6:]])


def test_energies_of_a_quaternion_are_those_of_euler_angles() -> None:
    q, v, q_p, v_p = states()
    one, other = at(by_angles(), q, v), at(by_quaternion(), q_p, v_p, (0, 0, 0))
    assert other["L"] == pytest.approx(one["L"], rel=1e-9)
    np.testing.assert_allclose(
        np.array(other["p"])[[0, 1, 2, 7]], np.array(one["p"])[[0, 1, 2, 6]], rtol=1e-8
    )


@pytest.mark.parametrize("axes", ["body", "world"])
def test_the_work_of_torques_is_that_of_their_axes(axes: str) -> None:
    *_, q, v = states()
    force = np.array(at(by_quaternion(axes), q, v, u := np.array([0.3, -1.0, 0.7]))["Q"])
    omega = 2 * np.array(rates(q[3:7])) @ v[3:7]
    if axes == "world":
        omega = np.array(rotation(q[3:7])) @ omega
    assert force @ v == pytest.approx(u @ omega, rel=1e-12)
    assert force[[0, 1, 2, 7]].tolist() == [0, 0, 0, 0]


def test_a_torque_in_the_world_may_have_one_component() -> None:
    world = dmoc.spatial.World()
    world.ball("q", inertia=(1, 2, 3), torque=(0, 0, torque[2]), axes="world")
    system = world.system("one", inputs=torque[2:], cost=1)
    *_, q, v = states()
    force = np.array(at(system, q[3:7], v[3:7], [2.0])["Q"])
    omega = np.array(rotation(q[3:7])) @ (2 * np.array(rates(q[3:7])) @ v[3:7])
    assert force @ v[3:7] == pytest.approx(2 * omega[2], rel=1e-12)


def test_an_attitude_brings_its_constraint_and_its_angular_velocity() -> None:
    system = by_quaternion()
    p = dynamicsymbols("q0:4")
    assert system.attitudes == {"q": tuple(p)}
    assert system.constraints["q_unit"] == sum(e**2 for e in p) - 1
    assert [system.units[f"q_omega_{axis}"] for axis in "xyz"] == ["rad/s"] * 3
    *_, q, v = states()
    values = dict(zip((*system.velocities, *system.coordinates), (*v, *q), strict=True))
    omega = [float(system.quantities[f"q_omega_{axis}"].subs(values)) for axis in "xyz"]
    np.testing.assert_allclose(omega, 2 * np.array(rates(q[3:7])) @ v[3:7], rtol=1e-12)
    again = dataclasses.replace(system)
    assert again.fingerprint() == system.fingerprint()


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"attitudes": {"q": (a, b)}},
            r"attitude 'q' = .*: expected four coordinates of the model",
        ),
        ({"attitudes": {"q": (a, b, c, c)}}, "expected four coordinates of the model"),
        ({"attitudes": {"q": 3}}, "attitude 'q' = 3: expected a list of coordinates"),
        ({"attitudes": {"a": (a, b, c, s)}}, "the name 'a' is used twice, as coordinate and as at"),
        ({"attitudes": {"q q": (a, b, c, s)}}, "attitude name 'q q' is not a C identifier"),
        ({"attitudes": [a]}, r"attitudes = .*: expected a mapping such as"),
        (
            {"attitudes": {"q": (a, b, c, s)}, "quantities": {"q_omega_x": a}},
            "quantity 'q_omega_x' has a name of the attitude 'q': choose another name",
        ),
    ],
)
def test_a_wrong_attitude_is_one_sentence(fields: dict[str, Any], message: str) -> None:
    kinetic = sum(e.diff() ** 2 for e in (a, b, c, s))
    with pytest.raises(ModelError, match=message):
        dmoc.MechanicalSystem("wrong", [a, b, c, s], kinetic, cost=1, **fields)


def test_what_a_ball_joint_refuses() -> None:
    world = dmoc.spatial.World()
    for arguments, message in (
        ({"attitude": "q!"}, "attitude name 'q!' is not a C identifier"),
        ({"attitude": "q", "axes": "earth"}, "the axes of body q = 'earth': expected one of body,"),
        ({"attitude": "q", "torque": 1}, "the torque on body q = 1: expected 3 expressions"),
    ):
        with pytest.raises(ModelError, match=message):
            world.ball(**arguments)
    world.ball("q", mass=1)
    with pytest.raises(ModelError, match="coordinate q0 belongs to a joint already"):
        world.ball("q", mass=1)


def test_a_joint_without_a_mass_of_its_own_has_a_regular_mass_matrix() -> None:
    """Its size across the sphere, where nothing moves, is 1 then."""
    world = dmoc.spatial.World(gravity=9.81)
    world.ball("q").slide(s, "x", mass=2, inertia=(1, 1, 1))
    system = world.system("rail", cost=1)
    values = dict(zip(system.coordinates, (1, 0, 0, 0, 0), strict=True))
    (across,) = sp.hessian(system.lagrangian, system.velocities[:1]).subs(values)
    assert across == 4


def test_the_name_of_an_attitude_may_end_with_a_digit() -> None:
    world = dmoc.spatial.World()
    world.ball("wrist1", inertia=(1, 1, 1))
    names = [str(p.func) for p in world.system("ball", cost=1).coordinates]
    assert names == ["wrist10", "wrist11", "wrist12", "wrist13"]


def test_no_masses_compare_the_coordinates_of_a_quaternion() -> None:
    """Its row says by how much a step turns, 4 cos(angle / 2), whatever hangs at the body."""
    kernels = dmoc.build(by_quaternion(), backend="numpy")
    ends = np.random.default_rng(5).normal(size=(2, 8))
    for q in ends:
        q[3:7] /= np.linalg.norm(q[3:7])
    rest = np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 0))
    (turn,) = kernels.call("joint_turn", *ends[:, None], *rest)
    assert turn.ravel() == pytest.approx([4 * ends[0, 3:7] @ ends[1, 3:7]])
