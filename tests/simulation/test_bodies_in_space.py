"""Bodies in space beside what is known of them: the hit of a corner, and chains that move in a
plane."""

from __future__ import annotations

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.motion.attitude import rotation

GRAVITY, MASS, HALF, RESTITUTION = 9.81, 2.0, (0.3, 0.2, 0.1), 0.6


def test_the_corner_of_a_box_hits_a_smooth_floor() -> None:
    """The impulse is -(1 + e) m_eff w with 1/m_eff = 1/m + (r x n) J^-1 (r x n) in the axes of the
    body and the speed w of the corner, of a body that turns freely until then."""
    a, b, c = HALF
    inertia = MASS / 3 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    world = dmoc.spatial.World(gravity=GRAVITY)
    at = dynamicsymbols("x y z")
    box = world.free(at, attitude="q", mass=MASS, inertia=tuple(inertia))
    corner = np.array([a, b, -c])
    floor = {"floor": box.point(*corner)[2] >= 0}
    kernels = dmoc.build(world.system("box_on_its_corner", surfaces=floor, cost=1))
    spin = np.array([1.0, -2.0, 3.0])
    run = dmoc.simulate(
        kernels, {"z": 0.8, "q": dmoc.attitude(axis=(1, 2, 0.5), angle=0.7)},
        {"x": 0.4, **{f"q_omega_{k}": w for k, w in zip("xyz", spin, strict=True)}},
        step_size=0.01, steps=60, restitution=RESTITUTION,
    )  # fmt: skip
    hit = run.trajectory.collisions[0]

    def turns(_: float, omega: np.ndarray) -> np.ndarray:
        return np.asarray(-np.cross(omega, inertia * omega) / inertia)

    omega = solve_ivp(turns, (0, hit.time), spin, rtol=1e-12, atol=1e-12).y[:, -1]
    turned = rotation(np.asarray(hit.position)[3:])
    speed = -GRAVITY * hit.time + (turned @ np.cross(omega, corner))[2]
    arm = np.cross(corner, turned[2])
    effective = 1 / (1 / MASS + arm @ (arm / inertia))
    expected = -(1 + RESTITUTION) * effective * speed
    np.testing.assert_allclose(hit.impulse, expected, rtol=1e-10)
    assert dmoc.verify(run.trajectory, kernels).passed


def test_a_chain_in_space_moves_as_that_in_the_plane() -> None:
    a, b = dynamicsymbols("a b")
    plane, space = dmoc.planar.World(gravity=GRAVITY), dmoc.spatial.World(gravity=GRAVITY)
    plane.hinge(a, length=0.7, mass=1.2, zero=-sp.pi / 2).hinge(b, length=0.5, mass=0.8)

    def rod(length: float, mass: float) -> dict[str, object]:
        thick = mass * length**2 / 12
        return {
            "tip": (0, 0, -length), "mass": mass, "centre": (0, 0, -length / 2),
            "inertia": (thick, thick, 0.001),
        }  # fmt: skip

    space.hinge(a, (0, -1, 0), **rod(0.7, 1.2)).hinge(b, (0, -1, 0), **rod(0.5, 0.8))
    ways = [
        dmoc.simulate(
            world.system(name, cost=1), {a: 1.0, b: 0.5}, {a: 1.0, b: -2.0}, step_size=0.01,
            steps=300,
        ).q
        for name, world in (("chain_in_the_plane", plane), ("chain_in_space", space))
    ]  # fmt: skip
    np.testing.assert_allclose(*ways, atol=1e-8)
