"""Impacts in a simulation with lasting contact and friction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dmoc.base.errors import SimulationError
from dmoc.base.records import record
from dmoc.base.tolerances import ROUNDING, SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contact_forces import unknown_in_impacts
from dmoc.mechanics.contact_mode import FREE, Mode
from dmoc.mechanics.isotropy import coupled
from dmoc.mechanics.model import Model
from dmoc.motion.impact_laws import IMPACT_LAWS, POISSON
from dmoc.simulation.contact_modes import Reaction
from dmoc.simulation.friction_at import check_impact
from dmoc.simulation.hit_coefficients import hit_coefficients, several_by_law
from dmoc.simulation.impact_course import Blow, blow_on
from dmoc.simulation.impact_orders import undecided_of
from dmoc.simulation.mode_choice import Place, Setting, there
from dmoc.simulation.simultaneous_impacts import NOISE, simultaneous
from dmoc.simulation.single_hit import SingleHit, single_hit

# A rebound whose flight, with all that follow it, takes less than this share of a step is none.
DYING = 1e-4
MOST_IN_TURN = 20  # impacts on several surfaces after the first one of an order


@record(frozen=True, eq=False)
class Struck:
    """Velocity after impacts (nq,) and their impulses, in their order: of surfaces, with those of
    their tangents; where the order decides, the velocity with one of them hit first."""

    velocity: Array
    impulses: tuple[tuple[int, float, Mapping[int, float]], ...]
    orders: tuple[tuple[int, Array], ...] = ()


def struck(model: Model, at: Place, reaction: Reaction, restitution: Array, h: float) -> Struck:
    """The impacts on the surfaces that a state touches and approaches; closed contacts that carry
    a force in its reaction stay closed through them.

    Raises
    ------
    SimulationError
        If friction takes part that is not known in an impact, or if the law of impact has no
        outcome.
    """
    nq, surfaces = model.nq, model.kernels.surfaces
    q, v = at.y[:nq], at.y[nq : 2 * nq]
    rates = model.gap_rates(q, v, at.t)
    on = [int(j) for j in np.flatnonzero((model.gaps(q, at.t) >= -at.small.gap) & there(model, at))]
    if unknown := unknown_in_impacts(model, (model.rough[j] for j in on if j in model.rough)):
        raise SimulationError(
            f"{unknown}: there is one at t = {at.t:.6g} s; stop before it, or give the surface "
            "friction without them."
        )
    check_impact(model, q, at.t, on)
    hit = [j for j in on if rates[j] > at.small.rate[j]]
    e, dies = _effective(model, at, reaction, restitution, h)
    if (j := next((j for j in hit if _is_alone(model, j) and not dies[j]), None)) is not None:
        if len(hit) > 1 or not _uncoupled(model, at, j, on):
            raise SimulationError(_beside(model, j, on, at.t))
        return _alone(model, at, j, model.impact_laws[j], float(e[j]))
    rough = [j for j in on if j in model.rough]
    carrying = bool((reaction.normal[0] > at.small.force)[on].any())
    names = ", ".join(repr(surfaces[j]) for j in on)
    if not rough and not carrying:
        by_law = [j for j in on if np.isnan(restitution[j])]
        if by_law and len(hit) == 1 and _uncoupled(model, at, hit[0], on):
            return _alone(model, at, hit[0], None, float(e[hit[0]]))
        if by_law and len(on) > 1:
            raise SimulationError(several_by_law(model, by_law, at.t))
        return _one_by_one(model, at, e)
    if len(hit) == 1 and _uncoupled(model, at, hit[0], on):
        by = POISSON if hit[0] in model.rough else None
        return _alone(model, at, hit[0], by, float(e[hit[0]]))
    for name in model.contacts.named(j for j in rough if j in model.contacts.in_space):
        raise SimulationError(
            f"{names} touch at t = {at.t:.6g} s in an impact, and the friction of {name!r} has two "
            "directions, in which sliding may turn: stop before it, or give its tangent one "
            "direction."
        )
    if (outcome := _at_once(model, at, on, hit, e)) is not None:
        return outcome
    if not rough:
        return _one_by_one(model, at, e)
    raise SimulationError(
        f"the impact on {names} at t = {at.t:.6g} s has no outcome that obeys the laws of impact "
        "and friction: give them one restitution, or lower the friction."
    )


def _at_once(model: Model, at: Place, on: list[int], hit: list[int], e: Array) -> Struck | None:
    """Impacts on several touched surfaces, some of them with friction or under load: all together,
    unless all orders in which they may be hit come to the same; None if the laws have no outcome
    without a gain of energy."""
    M, blow = model.mass(at.y[: model.nq], at.t), blow_on(model, at, on, e)
    if blow is None or _gains(model, at, blow):
        return None
    ways = [(j, _first(model, at, j, (on, hit), e)) for j in hit if len(hit) > 1]
    orders = tuple((j, way.velocity) for j, way in ways if way is not None)
    change = blow.velocity - at.y[model.nq : 2 * model.nq]
    apart = [v - orders[0][1] for _, v in orders]
    if orders and all(off @ M @ off <= SAME**2 * (change @ M @ change) for off in apart):
        blow, orders = next(way for _, way in ways if way is not None), ()
    return Struck(blow.velocity, tuple(_felt(model, blow, on, model.rough)), orders)


def _first(
    model: Model, at: Place, j: int, among: tuple[list[int], list[int]], e: Array
) -> Blow | None:
    """The impacts on touched surfaces of which some are hit, one of these before the others meet;
    None if they come to no end, or to no outcome without a gain of energy."""
    (on, hit), nq = among, model.nq
    whole = blow_on(model, at, [k for k in on if k == j or k not in hit], e)
    for _ in range(MOST_IN_TURN):
        if whole is None or _gains(model, at, whole):
            return None
        y = np.concatenate([at.y[:nq], whole.velocity])
        if not (model.gap_rates(y[:nq], y[nq:], at.t) > at.small.rate)[on].any():
            return whole
        then = blow_on(model, replace(at, y=y), on, e)
        if then is None:
            return None
        both = whole.normal + then.normal, whole.tangential + then.tangential
        whole = Blow(then.velocity, *both)
    return None


def _struck_by(model: Model, hit: SingleHit, on: list[int]) -> Struck:
    blow = Blow(hit.velocity, hit.normal, hit.tangential)
    return Struck(blow.velocity, tuple(_felt(model, blow, on, model.rubs_in_hits)))


def _felt(
    model: Model, blow: Blow, on: list[int], tangent: dict[int, int]
) -> Iterator[tuple[int, float, Mapping[int, float]]]:
    """Surfaces that take an impulse, with it and with those of their friction."""
    for j in on:
        if blow.normal[j] > SAME * blow.normal.max():
            along = model.contacts.directions(tangent[j]) if j in tangent else []
            yield j, float(blow.normal[j]), {k: float(blow.tangential[k]) for k in along}


def _effective(
    model: Model, at: Place, reaction: Reaction, restitution: Array, h: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Coefficients of restitution, zero where the bounces that would follow die away at once, and
    where that is."""
    nq = model.nq
    q, v, t = at.y[None, :nq], at.y[None, nq : 2 * nq], np.array([at.t])
    slopes = model.gap_slopes(q, t)[0, :, :-1]
    pressed = slopes @ reaction.acceleration[0] + model.gap_accelerations(q, v, t)[0]
    rates = model.gap_rates(q, v, t)[0]
    restitution = hit_coefficients(model, restitution, (q[0], v[0], at.t), rates > at.small.rate)
    rebound = 2 * restitution * np.maximum(rates, 0.0)
    dies = (pressed > 0) & (rebound < DYING * h * (1 - restitution) * pressed)
    return np.where(dies, 0.0, restitution), dies


