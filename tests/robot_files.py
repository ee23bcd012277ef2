"""Robots as URDF text, and the dynamics that MuJoCo has of their files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

import dmoc
from dmoc.base.names import name_of
from dmoc.motion.attitude import rates
from dmoc.robots.robot import Robot
from dmoc.symbolic.continuous import readable
from dmoc.symbolic.graph import Graph
from dmoc.symbolic.traversal import evaluated

Array = np.ndarray
STEP = 1e-30  # of complex steps


def inertial(rng: np.random.Generator, mass: float) -> str:
    """An inertia of a body, with products and in a turned frame."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    extent = rng.uniform(0.02, 0.2, 3) ** 2
    J = turn @ np.diag(mass * (extent.sum() - extent)) @ turn.T
    entries = zip(
        ("xx", "yy", "zz", "xy", "xz", "yz"),
        (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]),
        strict=True,
    )
    inertia = " ".join(f'i{name}="{value:.17g}"' for name, value in entries)
    return f'<inertial>{origin(rng)}<mass value="{mass}"/><inertia {inertia}/></inertial>'


def origin(rng: np.random.Generator) -> str:
    xyz, rpy = rng.uniform(-0.3, 0.3, 3), rng.uniform(-1, 1, 3)
    return f'<origin xyz="{" ".join(map(str, xyz))}" rpy="{" ".join(map(str, rpy))}"/>'


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{inside}</joint>"
    )


def chain(
    rng: np.random.Generator, root: str, prefix: str, kinds: Sequence[str], tip: str = ""
) -> str:
    """Links behind each other with turned frames and axes, and a tip fixed to the last."""
    text, before = "", root
    for k, kind in enumerate(kinds, 1):
        axis = " ".join(map(str, rng.normal(size=3)))
        inside = f'{origin(rng)}<axis xyz="{axis}"/><dynamics damping="{rng.uniform(0, 1)}"/>'
        if kind != "continuous":
            inside += '<limit lower="-1" upper="2" effort="30" velocity="4"/>'
        text += link(f"{prefix}{k}", inertial(rng, rng.uniform(0.5, 2)))
        text += joint(f"{prefix}_joint{k}", kind, before, f"{prefix}{k}", inside)
        before = f"{prefix}{k}"
    text += link(f"{prefix}_tip", tip + inertial(rng, 0.3))
    return text + joint(f"{prefix}_weld", "fixed", before, f"{prefix}_tip", origin(rng))


def robot(name: str, inside: str) -> str:
    return f'<robot name="{name}">{inside}</robot>'


FOOT = '<collision name="{}"><geometry><sphere radius="0.03"/></geometry></collision>'


def arm(count: int) -> str:
    """An arm on a stand, the second last joint prismatic and the last one continuous."""
    kinds = ["revolute"] * (count - 2) + ["prismatic", "continuous"]
    return robot(
        f"arm_{count}", link("stand") + chain(np.random.default_rng(count), "stand", "a", kinds)
    )


def legged(legs: Sequence[str], joints: int) -> str:
    """A trunk with legs, each with a spherical foot."""
    rng = np.random.default_rng(len(legs))
    text = link("trunk", inertial(rng, 8.0))
    for leg in legs:
        text += chain(rng, "trunk", leg, ["revolute"] * joints, FOOT.format(f"{leg}_foot"))
    return robot("legged", text)


class _Ours:
    """Energy and forces of a system as functions of states, without a compiler."""

    def __init__(self, system: dmoc.MechanicalSystem) -> None:
        self.nodes = readable(system).to_nodes(Graph())
        self.n = len(self.nodes.q)

    def _evaluated(self, functions: Sequence[Any], q: Array, v: Array) -> list[Array]:
        f = self.nodes
        values = dict(zip((*f.q, *f.v), (*q, *v), strict=True)) | dict.fromkeys(f.u, 0.0)
        return [np.asarray(e) for e in evaluated(functions, values, np)]

    def _energy(self, q: Array, v: Array) -> Array:
        """L of columns of places and velocities."""
        q, v = np.broadcast_arrays(q, v)
        return np.broadcast_to(self._evaluated([self.nodes.L], q, v)[0], q.shape[1:])

    def _momenta(self, q: Array, v: Array) -> Array:
        one = np.eye(self.n)
        return (self._energy(q, v + one) - self._energy(q, v - one)) / 2

    def mass(self, q: Array) -> Array:
        rest = self._momenta(q[:, None], np.zeros((self.n, 1)))
        columns = [self._momenta(q[:, None], e[:, None]) - rest for e in np.eye(self.n)]
        return np.array(columns)

    def forces(self, q: Array, v: Array, a: Array) -> Array:
        """d/dt dL/dv - dL/dq - Q, with derivatives by complex steps."""
        later = [(one + 1j * STEP * rate)[:, None] for one, rate in ((q, v), (v, a))]
        pushed = self._energy(q[:, None] + 1j * STEP * np.eye(self.n), v[:, None] + 0j)
        Q = self._evaluated(self.nodes.Q, q, v)
        return (self._momenta(*later).imag - pushed.imag) / STEP - np.array(Q)


