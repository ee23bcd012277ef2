"""The sequence of a relaxed motion: what is closed, slides and is hit, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.guess.folded import Folded
from dmoc.guess.hit_course import course_at
from dmoc.guess.transfer import Piece, times_of_inputs
from dmoc.mechanics.contact_mode import Course, Event, Mode
from dmoc.mechanics.contacts import NOWHERE, RAIL
from dmoc.mechanics.sequence_words import word_between
from dmoc.mechanics.touch import Bools, Touch
from dmoc.motion.friction import states_of
from dmoc.program.hit_stages import Passage
from dmoc.program.iterate import Iterate
from dmoc.program.transcription import Transcription

# A hit that is none: its impulse, and its gap, as shares of their sizes.
NO_HIT, AWAY = 1e-3, 1e-2
# Steps of a mode at least: what lasts shorter trembles.
FEWEST = 2


@dataclass(frozen=True)
class Reading:
    """What a relaxed motion says.

    Attributes
    ----------
    start : Mode
        What touches at the start, and how it rubs.
    words : tuple of str
        The events after it.
    motion : Folded
        The motion with these events.
    """

    start: Mode
    words: tuple[str, ...]
    motion: Folded

    def same(self, other: Reading) -> bool:
        """Whether the sequence and the contacts at the start are the same."""
        return (self.start, self.words) == (other.start, other.words)


@record(frozen=True, eq=False)
class RelaxedMotion:
    """A motion of a relaxed program, in units of the problem, and its cost."""

    nlp: Transcription
    x: Array
    cost: float

    @cached_property
    def at(self) -> Iterate:
        return self.nlp.iterate(self.x)

    @cached_property
    def reading(self) -> Reading:
        """The sequence that the motion shows, without what trembles."""
        return sequence_in(self, FEWEST)

    @property
    def in_detail(self) -> Reading:
        """The sequence that the motion shows step by step."""
        return sequence_in(self, 1)


@dataclass(frozen=True)
class Hit:
    """A hit: its surface, its impulse, and its course where it has friction."""

    surface: int
    impulse: float
    course: Course | None = None


def sequence_in(relaxed: RelaxedMotion, fewest: int) -> Reading:
    """The sequence that a motion has, without modes that last for fewer steps."""
    lay, (modes, hits) = relaxed.nlp.layout, _bumps(relaxed, _modes(relaxed))
    hits |= _hits(relaxed)
    modes = at_hits(cleaned(modes, fewest), list(hits))
    contacts, words, names = lay.touch.contacts, list[str](), list[str]()
    cuts, impulses = list[int](), list[float]()
    ends = _at_ends(relaxed)
    for k in range(1, lay.total):
        before, after, event, impulse = modes[k - 1], modes[k], Event(), 0.0
        if hit := hits.get(k):
            impulse = hit.impulse
            if hit.surface not in after.closed or hit.surface in before.closed:
                event = Event(hit=hit.surface, course=hit.course)
        off = [j for j in before.closed if j not in after.closed and ends[k, j]]
        word = word_between(contacts, before, after, replace(event, off=tuple(off)))
        if word:
            words.append(word)
            cuts.append(k)
            impulses.append(impulse)
            names.append("" if event.hit == NOWHERE else contacts.surfaces[event.hit])
    motion = Folded(tuple(names), _pieces(relaxed, cuts), tuple(impulses))
    return Reading(modes[0], tuple(words), motion)


def _at_ends(relaxed: RelaxedMotion) -> Bools:
    """Surfaces whose ends are passed outwards in the step before or after each node, shape (nodes,
    nc)."""
    W = relaxed.at.problem.model.within(relaxed.at.q, relaxed.at.t)
    late = np.vstack([W[1:], W[-1:]])
    ahead = late + np.minimum(late - W, 0.0)  # a node further, where the steps go on
    return np.asarray(ahead < 0)


def _hits(relaxed: RelaxedMotion) -> dict[int, Hit]:
    """The hits of the program, by their nodes, at which something is hit."""
    nlp, lay, x = relaxed.nlp, relaxed.nlp.layout, relaxed.x
    surfaces, lam = lay.touch.surfaces, x[lay.impact.lam]
    gaps = relaxed.at.problem.model.covered_gaps(relaxed.at.q, relaxed.at.t)
    return {
        int(node): Hit(int(j), float(lam[i]), _course(relaxed, i))
        for i, (node, j) in enumerate(zip(lay.collision_nodes, surfaces, strict=True))
        if lam[i] > NO_HIT * nlp.scale.lam[j] and gaps[node, j] > -AWAY * nlp.scale.gap[j]
    }


def _bumps(relaxed: RelaxedMotion, modes: Sequence[Mode]) -> tuple[list[Mode], dict[int, Hit]]:
    """Modes without the stays of elastic smooth surfaces that are as short as a hit, and these
    hits, by their nodes."""
    lay, x, problem = relaxed.nlp.layout, relaxed.x, relaxed.nlp.problem
    contacts, modes, hits = lay.touch.contacts, list(modes), dict[int, Hit]()
    for j in map(int, np.flatnonzero(problem.restitution_values != 0)):
        if contacts.rubs_on(j):
            continue
        for a, b in _stays(modes, j):
            if a == 0 or b == len(modes) or b - a > FEWEST:
                continue
            P = x[lay.relaxed.P_r[a:b, j]]
            hits[a + int(P.argmax())] = Hit(j, float(P.sum()))
            modes[a:b] = [m.opening(j, contacts) for m in modes[a:b]]
    return modes, hits


def _stays(modes: Sequence[Mode], j: int) -> list[tuple[int, int]]:
    """First steps, and ones after the last, in which a surface is closed."""
    closed = np.array([False, *(j in m.closed for m in modes), False])
    edges = np.flatnonzero(closed[1:] != closed[:-1]).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _course(relaxed: RelaxedMotion, i: int) -> Course | None:
    """The course that a hit with friction takes from the velocity before it."""
    lay, at = relaxed.nlp.layout, relaxed.at
    contacts = lay.touch.contacts
    surface, node = int(lay.touch.surfaces[i]), lay.collision_nodes[i]
    if contacts.surfaces[surface] not in contacts.rough:
        return None
    law = contacts.impact_law(contacts.surfaces[surface])
    hit = Passage(i, surface, contacts.tangents_of(surface), False, (), (), law=law)
    return course_at(at.problem, hit, (at.q[node], at.x[lay.impact.v_a[i]], float(at.t[node])))


def _modes(relaxed: RelaxedMotion) -> list[Mode]:
    """The mode of each step.  Of two factors whose product vanishes the one counts that is the
    larger, in its size: a contact is closed where it presses, and slides where its friction leaves
    the cone no room."""
    nlp, lay, x = relaxed.nlp, relaxed.nlp.layout, relaxed.x
    model, q, t = relaxed.at.problem.model, relaxed.at.q, relaxed.at.t
    s, steps, left_open = nlp.scale, lay.total, lay.touch.open
    P = np.where(lay.relaxed.P_r == NOWHERE, 0.0, x[lay.relaxed.P_r])[:-1] * steps
    T = np.where(lay.relaxed.T_r == NOWHERE, 0.0, x[lay.relaxed.T_r])[:-1] * steps
    away = -model.covered_gaps(q, t)[1:] * steps
    closed = P / s.lam > away / s.gap
    _close_grips(closed, lay.touch, np.abs(P) / s.lam, model.gaps(q, t) / s.gap)
    slid = np.diff(model.tangents(q, t), axis=0) * steps / (s.slide * s.time)
    bears = np.zeros_like(T)
    h, u = x[lay.index_h][lay.phase_of_step] * steps, x[lay.index_u[lay.row_u_k]]
    share = (h + np.append(0.0, h[:-1])) / 2
    mu = model.with_friction_at(q[:-1], u=u, t=t[:-1]).friction
    for k, j in enumerate(lay.touch.contacts.supports):
        bears[:, k] = mu[..., k] * (share if j == RAIL else P[:, j])
    room = (bears - np.abs(T)) / s.friction
    states = states_of(slid, room)
    modes = []
    for k in range(steps):
        on = [j for j in left_open.surfaces if closed[k, j]] if left_open else []
        rubs = {
            i: int(states[k, i])
            for i, j in enumerate(lay.touch.contacts.supports)
            if (j == RAIL or j in on) and i in (left_open.tangents if left_open else ())
        }
        modes.append(Mode.of(on, rubs))
    return modes


def _close_grips(closed: Bools, touch: Touch, forces: Array, gaps: Array) -> None:
    """Enter in which steps grips are closed, by forces of all steps (n, nc) and gaps at their nodes
    (n + 1, nc) in their sizes: where these are the smaller, and where a grip that was closed stays
    where it is without a force."""
    contacts, steps = touch.contacts, len(forces)
    begins = touch.open.closed if touch.open else ()
    for _, names in contacts.grips:
        places = list(map(contacts.surface_numbers.__getitem__, names))
        off = np.abs(gaps[1:, places])
        floats = [j in contacts.floating for j in places]
        off[:, floats] = np.abs(np.diff(gaps[:, places], axis=0))[:, floats]
        most = off.max(axis=1)
        holds = forces[:, places].max(axis=1) > most * steps
        on = bool(set(places) & {*begins})
        for a, b in _runs(holds.tolist()):
            on = bool(holds[a]) or (on and bool((most[a:b] < AWAY).all()))
            closed[a:b, places] = on
    return None


def cleaned(modes: Sequence[Mode], fewest: int = FEWEST) -> list[Mode]:
    """Modes of steps in which none trembles: one that lasts for fewer steps becomes that of the
    longer of its neighbours."""
    modes = list(modes)
    while True:
        runs = _runs(modes)
        short = [r for r in runs if r[1] - r[0] < fewest]
        if not short or len(runs) == 1:
            return modes
        a, b = min(short, key=lambda r: r[1] - r[0])
        beside = [r for r in runs if r[1] == a or r[0] == b]
        longest = max(beside, key=lambda r: r[1] - r[0])
        modes[a:b] = [modes[longest[0]]] * (b - a)


def at_hits(modes: Sequence[Mode], nodes: Sequence[int]) -> list[Mode]:
    """Modes of steps in which those that change a step before or after a hit change with it."""
    modes = list(modes)
    for k in nodes:
        if k >= 2 and modes[k - 2] != modes[k - 1] == modes[k]:
            modes[k - 1] = modes[k - 2]
        if k + 1 < len(modes) and modes[k - 1] == modes[k] != modes[k + 1]:
            modes[k] = modes[k + 1]
    return modes


def _runs(modes: Sequence[object]) -> list[tuple[int, int]]:
    """First and one after the last of equal ones."""
    at = [0, *(k for k in range(1, len(modes)) if modes[k] != modes[k - 1]), len(modes)]
    return list(pairwise(at))


def _pieces(relaxed: RelaxedMotion, cuts: Sequence[int]) -> tuple[Piece, ...]:
    """The motion between some nodes."""
    lay, x = relaxed.nlp.layout, relaxed.x
    t, q, u = lay.times(x), x[lay.index_q], x[lay.index_u]
    ends, pieces, problem = [0, *cuts, lay.total], [], relaxed.nlp.problem
    design = dict(zip(problem.design, x[lay.index_design].tolist(), strict=True))
    events = lay.collision_nodes.tolist()
    before, after = (dict(zip(events, x[v], strict=True)) for v in (lay.impact.v_a, lay.impact.v_c))
    for a, b in pairwise(ends):
        at, nodes = t[a : b + 1], np.ascontiguousarray(q[a : b + 1])
        rows = slice(lay.row_u_k[a], lay.row_u_kp1[b - 1] + 1)
        v = np.gradient(nodes, at, axis=0)
        v[0], v[-1] = after.get(a, v[0]), before.get(b, v[-1])
        times = times_of_inputs(lay.form.name, at)
        pieces.append(Piece(at, nodes, v, times, u[rows], parameters=design))
    return tuple(pieces)
