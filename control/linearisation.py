"""A motion linearised along itself: between events by the derivatives of its mode's accelerations,
at events by saltation matrices (:eq:`saltation`), for all kinds of events.

A deviation is one of y = (q | v).  Where contacts are closed, something sticks or joints hold, it
keeps their conditions; what does not is projected to where they hold, the shortest way by the
masses.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dmoc.base.errors import SimulationError
from dmoc.base.records import record
from dmoc.base.tolerances import TINY
from dmoc.check.checked_motion import Motion, put
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved
from dmoc.mechanics.contact_mode import FREE, Mode
from dmoc.motion.friction import sticks
from dmoc.simulation.contact_modes import limits
from dmoc.simulation.flow import Steps

# Change of a state, in sizes, of central differences, which are then right to about 1e-10.
CHANGED = 1e-5
PARTS = 4  # of a step: intervals in which the linearised motion is integrated
GAUSS = 0.5 - np.sqrt(3) / 6, 0.5 + np.sqrt(3) / 6
# Rate of a gap before a hit, and of what ends a mode, in sizes, below which its time is not
# differentiable.
GRAZES = 1e-6
# Terms of the series of exponentials of matrices of a norm up to SHORT: an error of 1e-16.
TERMS, SHORT, LARGEST = 13, 0.5, 1e9
# Of a friction force: one that is further from what its contact bears has not given way, an input
# has jumped.
EDGE = 1e-2


@record(frozen=True, eq=False)
class LinearPhase:
    """Intervals of a phase, m of them: their times (m + 1,), the motion (m + 1, 2 nq), the inputs
    in their middles (m, nu), and A (m, 2, n, n) and B (m, 2, n, nu) of dy' = A dy + B du at the two
    points of Gauss of each, n = 2 nq."""

    t: Array
    y: Array
    u: Array
    A: Array
    B: Array

    @property
    def h(self) -> Array:
        """Durations of the intervals in seconds, shape (m,)."""
        return np.diff(self.t)

    def transitions(self) -> Array:
        """Derivatives (m, n, n) of the states after the intervals by those before them."""
        return exponentials(magnus(self.A, self.h))


def magnus(A: Array, h: Array) -> Array:
    """The exponents (m, n, n) of the transition matrices of intervals of linear equations, from
    their matrices at the points of Gauss (m, 2, n, n), with an error of h^5 [1]_.

    References
    ----------
    .. [1] S. Blanes, F. Casas, J. A. Oteo, J. Ros, *The Magnus expansion and some of its
       applications*, Physics Reports 470 (2009) 151-238.
    """
    first, second = A[:, 0], A[:, 1]
    h = h[:, None, None]
    twist = second @ first - first @ second
    return np.asarray(h / 2 * (first + second) + np.sqrt(3) / 12 * h**2 * twist)


def exponentials(X: Array) -> Array:
    """The exponentials of matrices (m, n, n) side by side, by their series, scaled and squared."""
    largest = float(np.abs(X).sum(axis=-1).max(initial=0.0))
    if not largest < LARGEST:
        return np.full(X.shape, np.nan)
    squared = max(0, int(np.ceil(np.log2(max(largest, TINY) / SHORT))))
    X = X / 2.0**squared
    term = result = np.broadcast_to(np.eye(X.shape[-1]), X.shape)
    for k in range(1, TERMS + 1):
        term = term @ X / k
        result = result + term
    for _ in range(squared):
        result = result @ result
    return np.asarray(result)


def state_sizes(motion: Motion) -> Array:
    """Sizes of a state (2 nq,)."""
    return np.concatenate([motion.sizes.q, motion.sizes.v])


def linear_phase(motion: Motion, i: int) -> LinearPhase:
    """The linearised motion along phase i, which has steps."""
    phase, mode, steps = motion.trajectory.phases[i], motion.modes[i], motion.steps[i]
    shares = np.arange(PARTS + 1) / PARTS
    y0, anchors = put(motion, mode, np.hstack([phase.q[:-1], phase.v[:-1]]), phase.t[:-1])
    count = len(y0)
    places = np.concatenate([shares[:-1] + c / PARTS for c in (0, *GAUSS)])
    rows = states_after(motion, mode, (y0, anchors), steps, places)
    t = steps.t[:, None] + places * steps.h[:, None]
    u = np.stack([steps.inputs(float(s)) for s in places], axis=1)
    at, inputs = (x[:, PARTS:].reshape(2 * count * PARTS, x.shape[-1]) for x in (rows, u))
    points = motion, mode, at, inputs, t[:, PARTS:].ravel()
    last, _ = put(motion, mode, np.hstack([phase.q[-1:], phase.v[-1:]]), phase.t[-1:])
    return LinearPhase(
        np.append(t[:, :PARTS].ravel(), phase.t[-1]),
        np.vstack([rows[:, :PARTS].reshape(count * PARTS, -1), last]),
        np.stack([steps.inputs(float(s)) for s in shares[:-1] + 0.5 / PARTS], axis=1).reshape(
            count * PARTS, motion.model.nu
        ),
        *(_by_interval(f(*points), count) for f in (state_slopes, input_slopes)),
    )


def _by_interval(x: Array, steps: int) -> Array:
    """Matrices at the points of Gauss, shape (m, 2, ...), of those that are sorted by the steps,
    the points, the intervals."""
    x = x.reshape(steps, 2, PARTS, *x.shape[1:])
    return np.swapaxes(x, 1, 2).reshape(steps * PARTS, 2, *x.shape[3:])


def states_after(
    motion: Motion, mode: Mode, start: tuple[Array, Array], steps: Steps, places: Array
) -> Array:
    """States (N, places, 2 nq) at shares of steps in a mode, from those at their begins and what
    sticks there."""
    y, anchors = (np.repeat(x, len(places), axis=0) for x in start)
    parts = Steps(
        np.repeat(steps.t, len(places)),
        (steps.h[:, None] * places).ravel(),
        np.repeat(steps.u0, len(places), axis=0),
        np.stack([steps.inputs(float(s)) for s in places], axis=1).reshape(len(y), motion.model.nu),
    )
    number = np.arange(len(y))
    motion.flow.advance(y, parts, number, number + 1, None if mode == FREE else mode, anchors)
    return y.reshape(len(steps), len(places), -1)


def state_rates(motion: Motion, mode: Mode, y: Array, u: Array, t: Array) -> Array:
    """The rates (n, 2 nq) of states in a mode."""
    nq, model = motion.model.nq, motion.model
    q, v = (np.ascontiguousarray(part) for part in (y[:, :nq], y[:, nq:]))
    if mode == FREE:
        return np.hstack([v, model.acceleration(q, v, u, t)])
    return np.hstack([v, motion.flow.integrator.reaction(mode, y, u, t).acceleration])


def state_slopes(motion: Motion, mode: Mode, y: Array, u: Array, t: Array) -> Array:
    """Derivatives (rows, n, n) of the rates of states in a mode by the states: those of the model
    where nothing is closed, rubs or is joined, and central differences elsewhere, and at kinks."""
    model, nq = motion.model, motion.model.nq
    if mode == FREE and not model.nj:
        q, v = (np.ascontiguousarray(part) for part in (y[:, :nq], y[:, nq:]))
        A = np.zeros((len(y), 2 * nq, 2 * nq))
        A[:, :nq, nq:] = np.eye(nq)
        R = model.equations_slopes(q, v, u, t, a=model.acceleration(q, v, u, t))
        A[:, nq:] = solved(model.mass(q, t), R)
        if np.isfinite(A).all():
            return A
    return central_differences(
        lambda x: state_rates(motion, mode, x, _like(u, x), _like(t, x)), y, state_sizes(motion)
    )


def input_slopes(motion: Motion, mode: Mode, y: Array, u: Array, t: Array) -> Array:
    """Derivatives of the rates of states (rows, n) by the inputs (rows, nu), at times (rows,),
    shape (rows, n, nu)."""
    model, nq = motion.model, motion.model.nq
    if mode == FREE and not model.nj:
        q, v = (np.ascontiguousarray(part) for part in (y[:, :nq], y[:, nq:]))
        B = np.zeros((len(y), 2 * nq, model.nu))
        B[:, nq:] = solved(model.mass(q, t), model.input_matrix(q, v, u, t))
        return B
    return central_differences(
        lambda x: state_rates(motion, mode, _like(y, x), x, _like(t, x)), u, input_sizes(motion)
    )


def _like(rows: Array, x: Array) -> Array:
    """Rows repeated to as many as there are of others."""
    return np.repeat(rows, len(x) // len(rows), axis=0)


def central_differences(f: Callable[[Array], Array], x: Array, sizes: Array) -> Array:
    """Derivatives (n, m, k) of a function of rows (n, k) with the values (n, m), by central
    differences in sizes (k,)."""
    n, k = x.shape
    if not k:
        return np.zeros((n, f(x).shape[1], 0))
    changes = CHANGED * np.vstack([np.diag(sizes), -np.diag(sizes)])
    values = f(np.ascontiguousarray((x[:, None] + changes).reshape(-1, k)))
    both = values.reshape(n, 2, k, -1)
    return np.swapaxes(both[:, 0] - both[:, 1], 1, 2) / (2 * CHANGED * sizes)


def input_sizes(motion: Motion) -> Array:
    """Sizes of inputs (nu,): the largest in the motion, or what would accelerate as much as its
    forces where one is never used."""
    ends = [np.vstack([s.u0, s.u1]) for s in motion.steps if len(s)]
    largest = np.abs(np.vstack(ends)).max(axis=0)
    needed = np.where(np.isfinite(motion.needed_inputs), motion.needed_inputs, 1.0)
    return np.where(largest > 1e-6 * needed, largest, needed)


def projection(motion: Motion, mode: Mode, y: Array, t: Array) -> Array:
    """Derivatives of states, moved to where the conditions of a mode hold, by states y, shape
    (rows, n), at times (rows,); shape (rows, n, n)."""
    if mode == FREE and not motion.model.nj:
        return np.broadcast_to(np.eye(y.shape[1]), (len(y), y.shape[1], y.shape[1]))
    return central_differences(
        lambda x: put(motion, mode, x, _like(t, x))[0], y, state_sizes(motion)
    )


# Events -------------------------------------------------------------------------------------------


def saltation(motion: Motion, i: int, u: Array) -> Array:
    """The derivative (n, n) of the state after event i, carried back to its planned time, by the
    one before it, carried on to it (:eq:`saltation`), with the inputs u (2, nu) before it and after
    it.

    Raises
    ------
    SimulationError
        If the event grazes.
    """
    p, sizes, n = motion.passages[i], state_sizes(motion), 2 * motion.model.nq
    nq, time = motion.model.nq, np.array([p.c.time])
    before = np.concatenate([p.before.q[-1], p.before.v[-1]])[None]
    later = np.concatenate([p.after.q[0], p.after.v[0]])[None]

    def law(x: Array) -> Array:
        """States (q | v | late) after the law."""
        q, v, late = (np.ascontiguousarray(part) for part in np.split(x, [nq, n], axis=1))
        return np.hstack([q, p.after_law(q, v, late[:, 0]).velocity])

    at = np.hstack([before, [[0.0]]])
    R = central_differences(law, at, np.append(sizes, motion.sizes.time))[0]
    f0 = state_rates(motion, motion.modes[i], before, u[:1], time)[0]
    f1 = state_rates(motion, motion.modes[i + 1], later, u[1:], time)[0]
    jump = f1 - R[:, :n] @ f0 - R[:, n]
    S = R[:, :n] + np.outer(jump, _sooner(motion, i, (before, u[:1], time), f0))
    return np.asarray(projection(motion, motion.modes[i + 1], later, time)[0] @ S)


def sooner(motion: Motion, i: int, u: Array) -> Array:
    """Derivatives of the time by which event i comes sooner by the state before it, shape (n,),
    with the inputs u (1, nu)."""
    p = motion.passages[i]
    before, time = np.concatenate([p.before.q[-1], p.before.v[-1]])[None], np.array([p.c.time])
    f0 = state_rates(motion, motion.modes[i], before, u, time)[0]
    return _sooner(motion, i, (before, u, time), f0)


def inputs_at(motion: Motion, i: int) -> Array:
    """Inputs before and after event i, shape (2, nu): those of a feedback, which goes over from one
    to the other when it feels the event."""
    last, following = motion.steps[i].u1[-1], motion.steps[i + 1].u0
    return np.vstack([last, following[0] if len(following) else last])


def timed_inputs_at(motion: Motion, i: int) -> Array:
    """Inputs before and after event i that are functions of the time, shape (2, nu): where they
    jump at its planned time, an early event has those before on both sides, a late one those after;
    for both, their mean."""
    both = inputs_at(motion, i)
    return np.repeat(both.mean(axis=0, keepdims=True), 2, axis=0)


def _sooner(motion: Motion, i: int, at: tuple[Array, Array, Array], f: Array) -> Array:
    """Derivatives of the time by which event i comes sooner by the state before it, shape (n,);
    zero where it comes at its time, or where nothing depends on that."""
    p, sizes, (y, u, t) = motion.passages[i], state_sizes(motion), at
    value = _ends(motion, i)
    if value is None:
        return np.zeros(len(sizes))

    def along(x: Array) -> Array:
        return value(y + x * f, _like(u, x), t + x[:, 0])

    slope = central_differences(lambda x: value(x, _like(u, x), _like(t, x)), y, sizes)[0, 0]
    rate = central_differences(along, np.zeros((1, 1)), np.array([motion.sizes.time]))[0, 0, 0]
    size = float(np.abs(slope) @ sizes) / motion.sizes.time
    if abs(rate) > GRAZES * size:
        return np.asarray(slope / rate)
    if p.c.surface or p.c.switch or p.c.off:
        raise SimulationError(
            f"the event {p.c.word!r} at {p.c.time:.6g} s grazes: a small deviation decides whether "
            "it happens, so there is no linearised motion through it; take a motion that hits or "
            "misses it clearly."
        )
    return np.zeros(len(sizes))


def _ends(motion: Motion, i: int) -> Callable[[Array, Array, Array], Array] | None:
    """A function of rows of states, inputs and times that is zero when event i happens, shape
    (rows, 1). None where the accelerations on both sides are the same then, as where a contact
    opens without a force, or where the inputs jump."""
    p, model, nq = motion.passages[i], motion.model, motion.model.nq

    def parts(y: Array) -> tuple[Array, Array]:
        return np.ascontiguousarray(y[:, :nq]), np.ascontiguousarray(y[:, nq:])

    if p.c.grazes:
        raise SimulationError(
            f"the motion touches {p.c.surface!r} at {p.c.time:.6g} s without an impulse: a small "
            "deviation decides whether it hits, so there is no linearised motion through it; solve "
            "without this event."
        )
    if p.c.surface:
        j = model.surface_numbers[p.c.surface]
        return lambda y, u, t: model.gaps(parts(y)[0], t)[:, [j]]
    if p.c.switch:
        crossed = model.contacts.switches.index(p.c.switch)
        return lambda y, u, t: model.crossings(*parts(y), t)[:, [crossed]]
    if p.c.off:
        ended = model.surface_numbers[p.c.off[0]]
        return lambda y, u, t: model.within(parts(y)[0], t)[:, [ended]]
    was, now = motion.modes[i].rubbing, motion.modes[i + 1].rubbing
    changed = [k for k, s in now.items() if was.get(k, s) != s]
    if len(changed) != 1:
        return None
    k = changed[0]
    if not sticks(was[k]):  # it stops
        return lambda y, u, t: model.slide_rates(*parts(y), t)[:, [k]]

    def borne(y: Array, u: Array, t: Array) -> Array:
        react, mode = motion.flow.integrator.reaction, motion.modes[i]
        return limits(model, react, mode, (y, u, t))[:, [model.nc + k]]

    y = np.concatenate([p.before.q[-1], p.before.v[-1]])[None]
    left = borne(y, inputs_at(motion, i)[:1], np.array([p.c.time]))[0, 0]
    force = p.before.tangential[-1, list(p.before.rubbing).index(model.kernels.tangents[k])]
    return borne if abs(left) <= EDGE * abs(force) else None
