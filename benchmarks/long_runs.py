"""Long motions through hits by the variational scheme and by collocation: what becomes of energy
and angular momentum."""

from __future__ import annotations

import math

import numpy as np
import sympy as sp
from common import Section
from scipy.optimize import brentq
from sympy.physics.mechanics import dynamicsymbols

import dmoc

LENGTH, WIDTH = 1000.0, 0.1  # of the motion and its steps, in seconds
# Places of the stages in a step: Hermite and Simpson's rule, and Radau's methods.
LOBATTO = np.array([0.0, 0.5, 1.0])
RADAU = {2: np.array([1 / 3, 1.0]), 3: np.array([(4 - 6**0.5) / 10, (4 + 6**0.5) / 10, 1.0])}


def collocation(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tableau A, b of the collocation at some places of a step."""
    powers = np.arange(1, len(places) + 1)
    moments = np.vander(places, increasing=True).T
    A = np.linalg.solve(moments, (places[:, None] ** powers / powers).T).T
    return A, np.linalg.solve(moments, 1 / powers)


def bowl() -> dmoc.MechanicalSystem:
    """A particle on a spring that hardens, within a round wall: hits keep its energy and its
    angular momentum."""
    x, y = dynamicsymbols("x y")
    square = x**2 + y**2
    return dmoc.MechanicalSystem(
        "bowl", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - square / 2 - square**2 / 2,
        surfaces={"wall": square <= sp.Integer(1)}, cost=1,
    )  # fmt: skip


START, SPEED = np.array([0.4, 0.0]), np.array([1.2, 1.3])


def _force(q: np.ndarray) -> np.ndarray:
    return -q * (1 + 2 * (q * q).sum(axis=-1, keepdims=True))


def _kept(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Energy and angular momentum."""
    square = (q * q).sum(axis=1)
    energy = (v * v).sum(axis=1) / 2 + square / 2 + square**2 / 2
    return energy, q[:, 0] * v[:, 1] - q[:, 1] * v[:, 0]


def collocated(places: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Nodes of a motion by a collocation method, which locates its hits: a step ends at the wall,
    the velocity is mirrored there, and the rest of the step follows."""
    A, b = collocation(places)

    def step(q: np.ndarray, v: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        speed, force = np.tile(v, (len(b), 1)), np.tile(_force(q), (len(b), 1))
        for _ in range(60):  # contracts by h^2
            new_speed = v + h * A @ force
            new_force = _force(q + h * A @ speed)
            change = abs(new_speed - speed).max() + abs(new_force - force).max()
            speed, force = new_speed, new_force
            if change < 1e-15:
                break
        return q + h * b @ speed, v + h * b @ force

    q, v, hits = START, SPEED, 0
    nodes = [(q, v)]
    for _ in range(steps):
        left = WIDTH
        while True:
            q_1, v_1 = step(q, v, left)
            if q_1 @ q_1 <= 1.0:
                break

            def outside(
                share: float, q: np.ndarray = q, v: np.ndarray = v, h: float = left
            ) -> float:
                place, _ = step(q, v, share * h)
                return float(place @ place) - 1.0

            low = 1e-9 if outside(1e-9) < 0 else 1e-6
            share = brentq(outside, low, 1.0, xtol=1e-14)
            q, v = step(q, v, share * left)
            v = v - 2 * (q @ v) / (q @ q) * q
            q, left, hits = q / math.sqrt(q @ q), left * (1 - share), hits + 1
        q, v = q_1, v_1
        nodes.append((q, v))
    places_, speeds = (np.array(part) for part in zip(*nodes, strict=True))
    return places_, speeds, hits


def compare(quick: bool) -> Section:
    steps = int((LENGTH / 10 if quick else LENGTH) / WIDTH)
    section = Section(
        "Schemes: long motions through hits",
        f"A particle on a spring that hardens, in a round elastic wall, {steps} steps of {WIDTH:g} "
        "s. Relative errors of the energy and of the angular momentum: the largest in the first "
        "tenth of the motion, and in the last one. All methods locate their hits; the variational "
        "one by its discrete law of impact, the others by a mirror.",
        [
            "scheme", "hits", "energy: first tenth", "last tenth", "angular momentum: first tenth",
            "last tenth",
        ],
    )  # fmt: skip
    for order in (2, 4, 6):
        run = dmoc.simulate(
            dmoc.build(bowl(), order=order), START, SPEED, step_size=WIDTH, steps=steps
        )
        _row(section, f"variational, order {order}", run.q, run.p, len(run.collisions))
    for name, places in (
        ("Hermite and Simpson, order 4", LOBATTO),
        ("Radau, 2 stages, order 3", RADAU[2]),
        ("Radau, 3 stages, order 5", RADAU[3]),
    ):
        _row(section, name, *collocated(places, steps))
    return section


def _row(section: Section, name: str, q: np.ndarray, v: np.ndarray, hits: int) -> None:
    cells = []
    for values in _kept(q, v):
        errors = np.abs(values / values[0] - 1)
        tenth = len(errors) // 10
        cells += [f"{errors[:tenth].max():.1e}", f"{errors[-tenth:].max():.1e}"]
    section.row(name, hits, *cells)
