"""One hit with friction where other contacts hold: Poisson's law with what they let move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import columns
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.simulation.contact_modes import (
    Reaction,
    answers,
    borne,
    conditions,
    spread,
)
from dmoc.simulation.poisson import Impulses, impulses


@dataclass(frozen=True)
class SingleHit:
    """Velocity after the hit (nq,), impulses of all surfaces (nc,) and tangents (nt,), the way
    through it, and contacts that it does not hold: that would have to pull, or slip."""

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
) -> SingleHit:
    """The hit of a surface and its tangent in a state (q, v, t)."""
    (j, k), (q, v, t) = contact, state
    rows, times, mu = q[None], np.array([t]), float(model.friction[k])
    D = conditions(model, Mode((j,), (k,)), rows, times).B[:, :2]
    pushed, beside = _held(model, holding, rows, times, D)
    rates = np.array([-model.gap_rates(q, v, t)[j], model.slide_rates(q, v, t)[k]])
    response = D[0] @ pushed
    free = D[0, 1] @ columns(model.mass(rows, times), D)[0][:, 1]
    if response[1, 1] <= SAME * free:  # what holds leaves it nothing to slide along
        response[1], response[:, 1] = 0.0, 0.0
    way = impulses(rates, response, mu, e)
    lam = np.array([way.normal, way.tangential])
    both = Reaction(v[None], *(lam[None] @ part for part in beside))
    both = borne(model, holding, both, rows, times)
    normal, tangential = both.normal[0], both.tangential[0]
    normal[j], tangential[k] = lam
    unheld = _unheld(model, holding, (rows, times), beside, way.slopes(response, mu))
    return SingleHit(v + pushed @ lam, normal, tangential, way, unheld)


def _held(
    model: Model, holding: Mode, q: Array, t: Array, D: Array
) -> tuple[Array, tuple[Array, Array, Array]]:
    """Changes of the velocity (nq, 2) by units of impulses along D, and the impulses of all
    surfaces, tangents and joints beside them, two rows each."""
    M = model.mass(q, t)
    free = columns(M, D)[0].T
    c = conditions(model, holding, q, t)
    if not c.C.shape[1]:
        nothing = np.zeros((2, model.nc)), np.zeros((2, model.nt)), np.zeros((2, model.nj))
        return free.T, nothing
    twice = [np.repeat(part, 2, axis=0) for part in (M, c.C, c.B)]
    wanted = -np.einsum("nmi,ni->nm", twice[1], free)
    change, lam = answers(twice[0], type(c)(*twice[1:]), wanted)
    return (free + change).T, spread(model, holding, lam)


def _unheld(
    model: Model,
    holding: Mode,
    at: tuple[Array, Array],
    beside: tuple[Array, Array, Array],
    slopes: tuple[float, ...],
) -> tuple[str, ...]:
    """Contacts that pull or slip in one of the regimes, in which all impulses grow in one
    proportion."""
    names = list[str]()
    for slope in slopes if holding.closed else ():
        rates = [np.array([[1.0, slope]]) @ part for part in beside]
        grown = borne(model, holding, Reaction(np.zeros((1, model.nq)), *rates), *at)
        least = SAME * float(np.abs(grown.normal).max(initial=1.0))  # beside a unit of the hit
        held = model.bearing(grown.normal)[0] - np.abs(grown.tangential[0])
        names += [model.kernels.surfaces[j] for j in holding.closed if grown.normal[0, j] < -least]
        names += [model.kernels.tangents[k] for k in holding.sticking if held[k] < -least]
    return tuple(dict.fromkeys(names))
