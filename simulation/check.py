"""The independent check of a motion: continuous equations of motion, event detection and impact
law.

Nothing here is shared with the discrete equations of the optimiser (:mod:`dmoc.simulation.flow`).
A motion is compared with the flow in four ways: step by step and segment by segment, each from its
own states; at its collisions, with the law of impact; and from the start to the end in one
open-loop run.  An unstable motion amplifies every error on the way, so that the end of the
open-loop run says nothing about it: it is weighed with the amplification of the linearised flow.
Where the motion itself lies on a surface, held there by its inputs, a simulation may enter the
surface by a little.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dmoc.arguments import shown
from dmoc.codegen.kernels import Array, Kernels
from dmoc.errors import SimulationError
from dmoc.mechanics.model import Model
from dmoc.mechanics.values import parameter_row, restitution_row
from dmoc.simulation.amplification import amplification, nodes_of_segments
from dmoc.simulation.flow import PLACES, Contact, Flow, Lost, quintic
from dmoc.simulation.sizes import sizes_of
from dmoc.trajectory import GRAZING, Trajectory

# What a motion may miss and still count as confirmed.  Errors of states are relative to the ranges
# of coordinates and momenta, energies to the kinetic energy, penetration and excess of soft limits
# to the ranges, the law of impact to the largest rate of the gap.
PASSING = {
    "segment error": 0.01,
    "energy error": 0.02,
    "penetration": 0.002,
    "excess of a limit": 0.002,
    "excess of an input": 1e-6,
    "error of the law of impact": 0.02,
    "error of the law of impact relative to its own rates": 0.15,
}
# The end of the open-loop run: its error as it is, or divided by the motion's amplification, where
# segments are right to the last share.
TERMINAL, WEIGHED, UNSTABLE_SEGMENT = 0.25, 0.01, 0.005
# A contact belongs to a planned collision if it happens within this share of the final time from
# it.
SAME_CONTACT = 0.05
# A node within this share of the gap's size lies on the surface; so many in a row slide along it.
# A motion that slides may enter the surface between its nodes as far as penetration may be, one
# that only touches it less far: it would bounce.
ON_ARC, LASTING, TOUCHING = 1e-4, 3, 3e-4
# gap of a planned collision, relative to how far the coordinates move it, that a solver may leave
OFF_SURFACE = 1e-6
ASTRAY = 100.0  # ranges from the motion at which an open-loop run ends
SINGULAR = 1e-12  # smallest eigenvalue of a regular mass matrix, relative to the largest inertias


class OutOfTimeError(SimulationError):
    """The check was not finished in its time."""


@dataclass(frozen=True)
class Verification:
    """What the check found.  Errors are relative to the range of the coordinate and to the largest
    momentum of the motion.

    Attributes
    ----------
    passed : bool
    message : str
        What contradicts the motion, or, where it passed, why its open-loop end does not count.
    terminal_error : float
        Error of the state at the end of an open-loop simulation with the motion's inputs.
    amplification : float
        Largest ratio by which the linearised flow, through the collisions, carries a small error
        from a segment's start to the end.
    max_defect : float
        Largest error over a single step, started at its first node.
    segment_defects : array
        Error over each of ten segments a phase, started at its first node.
    energy_error : float
        Largest |E(end) - E(start) - work| of a phase, or jump of the energy at a collision,
        relative to the largest kinetic energy.
    impact_error : float
        Largest error of the law of impact: of the rate of the gap after a collision, and of its
        impulse, both relative to the largest rate.
    missed_contacts, extra_contacts : tuples of str
        Planned collisions that the simulation does not meet, and contacts that were not planned and
        change a momentum by more than 1 %.
    penetration : float
        Largest gap g > 0 between nodes, relative to how far the motion's ranges move the gap.
    limit_excess : float
        Largest excess of an input or a coordinate over its bounds, between nodes too, relative to
        its range.
    contacts : tuple of Contact
        Of the open-loop simulation.
    """

    passed: bool
    message: str
    terminal_error: float
    amplification: float
    max_defect: float
    segment_defects: Array
    energy_error: float
    impact_error: float
    missed_contacts: tuple[str, ...]
    extra_contacts: tuple[str, ...]
    penetration: float
    limit_excess: float
    contacts: tuple[Contact, ...]


def verify(trajectory: Trajectory, kernels: Kernels, seconds: float | None = None) -> Verification:
    """Simulate a motion independently and compare.

    A motion passes if every tenth of a phase is right to 1 % of the motion's ranges, the energy to
    2 %, its collisions obey the law of impact, it keeps its limits and surfaces between nodes, the
    simulation meets the planned collisions and no others, and the end of an open-loop run is right
    to 25 %.  The last does not count for an unstable motion, whose amplification explains the end;
    its segments must be right to 0.5 %.

    Raises
    ------
    SimulationError
        If the kernels are not those of the motion's model, or the time of ``seconds`` is used up.
    """
    if not isinstance(trajectory, Trajectory):
        raise SimulationError(
            f"trajectory = {shown(trajectory)}: expected that of a solution, solution.trajectory."
        )
    if not isinstance(kernels, Kernels):
        raise SimulationError(
            f"kernels = {shown(kernels)}: expected the kernels of the motion's model."
        )
    if kernels.manifest["fingerprint"] != trajectory.fingerprint:
        raise SimulationError(
            f"the motion of model {trajectory.model!r} was made with another version or order of "
            f"it than the kernels of {kernels.name!r}: give those it was made with."
        )
    with np.errstate(all="ignore"):
        return _Check(trajectory, kernels, seconds).result()


@dataclass(frozen=True)
class Arc:
    """A time in which a motion lies on a surface, and how far a simulation may enter it."""

    surface: int
    begin: float
    end: float
    depth: float


class _Check:
    def __init__(self, trajectory: Trajectory, kernels: Kernels, seconds: float | None) -> None:
        self.trajectory, self.kernels = trajectory, kernels
        self.nq = len(trajectory.coordinates)
        self.deadline = np.inf if seconds is None else time.perf_counter() + seconds
        restitution = restitution_row(kernels, trajectory.restitution, SimulationError)
        self.model = Model(kernels, parameter_row(kernels, trajectory.parameters, SimulationError))
        self.sizes = sizes_of(trajectory, self.model)
        self.flow = Flow(self.model, self.sizes, restitution, self._allowance, self._check_time)
        self.arcs = self._arcs()

    def _check_time(self) -> None:
        if time.perf_counter() > self.deadline:
            raise OutOfTimeError(
                "the time for the check was used up: raise it, or take fewer steps."
            )

    def _allowance(self, t: Array) -> Array:
        """How far simulations may enter surfaces: where the motion itself lies on one, without a
        force of its own, as far as penetration may be."""
        allowed = np.zeros((len(t), len(self.kernels.surfaces)))
        for arc in self.arcs:
            on = (arc.begin <= t) & (t <= arc.end)
            allowed[on, arc.surface] = np.maximum(allowed[on, arc.surface], arc.depth)
        return allowed

    def _arcs(self) -> list[Arc]:
        """Where the motion lies on a surface without a planned collision."""
        found: list[Arc] = []
        if not self.model.nc:
            return found
        hits = [
            (self.kernels.surfaces.index(c.surface), c.time)
            for c in self.trajectory.collisions
            if not c.grazes
        ]
        for phase in self.trajectory.phases:
            on, h = self.model.gaps(phase.q, phase.t) >= -ON_ARC * self.sizes.gap, phase.step_size
            for k, j in zip(*np.nonzero(on), strict=True):
                t = float(phase.t[k])
                if not any(surface == j and abs(t - at) <= 2.5 * h for surface, at in hits):
                    slides = any(
                        on[max(k - i, 0) : k + 3 - i, j].sum() == LASTING for i in range(LASTING)
                    )
                    # What happens after the end is nobody's business.
                    ends = t >= self.sizes.time - h / 2
                    depth = PASSING["penetration"] if slides or ends else TOUCHING
                    found.append(Arc(int(j), t - h, t + h, depth * float(self.sizes.gap[j])))
        return found

    def result(self) -> Verification:
        defects, work, penetration, excess = self.steps()
        energy, (law, own) = self.energy_error(work), self.impact_errors()
        segments = self.segments()
        amplified = amplification(self.trajectory, self.flow)
        terminal, contacts = self.open_loop()
        missed, extra = self.compare(contacts)
        failures = [
            f"the collision with {surface!r} is {gap:.3g} off it"
            for surface, gap in self.off_surface()
        ]
        singular = self.singular()
        if singular is not None:
            failures.append(
                f"the mass matrix is singular or negative on the way, first at {singular:.4g} s"
            )
        worst, inputs = float(segments.max(initial=0.0)), self.input_excess()
        measured = {
            "segment error": worst, "energy error": energy, "error of the law of impact": law,
            "error of the law of impact relative to its own rates": own, "penetration": penetration,
            "excess of a limit": excess, "excess of an input": inputs,
        }  # fmt: skip
        failures += [
            f"{name} {value:.3g} exceeds {PASSING[name]:g}"
            for name, value in measured.items()
            if not value <= PASSING[name]
        ]
        note = ""
        if missed or extra or not terminal <= TERMINAL:
            lost = [f"the simulation misses {', '.join(missed)}"] * bool(missed)
            lost += [f"the simulation meets {', '.join(extra)}"] * bool(extra)
            lost += [f"terminal error {terminal:.3g} exceeds {TERMINAL:g}"] * (
                not terminal <= TERMINAL
            )
            missed_on_way, extra_on_way = (
                self.compare(self.on_the_way())
                if not failures and worst <= UNSTABLE_SEGMENT
                else (missed, extra)
            )
            followed = not (failures or missed_on_way or extra_on_way) and worst <= UNSTABLE_SEGMENT
            if followed and amplified * WEIGHED >= min(terminal, 1.0):
                note = (
                    f"the motion is unstable: it amplifies errors {amplified:.3g} times, so that "
                    "an open-loop run leaves it "
                    f"({'; '.join(lost)}), while every segment is right to {worst:.1g}"
                )
                missed, extra = missed_on_way, extra_on_way
            else:
                failures = lost + failures
        unstable = (
            f" (the motion amplifies errors {amplified:.3g} times)"
            if amplified * WEIGHED > 1
            else ""
        )
        message = (
            "; ".join(failures) + f": too coarse{unstable}, take more steps" if failures else note
        )
        return Verification(
            not failures,
            message,
            terminal,
            amplified,
            float(defects.max(initial=0.0)),
            segments,
            energy,
            law,
            missed,
            extra,
            penetration,
            max(excess, inputs),
            tuple(contacts),
        )

    def singular(self) -> float | None:
        """First node at which the mass matrix is not positive definite, up to rounding errors of
        its entries."""
        for phase in self.trajectory.phases:
            M = self.model.mass(phase.q, phase.t)
            root = np.sqrt(np.abs(np.diagonal(M, axis1=1, axis2=2)).max(axis=0))
            scaled = M / np.where(root > 0, root, 1.0)[:, None] / np.where(root > 0, root, 1.0)
            good = np.array(np.isfinite(scaled).all(axis=(1, 2)))
            good[good] = np.linalg.eigvalsh(scaled[good])[:, 0] > SINGULAR
            if not good.all():
                return float(phase.t[int(np.argmin(good))])
        return None

    # Step by step ---------------------------------------------------------------------------------

    def steps(self) -> tuple[Array, list[float], float, float]:
        """Integrate every step from its first node; return errors, the work of each phase, and
        the largest penetration and excess of a bound of a coordinate between nodes, relative to
        the ranges."""
        defects, work, penetration, excess = [], [], 0.0, 0.0
        low, high = self.trajectory.coordinate_bounds.T
        for phase in self.trajectory.phases:
            u0, u1 = self.trajectory.input_ends(phase)
            q0, v0, t0, h = phase.q[:-1], phase.v[:-1], phase.t[:-1], np.diff(phase.t)
            q, v, w = self.flow.advance(q0, v0, t0, h, u0, u1)
            defects.append(self.error(q, v, phase.t[1:], phase.q[1:], phase.p[1:]))
            work.append(float(w.sum()))
            a0 = self.flow.acceleration(q0, v0, u0, t0)
            a1 = self.flow.acceleration(q, v, u1, phase.t[1:])
            path = quintic(q0, v0, a0, q, v, a1, h[:, None])
            for s in PLACES[1:-1]:
                between = path(s)
                gaps = self.model.gaps(between, t0 + s * h) / self.sizes.gap
                penetration = max(
                    penetration, float(np.nan_to_num(gaps, nan=np.inf).max(initial=0.0))
                )
                excess = max(
                    excess,
                    float(
                        (np.maximum(low - between, between - high) / self.sizes.q).max(initial=0.0)
                    ),
                )
        return np.concatenate(defects), work, penetration, excess

    def input_excess(self) -> float:
        """Largest excess of an input over its bounds in any step, relative to the range of the
        bounds."""
        low, high = self.trajectory.input_bounds.T
        width = np.where(
            np.isfinite(high - low) & (high > low),
            high - low,
            np.maximum(np.abs(low), np.abs(high)),
        )
        width = np.where(np.isfinite(width) & (width > 0), width, 1.0)
        ends = [u for phase in self.trajectory.phases for u in self.trajectory.input_ends(phase)]
        return max(
            (float((np.maximum(low - u, u - high) / width).max(initial=0.0)) for u in ends),
            default=0.0,
        )

    def error(self, q: Array, v: Array, t: Array, q_wanted: Array, p_wanted: Array) -> Array:
        """Largest relative error of each row's state."""
        p = self.model.momentum(q, v, t)
        parts = np.hstack(
            [np.abs(q - q_wanted) / self.sizes.q, np.abs(p - p_wanted) / self.sizes.p]
        )
        return np.asarray(np.nan_to_num(parts.max(axis=1), nan=np.inf))

    def energy_error(self, work: list[float]) -> float:
        """Largest imbalance of a phase or jump at a collision, relative to the largest kinetic
        energy."""
        phases = self.trajectory.phases
        energies = [self.model.energy(p.q, p.v, p.t) for p in phases]
        found = [abs(e[-1] - e[0] - w) for e, w in zip(energies, work, strict=True)]
        for collision, before, after in zip(
            self.trajectory.collisions, phases, energies[1:], strict=False
        ):
            v = self.flow.planned_impact(collision, before.q[-1], before.v[-1])[0]
            found.append(abs(after[0] - self.model.energy(before.q[-1], v, before.t[-1])))
        return float(np.nan_to_num(max(found), nan=np.inf)) / self.sizes.energy

    # Collisions -----------------------------------------------------------------------------------

    def impact_errors(self) -> tuple[float, float]:
        """Errors of the rate after a collision, of the impulse, and rates that approach after it
        or leave before it: relative to the largest rate, and to the rates of the collision
        itself."""
        worst = own = 0.0
        for c, before, after in zip(
            self.trajectory.collisions,
            self.trajectory.phases,
            self.trajectory.phases[1:],
            strict=False,
        ):
            j, q, t = self.kernels.surfaces.index(c.surface), before.q[-1], c.time
            slope = self.model.gap_slopes(q, t)[j]
            w = [float(slope[: self.nq] @ v + slope[self.nq]) for v in (before.v[-1], after.v[0])]
            _, impulse, _ = self.flow.planned_impact(c, q, before.v[-1])
            e = 0.0 if c.grazes else self.trajectory.restitution[c.surface]
            n = slope[: self.nq]
            try:
                inertia = float(n @ self.flow.response(q, t, n))
            except Lost:
                return np.inf, np.inf
            errors = [
                abs(w[1] + e * w[0]),
                abs(impulse - c.impulse) * inertia,
                max(-w[0], 0.0),
                max(w[1], 0.0),
            ]
            largest = float(np.nan_to_num(max(errors), nan=np.inf))
            worst = max(worst, largest / float(self.sizes.rate[j]))
            if not c.grazes:
                own = max(own, largest / max(abs(w[0]), abs(w[1]), 1e-300))
        return worst, own

    def off_surface(self) -> list[tuple[str, float]]:
        """Planned collisions whose positions do not lie on their surfaces, with the gap."""
        found = []
        for c in self.trajectory.collisions:
            j = self.kernels.surfaces.index(c.surface)
            gap = float(self.model.gaps(c.position, c.time)[j])
            if not abs(gap) <= OFF_SURFACE * self.sizes.gap[j]:
                found.append((c.surface, gap))
        return found

    # Segments and amplification -------------------------------------------------------------------

    def segments(self) -> Array:
        """Errors over segments, all of a phase integrated side by side from the motion's own
        states, without contacts."""
        errors = []
        for phase in self.trajectory.phases:
            u0, u1 = self.trajectory.input_ends(phase)
            cuts, h = nodes_of_segments(phase.steps), np.diff(phase.t)
            first, last = cuts[:-1], cuts[1:]
            q, v = phase.q[first].copy(), phase.v[first].copy()
            for j in range(int((last - first).max())):
                on = first + j < last
                k = first[on] + j
                q[on], v[on], _ = self.flow.advance(q[on], v[on], phase.t[k], h[k], u0[k], u1[k])
            errors.append(self.error(q, v, phase.t[last], phase.q[last], phase.p[last]))
        return np.concatenate(errors)

    def on_the_way(self) -> list[Contact]:
        """Contacts met in segments, each simulated from the motion's own state; one that ends in
        a planned collision meets it a little early or late."""
        contacts = list[Contact]()
        for i, phase in enumerate(self.trajectory.phases):
            cuts = nodes_of_segments(phase.steps)
            for first, last in pairwise(cuts):
                met = list[Contact]()
                try:
                    q, v = self._segment(i, int(first), int(last), met)
                    if last == phase.steps and i < len(self.trajectory.collisions):
                        met += self._late(i, q, v, float(phase.t[last]), met)
                except Lost:
                    pass  # what it has met until then does not fit
                contacts += met
        return contacts

    def _segment(self, i: int, first: int, last: int, met: list[Contact]) -> tuple[Array, Array]:
        """Simulate a segment; where its planned collision is met early, the end is that of the
        motion without the impact."""
        phase = self.trajectory.phases[i]
        u0, u1 = self.trajectory.input_ends(phase)
        q, v = phase.q[first].copy(), phase.v[first].copy()
        free = False
        for k in range(first, last):
            span, before, count = (float(phase.t[k]), float(phase.t[k + 1])), (q, v), len(met)
            if not free:
                q, v = self.flow.through_contacts(q, v, span, u0[k], u1[k], met)
                free = last == phase.steps and any(
                    self._planned(c, i, phase.t[last]) for c in met[count:]
                )
            if free:
                del met[count + 1 :]
                rows = (
                    before[0][None],
                    before[1][None],
                    np.array(span[:1]),
                    np.array([span[1] - span[0]]),
                    u0[[k]],
                    u1[[k]],
                )
                found = self.flow.advance(*rows)
                q, v = found[0][0], found[1][0]
        return q, v

    def _planned(self, contact: Contact, i: int, end: float) -> bool:
        collisions = self.trajectory.collisions
        window = SAME_CONTACT * self.sizes.time
        return (
            i < len(collisions)
            and contact.surface == collisions[i].surface
            and abs(contact.time - end) <= window
        )

    def _late(self, i: int, q: Array, v: Array, t: float, met: list[Contact]) -> list[Contact]:
        """The planned collision where a segment ends just before it: by the rate of the gap."""
        collision = self.trajectory.collisions[i]
        if any(self._planned(c, i, t) for c in met):
            return []
        j = self.kernels.surfaces.index(collision.surface)
        rate, gap = self.flow.rate(q, v, t, j), float(self.model.gaps(q, t)[j])
        if rate > 0 and -gap <= SAME_CONTACT * self.sizes.time * rate:
            return [Contact(collision.surface, t, 1.0)]
        return []

    # Open loop ------------------------------------------------------------------------------------

    def open_loop(self) -> tuple[float, list[Contact]]:
        """Simulate from the start with the motion's inputs; return the terminal error and the
        contacts."""
        phases = self.trajectory.phases
        q, v = phases[0].q[0].copy(), phases[0].v[0].copy()
        contacts: list[Contact] = []
        try:
            for phase in phases:
                u0, u1 = self.trajectory.input_ends(phase)
                for k in range(phase.steps):
                    q, v = self.flow.through_contacts(
                        q, v, (float(phase.t[k]), float(phase.t[k + 1])), u0[k], u1[k], contacts
                    )
                    if (np.abs(q - phase.q[k + 1]) > ASTRAY * self.sizes.q).any():
                        return float((np.abs(q - phase.q[k + 1]) / self.sizes.q).max()), contacts
        except Lost:
            return np.inf, contacts
        last = phases[-1]
        return float(
            self.error(q[None].copy(), v[None].copy(), last.t[-1:], last.q[-1:], last.p[-1:])[0]
        ), contacts

    def compare(self, contacts: list[Contact]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Match contacts with planned collisions by surface and time; of the others those count
        that do not merely graze."""
        left, missed = list(contacts), []
        for planned in self.trajectory.collisions:
            window = SAME_CONTACT * self.sizes.time
            match = next(
                (
                    c
                    for c in left
                    if c.surface == planned.surface and abs(c.time - planned.time) <= window
                ),
                None,
            )
            if match is not None:
                left.remove(match)
            elif not planned.grazes:
                missed.append(f"the collision with {planned.surface!r} at {planned.time:.4g} s")

        return tuple(missed), tuple(
            f"a contact with {c.surface!r} at {c.time:.4g} s" for c in left if c.jump > GRAZING
        )
