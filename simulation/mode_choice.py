"""Which mode a motion takes on: the complementarity conditions of a few contacts and rails, tried
one combination after the other.

A closed contact pushes or its gap opens; what sticks is held by its friction or begins to slide
against it.  The same conditions hold between accelerations and forces, and between rates and
impulses of a plastic impact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from dmoc.base.errors import SimulationError
from dmoc.base.records import record
from dmoc.base.tolerances import DEPENDENT, SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.model import Model
from dmoc.motion.friction import FRICTION, STICK, sliding_with
from dmoc.simulation.contact_modes import borne
from dmoc.simulation.friction_at import with_friction
from dmoc.simulation.integrator import Integrator
from dmoc.simulation.tolerances import Tolerances

# Combinations that may be tried for one choice.
MOST_COMBINATIONS = 20_000
# Gaps behind surfaces with ends up to which these are met, in what is zero of them.
BEHIND = 1e4
OPEN = 2  # beside the signs 0, 1 and -1 of friction: a contact that opens
SMOOTH = 3  # a contact that is closed without friction


@record(frozen=True, eq=False)
class Setting:
    """The setting of a simulation: model, coefficients of restitution (nc,), step size, the models
    of the phases to come where parameters change, and since when they are what they are."""

    model: Model
    restitution: Array
    h: float
    later: tuple[Model, ...] = ()
    since: float = 0.0

    def following(self, time: float) -> Setting:
        """The setting of the next phase, which begins at a time."""
        model, *later = self.later
        model = model.gripping(self.model.gripped)
        return replace(self, model=model, later=tuple(later), since=time)

    @cached_property
    def integrator(self) -> Integrator:
        """The integrator of the model, for motions of the size 1 and without a limit of time."""
        model = self.model
        made = Integrator(model.kernels, model.par, np.ones(2 * model.nq + 1), lambda: None)
        strong = zip(model.contacts.of_strong, model.strength[0].tolist(), strict=True)
        made.grip(model.gripped, [own for own in strong if own[0][0] in model.gripped])
        return made

    def without(self, place: int) -> Setting:
        """The setting in which the grip of a place has let go."""
        model, contacts = self.model, self.model.contacts
        (grip,) = contacts.grasped(contacts.named([place]))
        own = contacts.places(grip)
        kept = tuple(j for j in model.gripped if model.kernels.surfaces[j] not in own)
        return replace(self, model=model.gripping(kept))

    def whole(self, mode: Mode) -> Mode:
        """A mode with the grips that are closed."""
        gripped = self.model.gripped
        return replace(mode, closed=(*mode.closed, *gripped)) if gripped else mode


@record(frozen=True, eq=False)
class Place:
    """A moment of a simulation: time, state (q | v), inputs, and what counts as zero."""

    t: float
    y: Array
    u: Array
    small: Tolerances


@dataclass(frozen=True)
class Hints:
    """Contacts that have just reached a limit of the mode: surfaces that open, tangents that begin
    to slide."""

    opening: tuple[int, ...] = ()
    slipping: tuple[tuple[int, int], ...] = ()


Trial = Callable[[Mode, tuple[int, ...]], bool]


def touched(model: Model, at: Place) -> list[int]:
    """Surfaces that a state touches without a rate, which are no grips."""
    q, v = at.y[: model.nq], at.y[model.nq : 2 * model.nq]
    near = np.abs(model.gaps(q, at.t)) <= at.small.gap
    still = np.abs(model.gap_rates(q, v, at.t)) <= at.small.rate
    return [int(j) for j in np.flatnonzero(near & still & there(model, at))]


def there(model: Model, at: Place) -> NDArray[np.bool_]:
    """Surfaces that are where a state is, and does not slip off their ends nor lie far behind
    one that has ends, shape (nc,); no grips."""
    if not model.ends:
        return ~model.contacts.pull
    q, v = at.y[: model.nq], at.y[model.nq : 2 * model.nq]
    within, rates = model.within(q, at.t), model.within_rates(q, v, at.t)
    at_end = (np.abs(within) <= at.small.within) & (rates >= -at.small.outwards)
    met = model.gaps(q, at.t) <= BEHIND * at.small.gap
    met[[j for j in range(model.nc) if j not in model.ends]] = True
    return np.asarray(((within > at.small.within) | at_end) & met & ~model.contacts.pull)


def mode_at(setting: Setting, at: Place, hints: Hints) -> Mode:
    """The mode that a motion goes on in.  A contact that slides without getting anywhere sticks,
    if there are forces that hold it (:mod:`dmoc.simulation.contact_modes`).

    Raises
    ------
    SimulationError
        If none obeys the laws of contact and friction.
    """
    integrator, nq = setting.integrator, setting.model.nq
    on = touched(setting.model, at)
    q, v, t = at.y[None, :nq], at.y[None, nq : 2 * nq], np.array([at.t])
    model = with_friction(setting.model, at.y[None], at.u[None], t, on)
    bends = model.gap_accelerations(q, v, t)[0], model.slide_accelerations(q, v, t)[0]
    slopes = model.gap_slopes(q, t)[0, :, :-1], model.tangent_slopes(q, t)[0, :, :-1]
    sigma = model.slide_rates(q, v, t)[0]
    others: dict[Mode, Array] = {}  # by other forces than the smallest

    def holds(mode: Mode, opened: tuple[int, ...]) -> bool:
        reaction = integrator.reaction(mode, at.y[None], at.u[None], t)
        gap_bend, skid = (
            s @ reaction.acceleration[0] + b for s, b in zip(slopes, bends, strict=True)
        )
        skids = conditions_of(model, mode, joints=False).forward(skid)
        if not (
            (gap_bend[list(opened)] <= at.small.bend[list(opened)]).all()
            and all(
                forward >= -at.small.skid[k]
                for k, forward in skids.items()
                if abs(sigma[k]) <= at.small.slide[k]
            )
        ):
            return False
        slack = at.small.force, at.small.hold
        if is_borne(model, mode, (reaction.normal[0], reaction.tangential[0]), *slack):
            return True
        other = borne(model, mode, reaction, q, t)
        if other is not reaction and is_borne(
            model, mode, (other.normal[0], other.tangential[0]), *slack
        ):
            others[mode] = reaction.acceleration[0]
        return False

    mode = first_mode(model, on, sigma, at.small.slide, hints, holds, rails=True)
    if others:
        mode = _at_rest(setting, at, mode, others)
    if mode is None and not np.isfinite(model.acceleration(q, v, at.u[None], t)).all():
        raise SimulationError(
            f"the mass matrix or a force at t = {at.t:.6g} s is singular or not finite: check the "
            "parameters, and stop before the motion gets there."
        )
    if mode is None:
        check_driven(model, at, on)
        _check_sliding(model, at, on)
        names = ", ".join(repr(model.kernels.surfaces[j]) for j in on) or "the rails"
        raise SimulationError(
            f"no state of contact and friction of {names} at t = {at.t:.6g} s obeys the laws of "
            "Coulomb (Painleve's paradox): lower the friction, or stop before it."
        )
    return mode


def _check_sliding(model: Model, at: Place, on: Sequence[int]) -> None:
    """Refuse sliding that lasts in two tangential directions."""
    for name in model.contacts.named(j for j in on if j in model.contacts.in_space):
        raise SimulationError(
            f"{name!r} stays closed from t = {at.t:.6g} s on and slides, and sliding that lasts "
            "may turn in its two tangential directions: stop before it, give it enough friction to "
            "stick, or give its tangent one direction."
        )


def check_driven(model: Model, at: Place, on: Sequence[int]) -> None:
    """Refuse surfaces that a state meets, and gets through by what the joints do alone.

    Raises
    ------
    SimulationError
        If no force or impulse of such a surface has an effect.
    """
    q, t = at.y[: model.nq], at.t
    for j in on if model.nj else ():
        n = model.gap_slopes(q, t)[j, :-1]
        alone = float(n @ solved(model.mass(q, t), n))
        if not float(n @ model.responses(q, n, t)) > DEPENDENT**2 * alone:
            raise SimulationError(
                f"the constraints ({', '.join(model.kernels.joints)}) drive the motion through "
                f"surface {model.kernels.surfaces[j]!r} at t = {t:.6g} s, and no contact stops "
                "what constraints drive: change them, or stop before it."
            )


def _at_rest(setting: Setting, at: Place, mode: Mode | None, others: dict[Mode, Array]) -> Mode:
    """The first mode that is held if a motion goes on as in the one that was chosen, or if none
    was."""
    first, acceleration = next(iter(others.items()))
    if mode is None:
        return first
    nq, t = setting.model.nq, np.array([at.t])
    M, F = setting.model.equations(at.y[:nq], at.y[nq : 2 * nq], at.u, at.t)
    off = setting.integrator.reaction(mode, at.y[None], at.u[None], t).acceleration[0]
    off = off - acceleration
    return first if off @ M @ off <= SAME**2 * (F @ solved(M, F)) else mode


def is_borne(
    model: Model, mode: Mode, forces: tuple[Array, Array], small: Array, slack: Array
) -> bool:
    """Whether no contact pulls and all that sticks is held."""
    normal, tangential = forces
    if not ((normal >= -small) | model.contacts.pull).all():
        return False
    bears = model.bearing(normal).reshape(model.nt) if mode.sticking else slack
    needs = model.contacts.needed(tangential)
    return all(needs[k] <= bears[k] + slack[k] for k in mode.sticking)


def first_mode(
    model: Model, on: list[int], sigma: Array, small: Array, hints: Hints, holds: Trial,
    rails: bool,
) -> Mode | None:  # fmt: skip
    """The first combination that holds; those of the hints come first, then what sticks."""
    at = model.supports
    rubs = [k for k, j in enumerate(at) if rails and j == RAIL and model.has_friction[k]]
    options = [_options(model, j, sigma, small, hints) for j in on]
    options += [_signs(k, sigma, small, hints) for k in rubs]
    keys = [*[model.rough.get(j, RAIL) for j in on], *rubs]
    if math.prod(map(len, options)) > MOST_COMBINATIONS:
        raise SimulationError(
            f"{len(options)} contacts and rails are touched at once: these are too many states of "
            "contact and friction to choose from, stop before it."
        )
    for states in product(*options):
        closed = tuple(j for j, s in zip(on, states, strict=False) if s != OPEN)
        rubbing = [
            (direction, s)
            for k, s in zip(keys, states, strict=True)
            if s not in (OPEN, SMOOTH)
            for direction in model.contacts.directions(k)
        ]
        mode = Mode.in_order(closed, rubbing)
        if holds(mode, tuple(j for j in on if j not in closed)):
            return mode
    return None


def _options(model: Model, j: int, sigma: Array, small: Array, hints: Hints) -> tuple[int, ...]:
    """States that a touched contact may take; one with two tangential directions does not slide."""
    tangent, closed = model.rough.get(j), tuple[int, ...]((SMOOTH,))
    if j in model.contacts.in_space and tangent is not None:
        along = model.contacts.directions(tangent)
        closed = (STICK,) if (np.abs(sigma) <= small)[along].all() else ()
    elif tangent is not None:
        closed = _signs(tangent, sigma, small, hints)
    return (OPEN, *closed) if j in hints.opening else (*closed, OPEN)


def _signs(k: int, sigma: Array, small: Array, hints: Hints) -> tuple[int, ...]:
    """Friction that a tangent may have."""
    if abs(sigma[k]) > small[k]:
        return (sliding_with(sigma[k]),)
    first = [s for tangent, s in hints.slipping if tangent == k]
    return tuple(dict.fromkeys([*first, *FRICTION.values()]))
