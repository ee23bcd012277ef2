"""Motions that are free between hits, read from the unknowns of many programs of one form at
once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Index
from dmoc.program.extraction import NO_EFFECT
from dmoc.program.layout import Layout


@record(frozen=True, eq=False)
class FreeRows:
    """Motions of R rows at the K nodes of all phases, of which an event has two.

    Attributes
    ----------
    begins : array of int, shape (phases + 1,)
        First nodes of the phases, and K.
    t, q, v, p : arrays, shapes (R, K) and (R, K, nq)
    u_begin, u_end : arrays, shape (R, N, nu)
        Inputs at both ends of the steps.
    inside : array, shape (R, N places, nq)
        Coordinates inside the steps.
    impulse : array, shape (R, events)
    arrivals : array, shape (R, events, nq)
        Velocities before the events.
    grazes : array of bool, shape (R, events)
        Hits that change no momentum by a share of its size that counts.
    cost : array, shape (R,)
    design : array, shape (R, number)
    par : array, shape (R, npar)
        Parameters, with those that are chosen.
    """

    begins: Index
    t: Array
    q: Array
    v: Array
    p: Array
    u_begin: Array
    u_end: Array
    inside: Array
    impulse: Array
    arrivals: Array
    grazes: NDArray[np.bool_]
    cost: Array
    design: Array
    par: Array

    @classmethod
    def of(cls, problem: Problem, lay: Layout, par: Array, y: Array) -> FreeRows:
        """The motions of unknowns y, shape (R, n), in units of the problem, with parameters par,
        shape (R, npar); ``problem`` is one of theirs."""
        count, nq, kernels = len(y), lay.nq, problem.kernels
        names, design = list(kernels.parameters), y[:, lay.index_design]
        par = par.copy()
        par[:, [names.index(name) for name in problem.design]] = design
        one = (par == par[0]).all()

        def model(rows: int) -> Model:
            return Model(kernels, par[:1] if one else np.repeat(par, rows, axis=0))

        first, last = lay.ends[:-1], lay.ends[1:]
        nodes = np.concatenate([np.arange(a, b + 1) for a, b in zip(first, last, strict=True)])
        begins = np.cumsum([0, *(last - first + 1)])
        t, begin = np.empty((count, len(nodes))), np.zeros(count)
        for i, steps in enumerate(lay.steps):
            own = t[:, begins[i] : begins[i + 1]]
            own[:] = begin[:, None] + y[:, lay.index_h[i], None] * np.arange(steps + 1)
            begin = own[:, -1]
        step = [p.reshape(count * lay.total, p.shape[-1]) for p in lay.step_inputs(y)]
        p_start, p_end, costs = model(lay.total).steps(step)
        before, after = (p.reshape(count, lay.total, nq) for p in (p_start, p_end))
        p = np.empty((count, len(nodes), nq))
        p[:, begins[:-1]] = before[:, first]
        inner = np.delete(np.arange(len(nodes)), begins[:-1])
        p[:, inner] = after
        q = y.take(lay.index_q[nodes], axis=1)
        rows = q.reshape(-1, nq), p.reshape(-1, nq), t.ravel()
        v = model(len(nodes)).velocity(*rows).reshape(q.shape)
        largest = np.maximum(np.abs(before).max(axis=1), np.abs(after).max(axis=1))
        arrive, leave = p[:, begins[1:-1] - 1], p[:, begins[1:-1]]
        grazes = (np.abs(leave - arrive) <= NO_EFFECT * largest[:, None]).all(axis=2)
        end = y[:, lay.index_v_E] if len(lay.index_v_E) else np.zeros((count, nq))
        cost = costs.reshape(count, lay.total).sum(axis=1)
        times = np.cumsum(y[:, lay.index_h[lay.phase_of_step]], axis=1)
        cost = cost + model(1).terminal_cost(y[:, lay.index_q[-1]], end, times[:, -1])
        return cls(
            begins, t, q, v, p, y.take(lay.index_u[lay.row_u_k], axis=1),
            y.take(lay.index_u[lay.row_u_kp1], axis=1),
            y.take(lay.index_q_i, axis=1).reshape(count, lay.total * lay.inside, nq),
            y[:, lay.impact.lam], y.take(lay.impact.v_a, axis=1), grazes, cost, design, par,
        )  # fmt: skip

    @property
    def final_time(self) -> Array:
        return self.t[:, -1]

    @property
    def event_times(self) -> Array:
        """Times of the events, shape (R, events)."""
        return self.t[:, self.begins[1:-1]]

    def still(self, sizes: Array) -> NDArray[np.bool_]:
        """Rows in which no momentum is larger than its size, shape (R, nq)."""
        return np.asarray((np.abs(self.p).max(axis=1) <= sizes).all(axis=1))

    def states(self, which: Index, surfaces: Index) -> tuple[Any, ...]:
        """Arrays of some rows as :func:`dmoc.check.compiled.arrays_of` has them, up to what was
        recorded of their events."""
        at = self.begins[1:-1]
        states, inputs = (self.q, self.v, self.p, self.t), (self.u_begin, self.u_end, self.inside)
        q, v, p, t = (a.take(which, axis=0) for a in states)
        numbers = np.stack([t[:, at], self.impulse[which]], axis=2)
        recorded = np.stack([q[:, at - 1], p[:, at - 1], p[:, at]], axis=2)
        begin, end, inside = (a.take(which, axis=0) for a in inputs)
        of_events = map(np.ascontiguousarray, (numbers, recorded))
        return q, v, p, t, self.begins, begin, end, inside, surfaces, *of_events
