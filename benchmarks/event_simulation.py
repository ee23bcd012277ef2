"""An event-driven simulation with lasting contacts and Coulomb friction that shares no code with
dmoc and is told no mode: at every instant it looks for forces that are consistent."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from contact_equations import (
    CLOSED,
    NEAR,
    OPEN,
    SLOW,
    STICK,
    Array,
    ContactEquations,
    ContactForces,
    ContactSizes,
)
from equations import Inputs
from scipy.integrate import solve_ivp

MOST_EVENTS = 100
SHORTEST = 1e-12
RELATIVE, ABSOLUTE = 1e-9, 1e-11  # of the integrator: far below the errors of the discretisation


@dataclass
class ContactRun:
    """State at the end of a simulation, impacts (surface, time), and surfaces that hold nothing."""

    q: Array
    v: Array
    impacts: list[tuple[str, float]] = field(default_factory=list)
    passed: set[int] = field(default_factory=set)
    events: int = 0


class ContactMechanism(ContactEquations):
    """Motions of a description with contacts and friction."""

    def run(
        self, inputs: Inputs, begin: float, end: float, q: Array, v: Array, par: Array,
        sizes: ContactSizes, e: Sequence[float], spared: Callable[[int, float], bool],
        passed: Collection[int] = (),
    ) -> ContactRun:  # fmt: skip
        """Simulate from one time to another; surfaces that are ``passed`` hold nothing, nor do
        those whose impact is ``spared`` (surface, time) from there on."""
        run = ContactRun(np.array(q, dtype=float), np.array(v, dtype=float), passed=set(passed))
        nodes, first, last = inputs
        mode: tuple[Any, ...] = ()
        over = False
        for k in range(len(first)):
            a, b = max(nodes[k], begin), min(nodes[k + 1], end)
            while b - a > SHORTEST * sizes.time:

                def u(t: float, k: int = k) -> Array:
                    s = (t - nodes[k]) / (nodes[k + 1] - nodes[k])
                    return (1 - s) * first[k] + s * last[k]

                a, mode, over = self._stretch(u, (a, b), run, par, sizes, e, spared, (mode, over))
                run.events += 1
                if run.events > MOST_EVENTS + len(first):
                    raise ArithmeticError(f"events without end at {a:.6g} s")
        return run

    def _stretch(
        self, u: Callable[[float], Array], span: tuple[float, float], run: ContactRun, par: Array,
        sizes: ContactSizes, e: Sequence[float], spared: Callable[[int, float], bool],
        last: tuple[tuple[Any, ...], bool],
    ) -> tuple[float, tuple[Any, ...], bool]:  # fmt: skip
        """One mode with smooth inputs over a span or to the end of the mode: the time that is
        reached, the mode, and whether it is over."""
        a, b = span
        f = self.forces(run.q, run.v, u(a), a, par, sizes, last[0], run.passed, last[1])
        mode, nq, nc, mu = f.mode, self.nq, len(self.surfaces), self.friction(par)

        def solved(t: float, y: Array) -> ContactForces:
            q, v = y[:nq], y[nq:]
            M, F = self.motion(q, v, u(t), t, par)
            forces = self.solved(mode, M, F, self.conditions(q, v, t, par), mu)
            if forces is None:
                raise ArithmeticError(f"a mode without a motion at {t:.6g} s")
            return forces

        def rate(t: float, y: Array) -> Array:
            return np.concatenate([y[nq:], solved(t, y).motion])

        events: list[Any] = []

        def watch(function: Callable[[float, Array], float], what: tuple[str, int]) -> None:
            def event(t: float, y: Array) -> float:
                return function(t, y)

            event.terminal = True  # type: ignore[attr-defined]
            event.direction = -1.0  # type: ignore[attr-defined]
            events.append((event, what))

        for j, status in enumerate(mode[:nc]):
            if j in run.passed:
                continue
            if status == OPEN:
                watch(
                    lambda t, y, j=j: (
                        2 * NEAR * 1e-3 * sizes.gap[j]
                        - self.gap_motion(y[:nq], y[nq:], t, par)[0][j]
                    ),
                    ("gap", j),
                )
            else:
                watch(lambda t, y, j=j: solved(t, y).normal[j] + 1e-9, ("lift", j))
        rubbing = [(self.rubs[j], mode[j], j) for j in self.rubs]
        rubbing += [(k, s, -1) for k, s in zip(self.rails, mode[nc:], strict=True)]
        for k, status, j in rubbing:
            if status in (OPEN, CLOSED):
                continue
            if status == STICK:

                def margin(t: float, y: Array, k: int = k, j: int = j) -> float:
                    forces = solved(t, y)
                    most = mu[k] * (forces.normal[j] if j >= 0 else 1.0)
                    return float(most - abs(forces.tangential[k])) + 1e-9

                watch(margin, ("cone", k))
            else:
                watch(
                    lambda t, y, k=k, s=status: (
                        s * self.slide_motion(y[:nq], y[nq:], t, par)[1][k]
                        + 0.5 * SLOW * sizes.slide[k]
                    ),
                    ("turn", k),
                )
        start = np.concatenate([run.q, run.v])
        out = solve_ivp(
            rate, (a, b), start, method="DOP853", rtol=RELATIVE,
            atol=ABSOLUTE * max(1.0, float(np.abs(start).max())),
            events=[event for event, _ in events], max_step=(b - a) / 4,
        )  # fmt: skip
        if not out.success:
            raise ArithmeticError(out.message)
        t, y = float(out.t[-1]), out.y[:, -1]
        run.q, run.v = y[:nq], y[nq:]
        over = False
        for (_, (what, i)), times in zip(events, out.t_events, strict=True):
            if not len(times):
                continue
            over = over or what in ("lift", "cone")
            if what == "turn":
                run.v = self._stopped(i, run.q, run.v, u(t), t, par)
            if what == "gap":
                self._met(i, u(t), t, run, par, sizes, e, spared)
        return t, mode, over

    def _stopped(self, k: int, q: Array, v: Array, u: Array, t: float, par: Array) -> Array:
        """The velocity without what is left of sliding of one tangent."""
        M = self.motion(q, v, u, t, par)[0]
        _, sigma, d, _ = self.slide_motion(q, v, t, par)
        back = np.linalg.solve(M, d[k])
        return v - sigma[k] / (d[k] @ back) * back

    def _met(
        self, j: int, u: Array, t: float, run: ContactRun, par: Array, sizes: ContactSizes,
        e: Sequence[float], spared: Callable[[int, float], bool],
    ) -> None:  # fmt: skip
        """Go through an impact, by the first of its outcomes."""
        w = self.gap_motion(run.q, run.v, t, par)[1][j]
        if spared(j, t):
            run.passed.add(j)
            return
        if w <= SLOW * sizes.rate[j]:
            return
        outcome = next(iter(self.impacts([j], run.q, run.v, u, t, par, sizes, e, run.passed)), None)
        if outcome is None:
            raise ArithmeticError(f"an impact on {self.surfaces[j]} without an outcome")
        run.v = outcome.motion
        run.impacts.append((self.surfaces[j], t))
