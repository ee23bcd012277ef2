"""Shapes at random places in space, for dmoc and for MuJoCo."""

from __future__ import annotations

import itertools
from typing import Any

import mujoco
import numpy as np
import sympy as sp

import dmoc

WEDGE = np.array([(0.5, 0, -0.3), (-0.4, 0.5, -0.2), (-0.3, -0.5, -0.3), (0.1, 0, 0.6), (0, 0, 0)])


class Placed:
    """A random shape of a kind in the world, for dmoc and for MuJoCo."""

    def __init__(self, kind: str, rng: np.random.Generator) -> None:
        self.kind, self.size = kind, rng.uniform(0.2, 0.8, 3)
        at, turn = 0.7 * rng.normal(size=3), rng.normal(size=4)
        self.turn = turn / np.linalg.norm(turn)
        self.place(at)

    def place(self, place: np.ndarray) -> None:
        self.at, at, kind = place, tuple(place), self.kind
        R = dmoc.attitude(tuple(self.turn)).matrix
        attitude, radius, half = sp.Matrix(R.tolist()), *self.size[:2]
        self.corners = self.at + WEDGE @ R.T
        spatial = dmoc.spatial
        self.shape: Any = {
            "point": lambda: at,
            "sphere": lambda: spatial.Sphere(radius, at),
            "capsule": lambda: spatial.Capsule(radius, 2 * half, at, attitude),
            "cylinder": lambda: spatial.Cylinder(radius, 2 * half, at, attitude),
            "box": lambda: spatial.Box(tuple(2 * self.size), at, attitude),
            "hull": lambda: spatial.Hull(self.corners.tolist()),
        }[kind]()
        if kind == "box":
            signs = np.array([*itertools.product((1, -1), repeat=3)])
            self.corners = self.at + (signs * self.size) @ R.T

    def add_to(self, spec: Any, name: str) -> None:
        body = spec.worldbody.add_body(pos=self.at, quat=self.turn)
        if self.kind == "hull":
            spec.add_mesh(name=name, uservert=WEDGE.ravel(), inertia=3)
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)
            return
        kind = "sphere" if self.kind == "point" else self.kind
        size = [1e-9, 0, 0] if self.kind == "point" else self.size
        body.add_geom(type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"), size=size)


def of_mujoco(a: Placed, b: Placed) -> float:
    return nearest(a, b)[0]


def nearest(a: Placed, b: Placed) -> tuple[float, np.ndarray]:
    """The distance of two shapes, and the way from one to the other."""
    spec = mujoco.MjSpec()
    spec.option.ccd_tolerance, spec.option.ccd_iterations = 1e-13, 500
    a.add_to(spec, "a")
    b.add_to(spec, "b")
    model = spec.compile()
    data, ends = mujoco.MjData(model), np.zeros(6)
    mujoco.mj_forward(model, data)
    distance = float(mujoco.mj_geomDistance(model, data, 0, 1, 20.0, ends))
    return distance, ends[3:] - ends[:3]