def dying(setting: Setting, place: Place, mode: Mode, before: Array) -> list[int]:
    """Touched surfaces that an impact has opened, from rates before it, and whose flight back, with
    those of the impacts that follow if each keeps as much of the rates, is none: what clatters
    comes to rest."""
    model, nq, t = setting.model, setting.model.nq, np.array([place.t])
    q, v = place.y[:nq], place.y[nq : 2 * nq]
    on = np.flatnonzero((model.gaps(q, place.t) >= -place.small.gap) & there(model, place))
    slopes, rates = model.gap_slopes(q, place.t)[on, :-1], model.gap_rates(q, v, place.t)[on]
    pushed = setting.integrator.reaction(mode, place.y[None], place.u[None], t).acceleration[0]
    back = slopes @ pushed + model.gap_accelerations(q, v, place.t)[on]
    returns, low = (rates < 0) & (back > 0), rates**2 < 2 * back * place.small.gap[on]
    soon = 2 * -rates < DYING * setting.h * back  # if nothing is kept
    if (returns & soon).any():
        across = np.sqrt(np.einsum("ji,ij->j", slopes, model.responses(q, slopes, place.t)))
        kept = (-rates / across).max() / (before[on] / across).max()
        soon = 2 * -rates < DYING * setting.h * (1 - kept) * back
    return [j for j in on[returns & (soon | low)].tolist() if j not in mode.closed]


