"""Errors planted in true motions, and how many of them pass the check: its rate of false positives.

    python planted_errors.py [planted motions]

Solved and confirmed motions of several systems are made wrong in one way at a time, by shares of
what is changed or of the motion's ranges.  What passes at 0.1 % is no fault: the check is for
motions that are right to about 1 %.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from common import Section
from planted_motions import PROBLEMS, true_motions

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.motion.trajectory import Collision, Phase, Trajectory

SIZES = (0.001, 0.003, 0.01, 0.03, 0.1)
LARGE = 0.03  # from here on none should pass
MOTIONS = 500
QUICK = ("cart-pendulum", "ball", "block")


@dataclass(frozen=True)
class TrueMotion:
    """A true motion, its model, the share that is to be planted, and random numbers."""

    motion: Trajectory
    kernels: Kernels
    size: float
    rng: np.random.Generator

    @property
    def model(self) -> Model:
        values = dict(self.motion.parameters)
        return Model(self.kernels, parameter_row(self.kernels, values, SimulationError))

    @property
    def hits(self) -> list[int]:
        """Events with an impulse worth the name."""
        events = self.motion.collisions
        return [i for i, c in enumerate(events) if c.surface and not c.grazes and c.impulse > 1e-6]

    def moving(self) -> tuple[int, float]:
        """A coordinate that moves, and its range."""
        q = np.vstack([p.q for p in self.motion.phases])
        ranges = np.ptp(q, axis=0)
        j = int(self.rng.choice(np.flatnonzero(ranges > 1e-3 * ranges.max())))
        return j, float(ranges[j])

    def phase(self, allows: Callable[[Phase], bool] = lambda _: True) -> int | None:
        places = [i for i, p in enumerate(self.motion.phases) if allows(p)]
        return int(self.rng.choice(places)) if places else None

    def with_phase(self, i: int, **changes: object) -> Trajectory:
        phases = list(self.motion.phases)
        phases[i] = replace(phases[i], **changes)  # type: ignore[arg-type]
        return replace(self.motion, phases=tuple(phases))

    def with_event(self, i: int, **changes: object) -> Trajectory:
        events = list(self.motion.collisions)
        events[i] = replace(events[i], **changes)  # type: ignore[arg-type]
        return replace(self.motion, collisions=tuple(events))


Kind = Callable[[TrueMotion], Trajectory | None]


def impulse(case: TrueMotion) -> Trajectory | None:
    """An impulse that is off, with the momentum after it."""
    if not case.hits:
        return None
    i = int(case.rng.choice(case.hits))
    c, more = case.motion.collisions[i], 1 + case.size
    after = case.motion.phases[i + 1]
    p = c.momentum_before + more * (c.momentum_after - c.momentum_before)
    wrong = case.with_event(
        i, impulse=more * c.impulse, momentum_after=p,
        impulses={name: more * value for name, value in c.impulses.items()},
        tractions={name: more * value for name, value in c.tractions.items()},
    )  # fmt: skip
    return _starting(replace(case, motion=wrong), i + 1, after.p[0] + p - c.momentum_after)


def _starting(case: TrueMotion, i: int, p: np.ndarray) -> Trajectory:
    """The motion with another momentum at the start of a phase."""
    phase = case.motion.phases[i]
    v = case.model.velocity(phase.q[:1], p[None], phase.t[:1])[0]
    return case.with_phase(
        i, p=np.vstack([p[None], phase.p[1:]]), v=np.vstack([v[None], phase.v[1:]])
    )


def late(case: TrueMotion) -> Trajectory | None:
    """An event that happens later than its phase brings it about."""
    if not case.motion.collisions:
        return None
    i = int(case.rng.integers(len(case.motion.collisions)))
    phases, first = list(case.motion.phases), case.motion.phases[i].t[0]
    delay = case.size * phases[i].duration
    phases[i] = replace(phases[i], t=first + (1 + case.size) * (phases[i].t - first))
    phases[i + 1 :] = [replace(p, t=p.t + delay) for p in phases[i + 1 :]]
    events: list[Collision] = [
        replace(c, time=c.time + delay * (k >= i)) for k, c in enumerate(case.motion.collisions)
    ]
    return replace(case.motion, phases=tuple(phases), collisions=tuple(events))


def limit(case: TrueMotion) -> Trajectory | None:
    """A limit of a coordinate that the motion exceeds."""
    j, extent = case.moving()
    bounds = case.motion.coordinate_bounds.copy()
    bounds[j, 1] = max(float(p.q[:, j].max()) for p in case.motion.phases) - case.size * extent
    return replace(case.motion, coordinate_bounds=bounds)


def friction(case: TrueMotion) -> Trajectory | None:
    """A friction force of what slides that is not that of its law."""
    i = case.phase(lambda p: any(p.rubbing.values()))
    if i is None:
        return None
    return case.with_phase(i, tangential=(1 + case.size) * case.motion.phases[i].tangential)


def cone(case: TrueMotion) -> Trajectory | None:
    """What sticks with more than its friction: the coefficient is that much too small."""
    need = [
        float(np.abs(p.tangential[:, k] / p.normal[:, p.closed.index(name)]).max())
        for p in case.motion.phases
        for k, (name, sign) in enumerate(p.rubbing.items())
        if sign == 0 and name in p.closed
    ]
    if not need or "mu" not in case.motion.parameters or max(need) < 1e-3:
        return None
    return replace(
        case.motion, parameters={**case.motion.parameters, "mu": max(need) / (1 + case.size)}
    )


def scaled(case: TrueMotion) -> Trajectory | None:
    """Inputs that are too large."""
    if not case.motion.inputs:
        return None
    phases = [replace(p, u=(1 + case.size) * p.u) for p in case.motion.phases]
    return replace(case.motion, phases=tuple(phases))


def wall(case: TrueMotion) -> Trajectory | None:
    """A thin post in the way, between two nodes."""
    if "up" not in case.motion.parameters:
        return None
    phase = case.motion.phases[int(case.rng.integers(len(case.motion.phases)))]
    k = int(case.rng.integers(phase.steps // 4, phase.steps // 2))
    x, y = (phase.q[k] + phase.q[k + 1]) / 2
    extent = float(np.ptp(np.vstack([p.q for p in case.motion.phases]), axis=0).max())
    place = {"at": float(x), "up": float(y), "r": case.size * extent / 2}
    return replace(case.motion, parameters={**case.motion.parameters, **place})


def turned(case: TrueMotion) -> Trajectory | None:
    """A momentum that an event turns by an angle."""
    if not case.hits or len(case.motion.coordinates) < 2:
        return None
    i = int(case.rng.choice(case.hits))
    p = case.motion.phases[i + 1].p[0].copy()
    c, s = np.cos(case.size), np.sin(case.size)
    p[:2] = np.array([[c, -s], [s, c]]) @ p[:2]
    return _starting(replace(case, motion=case.with_event(i, momentum_after=p)), i + 1, p)


def jump(case: TrueMotion) -> Trajectory | None:
    """A position that jumps at an event."""
    j, extent = case.moving()
    i = int(case.rng.integers(1, len(case.motion.phases)))
    q = case.motion.phases[i].q.copy()
    q[:, j] += case.size * extent
    return case.with_phase(i, q=q)


def node(case: TrueMotion) -> Trajectory | None:
    """One node beside the path."""
    j, extent = case.moving()
    i = int(case.rng.integers(len(case.motion.phases)))
    q = case.motion.phases[i].q.copy()
    q[int(case.rng.integers(1, len(q) - 1)), j] += case.size * extent
    return case.with_phase(i, q=q)


def drift(case: TrueMotion) -> Trajectory | None:
    """A closed contact that comes off its surface, little by little."""
    i = case.phase(lambda p: bool(p.closed))
    if i is None:
        return None
    phase = case.motion.phases[i]
    j = case.kernels.surfaces.index(phase.closed[0])
    away = -case.model.gap_slopes(phase.q, phase.t)[:, j, :-1]
    away /= np.linalg.norm(away, axis=1)[:, None]
    extent = float(np.ptp(np.vstack([p.q for p in case.motion.phases]), axis=0).max())
    share = np.linspace(0.0, case.size * extent, len(phase.t))[:, None]
    return case.with_phase(i, q=phase.q + share * away)


def parameter(case: TrueMotion) -> Trajectory | None:
    """A parameter of another value."""
    idle = {"at", "up", "r", "mu", "a", "b"}  # what the motions do not feel; for mu there is a kind
    names = [n for n, value in case.motion.parameters.items() if value and n not in idle]
    name = str(case.rng.choice(names))
    value = (1 + case.size) * case.motion.parameters[name]
    return replace(case.motion, parameters={**case.motion.parameters, name: value})


def word(case: TrueMotion) -> Trajectory | None:
    """An event by another name: another surface or friction, a contact that stays."""
    i = int(case.rng.integers(len(case.motion.collisions)))
    c, after = case.motion.collisions[i], case.motion.phases[i + 1]
    others = [name for name in case.kernels.surfaces if name != c.surface]
    if c.surface and others and not c.lands:
        return case.with_event(i, surface=str(case.rng.choice(others)))
    if after.rubbing:
        signs = {name: 1 if sign <= 0 else -1 for name, sign in after.rubbing.items()}
        return case.with_phase(i + 1, rubbing=signs)
    return case.with_event(i, lands=(), leaves=())


KINDS: dict[str, Kind] = {
    kind.__name__: kind
    for kind in (
        impulse, late, limit, friction, cone, scaled, wall, turned, jump, node, drift, parameter,
        word,
    )
}  # fmt: skip


@dataclass(frozen=True)
class Planted:
    """A wrong motion, and what the check said."""

    kind: str
    system: str
    size: float
    passed: bool
    message: str
    phase_error: float


def plant(names: tuple[str, ...], number: int, seed: int = 1) -> list[Planted]:
    """About so many wrong motions, every kind in every system that has a place for it."""
    motions = list(true_motions(names))
    places = [
        (name, kind)
        for name, motion, kernels in motions
        for kind in KINDS
        if KINDS[kind](TrueMotion(motion, kernels, LARGE, np.random.default_rng(0))) is not None
    ]
    rounds, done = -(-number // (len(places) * len(SIZES))), list[Planted]()
    for name, motion, kernels in motions:
        for number_of_kind, kind in enumerate(k for n, k in places if n == name):
            for size in SIZES:
                for turn in range(rounds):
                    rng = np.random.default_rng([seed, number_of_kind, turn])
                    wrong = KINDS[kind](TrueMotion(motion, kernels, size, rng))
                    if wrong is not None:
                        check = dmoc.verify(wrong, kernels)
                        done.append(
                            Planted(
                                kind, name, size, check.passed, check.message, check.phase_error
                            )
                        )
    return done


def section(planted: list[Planted]) -> Section:
    """How many passed, by kind and size."""
    tried = Counter((p.kind, p.size) for p in planted)
    passed = Counter((p.kind, p.size) for p in planted if p.passed)
    rows = [
        [
            f"{kind}: {(KINDS[kind].__doc__ or '').rstrip('.').lower()}",
            *(f"{passed[kind, size]} of {tried[kind, size]}" for size in SIZES),
        ]
        for kind in KINDS
        if tried[kind, SIZES[0]]
    ]
    large = [p for p in planted if p.size >= LARGE]
    return Section(
        "Errors that pass the check",
        f"{len(planted)} wrong motions of {len(rows)} kinds, planted in "
        f"{len({p.system for p in planted})} confirmed ones by shares of what is changed or of the "
        "motion's ranges; how many of them pass. A word has no size. Of those from "
        f"{LARGE:.0%} on {sum(p.passed for p in large)} of {len(large)} pass.",
        ["planted", *(f"{size:.1%}" for size in SIZES)],
        rows,
    )


def compare(quick: bool) -> Section:
    """The section of the report."""
    return section(plant(QUICK, 100) if quick else plant(tuple(PROBLEMS), MOTIONS))


def main() -> int:
    number = int(sys.argv[1]) if len(sys.argv) > 1 else MOTIONS
    planted = plant(tuple(PROBLEMS), number)
    sys.stdout.write(section(planted).markdown())
    for p in planted:
        if p.passed and p.size >= LARGE:
            sys.stdout.write(
                f"passes: {p.kind} of {p.size:.0%} in {p.system}, whose phases are off by "
                f"{p.phase_error:.1%}; {p.message}\n"
            )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
