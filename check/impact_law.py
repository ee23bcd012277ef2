"""The law of what happens between two modes: rows of velocities after a hit, a landing, a contact
that opens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contact_mode import FREE, Event, Mode, without_rails
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.model import Model
from dmoc.motion.impact_laws import POISSON
from dmoc.simulation.single_hit import single_hit


@record(frozen=True, eq=False)
class ImpactResult:
    """Rows of velocities (n, nq) after an event, and the impulses of all surfaces (n, nc) and
    tangents (n, nt); of the first row, where it is that of a hit with friction, its course and
    contacts that should hold and do not."""

    velocity: Array
    normal: Array
    tangential: Array
    course: str = ""
    unheld: tuple[str, ...] = ()


@record(frozen=True, eq=False)
class ImpactLaw:
    """What an event makes of velocities."""

    model: Model
    restitution: Array  # (nc,), not a number where the law of the model says it
    mode: Mode = FREE  # surfaces that take impulses, and the friction of their tangents
    hit: int | None = None  # the one of them that is released, by its coefficient of restitution
    # Its tangent where it has friction: then it is hit by its law while the others hold; or that of
    # a landing during which sliding stops.
    rubs: int | None = None
    lands: bool = False  # the surface that is hit stays closed

    @classmethod
    def of(cls, model: Model, restitution: Array, event: Event, after: Mode) -> ImpactLaw:
        """The law of an event whose later mode is ``after``."""
        if not event.impact:
            return cls(model, restitution)
        at = model.supports
        on = after.closed
        ours = after.among(on, lambda k: at[k] in on)
        if event.hit == NOWHERE:
            if event.course is None:
                return cls(model, restitution, without_rails(at, ours))
            j = event.surface
            return cls(model, restitution, without_rails(at, ours), j, at.index(j), lands=True)
        j = event.hit
        mode = replace(ours, closed=(j, *ours.closed))
        return cls(model, restitution, mode, j, model.rubs_in_hits.get(j))

    def after(self, q: Array, v: Array, t: Array) -> ImpactResult:
        """The outcome for states before the event, q and v of shape (n, nq), at times (n,)."""
        mode = self.mode
        model = self.model.in_impact_at(q, t)
        if not mode.closed:
            return ImpactResult(v, np.zeros((len(q), model.nc)), np.zeros((len(q), model.nt)))
        if self.rubs is not None and self.hit is not None:
            return self._with_friction((self.hit, self.rubs), q, v, t)
        held = conditions_of(model, mode)
        wanted = -held.rates(model, q, v, t)
        if self.hit is not None:
            e = model.coefficients(self.restitution, q, v, t)
            wanted[:, 0] *= 1 + e[:, self.hit]
        change, lam = held.answers(model, q, t, wanted)
        return ImpactResult(v + change, *held.spread(model, lam)[:2])

    def _with_friction(
        self, contact: tuple[int, int], q: Array, v: Array, t: Array
    ) -> ImpactResult:
        """Outcome of one hit with a tangential impulse, for q and v (n, nq) at times (n,):
        ``contact`` are its surface and tangent."""
        e = self.model.coefficients(self.restitution, q, v, t)[:, contact[0]]
        e = np.zeros(len(q)) if self.lands else e
        hits = [
            single_hit(
                self.model, contact, self.holding, (*state, float(time)), float(e_n), self.by
            )
            for *state, time, e_n in zip(q, v, t, e, strict=True)
        ]
        return ImpactResult(
            np.array([h.velocity for h in hits]),
            np.array([h.normal for h in hits]),
            np.array([h.tangential for h in hits]),
            hits[0].way.course,
            hits[0].unheld,
        )

    @property
    def by(self) -> str:
        """The law of its impact; of a landing, which is compression alone, any that has stages."""
        return POISSON if self.lands or self.hit is None else self.model.impact_laws[self.hit]

    @property
    def holding(self) -> Mode:
        """The mode of the contacts that stay closed beside a hit with friction."""
        mode, rough, stuck = self.mode, self.model.has_friction, self.mode.sticking
        return mode.among(
            (j for j in mode.closed if j != self.hit),
            lambda k: k != self.rubs and bool(rough[k] or k not in stuck),
        )
