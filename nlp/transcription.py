"""The nonlinear program of a problem: cost, constraints, derivatives and bounds, assembled from step elements.

Equality constraints (c = 0), node by node along the whole chain of steps::

    momentum   r_plus(k-1) + r_minus(k) - lam grad g(q_c) [+ p_B at the start, - p_E at the end] = 0
    inside     r_i(k) = 0                                                          in each step, at order 4
    time       t_kp1 - t_k - h = 0                                                 in each step, where the model depends on the time
    arrival    r_plus(last step before) - dL/dv(q_c, v_a) = 0                      at each collision
    departure  r_minus(first step after) + dL/dv(q_c, v_c) = 0                     at each collision
    energy     e (e_plus(last step before) - e_minus(first step after)) - W = 0    at each collision; e is its coefficient of restitution
               w(q_c, v_c) = 0                                                     instead where e = 0, and where a collision only touches
    contact    g(q_c) = 0                                                          at each collision
    velocity   p_B - dL/dv(q_0, v_B) = 0, p_E - dL/dv(q_N, v_E) = 0                where velocities are needed
    final time t_E - value = 0                                                     where it is fixed
    periodic   state at the end - state at the start = 0

Inequality constraints (d >= 0): gaps -g(q_k) at every node (and inside the steps at order 4), path constraints r_d of every step, bounds of
the final time, approach w(q_c, v_a) >= 0 and separation -w(q_c, v_c) >= 0 at each collision, and T_i - T_min of each phase before one.

Everything here works on scaled unknowns and returns scaled values (:mod:`dmoc.nlp.scaling`): x of :class:`Transcription` is x divided by
``unit``, a row of r is divided by ``row_unit``.  :meth:`Transcription.physical` and :meth:`Transcription.scaled` convert.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse

from dmoc.codegen.kernels import Array
from dmoc.nlp.assembly import Program
from dmoc.nlp.elements import NOWHERE, Element, Elements, Rows
from dmoc.nlp.feasibility import minimal_time
from dmoc.nlp.labels import Block, Goal, equality_blocks, goal_limits, inequality_blocks
from dmoc.nlp.layout import Index, Layout
from dmoc.nlp.problem import Problem
from dmoc.nlp.program import ElementData, PassData, ProgramData
from dmoc.nlp.scaling import Scale
from dmoc.nlp.sparse import SparsePattern
from dmoc.nlp.surfaces import on_surface
from dmoc.symbolic.names import momentum_name, velocity_name

Matrix: TypeAlias = Any  # a SciPy CSR matrix; SciPy ships no type information
# The smallest step that is distinguishable from none, relative to the final time: shorter steps divide rounding errors by h^2.
SMALLEST_STEP = 1e-8
# A bound that lies on the surface to be hit gives way by this share of the coordinate's size.
GIVES_WAY = 1e-3
# Where collisions would rather merge, a phase between them shrinks to nothing and its equations with it: share of the largest final time
# (or of its own longest duration) that each phase of a motion with collisions keeps, unless the problem says otherwise.
SHORTEST_PHASE = 1e-3


class Transcription:
    """The nonlinear program of a :class:`Problem`.

    Attributes
    ----------
    layout : Layout
    lower, upper : arrays of shape (n,)
        Bounds of the scaled unknowns; ``limits`` are those of the unknowns.
    scale : Scale
        Sizes; none by default, so that x and r are in units of the problem.
    touching : array of bool
        Collisions that touch their surface without an impulse.
    equalities, inequalities : lists of Block
    goal_as_rows : bool
        Values of the goal are constraints instead of bounds of the unknowns, so that they can be missed by some amount.
    """

    def __init__(
        self, problem: Problem, scale: Scale | None = None, minimal_times: bool | None = None, goal_as_rows: bool = False,
        touching: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self.problem = problem
        self.goal_as_rows = goal_as_rows
        self.layout = Layout.of(problem)
        self.par = problem.parameter_values
        self.minimal_times = problem.minimal_times if minimal_times is None else minimal_times
        self.surfaces = np.array([problem.kernels.surfaces.index(s) for s in problem.sequence], dtype=np.intp)
        self.touching = np.isin(np.arange(len(self.surfaces)), touching)
        self.scale = Scale.none(problem) if scale is None else scale
        self.unit = self.scale.unknowns(self.layout, self.surfaces)
        self.limits = self._bounds()
        self.lower, self.upper = (limit / self.unit for limit in self.limits)
        none = np.zeros(0)
        self._last_values, self._last_slopes = (none, none), (none, none)
        self._last_times: dict[int, tuple[Array, float, Array]] = {}

    # Constraints by name ---------------------------------------------------------------------------------------------

    def physical(self, x: Array) -> Array:
        """Unknowns in units of the problem; what lies at a limit up to rounding lies at it."""
        y = x * self.unit
        for limit in self.limits:
            close = 4 * np.finfo(float).eps * np.where(np.isfinite(limit), np.abs(limit), 0.0)
            y = np.where(np.abs(y - limit) <= close, limit, y)
        return np.asarray(y)

    def scaled(self, y: Array) -> Array:
        return np.asarray(y / self.unit)

    @cached_property
    def row_unit(self) -> Array:
        """Size of the cost and of every constraint, in the order of r without the minimal times."""
        s, lay = self.scale, self.layout
        hit = self.surfaces
        states = {**self._sizes_of_states}
        law = np.where(self.plain_laws, s.rate[hit], s.energy)
        by_name = {
            "momentum": np.tile(s.p, lay.total + 1),
            "inside": np.tile(s.p, lay.total * lay.inside),
            "arrival": np.tile(s.p, len(hit)),
            "departure": np.tile(s.p, len(hit)),
            "energy": law,
            "contact": s.gap[hit],
            "start velocity": s.p[: len(lay.index_v_B)],
            "goal velocity": s.p[: len(lay.index_v_E)],
            "periodic": np.array([states[name] for name in self.problem.periodic]),
            "gap": s.gap[self.gap_constraints[1]],
            "gap inside": np.tile(s.gap[self.still], lay.total * lay.inside),
            "path": np.tile(s.path, lay.total * lay.scheme.points),
            "approach": s.rate[hit[self.approaching]],
            "separation": s.rate[hit[self.separating]],
        }
        sizes = [np.array([s.cost])]
        for blocks, goals in (
            (self.equalities, self._fixed_goals),
            (self.inequalities, [g for g, _, _ in goal_limits(self.goals)]),
        ):
            for block in blocks:
                if block.name == "goal":
                    sizes.append(np.array([states[g.name] for g in goals]))
                elif block.name != "minimal time":
                    sizes.append(by_name.get(block.name, np.full(len(block.rows), s.time)))
        return np.concatenate(sizes)

    @property
    def _fixed_goals(self) -> list[Goal]:
        return [g for g in self.goals if g.low == g.high]

    @property
    def _sizes_of_states(self) -> dict[str, float]:
        names, s = self.problem.kernels.coordinates, self.scale
        pairs = [
            (name(q), size[i])
            for name, size in ((str, s.q), (velocity_name, s.v), (momentum_name, s.p))
            for i, q in enumerate(names)
        ]
        return {name: float(size) for name, size in pairs}

    @property
    def plain_laws(self) -> Any:
        """Collisions whose law says w = 0 after them: plastic ones and touches."""
        return self.touching | (self.problem.restitution_values[self.surfaces] == 0)

    @property
    def approaching(self) -> Index:
        """Collisions that must be approached: all but touches, whose rate is known."""
        return np.flatnonzero(~self.touching)

    @property
    def separating(self) -> Index:
        """Collisions after which the gap must open: those whose rate the law does not fix."""
        return np.flatnonzero(~self.plain_laws)

    @cached_property
    def equalities(self) -> list[Block]:
        return equality_blocks(self.problem, self.layout, self.goals)

    @cached_property
    def inequalities(self) -> list[Block]:
        return inequality_blocks(
            self.problem, self.layout, (*self.gap_constraints, self.still), self.goals, self._timed,
            (self.approaching, self.separating),
        )  # fmt: skip

    @property
    def n(self) -> int:
        return self.layout.size

    @cached_property
    def n_eq(self) -> int:
        return sum(len(b.rows) for b in self.equalities)

    @cached_property
    def n_in(self) -> int:
        return sum(len(b.rows) for b in self.inequalities)

    def equality_rows(self, name: str) -> Index:
        return next(b.rows for b in self.equalities if b.name == name)

    def inequality_rows(self, name: str) -> Index:
        return next(b.rows for b in self.inequalities if b.name == name)

    @cached_property
    def gap_constraints(self) -> tuple[Index, Index]:
        """Node and surface of each gap constraint.

        Collisions hold with equality.  At a fixed end the gap is known and was checked: a constraint that cannot move would have no interior.
        """
        lay, kernels = self.layout, self.problem.kernels
        keep = np.ones((lay.total + 1, len(kernels.surfaces)), dtype=bool)
        keep[lay.collision_nodes, self.surfaces] = False
        for node in (0, -1):
            at = lay.index_q[node]
            fixed = self.limits[0][at] == self.limits[1][at]
            for j, surface in enumerate(kernels.surfaces):
                moves = node == -1 and surface in kernels.manifest["moving_surfaces"]
                keep[node, j] &= moves or not fixed[kernels.manifest["surface_coordinates"][surface]].all()
        return np.nonzero(keep)  # type: ignore[return-value]

    @property
    def still(self) -> Index:
        """Surfaces that do not move: their gaps inside the steps are constraints too (order 4)."""
        kernels = self.problem.kernels
        names = [s for s in kernels.surfaces if s not in kernels.manifest["moving_surfaces"]]
        return np.array([kernels.surfaces.index(s) for s in names], dtype=np.intp)

    @cached_property
    def _timed(self) -> list[int]:
        """Phases with a minimal time: those before a collision, where every input is bounded."""
        bounded = self.problem.nu > 0 and bool(np.isfinite(self.problem.input_bounds).all())
        estimated = self.minimal_times and bounded and self.problem.model.has_minimal_times
        return list(range(len(self.surfaces))) if estimated else []

    # Bounds ----------------------------------------------------------------------------------------------------------

    @cached_property
    def goals(self) -> list[Goal]:
        """The values of the goal that are constraints."""
        if not self.goal_as_rows:
            return []
        lay, goal = self.layout, self.problem.goal_bounds
        names = self.problem.kernels.coordinates
        found = []
        for index, bounds, name in (
            (lay.index_q[-1], goal.position, str),
            (lay.index_p_E, goal.momentum, momentum_name),
            (lay.index_v_E, goal.velocity, velocity_name),
        ):
            pairs = zip(index, bounds, names, strict=False)
            found += [
                Goal(int(i), float(low), float(high), name(q)) for i, (low, high), q in pairs if low > -np.inf or high < np.inf
            ]
        return found

    def _bounds(self) -> tuple[Array, Array]:
        lay, problem = self.layout, self.problem
        box = np.tile((-np.inf, np.inf), (lay.size, 1))
        latest = problem.final_time_bounds[1]
        shortest = SHORTEST_PHASE * latest if len(problem.sequence) and np.isfinite(latest) else 0.0
        low, high = problem.duration_bounds.T
        low = np.where(low > 0, low, np.minimum(shortest, SHORTEST_PHASE * high))  # a bound that was given counts
        box[lay.index_h] = np.maximum(
            np.stack([low, high], axis=1) / np.array(lay.steps)[:, None], SMALLEST_STEP * self.scale.time
        )
        box[lay.index_q] = problem.coordinate_bounds
        box[lay.index_u] = problem.input_bounds
        box[lay.index_lam, 0] = 0.0
        box[lay.index_lam[self.touching], 1] = 0.0
        for node, boundary, p, v in (
            (0, problem.start_bounds, lay.index_p_B, lay.index_v_B),
            (-1, problem.goal_bounds, lay.index_p_E, lay.index_v_E),
        ):
            at = lay.index_q[node]
            box[at, 0] = np.maximum(box[at, 0], boundary.position[:, 0])
            box[at, 1] = np.minimum(box[at, 1], boundary.position[:, 1])
            box[p] = boundary.momentum
            if len(v):
                box[v] = boundary.velocity
        for unknown, side, limit in self._at_contacts(box):
            box[unknown, side] = limit
        box[lay.index_q_i] = np.tile(problem.coordinate_bounds, (lay.inside, 1))
        box[lay.index_t[:1]] = 0.0
        for goal in self.goals:
            box[goal.unknown] = (-np.inf, np.inf)
        if self.goals:
            box[lay.index_q[-1]] = problem.coordinate_bounds
        return box[:, 0].copy(), box[:, 1].copy()

    def _at_contacts(self, box: Array) -> list[tuple[int, int, float]]:
        """Limits of coordinates at collision nodes that lie on the surface itself, which leaves no interior: unknown, side, and a limit that
        gives way a little; the contact keeps the coordinate where it was."""
        problem, found = self.problem, []
        kernels = problem.kernels
        for node, surface in zip(self.layout.collision_nodes, problem.sequence, strict=True):
            involved = kernels.manifest["surface_coordinates"][surface]
            if len(involved) > 1 or surface in kernels.manifest["moving_surfaces"]:
                continue
            j = int(involved[0])
            for side, sign in enumerate((-1.0, 1.0)):
                q = np.zeros(problem.nq)
                q[j] = box[self.layout.index_q[node, j], side]
                if np.isfinite(q[j]) and on_surface(problem, q, surface):
                    size = max(abs(q[j]), self.scale.q[j])
                    found.append((int(self.layout.index_q[node, j]), side, float(q[j] + sign * GIVES_WAY * size)))
        return found

    # The program -----------------------------------------------------------------------------------------------------

    @cached_property
    def rows(self) -> Rows:
        """Rows of the constraints in r = (f | c | d)."""
        lay, nodes = self.layout, self.layout.collision_nodes
        shape = (lay.total + 1, len(self.problem.kernels.surfaces))
        gap, contact = np.full(shape, NOWHERE), np.full(shape, NOWHERE)
        gap[self.gap_constraints] = 1 + self.n_eq + self.inequality_rows("gap")
        contact[nodes, self.surfaces] = 1 + self.equality_rows("contact")
        return Rows(
            momentum=1 + self.equality_rows("momentum").reshape(lay.total + 1, lay.nq),
            inside=1 + self.equality_rows("inside").reshape(lay.total, lay.inside * lay.nq),
            time=1 + self.equality_rows("time"),
            arrival=1 + self.equality_rows("arrival").reshape(len(nodes), lay.nq),
            departure=1 + self.equality_rows("departure").reshape(len(nodes), lay.nq),
            energy=1 + self.equality_rows("energy"),
            contact=contact,
            velocity_B=1 + self.equality_rows("start velocity"),
            velocity_E=1 + self.equality_rows("goal velocity"),
            gap=gap,
            gap_inside=self._rows_inside(),
            path=1 + self.n_eq + self.inequality_rows("path").reshape(lay.total, -1),
            approach=self._rows_of_collisions("approach", self.approaching),
            separation=self._rows_of_collisions("separation", self.separating),
        )

    def _rows_inside(self) -> Index:
        count = self.layout.total * self.layout.inside
        rows = np.full((count, len(self.problem.kernels.surfaces)), NOWHERE)
        rows[:, self.still] = 1 + self.n_eq + self.inequality_rows("gap inside").reshape(count, len(self.still))
        return rows

    def _rows_of_collisions(self, name: str, kept: Index) -> Index:
        rows = np.full(len(self.surfaces), NOWHERE)
        rows[kept] = 1 + self.n_eq + self.inequality_rows(name)
        return rows

    @property
    def _periodic(self) -> list[tuple[int, int]]:
        """Unknowns of each periodic state at the start and at the end."""
        lay = self.layout
        pairs: dict[str, tuple[int, int]] = {}
        for name, start, end in (
            (str, lay.index_q[0], lay.index_q[-1]),
            (momentum_name, lay.index_p_B, lay.index_p_E),
            (velocity_name, lay.index_v_B, lay.index_v_E),
        ):
            names = map(name, self.problem.kernels.coordinates)
            pairs |= {n: (int(a), int(b)) for n, a, b in zip(names, start, end, strict=False)}
        return [pairs[n] for n in self.problem.periodic]

    @property
    def _linear_rows(self) -> list[tuple[int, Index, Array, float]]:
        """Rows that are linear in x: row of r, unknowns, factors and constant."""
        lay, (low, high) = self.layout, self.problem.final_time_bounds
        steps = np.array(lay.steps, dtype=float)
        rows = [(1 + row, lay.index_h, steps, -low) for row in self.equality_rows("final time")]
        rows += [(1 + self.n_eq + row, lay.index_h, steps, -low) for row in self.inequality_rows("final time >=")]
        rows += [(1 + self.n_eq + row, lay.index_h, -steps, high) for row in self.inequality_rows("final time <=")]
        pairs = zip(self.equality_rows("periodic"), self._periodic, strict=True)
        rows += [(1 + row, np.array(ends), np.array([-1.0, 1.0]), 0.0) for row, ends in pairs]
        one = np.ones(1)
        goals = zip(self.equality_rows("goal"), self._fixed_goals, strict=True)
        rows += [(1 + row, np.array([g.unknown]), one, -g.low) for row, g in goals]
        limits = zip(self.inequality_rows("goal"), goal_limits(self.goals), strict=True)
        return rows + [
            (1 + self.n_eq + row, np.array([g.unknown]), sign * one, -sign * value) for row, (g, sign, value) in limits
        ]

    @cached_property
    def program(self) -> Program:
        """Values and derivatives of (f | c | d), without the minimal times."""
        m = self.n_eq + self.n_in - len(self._timed)
        elements = Elements(self.problem, self.layout, self.rows, m, self.touching)
        linear = elements.linear(self._linear_rows)
        values, slopes, curvatures = elements.values(), elements.slopes(), elements.curvatures()
        column, row = self.unit, 1 / self.row_unit
        none = (np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0))
        constants = np.zeros(1 + m)
        constants[list(linear.constants)] = list(linear.constants.values())
        factors = linear.factors * row[linear.rows]
        places = [e.rows for v in values for e in v.results]
        prepared = _prepared(values, places, [row[p] for p in places])
        to_values = PassData(constants * row, linear.rows, linear.columns, factors, prepared)
        # The gradient of f first, dense, then the entries of the Jacobian.
        groups = [(rows - 1, columns) for s in slopes for rows, columns in (e.cells for e in s.results)]
        self.jacobian_pattern = SparsePattern((m, self.n), [*groups, (linear.rows - 1, linear.columns)])
        *slots, linear_slots = self.jacobian_pattern.slots
        constants = np.zeros(self.n + self.jacobian_pattern.size)
        constants[self.n + linear_slots] = factors * column[linear.columns]
        slots = [np.where(r == -1, c, np.where(s >= 0, self.n + s, NOWHERE)) for s, (r, c) in zip(slots, groups, strict=True)]
        prepared = _prepared(slopes, slots, [row[r + 1] * column[c] for r, c in groups])
        to_slopes = PassData(constants, *none, prepared)
        groups = [e.cells for c in curvatures for e in c.results]
        self.hessian_pattern = SparsePattern((self.n, self.n), [*groups, *self._time_groups])
        slots = self.hessian_pattern.slots[: len(groups)]
        prepared = _prepared(curvatures, slots, [column[i] * column[j] for i, j in groups])
        to_curvatures = PassData(np.zeros(self.hessian_pattern.size), *none, prepared)
        data = ProgramData(
            equalities=self.n_eq,
            lower=self.lower,
            upper=self.upper,
            unit=np.concatenate([column, row[1:], row[:1]]),
            pool=np.concatenate([np.zeros(self.n + m + 2), self.par[0], self.problem.restitution_values]),
            values=to_values,
            slopes=to_slopes,
            curvatures=to_curvatures,
            jacobian=(self.jacobian_pattern.indptr, self.jacobian_pattern.indices),
            hessian=(self.hessian_pattern.indptr, self.hessian_pattern.indices),
        )
        return Program(self.problem.kernels, data)

    def values(self, x: Array) -> Array:
        """r(x) = (f | c | d) without the minimal times; the last point is remembered, the array is read-only."""
        if not np.array_equal(self._last_values[0], x):
            found = self.program.values(np.ascontiguousarray(x))
            found.flags.writeable = False
            self._last_values = x.copy(), found
        return self._last_values[1]

    def slopes(self, x: Array) -> Array:
        """The gradient of f, then the entries of d(c | d)/dx; the last point is remembered, the array is read-only."""
        if not np.array_equal(self._last_slopes[0], x):
            found = self.program.slopes(np.ascontiguousarray(x))
            found.flags.writeable = False
            self._last_slopes = x.copy(), found
        return self._last_slopes[1]

    def cost(self, x: Array) -> float:
        return float(self.values(x)[0])

    def cost_gradient(self, x: Array) -> Array:
        return self.slopes(x)[: self.n]

    def equality(self, x: Array) -> Array:
        """c(x), shape (n_eq,)."""
        return self.values(x)[1 : 1 + self.n_eq]

    def equality_slopes(self, x: Array) -> Array:
        """Entries of dc/dx, by rows."""
        first = self.slopes(x)[self.n :]
        return first[: self.jacobian_pattern.indptr[self.n_eq]]

    def equality_jacobian(self, x: Array) -> Matrix:
        """dc/dx, shape (n_eq, n)."""
        slopes = self.slopes(x)
        return self.jacobian_pattern.matrix(slopes[self.n :], 0, self.n_eq)

    def inequality(self, x: Array) -> Array:
        """d(x) >= 0, shape (n_in,)."""
        found = self.values(x)[1 + self.n_eq :]
        return np.concatenate([found, [self._time_reserve(x, i)[0] for i in self._timed]]) if self._timed else found

    def inequality_slopes(self, x: Array) -> Array:
        """Entries of dd/dx, by rows."""
        slopes = self.slopes(x)[self.n :]
        found = slopes[self.jacobian_pattern.indptr[self.n_eq] :]
        return (
            np.concatenate([found, *(self._time_reserve(x, i)[1][self._time_order(i)] for i in self._timed)])
            if self._timed
            else found
        )

    def inequality_jacobian(self, x: Array) -> Matrix:
        """dd/dx, shape (n_in, n)."""
        slopes = self.slopes(x)
        rows = self.jacobian_pattern.matrix(slopes[self.n :], self.n_eq)
        if not self._timed:
            return rows
        # Zeros stay in the pattern, which is analysed once.
        times = [self._time_unknowns(i)[self._time_order(i)] for i in self._timed]
        starts = np.cumsum([rows.indptr[-1], *(len(t) for t in times)])
        indices, indptr = np.concatenate([rows.indices, *times]), np.concatenate([rows.indptr, starts[1:]])
        return scipy.sparse.csr_matrix((self.inequality_slopes(x), indices, indptr), shape=(self.n_in, self.n))

    def lagrangian_hessian(self, x: Array, y: Array, w: Array, sigma: float = 1.0) -> Matrix:
        """Upper triangle of the Hessian of sigma f + y . c + w . d, shape (n, n)."""
        timed = self.inequality_rows("minimal time")
        values = self.program.curvatures(np.ascontiguousarray(x), np.concatenate([y, w[: self.n_in - len(timed)]]), sigma)
        if self._timed:
            blocks = self.hessian_pattern.slots[-len(timed) :]
            for row, i, slots in zip(timed, self._timed, blocks, strict=True):
                values[slots] += w[row] * self._time_hessian(x, i)[np.triu_indices(3 * self.layout.nq + 1)]
        return self.hessian_pattern.matrix(values)

    def momenta(self, x: Array) -> tuple[Array, Array]:
        """Return p at the start and at the end of every step in units of the problem, shape (total, nq) each."""
        return self.problem.model.step_momenta(self.layout.step_inputs(self.physical(x)))

    # Minimal times ---------------------------------------------------------------------------------------------------

    def _time_unknowns(self, i: int) -> Index:
        """Unknowns y = (q_k, q_kp1, h, q_c) of the minimal time of phase i."""
        lay = self.layout
        first, last = lay.ends[i], lay.ends[i + 1]
        return np.concatenate([lay.index_q[first], lay.index_q[first + 1], lay.index_h[[i]], lay.index_q[last]])

    def minimal_time(self, y: Array, i: int) -> tuple[float, Array]:
        """Return T_min of phase i and its gradient with respect to y = (q_k, q_kp1, h, q_c)."""
        nq, bounds = self.layout.nq, self.problem.input_bounds
        surface = int(self.surfaces[i])
        return minimal_time(self.problem.model, y[:nq], y[nq : 2 * nq], float(y[2 * nq]), y[2 * nq + 1 :], surface, bounds)

    def phase_minimal_time(self, x: Array, i: int) -> float:
        """T_min of phase i in seconds."""
        return self.minimal_time(self._time_arguments(x, i), i)[0]

    def _time_arguments(self, x: Array, i: int) -> Array:
        at = self._time_unknowns(i)
        return np.asarray(x[at] * self.unit[at])

    def _time_reserve(self, x: Array, i: int) -> tuple[float, Array]:
        """T_i - T_min and its gradient with respect to the scaled y; without an estimate nothing is demanded.  The last point is remembered."""
        y = self._time_arguments(x, i)
        known = self._last_times.get(i)
        if known is not None and np.array_equal(known[0], y):
            return known[1], known[2]
        shortest, slope = self.minimal_time(y, i)
        steps = self.layout.steps[i]
        slope = -slope
        slope[2 * self.layout.nq] += steps
        reserve = float(steps * y[2 * self.layout.nq] - (shortest if np.isfinite(shortest) else 0.0)) / self.scale.time
        slope = slope * self.unit[self._time_unknowns(i)] / self.scale.time
        self._last_times[i] = (y, reserve, slope)
        return reserve, slope

    def _time_order(self, i: int) -> Index:
        """The order of the unknowns of a minimal time in a row."""
        return np.argsort(self._time_unknowns(i))

    @property
    def _time_groups(self) -> list[tuple[Index, Index]]:
        """Rows and columns of the second derivatives of the minimal times."""
        r, c = np.triu_indices(3 * self.layout.nq + 1)
        unknowns = [self._time_unknowns(i) for i in self._timed]
        return [(np.minimum(y[r], y[c]), np.maximum(y[r], y[c])) for y in unknowns]

    def _time_hessian(self, x: Array, i: int) -> Array:
        """Second derivative of T_i - T_min by central differences of its gradient: one small row, and rarely active."""
        y, unit = self._time_arguments(x, i), self.unit[self._time_unknowns(i)]
        hessian = np.empty((len(y), len(y)))
        for j in range(len(y)):
            step = 1e-6 * max(abs(y[j]), 1e-3 * unit[j])
            ends = [y.copy(), y.copy()]
            ends[0][j] -= step
            ends[1][j] += step
            below, above = (self.minimal_time(e, i)[1] for e in ends)
            hessian[j] = -(above - below) / (2 * step)
        return np.asarray((hessian + hessian.T) / 2 * np.outer(unit, unit) / self.scale.time)


def _prepared(elements: list[Element], slots: list[Index], units: list[Array]) -> tuple[ElementData, ...]:
    """Elements as a pass takes them: with slots, and the units of the entries in the factors."""
    remaining = iter(zip(slots, units, strict=True))
    found = []
    for e in elements:
        results = [(r, *next(remaining)) for r in e.results]
        factors = tuple(np.broadcast_to(r.factors, s.shape) * unit for r, s, unit in results)
        found.append(ElementData(e.kernel, e.arguments, tuple(s for _, s, _ in results), factors))
    return tuple(found)
