"""A claimed motion simulated: from a row on, with its inputs, through contacts by their laws, with
the cost integrated on the way."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from common import (
    FREE,
    ContactState,
    Magnitudes,
    Mode,
    MotionRecord,
    Setting,
    magnitudes_at,
    node,
    through_step,
)
from referee_motion import Claim

import dmoc
from dmoc.codegen.kernels import Array

# Within this share of its size a gap is closed, and a rate none, where a simulation begins.
NEAR = 1e-5
# Parts of a motion, at least, and of an interval with linear inputs; the places in a part at which
# its cost is taken.
PARTS, LINEAR_PARTS = 400, 8
PLACES, WEIGHTS = (np.array([-1, 0, 1]) * 0.15**0.5 + 0.5, np.array([5, 8, 5]) / 18)
# Share of the coordinates that errors of a solver move what rests by.
ROUNDING = 1e-9
# Of the final time: what a hit at one moment may take.
INSTANT = 1e-9


@dataclass(frozen=True, eq=False)
class ClaimSizes:
    """Sizes of a motion: of coordinates and velocities (nq,), and its time."""

    q: Array
    v: Array
    time: float

    @classmethod
    def of(cls, problem: dmoc.Problem, t: Array, q: Array, v: Array) -> ClaimSizes:
        """Ranges; what hardly moves counts by a hundredth of what the energy could give it."""
        M = problem.model.mass(q, t)
        inertia = np.abs(np.diagonal(M, axis1=1, axis2=2)).max(axis=0)
        inertia, time = np.where(inertia > 0, inertia, 1.0), float(t[-1] - t[0])
        speed, reach = (np.sqrt(np.einsum("ki,kij,kj->k", x, M, x).max() / inertia) for x in (v, q))
        least = np.maximum(0.01 * speed, ROUNDING * reach / time + 1e-100)
        return cls(
            np.maximum(np.ptp(q, axis=0), least * time),
            np.maximum(np.abs(v).max(axis=0), least),
            time,
        )

    def gaps(self, slopes: Array) -> tuple[Array, Array]:
        """Sizes of gaps, or tangential positions, and of their rates, by their slopes."""
        along = np.abs(slopes)
        return along @ np.append(self.q, self.time), along @ np.append(self.v, 1.0)


@dataclass(eq=False)
class ReplayRun:
    """What a simulation comes to: states (q | v) at rows, its cost, and its events."""

    rows: list[int] = field(default_factory=list)
    states: list[Array] = field(default_factory=list)
    cost: float = 0.0
    journal: MotionRecord = field(default_factory=MotionRecord)


class Replay:
    """Simulations of one claim."""

    def __init__(self, problem: dmoc.Problem, claim: Claim, sizes: ClaimSizes) -> None:
        self.problem, self.claim, self.sizes = problem, claim, sizes
        self.model, self.part = problem.model, sizes.time / PARTS
        e = problem.restitution_values.copy()
        e[sorted({j for mode in problem.touch.modes for j in mode.closed})] = 0.0  # they land
        self.setting = Setting(self.model, e, self.part)

    def placed(self, y: Array, t: float) -> Array:
        """A state moved out of surfaces, and onto those that it rests on up to small errors."""
        model, nq = self.model, self.model.nq
        q, v = y[:nq], y[nq:]
        size, speed = self.sizes.gaps(model.gap_slopes(q, t))
        gaps, rates = model.gaps(q, t), model.gap_rates(q, v, t)
        on = gaps >= -NEAR * size
        rests = on & (np.abs(rates) <= NEAR * speed)
        _, slide = self.sizes.gaps(model.tangent_slopes(q, t))
        still = np.abs(model.slide_rates(q, v, t)) <= NEAR * slide
        sticks = [
            k for k, j in enumerate(model.supports) if still[k] and (j < 0 or rests[j])
            and model.friction[k] > 0
        ]  # fmt: skip
        rows, at = y[None].copy(), np.array([t])
        held = model.tangents(rows[:, :nq].copy(), at)
        project = self.setting.integrator.project
        project(Mode(tuple(map(int, np.flatnonzero(on)))), rows, at, held, False)
        mode = Mode(tuple(map(int, np.flatnonzero(rests))), tuple(sticks))
        project(mode, rows, at, model.tangents(rows[:, :nq].copy(), at))
        return np.asarray(rows[0])

    def run(self, y: Array, first: int, last: int) -> ReplayRun:
        """From a state at a row to another row."""
        claim, run = self.claim, ReplayRun()
        t, largest, mode = float(claim.t[first]), Magnitudes(), FREE
        y = self.placed(y, t)
        nothing = np.zeros(self.model.nc), np.zeros(self.model.nt)
        run.journal.last = ContactState(t, y, *nothing)
        run.rows, run.states = [first], [y]
        for k in range(first, last):
            begin, end = float(claim.t[k]), float(claim.t[k + 1])
            held = bool((claim.u0[k] == claim.u1[k]).all())
            parts = max(1 if held else LINEAR_PARTS, int(np.ceil((end - begin) / self.part)))
            edges = np.linspace(begin, end, parts + 1) if end > begin else np.array([begin])
            for a, b in pairwise(edges):
                share = ((a + b) / 2 - begin) / (end - begin)
                u = (1 - share) * claim.u0[k] + share * claim.u1[k]
                before, marks = y, len(run.journal.marks)
                largest = magnitudes_at(self.model, y, u, float(a), self.part, largest)
                so_far = largest, run.journal
                _, y, after = through_step(self.setting, y, u, (float(a), float(b)), so_far)
                legs = [(float(a), before, mode)]
                legs += [(m.after.t, m.after.y, m.mode) for m in run.journal.marks[marks:]]
                run.cost += self._cost(legs, float(b), u, k)
                mode = after
                run.journal.last = node(self.setting, mode, y, u, float(b))
            run.rows.append(k + 1)
            run.states.append(y)
        return run

    def _cost(self, legs: list[tuple[float, Array, Mode]], end: float, u: Array, k: int) -> float:
        """The running cost along the legs of a part of the interval k."""
        model, nq, claim, cost = self.model, self.model.nq, self.claim, 0.0
        ends = [*(leg[0] for leg in legs[1:]), end]
        for (t, y, mode), stop in zip(legs, ends, strict=True):
            if stop <= t:
                continue
            times = t + PLACES * (stop - t)
            n = len(times)
            rows, inputs, which = np.repeat(y[None], n, 0), np.repeat(u[None], n, 0), np.arange(n)
            held = model.tangents(rows[:, :nq].copy(), np.full(n, t))
            self.setting.integrator.advance(
                rows, which, which + 1, np.full(n, t), times - t, inputs, inputs, mode, held
            )
            share = (times - claim.t[k]) / (claim.t[k + 1] - claim.t[k])
            own = (1 - share)[:, None] * claim.u0[k] + share[:, None] * claim.u1[k]
            q, v = (np.ascontiguousarray(a) for a in np.hsplit(rows, 2))
            cost += float(WEIGHTS @ model.running_cost(q, v, own, times)) * (stop - t)
        return cost

    def after_hit(self, row: int) -> Array:
        """The state that the laws make at once of that at a row."""
        claim, t = self.claim, float(self.claim.t[row])
        assert claim.v is not None
        y = self.placed(np.concatenate([claim.q[row], claim.v[row]]), t)
        u = claim.u0[min(row, len(claim.u0) - 1)]
        span = t, t + INSTANT * self.sizes.time
        largest = magnitudes_at(self.model, y, u, t, self.part, Magnitudes())
        return through_step(self.setting, y, u, span, (largest, MotionRecord()))[1]