@dataclass(frozen=True)
class _Block:
    """Coordinates of ours, one, four or three of them, with the first of MuJoCo's places and
    velocities that they are."""

    first: int
    kind: str
    place: int
    speed: int


def _blocks(names: Sequence[str], ours: Robot, model: Any) -> list[_Block]:
    blocks = []
    for first, name in enumerate(names):
        stem, kind = name, "single"
        for attitude in ours.attitudes:
            if name.removeprefix(attitude) in ("0", "_yaw", "_x", "_y", "_z"):
                stem, kind = attitude, name.removeprefix(attitude)
            elif name.removeprefix(attitude) in ("1", "2", "3", "_pitch", "_roll"):
                kind = ""
        if kind:
            j = model.joint(stem)
            free = model.jnt_type[j.id] == mujoco.mjtJoint.mjJNT_FREE
            more = {"_y": 1, "_z": 2, "0": 3 * free, "_yaw": 3}.get(kind, 0)
            blocks.append(_Block(first, kind, int(j.qposadr[0]) + more, int(j.dofadr[0]) + more))
    return blocks


def _tangent(q: Array, blocks: Sequence[_Block]) -> Array:
    """dq/dw, with w those of MuJoCo."""
    columns = []
    for block in blocks:
        k, rows = block.first, np.ones((1, 1))
        if block.kind == "0":
            rows = np.array(rates(q[k : k + 4])).T / 2
        elif block.kind == "_yaw":
            (sp, sr), (cp, cr) = np.sin(q[k + 1 : k + 3]), np.cos(q[k + 1 : k + 3])
            rows = np.linalg.inv(np.array([[-sp, 0, 1], [cp * sr, cr, 0], [cp * cr, -sr, 0]]))
        part = np.zeros((len(q), rows.shape[1]), dtype=q.dtype)
        part[k : k + len(rows)] = rows
        columns.append(part)
    return np.hstack(columns)


def differences(
    ours: Robot, model: Any, follow: Mapping[str, tuple[str, float, float]] | None = None
) -> tuple[float, float]:
    """How far mass matrix and inverse dynamics are from MuJoCo's at a random state, as parts of the
    largest entry; ``follow`` has leaders of joints, with factors and offsets."""
    for body in ours.bodies.values():
        body.draw()  # nothing, which is quicker
    system = ours.system(cost=1)
    own, data, rng = _Ours(system), mujoco.MjData(model), np.random.default_rng(7)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    blocks = _blocks([name_of(q) for q in system.coordinates], ours, model)
    q = rng.uniform(-1, 1, own.n)
    P, column = np.zeros((model.nv, 0)), np.eye(model.nv)
    for block in blocks:
        size = {"0": 4, "_yaw": 3}.get(block.kind, 1)
        values = q[block.first : block.first + size]
        if block.kind == "0":
            values /= np.linalg.norm(values)
        if block.kind == "_yaw":
            values = np.array(dmoc.attitude(euler=values).quaternion)
        data.qpos[block.place : block.place + len(values)] = values
        moved = column[:, block.speed : block.speed + max(1, len(values) - 1)]
        for other, (leader, factor, offset) in (follow or {}).items():
            if leader == name_of(system.coordinates[block.first]):
                j = model.joint(other)
                data.qpos[j.qposadr] = factor * values + offset
                moved = moved + factor * column[:, j.dofadr]
        P = np.hstack([P, moved])
    w, a = rng.uniform(-1, 1, (2, P.shape[1]))
    T = _tangent(q, blocks)
    v = T @ w
    acceleration = T @ a + (_tangent(q + 1j * STEP * v, blocks) @ w).imag / STEP
    data.qvel[:], data.qacc[:] = P @ w, P @ a
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_inverse(model, data)
    mujoco.mj_fullM(model, data, M)
    pairs = (
        (T.T @ own.mass(q) @ T, P.T @ M @ P),
        (T.T @ own.forces(q, v, acceleration), P.T @ data.qfrc_inverse),
    )
    one, two = (float(abs(x - y).max() / abs(y).max()) for x, y in pairs)
    return one, two
