"""A motion as it is planned: whether it holds together at its nodes and events, lies on the
surfaces that it hits, and keeps the bounds of its inputs.

Time goes on, positions are continuous, joints are kept, momenta are those of the velocities and
change by the planned impulses alone.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dmoc.base.arguments import check_known
from dmoc.base.errors import SimulationError
from dmoc.check.checked_motion import Motion
from dmoc.check.findings import Findings, infinite_where_none, largest
from dmoc.codegen.kernels import Array
from dmoc.motion.trajectory import Collision
from dmoc.simulation.sizes import NOTHING

# Both sides of an event share a node: times and positions differ by rounding errors, momenta by
# what a solver leaves of the balance.  Shares of the sizes.
JOINED, UNBALANCED = 1e-6, 1e-4
# A joint may be off, as a closed contact off its surface and what sticks off its place, by this
# share of the sizes, and their rates by the second share.
OFF, DRIFT = 1e-4, 0.02
# gap of a planned collision, relative to how far the coordinates move it, that a solver may leave
OFF_SURFACE = 1e-6
SINGULAR = 1e-12  # smallest eigenvalue of a regular mass matrix, relative to the largest inertias


def plan_errors(motion: Motion) -> Findings:
    """Look at a motion without simulating it."""
    of_nodes = _recorded, _times, _momenta, _positions, _balances, _disjoint, _singular
    looks = *of_nodes, _off_surfaces, _off_switches, _off_ends
    sentences = tuple(sentence for look in looks for sentence in look(motion))
    return Findings({"excess of an input": _input_excess(motion)}, sentences)


def _recorded(motion: Motion) -> Iterator[str]:
    """Events that record two impulses of their surface."""
    for c in motion.trajectory.collisions:
        own = c.impulses.get(c.surface, c.impulse)
        if not abs(c.impulse - own) <= JOINED * abs(own):
            yield f"{_event(c)} has the impulse {c.impulse:.6g} and one of {own:.6g} of {c.surface}"


def _times(motion: Motion) -> Iterator[str]:
    """Time that stands still or jumps, and events at another time than the end of their phase."""
    most = JOINED * motion.sizes.time
    back = ~(motion.run.h > 0)
    for i in range(motion.stepped if back.any() else 0):
        own = np.flatnonzero(back[motion.steps_of(i)])
        if len(own):
            yield f"the time does not go on after {motion.steps[i].t[own[0]]:.6g} s"
    for p in motion.passages:
        c, before, after = p.c, p.before, p.after
        if not abs(after.t[0] - before.t[-1]) <= most:
            yield f"a phase ends at {before.t[-1]:.6g} s and the next begins at {after.t[0]:.6g} s"
        if not abs(c.time - before.t[-1]) <= most:
            yield f"{_event(c)} is not at {before.t[-1]:.6g} s, where its phase ends"


def _momenta(motion: Motion) -> Iterator[str]:
    """Nodes whose momentum is not that of their velocity."""
    nodes = motion.nodes
    off = (nodes.p - nodes.momentum) / motion.sizes.p
    if largest(np.abs(off)) <= UNBALANCED:
        return
    for i in range(len(motion.modes)):
        own = nodes.of_phase(i)
        k, which = _worst(off[own], UNBALANCED)
        if which >= 0:
            yield (
                f"the momentum of {motion.trajectory.coordinates[which]} at "
                f"{nodes.t[own][k]:.4g} s, {nodes.p[own][k, which]:.4g}, is not that of its "
                f"velocity, {nodes.momentum[own][k, which]:.4g}"
            )


def _positions(motion: Motion) -> Iterator[str]:
    """Positions that jump at an event or from its record."""
    names = motion.trajectory.coordinates
    for p in motion.passages:
        c, before, after = p.c, p.before, p.after
        jumps = np.array([after.q[0] - before.q[-1], c.position - before.q[-1]])
        k, which = _worst(jumps / motion.sizes.q, JOINED)
        if which >= 0:
            yield f"{names[which]} jumps by {jumps[k, which]:.4g} at {_event(c)}"


def _disjoint(motion: Motion) -> Iterator[str]:
    """Joints that are not kept at nodes, and rates at which they would come apart."""
    model, names = motion.model, motion.model.kernels.joints
    if not names:
        return
    for i in range(len(motion.modes)):
        at = motion.places[i]
        place, rate = motion.sizes.along(model.joint_slopes(at.q, at.t))
        off, rates = model.joints(at.q, at.t), model.joint_rates(at.q, at.v, at.t)
        k, j = _worst(off / place, OFF)
        if j >= 0:
            yield f"the joint {names[j]!r} is off by {off[k, j]:.3g} at {at.t[k]:.4g} s"
        k, j = _worst(rates / rate, DRIFT)
        if j >= 0:
            yield f"the joint {names[j]!r} comes apart with {rates[k, j]:.3g} at {at.t[k]:.4g} s"


def _balances(motion: Motion) -> Iterator[str]:
    """Momenta that jump from the record of an event, or, where nothing stays in contact, by
    something else than the impulses; with contacts the law of impact compares them."""
    names = motion.trajectory.coordinates
    for p in motion.passages:
        c, before, after = p.c, p.before, p.after
        jumps = [before.p[-1] - c.momentum_before, after.p[0] - c.momentum_after]
        if before.free and after.free:
            jumps.append(p.missing)
        k, which = _worst(np.array(jumps) / motion.sizes.p, UNBALANCED)
        if which >= 0:
            yield (
                f"the momentum of {names[which]} jumps by "
                f"{jumps[k][which]:.4g} at {_event(c)}, beside its impulse"
            )


def _event(c: Collision) -> str:
    return f"the event {c.word!r} at {c.time:.6g} s"


def _worst(shares: Array, most: float) -> tuple[int, int]:
    """Row and column of the largest entry, if it is above a limit or no number; else -1."""
    sizes = np.abs(shares)
    if not largest(sizes) > most:
        return -1, -1
    sizes = infinite_where_none(sizes)
    row, column = np.unravel_index(int(np.argmax(sizes)), sizes.shape)
    return int(row), int(column)


def _off_surfaces(motion: Motion) -> Iterator[str]:
    """Surfaces that are hit or land where the motion is not on them."""
    noun = "contact" if motion.has_modes else "collision"
    for c in motion.trajectory.collisions:
        for name in dict.fromkeys((c.surface, *c.lands) if c.surface else ()):
            j = motion.model.surface_numbers[name]
            gap = float(motion.model.gaps(c.position, c.time)[j])
            floats = j in motion.model.contacts.floating
            if not (floats or abs(gap) <= OFF_SURFACE * motion.sizes.gap[j]):
                yield f"the {noun} with {name!r} is {gap:.3g} off it"


def _off_switches(motion: Motion) -> Iterator[str]:
    """Switches that do not vanish at their event, or that do not grow up to it."""
    model, names = motion.model, motion.model.contacts.switches
    for i, (mode, p) in enumerate(zip(motion.modes, motion.passages, strict=False)):
        if not p.c.switch:
            continue
        check_known(p.c.switch, names, "switch", error=SimulationError)
        k, q, v, t = names.index(p.c.switch), p.before.q[-1:], p.before.v[-1:], p.before.t[-1:]
        slope = np.abs(model.crossing_slopes(q, v, t)[0, k])
        size = float(slope @ np.concatenate([motion.sizes.q, motion.sizes.v, [motion.sizes.time]]))
        value = float(model.crossings(q, v, t)[0, k])
        if not abs(value) <= OFF_SURFACE * size:
            yield f"the switch {p.c.switch!r} is {value:.3g} at {_event(p.c)}, not zero"
        u = motion.trajectory.input_sides(p.before)[0][-1:]
        a = motion.within(i).flow.integrator.reaction(mode, np.hstack([q, v]), u, t).acceleration
        rate = float(model.crossing_rates(q, v, a, t)[0, k])
        if not rate >= -DRIFT * size / motion.sizes.time:
            yield f"the switch {p.c.switch!r} falls with {-rate:.3g} at {_event(p.c)}"


def _off_ends(motion: Motion) -> Iterator[str]:
    """Surfaces that are hit or land beyond their ends, and contacts that slip off elsewhere than at
    an end, or into their surface."""
    model = motion.model
    sizes, rates = motion.sizes.along(motion.nodes.within_slopes)
    for p in motion.passages if model.ends else ():
        c, way = p.c, model.within_rates(p.after.q[0], p.after.v[0], p.c.time)
        within = model.within(c.position, c.time)
        for name in dict.fromkeys((c.surface, *c.lands) if c.surface else ()):
            j = model.surface_numbers[name]
            if not within[j] >= -OFF_SURFACE * sizes[j]:
                yield f"{name!r} is hit {-within[j]:.3g} beyond its end at {c.time:.4g} s"
        for name in c.off:
            j = model.surface_numbers[name]
            if not (j in model.ends and abs(within[j]) <= OFF_SURFACE * sizes[j]):
                yield f"{name!r} slips off at {c.time:.4g} s, {within[j]:.3g} before its end"
            elif not way[j] <= DRIFT * rates[j]:
                yield f"{name!r} slips off at {c.time:.4g} s on a way that comes back to it"


def _input_excess(motion: Motion) -> float:
    """Largest excess of an input over its bounds in any step, relative to the largest input, or to
    one that the motion could use within them."""
    low, high = motion.trajectory.input_bounds.T
    u = np.concatenate([motion.run.u0, motion.run.u1])
    excess = np.maximum(low - u, u - high)
    if not (excess > 0).any():
        return 0.0
    size = np.maximum(
        np.abs(u).max(axis=0, initial=0.0), np.minimum(high - low, motion.needed_inputs)
    )
    return largest(np.where(excess > 0, excess, 0.0) / np.where(size > 0, size, NOTHING))


def _singular(motion: Motion) -> Iterator[str]:
    """A mass matrix that is not positive definite, up to rounding errors of its entries."""
    nodes = motion.nodes
    least = SINGULAR * nodes.inertia  # of the whole motion: at least those of each phase
    if np.isfinite(nodes.mass).all() and _positive(nodes.mass - np.diag(least)):
        return
    diagonal = np.abs(np.diagonal(nodes.mass, axis1=1, axis2=2))
    root = np.sqrt(np.maximum.reduceat(diagonal, nodes.begins[:-1]))
    root = np.repeat(np.where(root > 0, root, 1.0), np.diff(nodes.begins), axis=0)
    scaled = nodes.mass / root[:, :, None] / root[:, None]
    good = np.array(np.isfinite(scaled).all(axis=(1, 2)))
    good[good] = np.linalg.eigvalsh(scaled[good])[:, 0] > SINGULAR
    if not good.all():
        where = nodes.t[int(np.argmin(good))]
        yield f"the mass matrix is singular or negative on the way, first at {where:.4g} s"


def _positive(M: Array) -> bool:
    """Whether matrices are positive definite, up to rounding errors."""
    try:
        np.linalg.cholesky(M)
    except np.linalg.LinAlgError:
        return False
    return True
