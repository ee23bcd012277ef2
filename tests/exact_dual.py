"""The dual of a problem that is linear between its events, at durations and multipliers, in exact
fractions: of random problems that have all that there can be."""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

Numbers = list[Fraction]
DOUBLES = ctypes.POINTER(ctypes.c_double)
INPUTS, STEPS = 2, 2
IN_STEP, AT_NODE = -2, -1


class Shifts(ctypes.Structure):
    _fields_ = [
        ("operations", ctypes.c_int), ("shifts", ctypes.c_int),
        ("operation", ctypes.POINTER(ctypes.c_int)), ("constant", DOUBLES),
        ("result", ctypes.POINTER(ctypes.c_int)),
    ]  # fmt: skip


class Phase(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int) for name in ("r", "na", "nb", "steps", "paths", "nodes", "given")),
        *((name, DOUBLES) for name in ("place", "drives")),
        *((name, DOUBLES) for name in ("P", "R", "c")), ("c_0", ctypes.c_double),
        *((name, DOUBLES) for name in ("lower", "upper", "path", "most", "since", "moves")),
        ("within", DOUBLES),
        ("rows", ctypes.c_int), ("conditions", ctypes.c_int), ("S", DOUBLES),
        ("cost", ctypes.c_int), ("condition", DOUBLES),
    ]  # fmt: skip


class Rows(ctypes.Structure):
    _fields_ = [
        ("rows", ctypes.c_int), ("columns", ctypes.c_int), ("A", DOUBLES), ("b", DOUBLES),
        ("shifted", DOUBLES),
    ]  # fmt: skip


class Times(ctypes.Structure):
    _fields_ = [
        ("rows", ctypes.c_int), *((name, DOUBLES) for name in ("b", "shifted", "vanish")),
    ]  # fmt: skip


class Event(ctypes.Structure):
    _fields_ = [*((name, Rows) for name in ("after", "zero", "most")), ("when", Times)]


class Problem(ctypes.Structure):
    _fields_ = [
        ("phases", ctypes.c_int), ("phase", ctypes.POINTER(Phase)),
        ("event", ctypes.POINTER(Event)),
        ("goal_zero", Rows), ("goal_most", Rows), ("goal_cost", Rows), ("goal_when", Times),
        ("soft", DOUBLES), ("middle", DOUBLES),
        ("spreads", ctypes.c_int), ("spread", DOUBLES), ("tie", DOUBLES), ("shortest", DOUBLES),
        ("longest", DOUBLES), ("earliest", ctypes.c_double), ("latest", ctypes.c_double),
        ("shifts", Shifts), ("definitions", ctypes.c_int), ("scale", ctypes.c_double),
    ]  # fmt: skip


class Priced(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int) for name in ("phase", "node", "inside", "path")]


