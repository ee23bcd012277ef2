"""What the states of a claimed motion say against it, row by row: surfaces and limits, the forces
that its changes of momentum take, its impacts, its energy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from common import FREE, Boundary
from referee_motion import Claim
from referee_replay import PLACES, WEIGHTS, Replay
from scipy.optimize import lsq_linear

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model

# Shares of the sizes of gaps and path constraints, of forces and of energies that count.
DEEP, WEAK, ENERGY = 1e-3, 0.05, 0.01
# A surface within this share of its size pushes; one further away pushes at a distance.
CLOSE = 1e-3
LIMIT = 1e-6  # of the size of a limit or a goal, by which it may be missed


@dataclass(frozen=True)
class Violation:
    """What is violated, by how much in its own unit, when, and a sentence."""

    kind: str
    name: str
    amount: float
    time: float
    text: str


def violations(problem: dmoc.Problem, replay: Replay) -> list[Violation]:
    """All of a claim, the worst of each kind and name."""
    claim, every = replay.claim, list[Violation]()
    every += _ends(problem, claim, replay)
    every += _limits(problem, claim)
    every += _surfaces(replay)
    if claim.v is not None:
        every += _impacts(replay)
        every += _forces(replay)
        every += _energy(replay)
    worst: dict[tuple[str, str], Violation] = {}
    for v in every:
        key = v.kind, v.name
        if key not in worst or v.amount > worst[key].amount:
            worst[key] = v
    return list(worst.values())


def _ends(problem: dmoc.Problem, claim: Claim, replay: Replay) -> Iterator[Violation]:
    """Start and goal, what is periodic, and the final time."""
    names, ranges, (z, _) = (
        problem.kernels.quantities,
        problem.quantity_ranges,
        _along(problem, claim),
    )
    for what, bounds, own, row in (
        ("start", problem.start_bounds, ranges.start, 0),
        ("goal", problem.goal_bounds, ranges.goal, -1),
    ):
        v = None if claim.v is None else claim.v[row]
        off = missed(problem, bounds, claim.q[row], v, float(claim.t[row]))
        off |= {} if v is None else _outside(names, own, z[row])
        for name, by in off.items():
            yield Violation(
                what, name, by, float(claim.t[row]), f"{what}: {name} is missed by {by:.3g}"
            )
    low, high = problem.final_time_bounds
    by = max(low - replay.sizes.time, replay.sizes.time - high)
    if not by <= LIMIT * replay.sizes.time:
        yield Violation(
            "final time", "t", by, float(claim.t[-1]), f"the final time is off by {by:.3g} s"
        )
    if claim.v is not None and problem.relations:
        states = [
            _named(problem, claim.q[r], claim.v[r], float(claim.t[r]))
            | dict(zip(names, z[r].tolist(), strict=True))
            for r in (0, -1)
        ]
        sizes = dict(zip(problem.states, [*replay.sizes.q, *replay.sizes.v], strict=False))
        sizes |= dict(zip(names, np.ptp(z, axis=0), strict=True))
        for r in problem.relations:
            difference = states[1][r.end] - sum(f * states[0][name] for name, f in r.terms)
            by = max(r.low - difference, difference - r.high)
            if not by <= 100 * LIMIT * sizes.get(r.end, abs(states[1][r.end]) + abs(difference)):
                yield Violation(
                    "periodic", r.end, by, float(claim.t[-1]),
                    f"{r.end} at the end is off what periodic says by {by:.3g}",
                )  # fmt: skip


def _named(problem: dmoc.Problem, q: Array, v: Array, t: float) -> dict[str, float]:
    names, p = problem.kernels.coordinates, problem.model.momentum(q, v, t)
    state = dict(zip(names, q.tolist(), strict=True))
    state |= {velocity_name(n): float(x) for n, x in zip(names, v, strict=True)}
    return state | {momentum_name(n): float(x) for n, x in zip(names, p, strict=True)}


def velocity_bounds(problem: dmoc.Problem, bounds: Boundary, q: Array, t: float) -> Array:
    """What a problem says of the velocities of one of its ends, shape (nq, 2)."""
    if not bounds.by_velocity:
        return bounds.velocity
    v = problem.model.velocity(q, bounds.momentum[:, 0], t)
    return np.column_stack([v, v])


def missed(
    problem: dmoc.Problem, bounds: Boundary, q: Array, v: Array | None, t: float
) -> dict[str, float]:
    """By how much a state is off what a problem says of one of its ends, where it is."""
    names = problem.kernels.coordinates
    parts = [(list(names), bounds.position, q)]
    if v is not None:
        own = velocity_bounds(problem, bounds, q, t)
        parts.append((list(map(velocity_name, names)), own, v))
        if not bounds.by_velocity:
            p = problem.model.momentum(q, v, t)
            parts.append((list(map(momentum_name, names)), bounds.momentum, p))
    return {label: by for part in parts for label, by in _outside(*part).items()}


def _outside(names: Sequence[str], box: Array, values: Array) -> dict[str, float]:
    """By how much values are outside of their ranges, where they are."""
    off = {}
    for name, (low, high), value in zip(names, box, values, strict=True):
        by = float(max(low - value, value - high))
        if by > LIMIT * max(1.0, abs(value), *(abs(b) for b in (low, high) if np.isfinite(b))):
            off[name] = by
    return off


def _along(problem: dmoc.Problem, claim: Claim) -> tuple[Array, Array]:
    """Quantities at the ends of all intervals, and their times."""
    t = np.concatenate([claim.t[:-1], claim.t[1:]])
    u = np.vstack([claim.u0, claim.u1])
    if claim.v is None:
        return np.zeros((len(t), problem.model.nz)), t
    q, v = (np.vstack([a[:-1], a[1:]]) for a in (claim.q, claim.v))
    return problem.model.quantities(q, v, u, t), t


def _limits(problem: dmoc.Problem, claim: Claim) -> Iterator[Violation]:
    """Bounds of inputs and states, and path constraints at the rows."""
    kernels, steps = problem.kernels, claim.steps
    u = np.vstack([claim.u0[steps], claim.u1[steps]])
    t = np.concatenate([claim.t[steps], claim.t[steps + 1]])
    boxes_of = [
        ("input", kernels.inputs, problem.input_bounds, u, t),
        ("coordinate", kernels.coordinates, problem.coordinate_bounds, claim.q, claim.t),
    ]
    if claim.v is not None:
        rates = [velocity_name(name) for name in kernels.coordinates]
        boxes_of.append(("velocity", rates, problem.velocity_bounds, claim.v, claim.t))
        own = kernels.quantities, problem.quantity_bounds, *_along(problem, claim)
        boxes_of.append(("quantity", *own))
    for kind, names, boxes, values, times in boxes_of:
        for j, name in enumerate(names):
            low, high = boxes[j]
            over = np.maximum(low - values[:, j], values[:, j] - high)
            k = int(over.argmax())
            size = np.abs([b for b in (low, high) if np.isfinite(b)]).max(initial=0.0)
            share = LIMIT
            if kind in ("velocity", "quantity"):
                size, share = max(size, np.abs(values[:, j]).max()), DEEP
            if not over[k] <= share * max(size, 1e-100):
                text = f"{name} exceeds its bounds by {over[k]:.3g} at {times[k]:.5g} s"
                yield Violation(kind, name, float(over[k]), float(times[k]), text)
    if kernels.manifest.path_constraints and claim.v is not None:
        at = np.concatenate([steps, steps + 1])
        r = problem.model.path_at(claim.q[at], claim.v[at], u, claim.t[at])
        terms = problem.model.path_terms(claim.q[at], claim.v[at], u, claim.t[at]).max(axis=0)
        for j, name in enumerate(kernels.manifest.path_constraints):
            k = int(r[:, j].argmin())
            if not -r[k, j] <= DEEP * max(float(terms[j]), 1e-100):
                text = f"path constraint {name} is exceeded by {-r[k, j]:.3g} at {t[k]:.5g} s"
                yield Violation("path", name, float(-r[k, j]), float(t[k]), text)


def _surfaces(replay: Replay) -> Iterator[Violation]:
    """Penetrations, and joints that are off."""
    model, claim = replay.model, replay.claim
    for names, values, slopes, kind, word in (
        (model.kernels.surfaces, model.gaps(claim.q, claim.t),
         model.gap_slopes(claim.q, claim.t), "penetration", "is entered"),
        (model.kernels.joints, np.abs(model.joints(claim.q, claim.t)),
         model.joint_slopes(claim.q, claim.t), "joint", "is off"),
    ):  # fmt: skip
        size = replay.sizes.gaps(slopes)[0]
        for j, name in enumerate(names):
            k = int(values[:, j].argmax())
            if not values[k, j] <= DEEP * size[k, j]:
                by, t = float(values[k, j]), float(claim.t[k])
                yield Violation(kind, name, by, t, f"{name} {word} by {by:.3g} at {t:.5g} s")


def _impacts(replay: Replay) -> Iterator[Violation]:
    """Jumps between two rows of one time: the laws of impact from the state before."""
    claim, sizes, nq = replay.claim, replay.sizes, replay.model.nq
    assert claim.v is not None
    for k in np.flatnonzero(np.diff(claim.t) == 0):
        t, names = float(claim.t[k]), replay.model.kernels.coordinates
        moved = np.abs(claim.q[k + 1] - claim.q[k])
        if (moved > DEEP * sizes.q).any():
            j = int((moved / sizes.q).argmax())
            text = f"{names[j]} jumps by {moved[j]:.3g} at {t:.5g} s"
            yield Violation("jump", names[j], float(moved[j]), t, text)
        if not (np.abs(claim.v[k + 1] - claim.v[k]) > ENERGY * sizes.v).any():
            continue
        try:
            law = replay.after_hit(int(k))[nq:]
        except SimulationError as error:
            yield Violation("impact", f"{t:.5g} s", np.inf, t, f"no law for the impact: {error}")
            continue
        off = np.abs(claim.v[k + 1] - law)
        j = int((off / sizes.v).argmax())
        if not off[j] <= ENERGY * sizes.v[j]:
            name = velocity_name(names[j])
            yield Violation(
                "impact", f"{t:.5g} s", float(off[j]), t,
                f"impact at {t:.5g} s: {name} is {claim.v[k + 1, j]:.5g} after it, by the law "
                f"{law[j]:.5g}",
            )  # fmt: skip


def _forces(replay: Replay) -> Iterator[Violation]:
    """The forces of contacts that the changes of the momentum take, from row to row: pulls, pushes
    at a distance, friction beyond its cone or along the sliding, and what nothing explains."""
    model, claim, steps = replay.model, replay.claim, replay.claim.steps
    assert claim.v is not None
    q, v, t = claim.q, claim.v, claim.t
    ends, h = np.hstack([q, v])[steps], t[steps + 1] - t[steps]
    which = np.arange(len(steps))
    inputs = np.ascontiguousarray(claim.u0[steps]), np.ascontiguousarray(claim.u1[steps])
    integrator = replay.setting.integrator
    integrator.sizes = np.concatenate([replay.sizes.q, replay.sizes.v, [1.0]])
    free = ends.copy()
    integrator.advance(free, which, which + 1, t[steps], h, *inputs, FREE)
    M, F = model.equations(q[steps], v[steps], inputs[0], t[steps])
    strong = np.sqrt(np.einsum("ni,ni->n", F, np.linalg.solve(M, F[..., None])[..., 0]).max())
    strong = max(float(strong), np.sqrt(np.einsum("ni,nij,nj->n", v[steps], M, v[steps]).max())
                 / replay.sizes.time)  # fmt: skip
    for n, k in enumerate(steps):
        push = M[n] @ (v[k + 1] - free[n, model.nq :]) / h[n]
        yield from _explained(replay, int(k), push, M[n], WEAK * strong)


def _explained(replay: Replay, k: int, push: Array, M: Array, small: float) -> Iterator[Violation]:
    """What the mean force of contacts in one interval, measured by the masses, has against it."""
    model, claim = replay.model, replay.claim
    assert claim.v is not None
    root = np.linalg.inv(np.linalg.cholesky(M))
    if np.linalg.norm(root @ push) <= small and not model.nt:
        return
    t, ends = float(claim.t[k + 1]), slice(k, k + 2)
    slopes = model.gap_slopes(claim.q[k + 1], t)
    along = model.tangent_slopes(claim.q[k + 1], t)[:, :-1]
    size = replay.sizes.gaps(slopes)[0]
    gaps = model.gaps(claim.q[ends], claim.t[ends])
    sigma = model.slide_rates(claim.q[ends], claim.v[ends], claim.t[ends])
    near = np.flatnonzero((gaps >= -CLOSE * size).any(axis=0))
    lasting = [j for j in near if (gaps[:, j] >= -CLOSE * size[j]).all()]
    rough = [i for i in range(model.nt) if model.hit_friction[i] > 0]
    rubs = [i for i in rough if model.supports[i] < 0 or model.supports[i] in near]
    B = np.vstack([-slopes[near, :-1], along[rubs]])
    joints = model.joint_slopes(claim.q[k + 1], t)[:, :-1]

    def split(rows: Array) -> tuple[Array, float]:
        rows = np.vstack([rows, joints])
        lam = np.linalg.lstsq((rows @ root.T).T, root @ push, rcond=None)[0]
        return lam, float(np.linalg.norm(root @ (push - lam @ rows)))

    slides = {
        i: int(np.sign(sigma[0, i])) if _slides(replay, k, i, sigma[:, i]) else 0 for i in rubs
    }
    if np.linalg.matrix_rank(B) < len(B):
        edges = list(_edges(model, B, [int(j) for j in near], slides))
        edges += [(row, -np.inf, np.inf) for row in joints]
        if _shared(push, root, edges) <= small:
            return  # how they share it is open
    lam, rest = split(B)
    weigh = [float(np.linalg.norm(root @ row)) for row in B]
    when, N = f"at {claim.t[k]:.5g} s", np.zeros(model.nc)
    N[near] = lam[: len(near)]
    if rest > small:
        far = split(np.vstack([-slopes[:, :-1], along[rubs]]))
        distant = [j for j in range(model.nc) if j not in near and far[0][j] > 0]
        if far[1] <= small and distant:
            j = max(distant, key=lambda j: far[0][j])
            name, by = model.kernels.surfaces[j], -float(gaps[:, j].max())
            text = f"{name} pushes with {far[0][j]:.3g} {when}, {by:.3g} away"
            yield Violation("distance", name, by, float(claim.t[k]), text)
        else:
            j = int(np.abs(push - lam[: len(B)] @ B).argmax())
            name, by = model.kernels.coordinates[j], float(abs((push - lam[: len(B)] @ B)[j]))
            text = f"a force of {by:.3g} on {name} {when} comes from nothing"
            yield Violation("force", name, by, float(claim.t[k]), text)
    for n, j in enumerate(near):
        if N[j] * weigh[n] < -small:
            name = model.kernels.surfaces[j]
            text = f"{name} pulls with {-N[j]:.3g} {when}"
            yield Violation("pull", name, float(-N[j]), float(claim.t[k]), text)
    bears = model.bearing(N)
    for n, i in enumerate(rubs, len(near)):
        j, name, T = model.supports[i], model.kernels.tangents[i], float(lam[n])
        if j >= 0 and j not in lasting:
            continue  # in the interval of a hit the mean of the force says nothing
        excess, least = (abs(T) - bears[i]) * weigh[n], (bears[i] - abs(T)) * weigh[n]
        if excess > small:
            text = f"friction of {name} is {abs(T):.3g} {when}, at most {bears[i]:.3g} is held"
            yield Violation("cone", name, float(abs(T) - bears[i]), float(claim.t[k]), text)
        if not slides[i]:
            continue
        if sigma[0, i] * T > 0 and abs(T) * weigh[n] > small:
            text = f"friction of {name} pushes along its sliding with {abs(T):.3g} {when}"
            yield Violation("slip", name, abs(T), float(claim.t[k]), text)
        elif least > small:
            text = f"{name} slides {when} with friction {abs(T):.3g} instead of {bears[i]:.3g}"
            yield Violation("slip", name, float(bears[i] - abs(T)), float(claim.t[k]), text)


def _slides(replay: Replay, k: int, i: int, sigma: Array) -> bool:
    """Whether a tangent slides in one direction all along an interval."""
    claim = replay.claim
    slope = replay.model.tangent_slopes(claim.q[k + 1], float(claim.t[k + 1]))[i]
    speed = replay.sizes.gaps(slope)[1]
    return bool(sigma[0] * sigma[1] > 0 and np.abs(sigma).min() > ENERGY * speed)


def _edges(
    model: Model, B: Array, near: list[int], slides: dict[int, int]
) -> Iterator[tuple[Array, float, float]]:
    """What contacts may push with: rows whose sums the laws allow, with the least and the largest
    factor of each.  Friction of a surface comes with the edges of its cone."""
    bears, smooth = model.bearing(np.zeros(model.nc)), set(near)
    for n, (i, s) in enumerate(slides.items(), len(near)):
        j = int(model.supports[i])
        smooth.discard(j)
        if j < 0:
            low, high = (-s * bears[i],) * 2 if s else (-bears[i], bears[i])
            yield B[n], low - LIMIT * bears[i], high + LIMIT * bears[i]
            continue
        for way in (-s,) if s else (1, -1):
            yield B[near.index(j)] + way * model.friction[i] * B[n], 0.0, np.inf
    for j in smooth:
        yield B[near.index(j)], 0.0, np.inf


def _shared(push: Array, root: Array, edges: list[tuple[Array, float, float]]) -> float:
    """What a force differs, measured by the masses, from the nearest that its rows may make."""
    rows, low, high = (np.array(part) for part in zip(*edges, strict=True))
    nearest = lsq_linear((rows @ root.T).T, root @ push, (low, high))
    return float(np.linalg.norm(nearest.fun))


def _energy(replay: Replay) -> Iterator[Violation]:
    """Energy beyond the work of inputs and dissipation, which contacts at rest can only take."""
    model, claim, steps = replay.model, replay.claim, replay.claim.steps
    assert claim.v is not None
    if model.kernels.manifest.explicit_time:
        return
    q, v, t = claim.q, claim.v, claim.t
    h, work = (t[steps + 1] - t[steps])[:, None], np.zeros(len(t) - 1)
    (q0, v0), (q1, v1) = (q[steps], h * v[steps]), (q[steps + 1], h * v[steps + 1])
    for s, weight in zip(PLACES, WEIGHTS, strict=True):
        d = q1 - q0
        place = q0 + s * (v0 + s * (3 * d - 2 * v0 - v1 + s * (v0 + v1 - 2 * d)))
        rate = (v0 + s * (2 * (3 * d - 2 * v0 - v1) + 3 * s * (v0 + v1 - 2 * d))) / h
        u = (1 - s) * claim.u0[steps] + s * claim.u1[steps]
        power = model.balance(place, rate, u, t[steps] + s * h[:, 0])[2]
        work[steps] += weight * h[:, 0] * power
    done = np.concatenate([[0.0], np.cumsum(work)])
    own = model.energy(q, v, t) - done
    rise = own - np.minimum.accumulate(own)
    masses, size = model.mass(q, t), replay.sizes.v
    k, kinetic = int(rise.argmax()), np.einsum("ki,kij,kj->k", v, masses, v).max() / 2
    rounding = np.finfo(float).eps * np.einsum("i,kij,j->k", size, np.abs(masses), size).max()
    if not rise[k] <= ENERGY * max(float(kinetic), float(np.ptp(done)), float(rounding)):
        text = f"energy of {rise[k]:.3g} until {t[k]:.5g} s comes from nothing"
        yield Violation("energy", "energy", float(rise[k]), float(t[k]), text)
