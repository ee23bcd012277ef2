"""One hit with friction beside contacts whose friction does not change: its law with what they let
move."""

from __future__ import annotations

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contact_forces import held_responses
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.simulation.contact_modes import Reaction, borne
from dmoc.simulation.impact_laws.course import Coefficients, Impulses
from dmoc.simulation.impact_laws.laws import LAWS


@record(frozen=True, eq=False)
class SingleHit:
    """Velocity after the hit (nq,), impulses of all surfaces (nc,) and tangents (nt,), the way
    through it, and contacts beside it that do not stay as they are asked to: that would have to
    pull or to slip, or stop sliding."""

    velocity: Array
    normal: Array
    tangential: Array
    way: Impulses
    unheld: tuple[str, ...] = ()


def single_hit(
    model: Model,
    contact: tuple[int, int],
    holding: Mode,
    state: tuple[Array, Array, float],
    e: float,
    law: str,
) -> SingleHit:
    """The hit of a surface and its tangent in a state (q, v, t) by a law of impact; where this has
    two directions, the hit is in the plane of the normal and the sliding velocity."""
    (j, k), (q, v, t) = contact, state
    model = model.in_impact_at(q, t)
    rows, times, mu = q[None], np.array([t]), float(model.hit_friction[k])
    coefficients = Coefficients(mu, e, float(model.tangential_restitution[k]))
    along = model.contacts.directions(k)
    slides = model.slide_rates(q, v, t)[along]
    way_of = _direction(slides)
    D = np.stack([-model.gap_slopes(q, t)[j, :-1], way_of @ model.tangent_slopes(q, t)[along, :-1]])
    pushed, normal, tangential = held_responses(model, holding, q, D, t)
    beside = Reaction(pushed.T, normal, tangential, np.zeros((2, model.nj)))
    rates = np.array([-model.gap_rates(q, v, t)[j], way_of @ slides])
    response = D @ pushed
    free = response[1, 1] if holding.free else D[1] @ model.responses(q, D[1], t)
    if response[1, 1] <= SAME * free:  # what holds leaves it nothing to slide along
        response[1], response[:, 1] = 0.0, 0.0
    way = LAWS[law](rates, response, coefficients)
    lam = np.array([way.normal, way.tangential])
    both = borne(model, holding, _grown(beside, lam), rows, times)
    normal, tangential = both.normal[0], both.tangential[0]
    normal[j], tangential[along] = lam[0], lam[1] * way_of
    passed = v + np.array([(0.0, 0.0), *way.stops, lam]) @ pushed.T
    slides = model.slide_rates(np.repeat(rows, len(passed), 0), passed, np.full(len(passed), t))
    unheld = _unheld(model, holding, (rows, times), beside, way.slopes(response, mu))
    unheld += _stopped(model, holding, slides)
    return SingleHit(passed[-1], normal, tangential, way, tuple(dict.fromkeys(unheld)))


def _direction(slides: Array) -> Array:
    """The unit vector of the tangent along which a contact slides: of one direction, this, whatever
    the sign."""
    speed = float(np.hypot(*slides)) if len(slides) > 1 else 0.0
    return slides / speed if speed > 0 else np.eye(len(slides))[0]


def _grown(beside: Reaction, lam: Array) -> Reaction:
    """The reaction to impulses along normal and tangent (2,), from the reactions to units of them,
    in two rows."""
    parts = beside.acceleration, beside.normal, beside.tangential, beside.joint
    return Reaction(*(lam[None] @ part for part in parts))


def _unheld(
    model: Model,
    holding: Mode,
    at: tuple[Array, Array],
    beside: Reaction,
    slopes: tuple[float, ...],
) -> list[str]:
    """Contacts that pull or slip in one of its states, in which all impulses grow in one
    proportion."""
    names = list[str]()
    for slope in slopes if holding.closed else ():
        grown = borne(model, holding, _grown(beside, np.array([1.0, slope])), *at)
        least = SAME * float(np.abs(grown.normal).max(initial=1.0))  # beside a unit of the hit
        bears = model.bearing(grown.normal)[0] - np.abs(grown.tangential[0])
        names += [model.kernels.surfaces[j] for j in holding.closed if grown.normal[0, j] < -least]
        names += [model.kernels.tangents[k] for k in holding.sticking if bears[k] < -least]
    return names


def _stopped(model: Model, holding: Mode, slides: Array) -> list[str]:
    """Contacts whose sliding velocities, rows before the hit, where its own sliding stops and after
    it, do not keep their direction."""
    return [
        model.kernels.tangents[k]
        for k, forward in conditions_of(model, holding, joints=False).forward(slides).items()
        if forward.min() < -SAME * float(np.abs(forward).max())
    ]