class RandomProblem:
    """Two phases of two steps with a place inside, of one coordinate and of two, one of whose
    inputs may have bounds, or no cost; all that can be priced is."""

    def __init__(self, seed: int, bounded: bool, flat: bool) -> None:
        self.rng, self.held = np.random.default_rng(seed), list[Any]()
        self.phases = [self._phase(r, bounded, flat) for r in (1, 2)]
        self.after, self.zero, self.most = (self._rows(k, 2) for k in (4, 1, 1))
        self.goal_zero, self.goal_most = self._rows(2, 4), self._rows(1, 4)
        self.soft, self.middle = np.array([0.0, 0.5]), self._some(2)
        self.spread, self.tie = self._some(1, 2), self._some(3, 2)
        self.priced = [
            (0, 1, AT_NODE, 0), (1, 0, 0, 1), (1, 2, AT_NODE, 0), (0, 0, IN_STEP, 0),
            (1, 0, IN_STEP, 1), (1, 0, IN_STEP, 2),
        ]  # fmt: skip
        self.count = 6 - 1 + len(self.priced)
        # Two shifts of the time t: 4 t^4 and t^3.
        operations = [[13, 0, 0], [4, 0, 0], [4, 1, 0], [12, 0, 0], [1, 3, 2], [1, 1, 0]]
        self.operations = np.array(operations, dtype=np.intc)
        self.results = np.array([4, 5], dtype=np.intc)
        self.constants = np.array([[0.0, 0], [0, 0], [0, 0], [4, 4], [0, 0], [0, 0]])

    def _some(self, *shape: int) -> Any:
        """Random numbers of few digits."""
        return np.round(self.rng.uniform(-1, 1, shape) * 64) / 64

    def _rows(self, rows: int, columns: int) -> tuple[Any, Any, Any]:
        return self._some(rows, columns), self._some(rows), self._some(rows, 2)

    def _phase(self, r: int, bounded: bool, flat: bool) -> dict[str, Any]:
        na, nb = 2 * r, INPUTS
        P = self._some(3, na + r, r + na + nb + 1) / 4
        P[0, :na, r : r + na] += np.eye(na)
        R = np.array([[2.0, 1.25], [1.25, 1.0]])
        if flat:
            R[1] = R[:, 1] = 0
        limit = np.array([0.5 if bounded else np.inf, 0.25 if bounded or flat else np.inf])
        return {
            "r": r, "na": na, "P": P, "R": R, "c": self._some(nb), "c_0": 0.25,
            "lower": -limit, "upper": limit + 0.125, "path": self._some(2, r),
            "most": self._some(2), "since": np.zeros(2), "within": np.ones(2),
            "moves": np.array([[1.0, 0], [0, 0]]),
            "S": self._some(3, 3, 2 * r + na + nb + 1) / 4, "cost": 2,
            "condition": np.array([[0, -1, 0, 1, 0], [0, 1, 0, 0, 0], [1, -1, 0, 1, 2.0]]),
        }  # fmt: skip

    # In C -----------------------------------------------------------------------------------------

    def _numbers(self, x: Any) -> Any:
        array = np.ascontiguousarray(x, dtype=float)
        self.held.append(array)
        return array.ctypes.data_as(DOUBLES)

    def _whole(self, x: Any) -> Any:
        self.held.append(x)
        return x.ctypes.data_as(ctypes.POINTER(ctypes.c_int))

    def _in_c(self, rows: tuple[Any, Any, Any]) -> Rows:
        return Rows(*rows[0].shape, *map(self._numbers, rows))

    def struct(self) -> Problem:
        """The problem as the engine takes it."""
        n = self._numbers
        phases = (Phase * 2)(*(
            Phase(
                p["r"], p["na"], INPUTS, STEPS, 2, 3, 0, n([0, 0.5, 1]), n([]),
                n(p["P"]), n(p["R"]), n(p["c"]), p["c_0"],
                *(n(p[k]) for k in ("lower", "upper", "path", "most", "since", "moves", "within")),
                3, 3, n(p["S"]), p["cost"], n(p["condition"]),
            )
            for p in self.phases
        ))  # fmt: skip
        at_event, never = map(self._in_c, (self.after, self.zero, self.most)), Times(0)
        events = (Event * 1)(Event(*at_event, never))
        free = self._in_c(self._rows(0, 4))
        shifts = Shifts(
            6, 2, self._whole(self.operations), n(self.constants), self._whole(self.results)
        )
        return Problem(
            2, phases, events, self._in_c(self.goal_zero), self._in_c(self.goal_most), free, never,
            n(self.soft),
            n(self.middle), 1, n(self.spread), n(self.tie), n(np.full(2, 1e-3)), n(np.full(2, 9.0)),
            0.0, 9.0, shifts, 0, 1.0,
        )  # fmt: skip

    # In fractions ---------------------------------------------------------------------------------

    def dual(self, t: Sequence[Fraction], m: Sequence[Fraction]) -> Fraction:
        """The least of the Lagrangian at durations and multipliers, which stand for the goal (zero,
        most), the event (zero, most) and what is priced."""
        return ExactDual(self, t, m).value

    def price_of_start(self, m: Any) -> float:
        """What the share of the start costs in the middle of the boxes."""
        t = [Fraction(5, 8), Fraction(1, 2)]
        return float(ExactDual(self, t, [Fraction(x) for x in m.tolist()]).total[-2])


