"""Referee of motions: simulates a motion that any tool claims, with its own inputs and the laws of
impact and friction, integrates its cost, and tells what it violates.

python benchmarks/referee.py problem.py:problem motion.csv
python benchmarks/referee.py puck_table motion.csv --inputs linear --claimed 0.53 --json

The table has a header with the names of the model, units in brackets if you like: t, all
coordinates, all velocities or none, all inputs.  Two rows at one time are the two sides of a jump.
Inputs are held until the next row, or linear between rows (--inputs linear, or a line
"# inputs: linear").  A column numerical_time is that of a tool whose physical time t may stand
still.  Exit: 0 where the motion keeps the laws, 1 where not, 2 where it cannot be read.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from referee_laws import Violation, missed, velocity_bounds, violations
from referee_motion import FORMS, Claim, read_claim
from referee_replay import ClaimSizes, Replay, ReplayRun

import dmoc
from dmoc.base.errors import ProblemError, SimulationError
from dmoc.codegen.kernels import Array
from dmoc.models.registry import find

TOLERANCE = 0.01  # share of the sizes of a motion, as in the check of a solution
ROUNDED = 1e-9  # deviation, in these sizes, that may be rounding errors
WINDOWS = 20


@dataclass(frozen=True)
class Window:
    """A simulation from one row to another one: the largest share of the sizes by which its end
    is off."""

    begin: float
    end: float
    defect: float


@dataclass(frozen=True)
class Judgement:
    """What the referee tells; costs are those of the simulated motion."""

    agrees: bool
    followed: str  # "open loop" or "piecewise"
    cost: float
    claimed: float | None
    frozen_cost: float
    deviation: float
    deviation_of: str
    windows: tuple[Window, ...]
    goal_missed: dict[str, float]
    events: tuple[str, ...]
    frozen: tuple[dict[str, float], ...]
    violations: tuple[Violation, ...]
    notes: tuple[str, ...]

    def _off(self) -> str:
        """The deviation in words; rounding errors, which differ between machines, are one."""
        if self.deviation <= ROUNDED:
            return f"below {ROUNDED:g} of its size"
        return f"{self.deviation:.3g} of its size, {self.deviation_of}"

    @property
    def lines(self) -> list[str]:
        """What a person reads."""
        worst = max(self.windows, key=lambda w: w.defect, default=None)
        lines = [
            f"cost           {self.cost:.8g}"
            if np.isfinite(self.cost)
            else "cost           unknown",
            f"simulated      {self.followed}",
            f"deviation      {self._off()}",
        ]
        if self.claimed is not None:
            lines.insert(1, f"claimed        {self.claimed:.8g}, {self._claim()}")
        if worst is not None:
            lines.append(
                f"windows        {len(self.windows)}, the worst from {worst.begin:.5g} to "
                f"{worst.end:.5g} s ends {worst.defect:.3g} of the sizes off"
            )
        off = ", ".join(f"{name} by {by:.3g}" for name, by in self.goal_missed.items())
        lines.append(f"goal           {'off: ' + off if off else 'reached'}")
        lines.append(f"events         {', '.join(self.events) or 'none'}")
        for frozen in self.frozen:
            lines.append(
                f"frozen time    {frozen['seconds']:.4g} s of numerical time at "
                f"{frozen['time']:.5g} s, {frozen['rows']:g} rows cut out"
            )
        lines += [f"violated       {v.text}" for v in self.violations]
        lines += [f"note           {text}" for text in self.notes]
        return [*lines, f"verdict        {'keeps the laws' if self.agrees else 'refused'}"]

    def _claim(self) -> str:
        assert self.claimed is not None
        size = TOLERANCE * max(abs(self.cost), abs(self.claimed))
        if abs(self.claimed - self.cost) <= size:
            return "as recomputed"
        if self.frozen_cost and abs(self.claimed - self.cost - self.frozen_cost) <= size:
            return f"which counts {self.frozen_cost:.6g} of frozen time"
        return f"{self.claimed - self.cost:+.6g} beside the recomputed one"


def judge(problem: dmoc.Problem, claim: Claim, claimed: float | None = None) -> Judgement:
    """Simulate a claim and tell what it violates."""
    if problem.ignored:
        raise SimulationError(
            f"the problem ignores {', '.join(problem.ignored)}: a simulation hits every surface; "
            "state it without ignored surfaces."
        )
    with np.errstate(all="ignore"):
        return _judged(problem, claim, claimed)


def _judged(problem: dmoc.Problem, claim: Claim, claimed: float | None) -> Judgement:
    velocities, notes = claim.v, list[str]()
    if velocities is None:
        velocities = np.zeros_like(claim.q)
        steps = claim.steps
        velocities[steps] = np.diff(claim.q, axis=0)[steps] / np.diff(claim.t)[steps, None]
        notes.append("the table has no velocities: impacts, forces and energy are not judged")
    sizes = ClaimSizes.of(problem, claim.t, claim.q, velocities)
    replay = Replay(problem, claim, sizes)
    last, nq = len(claim.t) - 1, problem.nq
    v_0 = _start_velocity(problem, claim) if claim.v is None else claim.v[0]
    run, end = ReplayRun(), None
    try:
        run = replay.run(np.concatenate([claim.q[0], v_0]), 0, last)
        end = run.states[-1]
        deviation, which = _deviation(replay, run)
    except SimulationError as error:
        run, deviation, which = ReplayRun(cost=np.nan), np.inf, "the simulation stops"
        notes.append(f"open loop: {error}")
    windows, cost, followed, runs = list[Window](), run.cost, "open loop", [run]
    if deviation > TOLERANCE and claim.v is not None:
        pieces, windows, reasons = _piecewise(replay)
        notes += reasons
        if windows:
            followed, runs = "piecewise", pieces
            cost, end = sum(p.cost for p in pieces), pieces[-1].states[-1]
            notes.append(f"open loop it is {deviation:.3g} of its size off: {which}")
            deviation = max(w.defect for w in windows)
            which = "largest end of a window"
    end = np.full(2 * nq, np.nan) if end is None else end
    cost += _terminal(problem, end, float(claim.t[-1]))
    if problem.model.has_objective:
        notes.append("the objective is not recomputed: the cost is that of integrand and end alone")
    off = missed(problem, problem.goal_bounds, *np.hsplit(end, 2), float(claim.t[-1]))
    broken = violations(problem, replay)
    return Judgement(
        bool(deviation <= TOLERANCE and not broken), followed, float(cost), claimed,
        sum(f.cost for f in claim.frozen), float(deviation), which, tuple(windows), off,
        tuple(_events(runs)), tuple(asdict(f) for f in claim.frozen), tuple(broken), tuple(notes),
    )  # fmt: skip


def _start_velocity(problem: dmoc.Problem, claim: Claim) -> Array:
    bounds = velocity_bounds(problem, problem.start_bounds, claim.q[0], float(claim.t[0]))
    if not (bounds[:, 0] == bounds[:, 1]).all():
        raise ProblemError(
            "the table has no velocities and the problem does not fix them at the start: give "
            "their columns."
        )
    return np.ascontiguousarray(bounds[:, 0])


def _terminal(problem: dmoc.Problem, end: Array, t: float) -> float:
    q, v = np.hsplit(end, 2)
    return float(problem.model.terminal_cost(q[None], v[None], np.array([t]))[0])


def _deviation(replay: Replay, run: ReplayRun) -> tuple[float, str]:
    """The largest share of its size by which a row is off the simulation.  Velocities count away
    from hits, whose times differ a little."""
    claim, sizes, nq = replay.claim, replay.sizes, replay.model.nq
    y = np.array(run.states)
    off = np.abs(y[:, :nq] - claim.q[run.rows]) / sizes.q
    names = list(replay.model.kernels.coordinates)
    if claim.v is not None:
        rates = np.abs(y[:, nq:] - claim.v[run.rows]) / sizes.v
        rates[_at_hits(replay, run)] = 0.0
        off, names = np.hstack([off, rates]), [*names, *(f"{name}_dot" for name in names)]
    k, j = np.unravel_index(int(np.nan_to_num(off, nan=np.inf).argmax()), off.shape)
    return float(off[k, j]), f"{names[j]} at {claim.t[run.rows[k]]:.5g} s"


def _at_hits(replay: Replay, run: ReplayRun) -> Array:
    """Rows beside a jump of the claim or a hit of the simulation."""
    t = replay.claim.t[run.rows]
    times = [*t[1:][np.diff(t) == 0], *(c.time for c in run.journal.collisions)]
    before, after = np.concatenate([t[:1], t[:-1]]), np.concatenate([t[1:], t[-1:]])
    beside = np.zeros(len(t), dtype=bool)
    for time in times:
        beside |= (before <= time) & (time <= after)
    return beside


def _piecewise(replay: Replay) -> tuple[list[ReplayRun], list[Window], list[str]]:
    """Simulations from the claim's own states at some rows, away from its jumps."""
    claim, sizes, nq = replay.claim, replay.sizes, replay.model.nq
    assert claim.v is not None
    jumps = np.flatnonzero(np.diff(claim.t) == 0)
    apart = np.setdiff1d(np.arange(1, len(claim.t) - 1), np.concatenate([jumps, jumps + 1]))
    picked = apart[np.linspace(0, len(apart) - 1, WINDOWS + 1).round().astype(int)[1:-1]] if len(
        apart) else apart  # fmt: skip
    edges = np.unique(np.concatenate([[0], picked, [len(claim.t) - 1]])).tolist()
    runs, windows = list[ReplayRun](), list[Window]()
    for a, b in pairwise(edges):
        try:
            run = replay.run(np.concatenate([claim.q[a], claim.v[a]]), a, b)
        except SimulationError as error:
            return [], [], [f"from {claim.t[a]:.5g} s: {error}"]
        y = run.states[-1]
        off = np.abs(y[:nq] - claim.q[b]) / sizes.q
        if not _at_hits(replay, run)[-1]:
            off = np.maximum(off, np.abs(y[nq:] - claim.v[b]) / sizes.v)
        runs.append(run)
        windows.append(Window(float(claim.t[a]), float(claim.t[b]), float(off.max())))
    return runs, windows, []