def _uncoupled(model: Model, at: Place, j: int, on: list[int]) -> bool:
    """Whether an impact on one surface leaves the others that are touched alone."""
    q = at.y[: model.nq]
    others = [k for k in on if k != j]
    if not others:
        return True
    rubs = tuple(k for k, s in enumerate(model.supports) if s in on)
    met = conditions_of(model, Mode((j, *others), rubs), joints=False)
    c = met.slopes(model, q, at.t)[:, :-1]
    A = c @ model.responses(q, c, at.t)
    at_j = np.array([True, *[False] * len(others), *[model.supports[k] == j for k in rubs]])
    size = np.sqrt(np.outer(np.diag(A), np.diag(A)))
    return bool((np.abs(A)[np.ix_(at_j, ~at_j)] <= ROUNDING * size[np.ix_(at_j, ~at_j)]).all())


def _one_by_one(model: Model, at: Place, e: Array) -> Struck:
    """Impacts on surfaces without friction, one after the other, or at once where all are
    plastic."""
    q, v = at.y[: model.nq], at.y[model.nq : 2 * model.nq]
    normals, rates = model.gap_slopes(q, at.t)[:, :-1], model.gap_rates(q, v, at.t)
    changes = model.responses(q, normals, at.t)
    small, gaps = at.small, np.where(there(model, at), model.gaps(q, at.t), -np.inf)
    impacts = simultaneous(gaps, small.gap, rates, small.rate / NOISE, normals @ changes, e, 0.0)
    if impacts is None:
        raise SimulationError(
            f"the impacts at t = {at.t:.6g} s come to no end: bodies that meet so cannot be "
            "simulated, change the start or give the surfaces a restitution below 1."
        )
    moment = undecided_of(model, (q, v, at.t), impacts)
    impulses = tuple[tuple[int, float, Mapping[int, float]], ...](
        (j, impulse, {}) for j, impulse in impacts.impulses
    )
    return Struck(moment.taken, impulses, moment.orders)


def _is_alone(model: Model, j: int) -> bool:
    """Whether a surface is hit by a law of one contact."""
    return j in model.impact_laws and IMPACT_LAWS[model.impact_laws[j]].alone


def _alone(model: Model, at: Place, j: int, by: str | None, e: float) -> Struck:
    """An impact on one surface, by a law where it has a tangential impulse."""
    q, v = at.y[: model.nq], at.y[model.nq : 2 * model.nq]
    if by is not None:
        return _by_law(model, (q, v, at.t), j, by, e)
    normal = -model.gap_slopes(q, at.t)[j, :-1]
    pushed = model.responses(q, normal, at.t)
    impulse = (1 + e) * float(model.gap_rates(q, v, at.t)[j]) / float(normal @ pushed)
    return Struck(v + impulse * pushed, ((j, impulse, {}),))


def _by_law(model: Model, state: tuple[Array, Array, float], j: int, by: str, e: float) -> Struck:
    """An impact with a tangential impulse on one surface in a state (q, v, t)."""
    if reason := coupled(model, j, state[0], state[2]):
        raise SimulationError(f"{reason}: there is one at t = {state[2]:.6g} s.")
    hit = single_hit(model, (j, model.rubs_in_hits[j]), FREE, state, e, by)
    if not hit.way.normal > 0:
        raise SimulationError(
            f"{model.kernels.surfaces[j]!r} would have to pull in its hit at t = {state[2]:.6g} s "
            f"by {IMPACT_LAWS[by].name}: give it friction, which limits the tangential impulse."
        )
    return _struck_by(model, hit, [j])


def _beside(model: Model, j: int, on: list[int], t: float) -> str:
    """Why a hit by a law of one contact is refused beside others."""
    names = " and ".join(repr(model.kernels.surfaces[k]) for k in on if k != j)
    return (
        f"{model.kernels.surfaces[j]!r}, whose hits obey {IMPACT_LAWS[model.impact_laws[j]].name}, "
        f"is hit at t = {t:.6g} s while {names} touches: the outcome of such an impact is not "
        "known to be unique; have only one of them touch then, or give it another law of impact."
    )


def _gains(model: Model, at: Place, blow: Blow) -> bool:
    """Whether an impact would raise the energy, where nothing that is touched moves by itself."""
    q, v = at.y[: model.nq], at.y[model.nq : 2 * model.nq]
    if model.kernels.manifest.explicit_time:
        return False
    M = model.mass(q, at.t)
    return bool(blow.velocity @ M @ blow.velocity > (1 + SAME) * (v @ M @ v))