class ExactDual:
    """Goes along the motion with functions of all inputs, of the share of the start and 1."""

    def __init__(self, of: RandomProblem, t: Sequence[Fraction], m: Sequence[Fraction]) -> None:
        self.of, self.m, self.size = of, m, 2 * STEPS * INPUTS + 2
        self.total = [Fraction(0)] * self.size
        share = self._unit(self.size - 2)
        state = [
            self._sum([(Fraction(a), self._one()), (Fraction(b), share)])
            for a, b in zip(of.middle, of.spread[0], strict=True)
        ]
        for j, row in enumerate(of.tie):
            self._add(m[j], [Fraction(float(row @ of.spread[0])) * x for x in share])
        value, time = Fraction(0), Fraction(0)
        for i, phase in enumerate(of.phases):
            h = t[i] / STEPS
            state = self._along(i, phase, h, time, state)
            time += t[i]
            shifts = [4 * time**4, time**3]
            if i == 0:
                for k, rows in ((3, of.zero), (4, of.most)):
                    self._price(k, rows, state, shifts)
                state = self._made(of.after, state, shifts)
        for k, rows in ((0, of.goal_zero), (2, of.goal_most)):
            self._price(k, rows, state, shifts)
        value -= sum(Fraction(s) * m[j] ** 2 / 2 for j, s in enumerate(of.soft.tolist()))
        value += self.total[-1] - abs(self.total[-2])
        for i, phase in enumerate(of.phases):
            for k in range(STEPS):
                at = (i * STEPS + k) * INPUTS
                value += least(phase, t[i] / STEPS, self.total[at : at + INPUTS])
        self.value = value

    def _unit(self, i: int) -> Numbers:
        return [Fraction(i == j) for j in range(self.size)]

    def _one(self) -> Numbers:
        return self._unit(self.size - 1)

    def _sum(self, parts: list[tuple[Fraction, Numbers]]) -> Numbers:
        return [sum((s * x[j] for s, x in parts), Fraction(0)) for j in range(self.size)]

    def _add(self, price: Fraction, function: Numbers) -> None:
        self.total = [a + price * b for a, b in zip(self.total, function, strict=True)]

    def _made(self, rows: Any, state: list[Numbers], shifts: Numbers) -> list[Numbers]:
        made = []
        for A, b, moved in zip(*(part.tolist() for part in rows), strict=True):
            rest = Fraction(b) + sum(Fraction(s) * x for s, x in zip(moved, shifts, strict=True))
            parts = [(Fraction(a), x) for a, x in zip(A, state, strict=True)]
            made.append(self._sum([*parts, (rest, self._one())]))
        return made

    def _price(self, first: int, rows: Any, state: list[Numbers], shifts: Numbers) -> None:
        for k, function in enumerate(self._made(rows, state, shifts)):
            self._add(self.m[first + k], function)

    def _along(
        self, i: int, phase: dict[str, Any], h: Fraction, time: Fraction, state: list[Numbers]
    ) -> list[Numbers]:
        """The state after a phase; what is priced along it, and its cost beside that of inputs."""
        r, na = phase["r"], phase["na"]
        y, p = state[:r], state[r:]
        P, S = (_polynomial(phase[name], h, axis) for name, axis in (("P", 0), ("S", 1)))
        for k in range(STEPS):
            at = (i * STEPS + k) * INPUTS
            u = [self._unit(at + a) for a in range(INPUTS)]
            hp = [[h * x for x in one] for one in p]
            outer = [*y, *u, self._one()]
            right = []
            for j in range(na):
                row = [*P[j][:r], *P[j][r + na :]]
                own = [(-c, x) for c, x in zip(row, outer, strict=True)]
                own += [(Fraction(-1), hp[j - na + r])] if j >= na - r else []
                right.append(self._sum(own))
            a = _solved([row[r : r + na] for row in P[:na]], right)
            every = [*y, *a, *u, self._one()]
            then = [self._sum(list(zip(row, every, strict=True))) for row in P[na:]]
            made = [
                self._sum(list(zip(row, [*y, *hp, *a, *u, self._one()], strict=True))) for row in S
            ]
            self._along_step(i, k, phase, made, a)
            for j, c in enumerate(phase["c"].tolist()):
                self._add(h * Fraction(c), u[j])
            self._add(h * Fraction(phase["c_0"]), self._one())
            y, p = a[na - r :], [[x / h for x in one] for one in then]
            self._at_node(i, k + 1, phase, y, time + (k + 1) * h)
        return [*y, *p]

    def _path(self, phase: dict[str, Any], path: int, y: list[Numbers], moved: Fraction) -> Numbers:
        parts = [(Fraction(c), x) for c, x in zip(phase["path"][path].tolist(), y, strict=True)]
        return self._sum([*parts, (moved - Fraction(float(phase["most"][path])), self._one())])

    def _along_step(
        self, i: int, k: int, phase: dict[str, Any], made: list[Numbers], a: list[Numbers]
    ) -> None:
        self._add(Fraction(1), made[phase["cost"]])
        for j, (of, node, inside, path) in enumerate(self.of.priced, 5):
            if of != i:
                continue
            if inside == IN_STEP:
                first, then, _, _, kind = phase["condition"][path].astype(int)
                if kind == 2 or node == k:
                    self._add(self.m[j], made[first])
                elif node == k - 1 and then >= 0:
                    self._add(self.m[j], made[then])
            elif inside >= 0 and node == k:
                r = phase["r"]
                self._add(self.m[j], self._path(phase, path, a[inside * r :][:r], Fraction(0)))

    def _at_node(
        self, i: int, node: int, phase: dict[str, Any], y: list[Numbers], time: Fraction
    ) -> None:
        for j, (of, at, inside, path) in enumerate(self.of.priced, 5):
            if (of, at, inside) == (i, node, AT_NODE):
                moved = 4 * time**4 if phase["moves"][path, 0] > 0 else Fraction(0)
                self._add(self.m[j], self._path(phase, path, y, moved))


