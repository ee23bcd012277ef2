"""The independent check of a motion: continuous equations of motion, event detection and impact law.

Nothing here is shared with the discrete equations of the optimiser: SciPy's DOP853 integrates M q'' = F(q, q', u) with the motion's inputs,
surfaces are found by root finding on its dense output, and an impact changes the velocities by the law of the continuous theory,
v+ = v- - (1 + e) (n . v- + dg/dt) / (n . M^-1 n) M^-1 n with n = grad g and the coefficient of restitution e.  After a plastic impact the
contact holds for as long as the forces push into the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq

from dmoc.codegen.kernels import Array, Kernels
from dmoc.errors import SimulationError
from dmoc.trajectory import Trajectory

RELATIVE, ABSOLUTE = 1e-10, 1e-12  # far below the discretisation errors that are to be seen
# What a motion may miss, relative to the ranges of its coordinates and momenta, and still count as confirmed.  An open-loop simulation of an
# unstable motion amplifies every discretisation error, so that its end is judged more leniently than segments and energy.
PASSING = {"terminal error": 0.25, "segment error": 0.01, "energy error": 0.02}
# A contact belongs to a planned collision if it happens within this share of the final time from it.
SAME_CONTACT = 0.05
# A contact that changes the momenta by less than this share of their size grazes: the motion touches a surface without colliding.
GRAZING = 0.01
SEGMENTS = 10  # of a phase, for the errors segment by segment
INSIDE = (0.25, 0.5, 0.75)  # where between nodes penetration is looked for
ON_SURFACE = 1e-6  # gap of a planned collision relative to how far the coordinates move it
RELEASED = 1e-7  # approach speed below which a plastic contact has no impact
TOUCH = 1e-9  # gap that counts as touching, not crossing
MOST_CONTACTS = 10_000  # of an open-loop simulation


@dataclass(frozen=True)
class Contact:
    """A contact met by the open-loop simulation; ``jump`` is its largest change of a momentum relative to the largest momentum."""

    surface: str
    time: float
    jump: float


@dataclass(frozen=True)
class Verification:
    """What the check found.  Errors are relative to the range of the coordinate and to the largest momentum of the motion.

    Attributes
    ----------
    passed : bool
    message : str
        The reason if it did not pass.
    terminal_error : float
        Error of the state at the end of an open-loop simulation with the motion's inputs.
    max_defect : float
        Largest error over a single step, started at its first node.
    segment_defects : array
        Error over each of ten segments a phase, started at its first node.
    energy_error : float
        Largest |E(end) - E(start) - work| of a phase, or jump of the energy at a collision, relative to the range of kinetic energies.
    missed_contacts, extra_contacts : tuples of str
        Planned collisions that the simulation does not meet, and contacts that were not planned and change a momentum by more than 1 %.
    penetration : float
        Largest gap g > 0 between nodes, in the units of g.
    contacts : tuple of Contact
    """

    passed: bool
    message: str
    terminal_error: float
    max_defect: float
    segment_defects: Array
    energy_error: float
    missed_contacts: tuple[str, ...]
    extra_contacts: tuple[str, ...]
    penetration: float
    contacts: tuple[Contact, ...]


def verify(trajectory: Trajectory, kernels: Kernels) -> Verification:
    """Simulate a motion independently and compare.

    A motion passes if the open-loop simulation meets the planned collisions and no others, and if the errors of its terminal state, of
    every segment and of the energy balance stay below 25 %, 1 % and 2 % of the motion's ranges.

    Raises
    ------
    SimulationError
        If the kernels are not those of the motion's model.
    """
    if kernels.manifest["fingerprint"] != trajectory.fingerprint:
        raise SimulationError(
            f"the motion of model {trajectory.model!r} was made with another version or order of it than the kernels of {kernels.name!r}: "
            "give those it was made with."
        )
    check = _Check(trajectory, kernels)
    ends, work, penetration = check.steps()
    defects = check.defects(ends)
    segments = check.segments()
    energy = check.energy_error(work)
    terminal, contacts = check.open_loop()
    missed, extra = _compare(trajectory, contacts)
    worst_segment = float(segments.max(initial=0.0))
    failures = [f"the collision with {surface!r} is {gap:.3g} off it" for surface, gap in check.off_surface()]
    if missed:
        failures.append(f"the simulation misses {', '.join(missed)}")
    if extra:
        failures.append(f"the simulation meets {', '.join(extra)}")
    for name, value in (("terminal error", terminal), ("segment error", worst_segment), ("energy error", energy)):
        if not value <= PASSING[name]:
            failures.append(f"{name} {value:.3g} exceeds {PASSING[name]:g}")
    message = "; ".join(failures) + (": take more steps" if failures else "")
    return Verification(
        not failures,
        message,
        terminal,
        float(defects.max(initial=0.0)),
        segments,
        energy,
        missed,
        extra,
        penetration,
        tuple(contacts),
    )


class _Check:
    def __init__(self, trajectory: Trajectory, kernels: Kernels) -> None:
        self.trajectory, self.kernels = trajectory, kernels
        self.par = trajectory.parameter_row
        self.nq = len(trajectory.coordinates)
        q = np.vstack([p.q for p in trajectory.phases])
        momentum = np.abs(np.vstack([p.p for p in trajectory.phases])).max(axis=0)
        spread = np.ptp(q, axis=0)
        self.q_scale = _scale(spread)
        self.p_scale = _scale(momentum)

    # Equations of motion ---------------------------------------------------------------------------------------------

    def acceleration(self, q: Array, v: Array, u: Array, t: Array) -> Array:
        mass, force = self.kernels.call("dynamics", q, v, u, t, self.par)
        return np.asarray(np.linalg.solve(mass.reshape(-1, self.nq, self.nq), force[:, :, None])[:, :, 0])

    def batch(self, q: Array, v: Array, t0: Array, h: Array, u0: Array, u1: Array) -> tuple[Array, Array, Array, Array]:
        """Integrate rows of states over one step each; return q, v, what changes the energy, and q inside, shape (len(INSIDE), n, nq)."""
        n, nq = q.shape
        span = h[:, None]

        def slope(s: float, y: Array) -> Array:
            state = y.reshape(n, 2 * nq + 1)
            at, rate = state[:, :nq].copy(), state[:, nq : 2 * nq].copy()
            u, t = (1 - s) * u0 + s * u1, t0[:, None] + s * span
            power = self.kernels.call("force", at, rate, u, t, self.par)[1]
            return np.asarray(np.hstack([rate, self.acceleration(at, rate, u, t), power]) * span).ravel()

        start = np.hstack([q, v, np.zeros((n, 1))]).ravel()
        done = solve_ivp(slope, (0.0, 1.0), start, "DOP853", t_eval=[*INSIDE, 1.0], rtol=RELATIVE, atol=ABSOLUTE)
        if not done.success:
            return np.full_like(q, np.nan), np.full_like(v, np.nan), np.full(n, np.nan), np.full((len(INSIDE), n, nq), np.nan)
        states = done.y.T.reshape(len(INSIDE) + 1, n, 2 * nq + 1)
        last = states[-1]
        return last[:, :nq].copy(), last[:, nq : 2 * nq].copy(), last[:, -1], states[:-1, :, :nq].copy()

    # Step by step and segment by segment -----------------------------------------------------------------------------

    def steps(self) -> tuple[list[tuple[Array, Array]], list[Array], float]:
        """Integrate every step from its first node; return end states and work of each phase, and the largest penetration."""
        ends, work, penetration = [], [], 0.0
        for phase in self.trajectory.phases:
            u0, u1 = self.trajectory.input_ends(phase)
            q, v, w, inside = self.batch(phase.q[:-1], phase.v[:-1], phase.t[:-1], np.diff(phase.t), u0, u1)
            ends.append((q, v))
            work.append(w)
            if self.kernels.has("surface"):
                t = phase.t[:-1] + np.outer(INSIDE, np.diff(phase.t))
                gaps = self.gaps(inside.reshape(-1, self.nq), t.ravel())
                penetration = max(penetration, float(gaps.max(initial=0.0)))
        return ends, work, penetration

    def error(self, q: Array, v: Array, t: Array, q_wanted: Array, p_wanted: Array) -> Array:
        """Largest relative error of each row's state."""
        p = self.kernels.call("legendre", q, v, t[:, None].copy(), self.par)[0]
        parts = np.hstack([np.abs(q - q_wanted) / self.q_scale, np.abs(p - p_wanted) / self.p_scale])
        return np.asarray(np.nan_to_num(parts.max(axis=1), nan=np.inf))

    def defects(self, ends: list[tuple[Array, Array]]) -> Array:
        pairs = zip(self.trajectory.phases, ends, strict=True)
        return np.concatenate([self.error(q, v, phase.t[1:], phase.q[1:], phase.p[1:]) for phase, (q, v) in pairs])

    def segments(self) -> Array:
        """Errors over segments, all segments of a phase integrated side by side."""
        errors = []
        for phase in self.trajectory.phases:
            cuts = np.unique(np.linspace(0, phase.steps, SEGMENTS + 1).round().astype(int))
            first, last = cuts[:-1], cuts[1:]
            q, v = phase.q[first], phase.v[first]
            u0, u1 = self.trajectory.input_ends(phase)
            h = np.diff(phase.t)
            for j in range(int((last - first).max())):
                on = first + j < last
                k = first[on] + j
                q[on], v[on], _, _ = self.batch(q[on], v[on], phase.t[k], h[k], u0[k], u1[k])
            errors.append(self.error(q, v, phase.t[last], phase.q[last], phase.p[last]))
        return np.concatenate(errors)

    def energy_error(self, work: list[Array]) -> float:
        """Largest imbalance of a phase or jump at a collision, relative to the range of the kinetic energies."""
        phases = self.trajectory.phases
        energies = [self.energy(p.q, p.v, p.t) for p in phases]
        rest = [self.energy(p.q, np.zeros_like(p.v), p.t) for p in phases]
        scale = max(float(np.abs(e - r).max()) for e, r in zip(energies, rest, strict=True)) or 1.0
        balance = [abs(e[-1] - e[0] - w.sum()) for e, w in zip(energies, work, strict=True)]
        jumps = []
        for collision, before, after in zip(self.trajectory.collisions, phases, energies[1:], strict=False):
            y = np.concatenate([before.q[-1], before.v[-1]])
            y = self.impact(y, float(before.t[-1]), self.kernels.surfaces.index(collision.surface))
            jumps.append(abs(after[0] - self.energy(y[None, : self.nq], y[None, self.nq :], before.t[-1:])[0]))
        return float(max([*balance, *jumps])) / scale

    def off_surface(self) -> list[tuple[str, float]]:
        """Planned collisions whose positions do not lie on their surfaces, with the gap."""
        found = []
        for c in self.trajectory.collisions:
            j = self.kernels.surfaces.index(c.surface)
            gap = float(self.gaps(c.position, np.array([c.time]))[0, j])
            reach = float(np.abs(self.slopes(c.position, c.time)[j, : self.nq]) @ self.q_scale)
            if not abs(gap) <= ON_SURFACE * max(reach, ON_SURFACE):
                found.append((c.surface, gap))
        return found

    def energy(self, q: Array, v: Array, t: Array) -> Array:
        return self.kernels.call("legendre", q.copy(), v.copy(), t[:, None].copy(), self.par)[1][:, 0]

    # Open loop -------------------------------------------------------------------------------------------------------

    def open_loop(self) -> tuple[float, list[Contact]]:
        """Simulate from the start with the motion's inputs; return the terminal error and the contacts."""
        phases = self.trajectory.phases
        y = np.concatenate([phases[0].q[0], phases[0].v[0]])
        contacts: list[Contact] = []
        for phase in phases:
            u0, u1 = self.trajectory.input_ends(phase)
            for k in range(phase.steps):
                try:
                    y = self.step_with_contacts(y, phase.t[k], phase.t[k + 1], u0[k], u1[k], contacts)
                except FloatingPointError:
                    return np.inf, contacts
        last = phases[-1]
        q, v = y[None, : self.nq].copy(), y[None, self.nq :].copy()
        return float(self.error(q, v, last.t[-1:], last.q[-1:], last.p[-1:])[0]), contacts

    def step_with_contacts(self, y: Array, t0: float, t1: float, u0: Array, u1: Array, contacts: list[Contact]) -> Array:
        nq = self.nq

        def slope(t: float, state: Array, held: int | None) -> Array:
            share = (t - t0) / (t1 - t0)
            u = ((1 - share) * u0 + share * u1)[None]
            at, rate = state[None, :nq].copy(), state[None, nq:].copy()
            a = self.acceleration(at, rate, u, np.array([[t]]))[0]
            return np.concatenate([rate[0], a if held is None else self.on_surface(state, a, t, held)[0]])

        t = t0
        for _ in range(100):  # impacts within one step
            held = self.resting(y, t, slope(t, y, None)[nq:])
            solver = DOP853(
                lambda s, state, j=held: slope(s, state, j), t, y, t1, rtol=RELATIVE, atol=ABSOLUTE, first_step=t1 - t
            )
            hit = None
            while solver.status == "running" and hit is None:
                solver.step()
                if not np.isfinite(solver.y).all() or solver.status == "failed":
                    raise FloatingPointError
                hit = self.first_hit(solver, held)
            if hit is None:
                return np.asarray(solver.y)
            t, y, surface = hit
            after = self.impact(y, t, surface)
            contacts.append(Contact(self.kernels.surfaces[surface], t, self.jump(y, after, t)))
            y = after
            if len(contacts) > MOST_CONTACTS:
                raise FloatingPointError
            if t1 - t <= 1e-12 * max(1.0, t1):
                return y
        raise FloatingPointError

    def jump(self, before: Array, after: Array, t: float) -> float:
        states = np.stack([before, after])
        p = self.kernels.call("legendre", states[:, : self.nq].copy(), states[:, self.nq :].copy(), np.array([[t]]), self.par)[0]
        return float((np.abs(p[1] - p[0]) / self.p_scale).max())

    def gaps(self, q: Array, t: Array) -> Array:
        return self.kernels.call("surface", np.atleast_2d(q).copy(), t[:, None].copy(), self.par)[0]

    def slopes(self, q: Array, t: float) -> Array:
        """Derivatives of the gaps with respect to (q, t), shape (nc, nq + 1)."""
        found = np.zeros((len(self.kernels.surfaces), self.nq + 1))
        found[self.kernels.pattern("surface_jac", "g_D_q")] = self.kernels.call(
            "surface_jac", q[None].copy(), np.array([[t]]), self.par
        )[0][0]
        return found

    def resting(self, y: Array, t: float, a: Array) -> int | None:
        """A plastic surface that the state touches without approaching it, while the acceleration pushes into it."""
        if not self.kernels.has("surface"):
            return None
        nq = self.nq
        gaps = self.gaps(y[:nq], np.array([t]))[0]
        for j, surface in enumerate(self.kernels.surfaces):
            if self.trajectory.restitution[surface] > 0 or abs(gaps[j]) > TOUCH:
                continue
            slope = self.slopes(y[:nq], t)[j]
            if abs(slope[:nq] @ y[nq:] + slope[nq]) < RELEASED and self.on_surface(y, a, t, j)[1] > 0:
                return j
        return None

    def on_surface(self, y: Array, a: Array, t: float, j: int) -> tuple[Array, float]:
        """The acceleration that keeps the rate of a gap, and the second derivative of the gap without the contact."""
        nq, q, v, small = self.nq, y[: self.nq], y[self.nq :], 1e-6
        ahead, behind = (self.slopes(q + s * v, t + s)[j] for s in (small, -small))
        n = self.slopes(q, t)[j, :nq]
        turning = (ahead - behind) / (2 * small)
        second = float(n @ a + turning[:nq] @ v + turning[nq])
        response = self.response(q, v, t, n)
        return a - second / (n @ response) * response, second

    def response(self, q: Array, v: Array, t: float, n: Array) -> Array:
        """M^-1 n."""
        zero = np.zeros((1, len(self.kernels.inputs)))
        mass = self.kernels.call("dynamics", q[None].copy(), v[None].copy(), zero, np.array([[t]]), self.par)[0]
        return np.asarray(np.linalg.solve(mass.reshape(self.nq, self.nq), n))

    def first_hit(self, solver: Any, held: int | None) -> tuple[float, Array, int] | None:
        """Look for the first crossing within the step that the integrator has just taken; the surface that holds the motion is not crossed."""
        if not self.kernels.has("surface"):
            return None
        nq = self.nq
        reach = np.abs(self.slopes(solver.y[:nq], solver.t)) @ np.append(np.abs(solver.y[nq:]), 1.0)
        if (self.gaps(solver.y[:nq], np.array([solver.t]))[0] < -3 * reach * (solver.t - solver.t_old) - 1e-3).all():
            return None
        dense = solver.dense_output()
        times = np.linspace(solver.t_old, solver.t, 9)
        gaps = self.gaps(np.array([dense(t)[:nq] for t in times]), times)
        first: tuple[float, Array, int] | None = None
        for j in range(gaps.shape[1]):
            if j == held:
                continue
            over = np.flatnonzero(gaps[:, j] > TOUCH)
            if not len(over):
                continue
            k = int(over[0])
            low = times[max(k - 1, 0)]
            if gaps[max(k - 1, 0), j] >= -TOUCH:  # starts on the surface: look for the last moment inside
                inside = [s for s in np.linspace(low, times[k], 33) if self.gaps(dense(s)[:nq], np.array([s]))[0, j] < -TOUCH]
                if not inside:  # leaves the admissible set at once: the contact is where the step starts
                    return float(solver.t_old), np.asarray(dense(solver.t_old)), j
                low = inside[-1]

            def gap(s: float, j: int = j) -> float:
                return float(self.gaps(dense(s)[:nq], np.array([s]))[0, j])

            at = float(brentq(gap, low, times[k], xtol=1e-14, rtol=1e-14))
            if first is None or at < first[0]:
                first = at, np.asarray(dense(at)), j
        return first

    def impact(self, y: Array, t: float, surface: int) -> Array:
        nq = self.nq
        q, v = y[:nq], y[nq:]
        *normal, moving = self.slopes(q, t)[surface]
        n = np.array(normal)
        response = self.response(q, v, t, n)
        e = self.trajectory.restitution[self.kernels.surfaces[surface]]
        return np.concatenate([q, v - (1 + e) * (n @ v + moving) / (n @ response) * response])


def _scale(ranges: Array) -> Array:
    """Ranges to compare errors with; what does not move is compared with a millionth of what does, so that roundings stay small."""
    return np.maximum(ranges, 1e-6 * ranges.max()) if ranges.max() > 0 else np.ones_like(ranges)


def _compare(trajectory: Trajectory, contacts: list[Contact]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Match contacts with planned collisions by surface and time; of the others those count that do not merely graze."""
    left = list(contacts)
    missed = []
    for planned in trajectory.collisions:
        window = SAME_CONTACT * trajectory.final_time
        match = next((c for c in left if c.surface == planned.surface and abs(c.time - planned.time) <= window), None)
        if match is None:
            missed.append(f"the collision with {planned.surface!r} at {planned.time:.4g} s")
        else:
            left.remove(match)
    return tuple(missed), tuple(f"a contact with {c.surface!r} at {c.time:.4g} s" for c in left if c.jump > GRAZING)