def _events(runs: list[ReplayRun]) -> list[str]:
    """Hits and stretches of contact and friction, in the order of their times."""
    events = [(c.time, f"hits {c.surface} at {c.time:.5g} s") for r in runs
              for c in r.journal.collisions]  # fmt: skip
    words = {None: "closed", 0: "sticks", 1: "slides +", -1: "slides -"}
    for run in runs:
        here: dict[float, list[str]] = {}
        going = [(key[0], key[1], begin) for key, begin in run.journal.going.items()]
        for name, s, begin in [*((x.name, x.friction, x.begin) for x in run.journal.stretches),
                               *going]:  # fmt: skip
            here.setdefault(begin, []).append(f"{name} {words[s]} from {begin:.5g} s")
        events += [(begin, text) for begin, texts in here.items() for text in texts]
    return [text for _, text in sorted(events, key=lambda event: event[0])]


def problem_of(reference: str) -> dmoc.Problem:
    """A shipped problem, or that of ``file.py:name``."""
    sys.path.append(str(Path(reference.rpartition(":")[0]).resolve().parent))
    stated = find(reference)
    if not stated.defaults:
        raise ProblemError(f"{reference} is no Problem: name one, or a function that returns it.")
    return dmoc.Problem(stated.kernels(), **stated.defaults)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("problem", help="file.py:name of a dmoc.Problem, or a shipped one")
    parser.add_argument("motion", type=Path, help="table as CSV")
    parser.add_argument("--inputs", choices=FORMS, help="between rows; by default what is said")
    parser.add_argument("--claimed", type=float, help="cost that the tool claims")
    parser.add_argument("--json", action="store_true", help="print a JSON object")
    options = parser.parse_args(arguments)
    try:
        problem = problem_of(options.problem)
        judgement = judge(
            problem, read_claim(options.motion, problem, options.inputs), options.claimed
        )
    except dmoc.DmocError as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    text = json.dumps(_finite(asdict(judgement)), indent=1) if options.json else ""
    sys.stdout.write((text or "\n".join(judgement.lines)) + "\n")
    return 0 if judgement.agrees else 1


def _finite(value: object) -> object:
    """The same with None for what is not finite, which JSON has no number for."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


if __name__ == "__main__":
    sys.exit(main())
