"""What a result says, read out of unknowns and multipliers: the motion, and the multipliers by
kind."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import nan

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import most_of, solved
from dmoc.mechanics.conditions import Forces
from dmoc.mechanics.contact_forces import accelerations_and_forces
from dmoc.mechanics.contact_mode import Mode, names_of, without_rails
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_trajectory import motion_along
from dmoc.mechanics.touch import friction_changes
from dmoc.motion.trajectory import FORCES, Collision, Phase, Trajectory
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE
from dmoc.program.layout import Layout
from dmoc.program.scaling import cost_of
from dmoc.program.sharing import shared
from dmoc.program.totals import totals_at
from dmoc.program.transcription import Transcription

# Impulses of an event by their kind and name.
Impulses = dict[str, dict[str, float]]
# A collision that changes no momentum by more than this share of its size has no effect.
NO_EFFECT = 1e-3
# Nodes of a phase whose forces are continued to its ends, at least one more.
FEWEST = 4


def trajectory(nlp: Transcription, x: Array, whole: bool = True) -> Trajectory:
    """Return the motion of the scaled unknowns x, shape (n,): times, coordinates, momenta,
    velocities, inputs, collisions and, of a whole one, cost, totals and scene."""
    nlp = nlp.designed(x)
    lay, problem = nlp.layout, nlp.problem
    momenta = nlp.momenta(x)
    x = nlp.physical(x)
    largest = np.maximum(*map(most_of, momenta))
    phases, begin = list[Phase](), 0.0
    for i in range(lay.stepped):
        phases.append(_phase(nlp, x, i, begin, momenta))
        begin = float(phases[-1].t[-1])
    if lay.ends_with_event:
        phases.append(_after_event(nlp, x, begin, x[lay.index_u[lay.row_u_kp1[-1:]]]))
    joined = enumerate(pairwise(phases))
    collisions = [_collision(nlp, x, i, both, largest) for i, both in joined]
    return motion_along(
        problem.models,
        phases,
        collisions,
        problem.restitution_values,
        controls=problem.control_form,
        bounds=(problem.input_bounds, problem.coordinate_bounds),
        ignored=problem.ignored,
        limits=problem.limits | problem.total_limits,
        totals=_totals(nlp, x) if whole else None,
        cost=cost_of(nlp.iterate(x)) if whole else nan,  # hidden unknowns at their kinks
        drawn=whole,
    )


def _phase(
    nlp: Transcription, x: Array, i: int, begin: float, momenta: tuple[Array, Array]
) -> Phase:
    """A phase that has steps; ``momenta`` are those at the starts and ends of all steps."""
    lay, model, mode = nlp.layout, nlp.problem.models[i], nlp.layout.touch.modes[i]
    first, last = int(lay.ends[i]), int(lay.ends[i + 1])
    t = begin + x[lay.index_h[i]] * np.arange(last - first + 1)
    q = np.ascontiguousarray(x[lay.index_q[first : last + 1]])
    p_start, p_end = momenta
    p = np.vstack([p_start[first : first + 1], p_end[first:last]])
    p = _as_held(nlp, i, (q, p + _pushed(nlp, x, i, q, t), t))
    v, u = model.velocity(q, p, t), x[lay.index_u]
    inside = _inside(nlp, i, t, q, v, x[lay.index_q_i[first:last]])
    of_nodes, of_inside = _forces(lay, x, i)
    if nlp.problem.redundant[i]:
        u_k, u_kp1 = (u[rows[first:last]] for rows in (lay.row_u_k, lay.row_u_kp1))
        mean = np.vstack([u_k[:1], (u_kp1[:-1] + u_k[1:]) / 2, u_kp1[-1:]])
        of_nodes = _shared(model.with_friction_at(q, v, mean, t), mode, (q, t), of_nodes)
        within = lay.scheme.within(t[:-1], t[1:]).ravel()
        if len(within):
            among = lay.scheme.within(u_k, u_kp1).reshape(len(within), -1)
            rates = model.velocity(*inside[:2], within)
            rubbing = model.with_friction_at(inside[0], rates, among, within)
            of_inside = _shared(rubbing, mode, (inside[0], within), of_inside)
    return Phase(
        t, q, p, v, np.ascontiguousarray(u[lay.row_u_k[first] : lay.row_u_kp1[last - 1] + 1]),
        *names_of(lay.touch.contacts, mode), of_nodes["normal"], of_nodes["tangential"],
        *inside, lay.joint.names, of_nodes["reaction"], *of_inside.values(),
    )  # fmt: skip


def _collision(
    nlp: Transcription, x: Array, i: int, phases: tuple[Phase, Phase], largest: Array
) -> Collision:
    """The event between two phases; it has an effect where it changes the largest momenta, shape
    (nq,), enough."""
    (before, after), touch, contacts = phases, nlp.layout.touch, nlp.layout.touch.contacts
    event, t, at = touch.events[i], float(after.t[0]), before.q[-1]
    impulses = _shared_in_impact(nlp, i, (at, t), _impulses(nlp.layout, x, i))
    grazes = event.hit != NOWHERE and _without_effect(before.p[-1], after.p[0], largest)
    surface = contacts.surfaces[event.surface] if event.impact else ""
    changes = friction_changes(*touch.modes[i : i + 2]).items()
    return Collision(
        surface, t, at.copy(), impulses["normal"].get(surface, 0.0),
        before.p[-1].copy(), after.p[0].copy(), *_rates(nlp, x, i, t), grazes,
        contacts.named(event.lands), contacts.named(event.leaves),
        contacts.said({contacts.tangents[k]: s for k, s in changes}),
        impulses["normal"], impulses["tangential"],
        "" if event.course is None else str(event.course), impulses["reaction"],
        contacts.switches[event.switch] if event.switch != NOWHERE else "",
        contacts.named(event.off),
        dict(contacts.grips),
    )  # fmt: skip


def _after_event(nlp: Transcription, x: Array, end: float, u: Array) -> Phase:
    """The phase of one node after the event that ends the motion, whose last inputs are u (1, nu):
    its contacts have no impulses, but forces by its state."""
    lay, model, mode = nlp.layout, nlp.problem.models[-1], nlp.layout.touch.modes[-1]
    q, p, t = x[lay.index_q[-1:]], x[lay.index_p_E[None]], np.array([end])
    v = model.velocity(q, p, t)
    y = accelerations_and_forces(model, mode, (q, v, u, t))
    _, N, T, R = np.split(y, np.cumsum([model.nq, model.nc, model.nt]), axis=1)
    none = np.zeros((0, model.nq))
    closed, rubbing = names_of(lay.touch.contacts, mode)
    rubs = T[:, list(mode.rubbing)]
    return Phase(
        t, q, p, v, u[:0], closed, rubbing, N[:, list(mode.closed)], rubs,
        none, none, lay.joint.names, R,
    )  # fmt: skip


def _totals(nlp: Transcription, x: Array) -> dict[str, float]:
    """Integrals of the model, and the largest values of the quantities whose peaks the objective
    has; a peak without a price lies anywhere above."""
    model, lay = nlp.problem.model, nlp.layout
    values = totals_at(nlp.iterate(x)).tolist()
    totals = dict(zip(model.totals_of, values, strict=True))
    totals.pop("final_time", None)
    peaks = x[lay.index_peaks] - loose_peaks(nlp, x / nlp.sizes) * nlp.scale.peaks
    return totals | dict(zip(model.peak_names, peaks.tolist(), strict=True))


def loose_peaks(nlp: Transcription, x: Array) -> Array:
    """Differences of peaks and their quantities at the scaled unknowns x, shape (n,), in sizes of
    the quantities; shape (peaks,)."""
    if not nlp.layout.index_peaks.size:
        return np.zeros(0)
    laws, values = nlp.laws, nlp.values(x)[1:]
    return np.concatenate([laws.peak.above(values), laws.hit_quantity.above(x, values)])


def loose_totals(nlp: Transcription, x: Array) -> Array:
    """Differences of totals and the integrals that they bound at the scaled unknowns x, shape (n,),
    in sizes of the totals; shape (totals,)."""
    lay = nlp.layout
    if not lay.index_totals.size:
        return np.zeros(0)
    at = nlp.iterate(nlp.physical(x))
    off = at.x[lay.index_totals] - totals_at(at)
    return np.asarray(off / nlp.scale.totals)


def _inside(
    nlp: Transcription, i: int, t: Array, q: Array, v: Array, q_i: Array
) -> tuple[Array, Array]:
    """Coordinates and momenta at the nodes inside the steps of phase i, with q and v at the nodes
    between them."""
    scheme, flat = nlp.layout.scheme, np.ascontiguousarray(q_i.reshape(-1, q.shape[1]))
    if not scheme.inside:
        return flat, flat
    h = np.diff(t)[:, None]
    nodes = q_i.reshape(len(q_i), scheme.inside, -1)
    data = np.concatenate([np.stack([q[:-1], q[1:]], axis=1), nodes], axis=1)
    data = np.concatenate([data, np.stack([h * v[:-1], h * v[1:]], axis=1)], axis=1)
    powers = np.arange(1, scheme.degree + 3)
    slopes = powers * scheme.nodes[2:, None] ** (powers - 1) @ scheme.course[1:]
    rates = np.einsum("ia,kaj->kij", slopes, data) / h[:, None]
    rows = np.ascontiguousarray(rates.reshape(flat.shape))
    times = scheme.within(t[:-1], t[1:]).ravel()
    return flat, nlp.problem.models[i].momentum(flat, rows, times)


def _forces(lay: Layout, x: Array, i: int) -> tuple[dict[str, Array], dict[str, Array]]:
    """Forces of all kinds at the nodes of phase i, and inside its steps, from impulses by the time
    that they stand for."""
    at, steps = lay.stations, lay.steps[i]
    of_nodes = {kind: np.zeros((steps + 1, 0)) for kind in FORCES}
    of_inside = {kind: np.zeros((steps * lay.inside, 0)) for kind in FORCES}
    weight = x[lay.index_h[i]] * at.share[at.rows(i)][:, None]
    for r in lay.reactions(i):
        rows = r.impulses(x) / weight
        of_nodes[r.kind], of_inside[r.kind] = at.at_nodes(rows if at.own else _continued(rows))
    return of_nodes, of_inside


def _continued(of_nodes: Array) -> Array:
    """Forces at the nodes of a phase; at its ends, where impulses stand for half a step and leave
    an error of first order, those of the nodes beside continued."""
    if len(of_nodes) > FEWEST:
        of_nodes[0] = 2 * of_nodes[1] - of_nodes[2]
        of_nodes[-1] = 2 * of_nodes[-2] - of_nodes[-3]
    return of_nodes


def _pushed(nlp: Transcription, x: Array, i: int, q: Array, t: Array) -> Array:
    """Momenta, shape (N + 1, nq), that impulses add at the nodes of phase i: at the first one back
    to where the phase begins, at the last one all of the impulse. At the others it is half of the
    node's impulse, or all of the impulse of the step before where steps have their own."""
    at, change = nlp.layout.stations, np.zeros_like(q)
    if not nlp.layout.reactions(i):
        return change
    rows = slice(None) if not at.own else np.append(0, np.flatnonzero(at.ends[at.rows(i)]))
    for r in nlp.layout.reactions(i):
        slopes = r.slopes(nlp.problem.model, q, t)
        change += r.functions.push * np.einsum("kj,kji->ki", r.impulses(x)[rows], slopes)
    change[0] *= -1
    change[1:-1] /= 1 if at.own else 2
    return change


