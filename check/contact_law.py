"""The law of what joins two phases with lasting contacts: hits, landings, and contacts that stay
closed through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dmoc.check.checked_motion import Motion
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.simulation.contact_modes import (
    Mode,
    answers,
    condition_rates,
    conditions,
    spread,
    supports,
    without_rails,
)
from dmoc.simulation.poisson import impulses


@dataclass(frozen=True)
class ImpactEvent:
    """Who takes part in what joins two phases.

    Attributes
    ----------
    mode : Mode
        Surfaces that take impulses, and the friction of their tangents.
    hit : int or None
        The one of them that is released, by its coefficient of restitution.
    rubs : int or None
        Its tangent where it has friction: then it is hit alone, after Poisson; or that of a landing
        during which sliding stops.
    lands : bool
        The surface that is hit stays closed.
    wrong : str
        What of the plan does not fit together; empty if nothing.
    """

    mode: Mode
    hit: int | None = None
    rubs: int | None = None
    lands: bool = False
    wrong: str = ""


@dataclass(frozen=True)
class ImpactResult:
    """Rows of velocities (n, nq) after an event, and the impulses of all surfaces (n, nc) and
    tangents (n, nt); the course of friction in the first row, where it is that of Poisson's law."""

    velocity: Array
    normal: Array
    tangential: Array
    course: str = ""


def event_of(motion: Motion, i: int) -> ImpactEvent:
    """What joins the phases i and i + 1."""
    c, kernels = motion.trajectory.collisions[i], motion.model.kernels
    before, after = motion.trajectory.phases[i], motion.trajectory.phases[i + 1]
    kept = [name for name in before.closed if name not in c.leaves]
    hit = c.surface if c.surface and c.surface not in c.lands and not c.grazes else None
    when = f"at {c.time:.4g} s"
    expected = {*kept, *c.lands}
    if expected != set(after.closed):
        shown = ", ".join(sorted(expected)) or "none"
        return ImpactEvent(
            Mode(), wrong=f"the contacts closed after what happens {when} are {shown}"
        )
    if not c.surface or c.grazes:
        return ImpactEvent(Mode())
    on = [kernels.surfaces.index(name) for name in (*c.lands, *kept)]
    own, at = motion.modes[i + 1], supports(kernels)
    ours = Mode(
        tuple(on),
        tuple(k for k in own.sticking if at[k] in on),
        tuple((k, s) for k, s in own.sliding if at[k] in on),
    )
    if hit is None and c.course and len(on) == 1:
        return ImpactEvent(Mode((on[0],)), on[0], at.index(on[0]), lands=True)
    if hit is None:
        return ImpactEvent(without_rails(ours, kernels))
    j = kernels.surfaces.index(hit)
    rubs = next((k for k, s in enumerate(at) if s == j and motion.model.friction[k] > 0), None)
    wrong = (
        f"the hit of {hit!r} {when} has friction, and other contacts are closed: its law is known "
        "for one contact alone"
        if rubs is not None and on
        else ""
    )
    with_hit = Mode((j, *ours.closed), ours.sticking, ours.sliding)
    return ImpactEvent(with_hit, j, rubs, wrong=wrong)


def after_event(motion: Motion, event: ImpactEvent, q: Array, v: Array, t: float) -> ImpactResult:
    """What the law makes of rows of states before an event."""
    model, mode = motion.model, event.mode
    if not mode.closed:
        return ImpactResult(v, np.zeros((len(q), model.nc)), np.zeros((len(q), model.nt)))
    times = np.full(len(q), t)
    if event.rubs is not None and event.hit is not None:
        e = 0.0 if event.lands else float(motion.flow.restitution[event.hit])
        return _with_friction(model, (event.hit, event.rubs), e, q, v, times)
    wanted = -condition_rates(model, mode, q, v, times)
    if event.hit is not None:
        wanted[:, 0] *= 1 + float(motion.flow.restitution[event.hit])
    change, lam = answers(model.mass(q, times), conditions(model, mode, q, times), wanted)
    return ImpactResult(v + change, *spread(model, mode, lam)[:2])


def _with_friction(
    model: Model, contact: tuple[int, int], e: float, q: Array, v: Array, t: Array
) -> ImpactResult:
    """One hit with friction, after Poisson: surface and tangent ``contact``."""
    j, k = contact
    directions = conditions(model, Mode((j,), (k,)), q, t).B[:, :2]
    pushed = model.responses(q, directions, t)
    rates = np.stack([-model.gap_rates(q, v, t)[:, j], model.slide_rates(q, v, t)[:, k]], axis=1)
    mu = float(model.friction[k])
    found = [impulses(r, A, mu, e) for r, A in zip(rates, directions @ pushed, strict=True)]
    lam = np.array([[f.normal, f.tangential] for f in found])
    normal, tangential = np.zeros((len(q), model.nc)), np.zeros((len(q), model.nt))
    normal[:, j], tangential[:, k] = lam.T
    return ImpactResult(v + (pushed @ lam[..., None])[..., 0], normal, tangential, found[0].course)
