"""An arm and a quadruped in space, and their masses in other ways."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from sympy.physics.mechanics import Point, ReferenceFrame, RigidBody, dynamicsymbols, inertia

import dmoc

Array = np.ndarray

# Axes of the joints of an arm; each link: to the next joint, mass, centre, moments of inertia.
ARM_AXES = ("z", "y", (1, 0, 1))
LINKS = [
    ((0.0, 0.0, 0.3), 1.5, (0.0, 0.05, 0.1), (0.02, 0.03, 0.01)),
    ((0.4, 0.0, 0.1), 1.0, (0.2, 0.0, 0.0), (0.005, 0.03, 0.03)),
    ((0.2, 0.1, 0.0), 0.6, (0.1, 0.02, 0.03), (0.001, 0.004, 0.005)),
]
GRAVITY = 9.81


def arm(hinges: int = 3) -> dmoc.MechanicalSystem:
    """Three hinges in space with torques, or the last of them."""
    world = dmoc.spatial.World(gravity=GRAVITY)
    link: dmoc.spatial.Body = world
    torques = dynamicsymbols("u1:4")[-hinges:]
    joints = list(zip(dynamicsymbols("q1:4"), dynamicsymbols("u1:4"), ARM_AXES, LINKS, strict=True))
    for q, u, axis, (tip, mass, centre, moments) in joints[-hinges:]:
        link = link.hinge(q, axis, tip=tip, mass=mass, centre=centre, inertia=moments, torque=u)
    return world.system("arm", inputs=torques, cost=1)


def nested_frames() -> tuple[ReferenceFrame, list[RigidBody], list[Any], list[Any]]:
    """The arm in frames of SymPy: the world's, bodies with potential energies, loads (weights, then
    torques), coordinates."""
    N, origin, q = ReferenceFrame("N"), Point("O"), dynamicsymbols("q1:4")
    origin.set_vel(N, 0)
    frame, joint, bodies, torques, weights = N, origin, [], [], []
    directions = ((0, 0, 1), (0, 1, 0), (1, 0, 1))
    for k, (s, axis, (tip, mass, centre, moments)) in enumerate(
        zip(q, directions, LINKS, strict=True), 1
    ):
        size = sp.sqrt(sum(e**2 for e in axis))
        n = _along(frame, [e / size for e in axis])
        turned = frame.orientnew(f"B{k}", "Axis", [s, n])
        mid = joint.locatenew(f"C{k}", _along(turned, centre))
        mid.v2pt_theory(joint, N, turned)
        body = RigidBody(f"b{k}", mid, turned, mass, (inertia(turned, *moments), mid))
        body.potential_energy = mass * GRAVITY * mid.pos_from(origin).dot(N.z)
        bodies.append(body)
        weights.append((mid, -mass * GRAVITY * N.z))
        u = dynamicsymbols(f"u{k}")
        torques += [(turned, u * n), (frame, -u * n)] if k > 1 else [(turned, u * n)]
        end = joint.locatenew(f"P{k}", _along(turned, tip))
        end.v2pt_theory(joint, N, turned)
        frame, joint = turned, end
    return N, bodies, [*weights, *torques], q


def _along(frame: ReferenceFrame, entries: Any) -> Any:
    return entries[0] * frame.x + entries[1] * frame.y + entries[2] * frame.z


@dataclass(frozen=True)
class Joint:
    """A joint of the quadruped and the body behind it; ``before`` is that of the body before."""

    name: str
    before: int
    axis: str
    slides: bool = False
    at: tuple[float, float, float] = (0, 0, 0)
    mass: float = 0
    centre: tuple[float, float, float] = (0, 0, 0)
    inertia: tuple[float, float, float] = (0, 0, 0)


SIDES = {"fl": (1, 1), "fr": (1, -1), "hl": (-1, 1), "hr": (-1, -1)}
JOINTS = [
    *(Joint(name, k - 1, name, slides=True) for k, name in enumerate("xyz")),
    Joint("yaw", 2, "z"),
    Joint("pitch", 3, "y"),
    Joint("roll", 4, "x", mass=9.0, inertia=(0.07, 0.26, 0.28), centre=(0.01, 0, 0)),
]
for side, (ahead, left) in SIDES.items():
    hip = len(JOINTS)
    JOINTS += [
        Joint(f"{side}_hip", 5, "x", False, (0.2 * ahead, 0.05 * left, 0), 0.6,
              (0, 0.02 * left, 0), (0.0005, 0.0008, 0.0006)),
        Joint(f"{side}_thigh", hip, "y", False, (0, 0.08 * left, 0), 0.8, (0, 0, -0.1),
              (0.005, 0.005, 0.001)),
        Joint(f"{side}_knee", hip + 1, "y", False, (0, 0, -0.2), 0.2, (0, 0, -0.1),
              (0.0007, 0.0007, 0.0001)),
    ]  # fmt: skip


def legged(legs: Sequence[str] = tuple(SIDES)) -> dmoc.MechanicalSystem:
    """A trunk that floats and legs of three joints with a torque each, and a floor below each foot:
    a quadruped of 18 degrees of freedom."""
    world = dmoc.spatial.World(gravity=GRAVITY)
    bodies: list[dmoc.spatial.Body] = []
    torques, feet = [], {}
    for joint in JOINTS:
        if "_" in joint.name and joint.name[:2] not in legs:
            continue
        before = bodies[joint.before] if joint.before >= 0 else world
        q = dynamicsymbols(joint.name)
        facts: dict[str, Any] = {
            "at": joint.at, "mass": joint.mass, "centre": joint.centre, "inertia": joint.inertia
        }  # fmt: skip
        if joint.slides:
            bodies.append(before.slide(q, joint.axis, **facts))
            continue
        u = dynamicsymbols(f"u_{joint.name}") if "_" in joint.name else 0
        torques += [u] if u != 0 else []
        bodies.append(before.hinge(q, joint.axis, torque=u, **facts))
        if joint.name.endswith("knee"):
            feet[joint.name[:2]] = bodies[-1].point(0, 0, -0.2)
    return world.system(
        "legged", inputs=torques, cost=sum(u**2 for u in torques),
        surfaces={name: foot[2] >= 0 for name, foot in feet.items()},
    )  # fmt: skip


def composite_mass(q: Array) -> Array:
    """Masses of the quadruped by the composite-rigid-body algorithm (Featherstone 2008, table 6.2),
    in spatial vectors (angular, linear) of the frames of bodies."""
    n = len(JOINTS)
    subspace, motion, composite = [], [], []
    for joint, value in zip(JOINTS, q, strict=True):
        axis = np.eye(3)["xyz".index(joint.axis)]
        E, at = np.eye(3), np.array(joint.at, float)
        if joint.slides:
            at = at + value * axis
            subspace.append(np.r_[np.zeros(3), axis])
        else:
            K = _skew(axis)
            E = np.eye(3) - np.sin(value) * K + (1 - np.cos(value)) * K @ K
            subspace.append(np.r_[axis, np.zeros(3)])
        motion.append(np.block([[E, np.zeros((3, 3))], [-E @ _skew(at), E]]))
        C = _skew(np.array(joint.centre, float))
        inertia_ = np.diag(joint.inertia) + joint.mass * C @ C.T
        composite.append(
            np.block([[inertia_, joint.mass * C], [joint.mass * C.T, joint.mass * np.eye(3)]])
        )
    for i in reversed(range(n)):
        if JOINTS[i].before >= 0:
            composite[JOINTS[i].before] += motion[i].T @ composite[i] @ motion[i]
    M = np.zeros((n, n))
    for i in range(n):
        force, j = composite[i] @ subspace[i], i
        M[i, i] = subspace[i] @ force
        while JOINTS[j].before >= 0:
            force, j = motion[j].T @ force, JOINTS[j].before
            M[i, j] = M[j, i] = force @ subspace[j]
    return M


def _skew(v: Array) -> Array:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
