"""A first fit from which a run is followed as a whole: by windows of it with a start each, read off
what was measured (multiple shooting [1]_ that leaves out the joints).

A motion through hits, or through many periods, is far from the measured one where parameters are
wrong, and its least squares have many minima.  In a window with at most one event it is near.

References
----------
.. [1] H. G. Bock, *Randwertproblemmethoden zur Parameteridentifizierung in Systemen nichtlinearer
   Differentialgleichungen*, Bonner Mathematische Schriften 183 (1987).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.signal import find_peaks

from dmoc.base.names import velocity_name
from dmoc.codegen.kernels import Array
from dmoc.fitting.data import Run, Samples
from dmoc.fitting.experiment import Experiment
from dmoc.fitting.noise import first_sigma
from dmoc.fitting.parameters import START, Parameter, first_state, state_size
from dmoc.fitting.regression import Regression
from dmoc.mechanics.touch import Touch

# Windows of a run without events; values in each at least, for each of its free states.
PIECES, FEWEST = 6, 3
# Share of the range of a gap by which it has to fall on both sides of a hit.
PROMINENT = 0.02
MOST_ITERATIONS = 40


def from_windows(regression: Regression, x: Array) -> Array | None:
    """Unknowns by windows, from which whole runs are followed; None where what is measured says
    nothing of the whole state."""
    pieces = [
        p for i, e in enumerate(regression.experiments) for p in _pieces(e, x[regression.own[i]])
    ]
    if not pieces:
        return None
    shared = tuple(p for p in regression.parameters if p.kind != START)
    starts = [p for piece in pieces for p in piece.parameters if p.kind == START]
    made = Regression(tuple(pieces), (*shared, *starts), regression.loss)
    if len(made.measured) <= len(made.parameters):
        return None
    begin = np.array([p.first for p in made.parameters])
    number = {id(p): k for k, p in enumerate(regression.parameters)}
    begin[: len(shared)] = [x[number[id(p)]] for p in shared]
    end, cost = made.fitted(begin, first_sigma(made), None, MOST_ITERATIONS)
    if not np.isfinite(cost):
        return None
    better = x.copy()
    values = {id(p): value for p, value in zip(made.parameters, end, strict=True)}
    for k, p in enumerate(regression.parameters):
        better[k] = values.get(id(p), better[k])
        if p.kind == START:
            first = next((s for s in starts if s.run == p.run and s.of == p.of), None)
            better[k] = better[k] if first is None else np.clip(values[id(first)], p.low, p.high)
    return better


def _pieces(e: Experiment, x: Array) -> Iterator[Experiment]:
    """The windows of a run, the first of them first."""
    names = e.problem.kernels.coordinates
    if not all(name in e.run.sensors for name in names):
        return
    hits = hits_seen(e, x)
    if hits is None:
        return
    for begin, end, event in windows(e.run.begin, e.run.end, hits):
        piece = _piece(e, begin, end, (event, hits))
        if piece is not None:
            yield piece


def windows(begin: float, end: float, hits: Array) -> Iterator[tuple[float, float, int]]:
    """Windows of a time: their ends, and the number of phases that are over before them; those
    around a hit have it in their middle, as far as the next one leaves them room."""
    length, t = (end - begin) / PIECES, begin
    for i, hit in enumerate(hits):
        before = (hits[i - 1] + hit) / 2 if i else begin
        after = (hit + hits[i + 1]) / 2 if i + 1 < len(hits) else end
        low, high = max(before, hit - length / 2), min(after, hit + length / 2)
        low = t if low - t < length / 2 else low
        yield from _even(t, low, length, i)
        yield low, high, i
        t = high
    yield from _even(t, end, length, len(hits))


def _even(begin: float, end: float, length: float, over: int) -> Iterator[tuple[float, float, int]]:
    """Windows of about a length; with a negative sign that no event is in them."""
    count = max(round((end - begin) / length), 1) if end - begin > 0.1 * length else 0
    edges = np.linspace(begin, end, count + 1)
    for low, high in pairwise(edges):
        yield float(low), float(high), -over - 1


def _piece(e: Experiment, begin: float, end: float, at: tuple[int, Array]) -> Experiment | None:
    """A window with its own start."""
    event, hits = at
    kernels, run = e.problem.kernels, e.run
    sensors = {}
    for name, s in run.sensors.items():
        here = (s.t >= begin) & (s.t <= end)
        if here.any():
            sensors[name] = Samples(s.t[here], s.y[here], s.sigma[here])
    names = kernels.coordinates
    if any(name not in sensors or len(sensors[name].y) < FEWEST for name in names):
        return None
    cut = Run(run.name, begin, end, sensors, run.inputs, run.form, (), np.nan)
    i = event if event >= 0 else -event - 1
    modes, events = e.touch.modes[i : i + 1], e.touch.events[i:i]
    last = end
    if event >= 0:
        modes, events, last = e.touch.modes[i : i + 2], e.touch.events[i : i + 1], float(hits[i])
    states, starts = [*names, *map(velocity_name, names)], []
    number = next((p.run for p in e.parameters if p.run is not None), None)
    for name in states:
        first = first_state(cut, name, begin, last)
        size = state_size(run, name)
        starts.append(Parameter(name, START, name, -np.inf, np.inf, first, size, number))
    others = tuple(p for p in e.parameters if p.kind != START)
    return replace(
        e, run=cut, touch=Touch(e.touch.contacts, modes, events),
        parameters=(*others, *starts), start=np.full(len(states), np.nan),
    )  # fmt: skip


# Hits ---------------------------------------------------------------------------------------------


def hits_seen(e: Experiment, x: Array) -> Array | None:
    """Times of the hits of a word as the measured coordinates show them, shape (events,): where
    gaps are largest; None where the word has events that they do not show, or they show others."""
    if not all(event.impact for event in e.touch.events):
        return None
    if not e.touch.events:
        return np.zeros(0)
    chosen, wanted = hits_of_word(e, x), [event.surface for event in e.touch.events]
    return np.array([t for t, _ in chosen]) if [j for _, j in chosen] == wanted else None


def hits_of_word(e: Experiment, x: Array) -> list[tuple[float, int]]:
    """Times and surfaces of the hits that measured gaps show best, as many of each surface as the
    word has, in their order."""
    wanted, seen = [event.surface for event in e.touch.events], peaks(e, x)
    chosen = list[tuple[float, int]]()
    for j in dict.fromkeys(wanted):
        own = sorted((p for p in seen if p[1] == j), key=lambda p: -p[2])[: wanted.count(j)]
        chosen += [(time, j) for time, _, _ in own]
    return sorted(chosen)


def peaks(e: Experiment, x: Array) -> list[tuple[float, int, float]]:
    """Where measured gaps are largest: times, surfaces, and by how much they fall on both sides, as
    shares of their range."""
    t, g = measured_gaps(e, x)
    found = []
    for j, gap in enumerate(g.T):
        size = float(np.ptp(gap)) if len(t) > 2 else 0.0
        if size > 0:
            at, how = find_peaks(gap, prominence=PROMINENT * size, plateau_size=1)
            found += [
                (float(t[k]), j, float(p) / size)
                for k, p in zip(at, how["prominences"], strict=True)
            ]
    return found


def measured_gaps(e: Experiment, x: Array) -> tuple[Array, Array]:
    """Times (n,) and gaps (n, nc) along the measured coordinates; 0 of those that these do not
    tell."""
    names, model = e.problem.kernels.coordinates, e.laws(x).model
    seen = {i: e.run.sensors[name] for i, name in enumerate(names) if name in e.run.sensors}
    if not seen:
        return np.zeros(0), np.zeros((0, model.nc))
    t = np.unique(np.concatenate([s.t for s in seen.values()]))
    q = np.zeros((len(t), len(names)))
    for i, s in seen.items():
        q[:, i] = np.interp(t, s.t, s.y)
    told = [set(on) <= set(seen) for on in model.surface_coordinates]
    return t, np.where(told, model.gaps(q, t), 0.0)
