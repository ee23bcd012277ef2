"""What holds a motion together at its nodes and events: time goes on, positions are continuous,
momenta are those of the velocities and change by the planned impulses alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dmoc.check.checked_motion import Motion
from dmoc.codegen.kernels import Array
from dmoc.motion.trajectory import Collision

# Both sides of an event share a node: times and positions differ by rounding errors, momenta by
# what a solver leaves of the balance.  Shares of the sizes.
JOINED, BALANCED = 1e-6, 1e-4
# A joint may be off, as a closed contact off its surface and what sticks off its place, by this
# share of the sizes, and their rates by the second share.
OFF, DRIFT = 1e-4, 0.02


def torn(motion: Motion) -> list[str]:
    """What does not hold together, in sentences."""
    held = (*_momenta(motion), *_positions(motion), *_balances(motion))
    return [*_times(motion), *held, *_disjoint(motion)]


def _times(motion: Motion) -> Iterator[str]:
    """Time that stands still or jumps, and events at another time than the end of their phase."""
    most = JOINED * motion.sizes.time
    for phase in motion.trajectory.phases:
        back = np.flatnonzero(~(np.diff(phase.t) > 0))
        if len(back):
            yield f"the time does not go on after {phase.t[back[0]]:.6g} s"
    for p in motion.passages:
        c, before, after = p.c, p.before, p.after
        if not abs(after.t[0] - before.t[-1]) <= most:
            yield f"a phase ends at {before.t[-1]:.6g} s and the next begins at {after.t[0]:.6g} s"
        if not abs(c.time - before.t[-1]) <= most:
            yield f"{_event(c)} is not at {before.t[-1]:.6g} s, where its phase ends"


def _momenta(motion: Motion) -> Iterator[str]:
    """Nodes whose momentum is not that of their velocity."""
    for phase in motion.trajectory.phases:
        p = motion.model.momentum(phase.q, phase.v, phase.t)
        k, which = _worst((phase.p - p) / motion.sizes.p, BALANCED)
        if which >= 0:
            yield (
                f"the momentum of {motion.trajectory.coordinates[which]} at {phase.t[k]:.4g} s, "
                f"{phase.p[k, which]:.4g}, is not that of its velocity, {p[k, which]:.4g}"
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
    for phase in motion.trajectory.phases:
        place, rate = motion.sizes.along(model.joint_slopes(phase.q, phase.t))
        off, rates = model.joints(phase.q, phase.t), model.joint_rates(phase.q, phase.v, phase.t)
        k, j = _worst(off / place, OFF)
        if j >= 0:
            yield f"the joint {names[j]!r} is off by {off[k, j]:.3g} at {phase.t[k]:.4g} s"
        k, j = _worst(rates / rate, DRIFT)
        if j >= 0:
            yield (
                f"the joint {names[j]!r} comes apart with {rates[k, j]:.3g} at {phase.t[k]:.4g} s"
            )


def _balances(motion: Motion) -> Iterator[str]:
    """Momenta that jump from the record of an event, or, where nothing stays in contact, by
    something else than the impulses; with contacts the law of impact compares them."""
    names = motion.trajectory.coordinates
    for p in motion.passages:
        c, before, after = p.c, p.before, p.after
        jumps = [before.p[-1] - c.momentum_before, after.p[0] - c.momentum_after]
        if before.free and after.free:
            jumps.append(p.missing)
        k, which = _worst(np.array(jumps) / motion.sizes.p, BALANCED)
        if which >= 0:
            yield (
                f"the momentum of {names[which]} jumps by "
                f"{jumps[k][which]:.4g} at {_event(c)}, beside its impulse"
            )


def _event(c: Collision) -> str:
    return f"the event {c.word!r} at {c.time:.6g} s"


def _worst(shares: Array, most: float) -> tuple[int, int]:
    """Row and column of the largest entry, if it is above a limit or no number; else -1."""
    sizes = np.nan_to_num(np.abs(shares), nan=np.inf)
    if not sizes.max(initial=0.0) > most:
        return -1, -1
    row, column = np.unravel_index(int(np.argmax(sizes)), sizes.shape)
    return int(row), int(column)