def _as_held(nlp: Transcription, i: int, states: tuple[Array, Array, Array]) -> Array:
    """Momenta of phase i at the states (q, p, t) of its nodes, moved the shortest way, measured by
    the masses, to where what is held has no rates."""
    model, (q, p, t) = nlp.problem.models[i], states
    holding = [r for r in nlp.layout.reactions(i) if r.held]
    if not holding:
        return p
    v, mass, follows = model.velocity(q, p, t), model.mass(q, t), nlp.problem.redundant[i]
    others = {"normal": follows.closed, "tangential": follows.sticking, "reaction": follows.joints}
    new = np.concatenate(
        [~np.isin(np.array(r.columns)[r.holds], others.get(r.kind, ())) for r in holding]
    )
    C = np.concatenate([r.slopes(model, q, t)[:, r.holds] for r in holding], axis=1)[:, new]
    rates = np.hstack([r.rates(model, q, v, t) for r in holding])[:, new]
    response = [solved(mass, np.ascontiguousarray(C[:, m])) for m in range(C.shape[1])]
    impulses = solved(C @ np.stack(response, axis=2), rates)
    moved = p - np.einsum("kmi,km->ki", C, impulses)
    return np.where(np.isfinite(moved), moved, p)


def _shared(
    model: Model, mode: Mode, at: tuple[Array, Array], forces: Mapping[str, Array]
) -> dict[str, Array]:
    """Forces by their kind at the nodes of a phase, with what its motion does not determine."""
    n = len(at[1])
    columns = list(mode.closed), list(mode.rubbing), list(range(model.nj))
    every = Forces(*(np.zeros((n, size)) for size in (model.nc, model.nt, model.nj)))
    for kind, rows, places in zip(FORCES, every, columns, strict=True):
        rows[:, places] = forces[kind] if forces[kind].shape[1] else 0.0
    same = shared(model, mode, at, every)
    return {kind: rows[:, at] for kind, rows, at in zip(FORCES, same, columns, strict=True)}


