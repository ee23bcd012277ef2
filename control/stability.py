"""What a motion makes of small deviations: those of periodic motions from period to period, those
of others from phase to phase and through each event."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dmoc.base.errors import SimulationError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.table import Cell, Shown, Table
from dmoc.check.checked_motion import Motion
from dmoc.codegen.kernels import Array
from dmoc.control.linearisation import (
    linear_phase,
    projection,
    saltation,
    sooner,
    state_rates,
    state_sizes,
    timed_inputs_at,
)

# Singular values, as shares of the largest, of directions that conditions leave no deviation in.
NONE = 1e-7
GROWS = 1.0 + 1e-6
LISTED = 0.2  # entries of a direction that are told, as shares of its largest
MOST = 3  # directions of a part that a table tells
STEADY = 1e-9  # of the sizes of inputs: what changes by less does not change with the time
NOT_CLOSED = 1e-4  # of a period, in sizes, by which a flow may miss its own direction


@dataclass(frozen=True, eq=False)
class Growth:
    """What a part of a motion makes of deviations, in sizes of the motion.

    Attributes
    ----------
    part : str
        A phase, an event by its word, or the whole motion.
    time : float
        When it begins, in seconds.
    factors : array of shape (k,)
        Singular values of the derivative of the state at its end by that at its begin: how much the
        lengths of deviations grow, the largest first.
    before, after : arrays of shape (k, 2 nq)
        The directions that grow so, of length 1 in sizes, and what becomes of them.
    """

    part: str
    time: float
    factors: Array
    before: Array
    after: Array


@dataclass(frozen=True, eq=False)
class Stability(Shown):
    """What a motion makes of small deviations; made by :meth:`dmoc.Solution.stability`.

    Attributes
    ----------
    states : tuple of str
        Coordinates and velocities, in the order of rows, columns and directions.
    sizes : array of shape (2 nq,)
        Sizes of the motion, in which lengths and directions are measured.
    parts : tuple of Growth
        The phases and the events between them, in their order.
    whole : Growth
        The motion from its start to its end.
    transition : array of shape (2 nq, 2 nq)
        Derivative of the state at the end by that at the start.
    monodromy : array of shape (2 nq, 2 nq) or None
        Of a periodic motion the derivative of the start of the next period by that of this one:
        the transition, and then what ``periodic`` says.
    multipliers : array of shape (k,), complex
        Its Floquet multipliers, the largest first: of the deviations that the conditions at the
        start allow, and, where the motion does not depend on the time, without the one along the
        motion itself.  Those of the return map of a gait are these.
    directions : array of shape (k, 2 nq), complex
        Their directions, of length 1 in sizes.
    """

    states: tuple[str, ...]
    sizes: Array
    parts: tuple[Growth, ...]
    whole: Growth
    transition: Array
    monodromy: Array | None = None
    multipliers: Array = field(default_factory=lambda: np.zeros(0, complex))
    directions: Array = field(default_factory=lambda: np.zeros((0, 0), complex))
    notes: tuple[str, ...] = ()

    @property
    def stable(self) -> bool | None:
        """Whether every deviation of a periodic motion dies away, or, where the motion may be moved
        as a whole, all others do not grow; None of a motion that does not repeat."""
        if self.monodromy is None:
            return None
        return bool((np.abs(self.multipliers) < GROWS).all())

    def __repr__(self) -> str:
        if self.monodromy is None:
            return f"<Stability: deviations grow up to {_factor(self.whole.factors[:1])} times>"
        return f"<Stability: largest multiplier {_factor(np.abs(self.multipliers[:1]))}>"

    def summary(self) -> Table:
        """What ``print``, notebooks and reports show."""
        head = "part", "from", "grows by", "direction before", "after"
        return Table(tuple(_rows(self)), head, self.notes, "Stability")


def _rows(s: Stability) -> Iterator[tuple[Cell, ...]]:
    for growth in (*s.parts, s.whole):
        name, time = growth.part, f"{growth.time:.4g} s"
        several = [k for k, x in enumerate(growth.factors[:MOST]) if x > GROWS or not k]
        for k in several:
            sides = (direction_in_words(s.states, d[k]) for d in (growth.before, growth.after))
            yield name, time, _factor(growth.factors[k : k + 1]), *sides
            name = time = ""
    if s.monodromy is not None:
        for multiplier, direction in zip(s.multipliers, s.directions, strict=True):
            words = direction_in_words(s.states, direction)
            yield "multiplier", "", _complex(multiplier), words, ""


def _factor(values: Array) -> str:
    return f"{values[0]:.4g}" if len(values) else "none"


def _complex(x: complex) -> str:
    x = complex(round(x.real, 12), round(x.imag, 12))
    return f"{x.real:.4g}" if not x.imag else f"{x.real:.4g}{x.imag:+.4g}i, size {abs(x):.4g}"


def direction_in_words(states: Sequence[str], direction: Array) -> str:
    """The large entries of a direction by name, the largest positive."""
    lead = direction[np.argmax(np.abs(direction))]
    entries = direction * np.conj(lead) / abs(lead) if lead else direction
    large = np.flatnonzero(np.abs(entries) > LISTED * np.abs(entries).max())
    order = large[np.argsort(-np.abs(entries[large]), kind="stable")]
    return " ".join(f"{entries[k].real:+.2f} {states[k]}" for k in order)


@np.errstate(all="ignore")  # what is not finite is told as that
def stability(motion: Motion, periodic: Mapping[str, Mapping[str, float]]) -> Stability:
    """The stability of a motion; ``periodic`` are the states at the end as sums of states at the
    start."""
    model, sizes = motion.model, state_sizes(motion)
    names = model.kernels.coordinates
    states = (*names, *map(velocity_name, names))
    phases, parts = motion.trajectory.phases, list[Growth]()
    first = allowed(motion, 0, 0)
    whole = projection(motion, motion.modes[0], *_state(motion, 0, 0))[0]
    ends = np.zeros(len(sizes))
    for i in range(motion.stepped):
        slope = np.eye(len(sizes))
        for transition in linear_phase(motion, i).transitions():
            slope = transition @ slope
        basis, time = allowed(motion, i, 0), phases[i].t[0]
        parts.append(_growth(f"phase {i + 1}, {phases[i].mode}", time, slope, basis, sizes))
        whole = slope @ whole
        if i < len(motion.trajectory.collisions):
            c = motion.trajectory.collisions[i]
            inputs = timed_inputs_at(motion, i)
            slope = saltation(motion, i, inputs)
            if i + 1 == motion.stepped:
                ends = sooner(motion, i, inputs[:1]) @ whole
            parts.append(_growth(c.word, c.time, slope, allowed(motion, i, -1), sizes))
            whole = slope @ whole
    growth = _growth("the motion", phases[0].t[0], whole, first, sizes)
    made = Stability(states, sizes, tuple(parts), growth, whole)
    return _repeated(motion, made, periodic, ends) if periodic else made


def _state(motion: Motion, i: int, k: int) -> tuple[Array, Array]:
    """State (1, 2 nq) and time (1,) of a node of a phase."""
    phase = motion.trajectory.phases[i]
    return np.concatenate([phase.q[k], phase.v[k]])[None], np.array([phase.t[k]])


def allowed(motion: Motion, i: int, k: int) -> Array:
    """Deviations at a node that the conditions of its phase allow, in sizes: an orthonormal basis
    (n, k)."""
    sizes = state_sizes(motion)
    kept = projection(motion, motion.modes[i], *_state(motion, i, k))[0]
    left, factors, _ = np.linalg.svd(kept / sizes[:, None] * sizes)
    return np.asarray(left[:, factors > NONE])


def _growth(name: str, time: float, slope: Array, basis: Array, sizes: Array) -> Growth:
    """The singular values of a derivative on a basis, in sizes, without those of directions that
    end in no deviation."""
    if not np.isfinite(slope).all():
        raise SimulationError(
            f"the linearised motion is not finite in {name}: its forces have no slopes there, or "
            "its mass matrix is singular; keep the motion away from there by bounds."
        )
    left, factors, right = np.linalg.svd(slope / sizes[:, None] * sizes @ basis)
    k = max(1, int((factors > NONE * factors[0]).sum()))
    return Growth(name, float(time), factors[:k], right[:k] @ basis.T, left.T[:k])


# Periods ------------------------------------------------------------------------------------------


def _repeated(
    motion: Motion, made: Stability, periodic: Mapping[str, Mapping[str, float]], ends: Array
) -> Stability:
    """The stability of a motion that repeats; ``ends`` are the derivatives (n,) of the time by
    which the event at its end comes sooner, if there is one, by the state at the start.

    What follows that event is the next period, in the mode of the start: a grip that holds through
    the event may be open there.
    """
    again = back(motion, made.transition, periodic)
    if isinstance(again, str):
        return Stability(
            made.states, made.sizes, made.parts, made.whole, made.transition, notes=(again,)
        )
    sizes, n = made.sizes, len(made.sizes)
    last = state_rates(motion, motion.modes[-1], *_end(motion))[0]
    monodromy = again @ made.transition + np.outer(_flow(motion) - again @ last, ends)
    basis = allowed(motion, 0, 0)
    scaled = monodromy / sizes[:, None] * sizes
    flow, notes = _flow(motion) / sizes, tuple[str, ...]()
    along = basis @ (basis.T @ flow)
    if depends_on_time(motion):
        notes = ("multipliers of deviations at one time: the motion depends on the time",)
    elif np.linalg.norm(along):
        along /= np.linalg.norm(along)
        missed = float(np.linalg.norm(scaled @ along - along))
        if missed > NOT_CLOSED:
            notes = (
                f"the flow misses its own direction by {missed:.1g} in a period: more steps make "
                "the multipliers more accurate",
            )
        rest = basis - np.outer(along, along @ basis)
        basis = np.linalg.svd(rest)[0][:, : basis.shape[1] - 1]
    values, vectors = np.linalg.eig(basis.T @ scaled @ basis)
    order = np.argsort(-np.abs(values), kind="stable")
    directions = (basis @ vectors[:, order]).T.reshape(-1, n)
    return Stability(
        made.states, sizes, made.parts, made.whole, made.transition, monodromy,
        values[order].astype(complex), directions.astype(complex), notes,
    )  # fmt: skip


def _flow(motion: Motion) -> Array:
    """The rate of the state at the start."""
    y, t = _state(motion, 0, 0)
    return np.asarray(state_rates(motion, motion.modes[0], y, motion.steps[0].u0[:1], t)[0])


def _end(motion: Motion) -> tuple[Array, Array, Array]:
    """State (1, 2 nq), inputs (1, nu) and time (1,) at the end."""
    y, t = _state(motion, -1, -1)
    return y, motion.steps[motion.stepped - 1].u1[-1:], t


def depends_on_time(motion: Motion) -> bool:
    """Whether a motion that begins later is another one: by its model, or as its inputs change."""
    if motion.model.kernels.manifest.explicit_time:
        return True
    u = np.vstack([ends for s in motion.steps for ends in (s.u0, s.u1)])
    needed = np.where(np.isfinite(motion.needed_inputs), motion.needed_inputs, 0.0)
    size = np.maximum(np.abs(u).max(axis=0, initial=0.0), needed)
    return bool((np.ptp(u, axis=0) > STEADY * size).any())


def back(
    motion: Motion, transition: Array, periodic: Mapping[str, Mapping[str, float]]
) -> Array | str:
    """The deviation at the start of the next period by that at the end of this one (n, n), or why
    ``periodic`` does not say it.

    Coordinates that it leaves out go on as they are, if no other deviation depends on them.
    """
    motion_names, sizes = motion.model.kernels.coordinates, state_sizes(motion)
    first, last = motion.trajectory.phases[0], motion.trajectory.phases[-1]
    ends = _state_slopes(motion, last.q[-1], last.v[-1], last.t[-1])
    starts = _state_slopes(motion, first.q[0], first.v[0], first.t[0])
    left, right = list[Array](), list[Array]()
    for end, terms in periodic.items():
        unknown = [name for name in (end, *terms) if name not in ends]
        if unknown:
            return f"no multipliers: periodic names {unknown[0]!r}, which is no state"
        left.append(ends[end])
        right.append(sum((f * starts[name] for name, f in terms.items()), np.zeros(len(sizes))))
    named = {*periodic, *(name for terms in periodic.values() for name in terms)}
    for k, name in enumerate(motion_names):
        others = np.delete(transition[:, k] / sizes * sizes[k], k)
        if (
            name not in named
            and np.abs(others).max(initial=0.0)
            <= NONE * np.abs(transition / sizes[:, None] * sizes).max()
        ):
            left.append(ends[name])
            right.append(starts[name])
    basis = allowed(motion, 0, 0) * sizes[:, None]
    A = np.array(right) @ basis
    size = np.linalg.norm(A, axis=1)
    size = np.where(size > 0, size, 1.0)[:, None]
    if np.linalg.matrix_rank(A / size, tol=NONE) < basis.shape[1]:
        return "no multipliers: periodic leaves states out, so that no period decides the next one"
    return np.asarray(basis @ np.linalg.lstsq(A / size, np.array(left) / size, rcond=None)[0])


def _state_slopes(motion: Motion, q: Array, v: Array, t: float) -> dict[str, Array]:
    """Derivatives of coordinates, velocities and momenta by name with respect to (q | v)."""
    names, n = motion.model.kernels.coordinates, 2 * len(q)
    own, momenta = np.eye(n), motion.model.momentum_slopes(q, v, t)[:, :n]
    rows = zip((*names, *map(velocity_name, names), *map(momentum_name, names)),
               (*own, *momenta), strict=True)  # fmt: skip
    return dict(rows)
