"""What joins two phases, and its law: hits, landings, contacts that stay closed through them."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import ROUNDING
from dmoc.check.impact_law import ImpactLaw, ImpactResult
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import FREE, Mode, without_rails
from dmoc.mechanics.isotropy import coupled
from dmoc.mechanics.model import Model
from dmoc.motion.trajectory import Collision, Phase
from dmoc.simulation.contact_modes import Reaction, borne
from dmoc.simulation.hit_coefficients import wrong_coefficient

PERTURBED = 1e-6  # change of a state, in sizes, that shows the linearised flow


@record(frozen=True, eq=False)
class EventPassage:
    """What joins two phases."""

    models: tuple[Model, Model]  # of the phases before and after it
    restitution: Array  # (nc,), not a number where the law of the model says it
    c: Collision  # what is planned
    before: Phase
    after: Phase
    sizes: Array  # sizes of positions and velocities, (2 nq,)
    # The inputs on both sides (2, nu) of a collision that happens where its surface is met; those
    # of events that happen at their time are not asked for.
    inputs: Array | None
    mode: Mode = FREE  # surfaces that take impulses, and the friction of their tangents
    hit: int | None = None  # the one of them that is released, by its coefficient of restitution
    # Its tangent where it has friction: then it is hit by its law while the others hold; or that of
    # a landing during which sliding stops.
    rubs: int | None = None
    lands: bool = False  # the surface that is hit stays closed
    wrong: str = ""  # what of the plan does not fit together

    @property
    def model(self) -> Model:
        """The model of the event: that of the phase before it."""
        return self.models[0]

    @cached_property
    def planned(self) -> tuple[Array, Array]:
        """The planned impulses of all surfaces and tangents."""
        c, kernels = self.c, self.model.kernels
        normal = {c.surface: c.impulse, **c.impulses} if c.surface else c.impulses
        return (
            np.array([normal.get(name, 0.0) for name in kernels.surfaces]),
            np.array([c.tractions.get(name, 0.0) for name in kernels.tangents]),
        )

    @cached_property
    def starts(self) -> tuple[Array, Array, Array]:
        """States at the event, by when they are late there (n, 1), and accelerations on both sides
        (2, nq): of the end of the phase before, and of ends changed by a little either way, at
        their surface if it is a collision that happens where this is met."""
        nq, changes = self.model.nq, PERTURBED * np.diag(self.sizes)
        end = np.concatenate([self.before.q[-1], self.before.v[-1]])
        y = end + np.concatenate([np.zeros((1, len(end))), changes, -changes])
        late, a = np.zeros((len(y), 1)), np.zeros((2, nq))
        if self.inputs is not None:
            n, moving = self.slopes[self.model.surface_numbers[self.c.surface]], end[nq:]
            rate = float(n[:-1] @ moving + n[-1])
            closes = self.model.contacts.pull[self.model.surface_numbers[self.c.surface]]
            if self.c.grazes or not (abs(rate) if closes else rate) > 0:
                return y[:1], late[:1], a
            sides = (self.before.q[-1:], self.after.q[:1]), (self.before.v[-1:], self.after.v[:1])
            q, v = map(np.concatenate, sides)
            a = self.model.acceleration(q, v, self.inputs, np.full(2, self.c.time))
            late[1:] = -((y[1:, :nq] - end[:nq]) @ n[:-1])[:, None] / rate
            y[1:, :nq] += late[1:] * y[1:, nq:]
            y[1:, nq:] += late[1:] * a[0]
        return y, late, a

    @cached_property
    def outcome(self) -> ImpactResult:
        """Outcome of the impact law for the states of ``starts``."""
        (y, late, _), nq = self.starts, self.model.nq
        return self.after_law(y[:, :nq].copy(), y[:, nq:].copy(), late[:, 0])

    @cached_property
    def law(self) -> ImpactResult:
        """Outcome of the impact law at the end of the phase before; where several impulses have the
        same effect, those that are borne."""
        rows, q, t = self.outcome, self.before.q[-1:], np.array([self.c.time])
        parts = rows.velocity[:1], rows.normal[:1], rows.tangential[:1]
        smallest = Reaction(*parts, np.zeros((1, self.model.nj)))
        best = borne(self.model, self.mode, smallest, q, t)
        return replace(rows, velocity=parts[0], normal=best.normal, tangential=best.tangential)

    @cached_property
    def slope(self) -> Array:
        """Derivative of the state after an event, at its planned time, by the state before it, in
        sizes, shape (2 nq, 2 nq)."""
        (y, late, a), nq, v = self.starts, self.model.nq, self.outcome.velocity
        if len(y) == 1:
            return np.eye(2 * nq)
        ends = np.concatenate([y[:, :nq] - late * v, v - late * a[1]], axis=1)
        up, down = np.split(ends[1:], 2)
        return np.asarray((up - down).T / (2 * PERTURBED * self.sizes[:, None]))

    @cached_property
    def rates(self) -> Array:
        """Rates of all gaps before, after, and after by the law, shape (3, nc)."""
        v = np.concatenate([self.before.v[-1:], self.after.v[:1], self.law.velocity])
        q = np.repeat(self.before.q[-1:], 3, axis=0)
        return self.model.gap_rates(q, v, np.full(3, self.c.time))

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of the gaps by the position and the time, shape (nc, nq + 1)."""
        return self.model.gap_slopes(self.before.q[-1], self.c.time)

    @property
    def normals(self) -> Array:
        """Gradients of the gaps, shape (nc, nq)."""
        return np.ascontiguousarray(self.slopes[:, :-1])

    @cached_property
    def missing(self) -> Array:
        """Change of the momentum that the planned impulses do not explain, nor joints, nor what
        other parameters make of it at the velocities after it, (nq,)."""
        q, t, model = self.before.q[-1], self.c.time, self.model
        normal, tangential = self.planned
        change = tangential @ model.tangent_slopes(q, t)[:, :-1] - normal @ self.normals
        by = [there.momentum(q, self.after.v[0], t) for there in self.models]
        jump = self.after.p[0] - self.before.p[-1] - change - (by[1] - by[0])
        return model.with_joints(model.mass(q, t), jump, q, t) if model.nj else jump

    @cached_property
    def impact(self) -> ImpactLaw:
        """The law of what happens."""
        return ImpactLaw(self.model, self.restitution, self.mode, self.hit, self.rubs, self.lands)

    def after_law(self, q: Array, v: Array, late: Array | float = 0.0) -> ImpactResult:
        """Outcome of the impact law for states before the event, q and v of shape (n, nq), at times
        later by ``late``, shape (n,)."""
        return self.impact.after(q, v, np.full(len(q), self.c.time) + late)