def _shared_in_impact(
    nlp: Transcription, i: int, at: tuple[Array, float], impulses: Impulses
) -> Impulses:
    """Impulses of event i, by their kinds and names, with what its motion does not determine."""
    problem, lay = nlp.problem, nlp.layout
    if not (problem.redundant[i + 1] and lay.touch.impacts[i]):
        return impulses
    kernels, mode = problem.kernels, without_rails(problem.model.supports, lay.touch.modes[i + 1])
    names = kernels.surfaces, kernels.tangents, kernels.joints
    every = [
        np.array([[impulses[kind].get(name, 0.0) for name in of]])
        for kind, of in zip(FORCES, names, strict=True)
    ]
    rubbing, there = problem.models[i].in_impact_at(*at), (at[0][None], np.array(at[1:]))
    same = shared(rubbing, mode, there, Forces(*every))
    return {
        kind: {n: x for n, x in zip(of, row[0].tolist(), strict=True) if n in impulses[kind]}
        for kind, of, row in zip(FORCES, names, same, strict=True)
    }


def _impulses(lay: Layout, x: Array, i: int) -> Impulses:
    """Impulses of an event by their kind and name."""
    kinds: Impulses = {kind: {} for kind in FORCES}
    for impulses in lay.impulses(i):
        kinds[impulses.kind] |= impulses.values(x)
    return kinds


