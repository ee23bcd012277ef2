"""Switches of a model that pass zero along a simulated motion: phases end there.

A crossing is located between recorded nodes, on the cubics through their positions and velocities,
whose error is of the fourth power of the time between these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.motion.trajectory import FORCES, Collision, Phase
from dmoc.simulation.roots import crossing

# Share of the time between two nodes, to which a crossing is located.
LOCATED = 1e-12


def with_switches(
    models: Sequence[Model], phases: Sequence[Phase], collisions: Sequence[Collision]
) -> tuple[list[Phase], list[Collision]]:
    """Phases with constant inputs, each with its model, and the events between them, with those of
    switches."""
    parts, events = list[Phase](), list[Collision]()
    for model, phase, event in zip(models, phases, (*collisions, None), strict=True):
        rest = phase
        for time, switch in _crossings(model, phase):
            if rest.t[0] < time < rest.t[-1] and not _is_known(phase, time, collisions):
                before, rest = _split(model, rest, time)
                parts.append(before)
                p = rest.p[0]
                name = model.contacts.switches[switch]
                events.append(Collision("", time, rest.q[0], 0.0, p, p, switch=name))
        parts.append(rest)
        events += [event] if event else []
    return parts, events


def _is_known(phase: Phase, time: float, events: Sequence[Collision]) -> bool:
    """Whether a time is that of a switch which has ended or begins a phase."""
    near = SAME * phase.duration
    return any(event.switch and abs(event.time - time) <= near for event in events)


def _crossings(model: Model, phase: Phase) -> list[tuple[float, int]]:
    """Times in a phase at which switches grow through zero, and which, in order."""
    if not model.contacts.switches:
        return []
    w = model.crossings(phase.q, phase.v, phase.t)[:, : len(model.contacts.switches)]
    passed = np.argwhere((w[:-1] < 0) & (w[1:] >= 0)).tolist()

    def time(k: int, i: int) -> float:
        def value(share: float) -> float:
            q, v, t = _between(phase, k, share)
            return float(model.crossings(q, v, t)[i])

        share = crossing(value, (0.0, float(w[k, i])), (1.0, float(w[k + 1, i])), LOCATED)
        return _between(phase, k, share)[2]

    return sorted((time(k, i), i) for k, i in passed)


def _between(phase: Phase, k: int, share: float) -> tuple[Array, Array, float]:
    """The state (q, v), shape (nq,) each, and the time at a share of the step after node k, on the
    cubic through both nodes."""
    h = float(phase.t[k + 1] - phase.t[k])
    (q0, q1), (v0, v1) = phase.q[k : k + 2], h * phase.v[k : k + 2]
    c2, c3 = 3 * (q1 - q0) - 2 * v0 - v1, 2 * (q0 - q1) + v0 + v1
    q = q0 + share * (v0 + share * (c2 + share * c3))
    return q, (v0 + share * (2 * c2 + 3 * share * c3)) / h, float(phase.t[k] + share * h)


def _split(model: Model, phase: Phase, time: float) -> tuple[Phase, Phase]:
    """The parts of a phase before and after a time between its ends."""
    k = int(np.searchsorted(phase.t, time, "right")) - 1
    share = (time - float(phase.t[k])) / float(phase.t[k + 1] - phase.t[k])
    q, v, _ = _between(phase, k, share)
    p = model.momentum(q, v, time)
    at = {"t": np.array([time]), "q": q[None], "p": p[None], "v": v[None]}
    for kind in FORCES:
        rows = getattr(phase, kind)
        at[kind] = (1 - share) * rows[k : k + 1] + share * rows[k + 1 : k + 2]
    upto = k + (share > 0)
    before, after = dict[str, Any](u=phase.u[:upto]), dict[str, Any](u=phase.u[k:])
    for name, row in at.items():
        rows = getattr(phase, name)
        before[name] = np.concatenate([rows[:upto], row])
        after[name] = np.concatenate([row, rows[k + 1 :]])
    return replace(phase, **before), replace(phase, **after)