def passage_of(
    models: tuple[Model, Model],
    restitution: Array,
    c: Collision,
    phases: tuple[Phase, Phase],
    own: Mode,
    around: tuple[Array, Array | None],
) -> EventPassage:
    """The event between two phases, the later one in its mode ``own``; ``around`` are sizes of
    states and the inputs on both sides, as :class:`EventPassage` has them."""
    (before, after), model = phases, models[0]
    parts = models, restitution, c, before, after, *around
    stay = [name for name in before.closed if name not in c.leaves]
    # A grip that is loaded beyond its strength when it closes lets go at once.
    when, expected = f"at {c.time:.4g} s", {*stay, *c.lands}.difference(c.leaves)
    if expected != set(after.closed):
        shown = ", ".join(sorted(expected)) or "none"
        return EventPassage(
            *parts, wrong=f"the contacts closed after what happens {when} are {shown}"
        )
    if not c.surface or c.grazes:
        return EventPassage(*parts)
    on = [model.surface_numbers[name] for name in (*c.lands, *stay)]
    at = model.supports
    ours = own.among(on, lambda k: at[k] in on)
    if c.surface in c.lands:
        if c.course:
            j = model.surface_numbers[c.surface]
            return EventPassage(*parts, without_rails(at, ours), j, at.index(j), lands=True)
        return EventPassage(*parts, without_rails(at, ours))
    j = model.surface_numbers[c.surface]
    with_hit = replace(ours, closed=(j, *ours.closed))
    wrong = _wrong_law(model, restitution, j, (before.q[-1], before.v[-1], c.time))
    wrong = wrong or coupled(model, j, before.q[-1], c.time)
    return EventPassage(*parts, with_hit, j, model.rubs_in_hits.get(j), wrong=wrong)


def _wrong_law(model: Model, restitution: Array, j: int, state: tuple[Array, Array, float]) -> str:
    """A sentence about a coefficient of the model's law that no hit can have; empty for a good
    one."""
    if not np.isnan(restitution[j]):
        return ""
    e = float(model.coefficients(restitution, *state)[j])
    least = ROUNDING if np.isfinite(e) else 0.0
    return "" if -least <= e <= 1 + least else wrong_coefficient(model, j, e, state).rstrip(".")