def _rates(nlp: Transcription, x: Array, i: int, t: float) -> tuple[float, float]:
    """Rates of the gap before and after collision i, from the unknowns in units of the problem."""
    lay, j = nlp.layout, int(nlp.layout.touch.surfaces[i])
    if j == NOWHERE:
        return 0.0, 0.0
    q = x[lay.index_q[lay.collision_nodes[i]]]
    before, after = (
        nlp.problem.model.gap_rates(q, x[v[i]], t)[j] for v in (lay.impact.v_a, lay.impact.v_c)
    )
    return float(before), float(after)


def _without_effect(before: Array, after: Array, largest: Array) -> bool:
    """Whether a collision changes no momentum by a share of its size that counts."""
    return bool((np.abs(after - before) <= NO_EFFECT * largest).all())


def named_multipliers(nlp: Transcription, y: Array, w: Array, z: Array) -> dict[str, Array]:
    """Multipliers by kind of constraint, in units of the problem, shape (count,), from y, w and z
    as in :func:`multiplier_vectors`; those of the momentum equations in the shape (nodes, nq),
    "bounds" those of the unknowns."""
    sizes = _sizes_of_multipliers(nlp)
    y, w, z = y * sizes[0], w * sizes[1], z * sizes[2]
    both = np.concatenate([y, w])
    named = {b.name: both[b.numbers] for b in (*nlp.equalities, *nlp.inequalities) if b.count}
    named["momentum"] = named["momentum"].reshape(-1, nlp.layout.nq)
    return named | {"bounds": z}


def multiplier_vectors(
    nlp: Transcription, named: Mapping[str, Array]
) -> tuple[Array, Array, Array]:
    """Return y, w and z, shapes (n_eq,), (n_in,) and (n,), from multipliers by kind, shape (count,)
    each; kinds of another shape, or that are not given, are zero."""
    rows, z = collected_multipliers(nlp, named)
    sizes = _sizes_of_multipliers(nlp)
    return rows[: nlp.n_eq] / sizes[0], rows[nlp.n_eq :] / sizes[1], z / sizes[2]


def collected_multipliers(nlp: Transcription, named: Mapping[str, Array]) -> tuple[Array, Array]:
    """Multipliers of the rows and of the unknowns in units of the problem, shapes (n_eq + n_in,)
    and (n,), as :func:`multiplier_vectors` takes them."""
    parts = [np.zeros(0)]
    for block in (*nlp.equalities, *nlp.inequalities):
        if block.count:
            part = np.ravel(named.get(block.name, ()))
            parts.append(part if len(part) == block.count else np.zeros(block.count))
    z = np.asarray(named.get("bounds", ()))
    return np.concatenate(parts), z if len(z) == nlp.n else np.zeros(nlp.n)


def stated_in_rates(problem: Problem, named: Mapping[str, Array]) -> bool:
    """Whether multipliers by kind are those of elastic collisions whose law is stated in the rates
    of the gaps: in energies it has a separation beside it."""
    e, hits = problem.restitution_values, [event.hit for event in problem.touch.events]
    elastic = any(e[hit] > 0 for hit in hits if hit != NOWHERE)
    return elastic and "separation" not in named


def stated_as(problem: Problem, named: Mapping[str, Array]) -> Problem:
    """The problem in the form of the law of impact for which multipliers by kind, shape (count,)
    each, were found."""
    return problem.in_rates() if stated_in_rates(problem, named) else problem


def _sizes_of_multipliers(nlp: Transcription) -> tuple[Array, Array, Array]:
    """Units of y, w and z: that of the cost by those of constraints and unknowns."""
    rows = nlp.scale.cost / nlp.row_sizes
    return rows[: nlp.n_eq], rows[nlp.n_eq :], nlp.scale.cost / nlp.sizes