def _polynomial(powers: Any, h: Fraction, axis: int) -> list[Numbers]:
    parts = [np.take(powers, k, axis=axis).tolist() for k in range(3)]
    return [
        [Fraction(a) + h * Fraction(b) + h * h * Fraction(c) for a, b, c in zip(*rows, strict=True)]
        for rows in zip(*parts, strict=True)
    ]


def _solved(A: list[Numbers], B: list[Numbers]) -> list[Numbers]:
    """The solution X of A X = B by elimination."""
    n, rows = len(A), [[*a, *b] for a, b in zip(A, B, strict=True)]
    for k in range(n):
        pivot = next(i for i in range(k, n) if rows[i][k])
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(n):
            if i != k and rows[i][k]:
                rows[i] = [x - rows[i][k] * y for x, y in zip(rows[i], rows[k], strict=True)]
    return [row[n:] for row in rows]


def least(phase: dict[str, Any], h: Fraction, y: Numbers) -> Fraction:
    """Least of h u R u/2 + y u within bounds: of all choices of what is at them."""
    R = [[h * Fraction(x) for x in row] for row in phase["R"].tolist()]
    best: Fraction | None = None
    ends = [
        [None, *(Fraction(x) for x in side if np.isfinite(x))]
        for side in zip(phase["lower"].tolist(), phase["upper"].tolist(), strict=True)
    ]
    for chosen in itertools.product(*ends):
        free = [i for i, x in enumerate(chosen) if x is None]
        if any(not R[i][i] for i in free):
            continue  # what costs nothing is at a bound
        u = [x or Fraction(0) for x in chosen]
        right = [[-y[i] - sum(R[i][j] * u[j] for j in range(INPUTS))] for i in free]
        for i, (x,) in zip(
            free, _solved([[R[i][j] for j in free] for i in free], right), strict=True
        ):
            u[i] = x
        if any(
            not lo <= x <= hi for lo, x, hi in zip(phase["lower"], u, phase["upper"], strict=True)
        ):
            continue
        value = sum(
            u[i] * (y[i] + sum(R[i][j] * u[j] for j in range(INPUTS)) / 2) for i in range(INPUTS)
        )
        best = value if best is None else min(best, value)
    assert best is not None
    return best
