"""The nonlinear program as a list of elements: which kernel, on which unknowns, adds to which values.

The values are r = (f | c | d): the cost and the constraints of :mod:`dmoc.nlp.transcription`, in the order of their rows.  Every
value, first derivative and second derivative of r is a sum over rows of kernel results; nothing else is evaluated in a solve.
Arguments are taken from one vector, the pool::

    pool = (x | y | sigma | 0 | parameters | e)

with the unknowns x, the multipliers y of (c | d), the weight sigma of the cost and the coefficients of restitution e.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dmoc.codegen.kernels import Array
from dmoc.nlp.layout import Index, Layout
from dmoc.nlp.problem import Problem

Bools = NDArray[np.bool_]
# Row or column of a result that is not wanted.
NOWHERE = -1


@dataclass(frozen=True)
class Entries:
    """Where the results of one kernel output are added: rows and columns, and factors, each of shape (n, size).

    Values have rows alone; first derivatives are entries of dr/dx; second derivatives are entries of the Hessian of
    sigma f + y . (c | d), either triangle.
    """

    rows: Index
    columns: Index | None = None
    factors: Array | float = 1.0

    @property
    def cells(self) -> tuple[Index, Index]:
        """Rows and columns of derivatives."""
        if self.columns is None:
            raise ValueError("values have no columns")
        return self.rows, self.columns


@dataclass(frozen=True)
class Element:
    """n rows of a kernel; ``arguments`` are positions in the pool, each of shape (n, size) or (1, size)."""

    kernel: str
    arguments: tuple[Index, ...]
    results: tuple[Entries, ...]


@dataclass(frozen=True)
class Rows:
    """Positions of the kinds of constraints in r; row 0 is the cost.

    ``gap`` and ``contact`` have the shape (nodes, nc): a node's gap to a surface is one or the other.
    """

    momentum: Index
    inside: Index
    time: Index
    arrival: Index
    departure: Index
    energy: Index
    approach: Index
    separation: Index
    contact: Index
    velocity_B: Index
    velocity_E: Index
    gap: Index
    gap_inside: Index
    path: Index


@dataclass(frozen=True)
class Linear:
    """The part of r that is linear in x, sum of factor * x[column] in each row, and the constants."""

    rows: Index
    columns: Index
    factors: Array
    constants: dict[int, float]


class Elements:
    """The elements of a problem's values, first and second derivatives."""

    def __init__(self, problem: Problem, layout: Layout, rows: Rows, m: int, touching: Bools) -> None:
        self.problem, self.layout, self.rows, self.touching = problem, layout, rows, touching
        self.kernels = problem.kernels
        self.y = layout.size  # first multiplier in the pool
        self.sigma = self.y + m
        self.zero = self.sigma + 1
        par, nc = problem.parameter_values.shape[1], len(self.kernels.surfaces)
        self.par = np.arange(self.zero + 1, self.zero + 1 + par)[None]
        self.e = np.arange(self.zero + 1 + par, self.zero + 1 + par + nc)[None]
        self.surfaces = np.array([self.kernels.surfaces.index(s) for s in problem.sequence], dtype=np.intp)

    def values(self) -> list[Element]:
        lay, rows = self.layout, self.rows
        cost = np.zeros((lay.total, 1), dtype=np.intp)
        places = (rows.momentum[:-1], rows.momentum[1:], cost, rows.inside)
        found = [Element("step", self._step, tuple(map(Entries, places)))]
        if len(self.surfaces):
            nodes = lay.collision_nodes
            found.append(Element("normal", self._normal, (Entries(rows.momentum[nodes], factors=-1.0),)))
            energy, nowhere = rows.energy[:, None], np.full((len(nodes), 1), NOWHERE)
            found.append(Element("impact", self._beside(nodes - 1), (Entries(energy, factors=self._share), Entries(nowhere))))
            found.append(Element("impact", self._beside(nodes), (Entries(nowhere), Entries(energy, factors=-self._share))))
            found.append(Element("restitution", self._restitution, (Entries(energy, factors=-self._work),)))
            for at, place, wanted in self._momenta_beside:
                results = (Entries(place if i == wanted else np.full_like(p[at], NOWHERE)) for i, p in enumerate(places))
                found.append(Element("step", self._beside(at), tuple(results)))
            for state, _, row, sign in self._rates:
                found.append(Element("gap_rate", (*state, self.par), (Entries(row, factors=sign),)))
        if self.kernels.has("surface"):
            found.append(Element("surface", self._surface, (Entries(self._gap_rows, factors=self._gap_signs),)))
        if rows.gap_inside.size:
            found.append(Element("surface", self._surface_inside, (Entries(rows.gap_inside, factors=-1.0),)))
        if self.kernels.has("path"):
            found.append(Element("path", self._step, (Entries(rows.path),)))
        for row, state, _, sign in self._legendre:
            energy_out = np.full((len(row), 1), NOWHERE)
            found.append(Element("legendre", (*state, self.par), (Entries(row, factors=sign), Entries(energy_out))))
        if self.kernels.has("terminal_cost"):
            found.append(Element("terminal_cost", (*self._terminal[0], self.par), (Entries(cost[:1]),)))
        return found

    def slopes(self) -> list[Element]:
        lay, rows = self.layout, self.rows
        cost = np.zeros((lay.total, 1), dtype=np.intp)
        z = lay.index_z
        outputs = (
            ("r_minus_D_z", rows.momentum[:-1]),
            ("r_plus_D_z", rows.momentum[1:]),
            ("C_d_D_z", cost),
            ("r_i_D_z", rows.inside),
        )
        found = [Element("step_jac", self._step, tuple(self._block("step_jac", name, row, z) for name, row in outputs))]
        if len(self.surfaces):
            nodes = lay.collision_nodes
            block = self._block("normal_jac", "n_D_ql", rows.momentum[nodes], self._normal_columns, -1.0)
            found.append(Element("normal_jac", self._normal, (block,)))
            energy = rows.energy[:, None]
            for at, share, side in ((nodes - 1, self._share, "e_plus_D_z"), (nodes, -self._share, "e_minus_D_z")):
                blocks = tuple(
                    self._block("impact_jac", name, energy if name == side else np.full_like(energy, NOWHERE), z[at], share)
                    for name in ("e_plus_D_z", "e_minus_D_z")
                )
                found.append(Element("impact_jac", self._beside(at), blocks))
            block = self._block("restitution_jac", "W_D_s", energy, self._restitution_columns, -self._work)
            found.append(Element("restitution_jac", self._restitution, (block,)))
            for at, place, wanted in self._momenta_beside:
                blocks = tuple(
                    self._block("step_jac", name, place if i == wanted else np.full_like(row[at], NOWHERE), z[at])
                    for i, (name, row) in enumerate(outputs)
                )
                found.append(Element("step_jac", self._beside(at), blocks))
            for state, columns, row, sign in self._rates:
                block = self._block("gap_rate_jac", "w_D_s", row, columns, sign)
                found.append(Element("gap_rate_jac", (*state, self.par), (block,)))
        if self.kernels.has("surface"):
            r, _ = self.kernels.pattern("surface_jac", "g_D_q")
            block = self._block("surface_jac", "g_D_q", self._gap_rows, self._surface_columns, self._gap_signs[:, r])
            found.append(Element("surface_jac", self._surface, (block,)))
        if rows.gap_inside.size:
            block = self._block("surface_jac", "g_D_q", rows.gap_inside, self._columns_inside, -1.0)
            found.append(Element("surface_jac", self._surface_inside, (block,)))
        if self.kernels.has("path"):
            found.append(Element("path_jac", self._step, (self._block("path_jac", "r_d_D_z", rows.path, z),)))
        for row, state, columns, sign in self._legendre:
            block = self._block("legendre_jac", "p_D_s", row, columns, sign)
            found.append(Element("legendre_jac", (*state, self.par), (block,)))
        if self.kernels.has("terminal_cost"):
            end, columns = self._terminal
            block = self._block("terminal_cost_jac", "Phi_D_s", cost[:1], columns)
            found.append(Element("terminal_cost_jac", (*end, self.par), (block,)))
        return found

    def curvatures(self) -> list[Element]:
        lay, rows = self.layout, self.rows
        z, mu = lay.index_z, self._multiplier(rows.momentum)
        sigma = np.full((1, 1), self.sigma)
        found = []
        if len(self.surfaces):
            nodes = lay.collision_nodes
            energy, zero = self._multiplier(rows.energy)[:, None], np.full((len(nodes), 1), self.zero)
            for at, share, weights in ((nodes - 1, self._share, (energy, zero)), (nodes, -self._share, (zero, energy))):
                found.append(self._curvature("impact_hess", (*self._beside(at), np.hstack(weights)), z[at], share))
            found.append(self._curvature("normal_hess", (*self._normal, mu[nodes]), self._normal_columns, -1.0))
            found.append(
                self._curvature("restitution_hess", (*self._restitution, energy), self._restitution_columns, -self._work)
            )
            none = np.full((1, 1), self.zero)
            for at, place, wanted in self._momenta_beside:
                weights_of = [np.full((len(at), size), self.zero) for size in (lay.nq, lay.nq, rows.inside.shape[1])]
                weights_of[wanted] = self._multiplier(place)
                found.append(self._curvature("step_hess", (*self._beside(at), none, *weights_of), z[at]))
            for state, columns, row, sign in self._rates:
                found.append(self._curvature("gap_rate_hess", (*state, self.par, self._multiplier(row)), columns, sign))
        found.append(self._curvature("step_hess", (*self._step, sigma, mu[:-1], mu[1:], self._multiplier(rows.inside)), z))
        if self.kernels.has("surface"):
            q, t, par = self._surface
            columns = self._surface_columns
            found.append(self._curvature("surface_hess", (q, t, par, self._multiplier(rows.gap)), columns, -1.0))
            if len(self.surfaces):
                at = lay.collision_nodes
                held = self._multiplier(rows.contact[at])
                found.append(self._curvature("surface_hess", (q[at], self._at(t, at), par, held), columns[at]))
        if rows.gap_inside.size:
            inside = (*self._surface_inside, self._multiplier(rows.gap_inside))
            found.append(self._curvature("surface_hess", inside, self._columns_inside, -1.0))
        if self.kernels.has("path"):
            found.append(self._curvature("path_hess", (*self._step, self._multiplier(rows.path)), z))
        for row, state, columns, sign in self._legendre:
            found.append(self._curvature("legendre_hess", (*state, self.par, self._multiplier(row)), columns, sign))
        if self.kernels.has("terminal_cost"):
            end, columns = self._terminal
            found.append(self._curvature("terminal_cost_hess", (*end, self.par, sigma), columns))
        return [e for e in found if e.results[0].rows.size]

    def linear(self, more: Sequence[tuple[int, Index, Array, float]]) -> Linear:
        """``more`` lists further linear rows: row of r, unknowns, factors and constant."""
        lay, rows = self.layout, self.rows
        parts: list[tuple[Index, Index, Array]] = []
        steps = np.arange(len(rows.time))
        for r, c, factor in (
            (rows.momentum[0], lay.index_p_B, 1.0),
            (rows.momentum[-1], lay.index_p_E, -1.0),
            (rows.velocity_B, lay.index_p_B[: len(rows.velocity_B)], 1.0),
            (rows.velocity_E, lay.index_p_E[: len(rows.velocity_E)], 1.0),
            (rows.time, lay.index_t[1:], 1.0),
            (rows.time, lay.index_t[:-1], -1.0),
            (rows.time, lay.index_h[lay.phase_of_step[steps]], -1.0),
        ):
            parts.append((r, c, np.full(len(r), factor)))
        for row, unknowns, factors, _ in more:
            parts.append((np.full(len(unknowns), row), unknowns, factors))
        r, c, f = (np.concatenate(p) for p in zip(*parts, strict=True))
        return Linear(r, c, f, {row: constant for row, _, _, constant in more})

    # Arguments -------------------------------------------------------------------------------------------------------

    @cached_property
    def _step(self) -> tuple[Index, ...]:
        """Positions of (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i, parameters) of every step."""
        parts = self.layout.split(self.layout.index_z)
        parts[5] = self._times[:-1] if self.layout.timed else self._times
        return (*parts, self.par)

    @cached_property
    def _times(self) -> Index:
        """Positions of the times of the nodes; of one zero in a model without explicit time."""
        return self.layout.time_columns if self.layout.timed else np.full((1, 1), self.zero)

    def _at(self, positions: Index, rows: Index) -> Index:
        """Some rows of an argument; one row serves all."""
        return positions[rows] if len(positions) > 1 else positions

    def _beside(self, steps: Index) -> tuple[Index, ...]:
        return (*(self._at(a, steps) for a in self._step[:-1]), self.par)

    @cached_property
    def _impulses(self) -> Index:
        """Positions of the impulses of every collision by surface; those of surfaces that are not hit are zero."""
        lam = np.full((len(self.surfaces), len(self.kernels.surfaces)), self.zero)
        lam[np.arange(len(lam)), self.surfaces] = self.layout.index_lam
        return lam

    @property
    def _impulse_columns(self) -> Index:
        return np.where(self._impulses == self.zero, NOWHERE, self._impulses)

    @cached_property
    def _normal(self) -> tuple[Index, ...]:
        """Positions of (q_c, lam, t, parameters) of every collision."""
        nodes = self.layout.collision_nodes
        return self.layout.index_q[nodes], self._impulses, self._at(self._times, nodes), self.par

    @cached_property
    def _normal_columns(self) -> Index:
        """Unknowns (q_c, lam, t) of each collision; impulses of surfaces that are not hit are nowhere."""
        nodes = self.layout.collision_nodes
        return np.hstack([self.layout.index_q[nodes], self._impulse_columns, self.layout.time_columns[nodes]])

    @cached_property
    def _share(self) -> Array:
        """Share of the balance of energy in the law of every collision, shape (collisions, 1): its coefficient of restitution, 0 for a touch."""
        return np.where(self.touching, 0.0, self.problem.restitution_values[self.surfaces])[:, None]

    @property
    def _work(self) -> Array:
        """Share of W in the law of every collision: plastic impacts and touches state w = 0 after it without the factor lam."""
        return np.where(self._share > 0, 1.0, 0.0)

    @property
    def _momenta_beside(self) -> list[tuple[Index, Index, int]]:
        """Steps before and after each collision, the rows that their momenta at it enter, and which output of the step they are."""
        nodes, rows = self.layout.collision_nodes, self.rows
        return [(nodes - 1, rows.arrival, 1), (nodes, rows.departure, 0)]

    @cached_property
    def _rates(self) -> list[tuple[tuple[Index, ...], Index, Index, float]]:
        """Where rates of gaps at collisions enter: positions of (q_c, v, t), their unknowns, rows by surface, and the factor."""
        lay, nodes = self.layout, self.layout.collision_nodes
        found: list[tuple[tuple[Index, ...], Index, Index, float]] = []
        q, t, hit = lay.index_q[nodes], self._at(self._times, nodes), (np.arange(len(nodes)), self.surfaces)
        plastic = np.where(self._work[:, 0] > 0, NOWHERE, self.rows.energy)
        for v, rows, sign in (
            (lay.index_v_a, self.rows.approach, 1.0),
            (lay.index_v_c, self.rows.separation, -1.0),
            (lay.index_v_c, plastic, 1.0),
        ):
            row = np.full((len(nodes), len(self.kernels.surfaces)), NOWHERE)
            row[hit] = rows
            found.append(((q, v, t), np.hstack([q, v, lay.time_columns[nodes]]), row, sign))
        return found

    @cached_property
    def _restitution(self) -> tuple[Index, ...]:
        """Positions of (q_c, v after, lam, t, parameters, e) of every collision."""
        q, lam, t, par = self._normal
        return q, self.layout.index_v_c, lam, t, par, self.e

    @cached_property
    def _restitution_columns(self) -> Index:
        """Unknowns (q_c, v after, lam, t) of each collision."""
        lay, nodes = self.layout, self.layout.collision_nodes
        return np.hstack([lay.index_q[nodes], lay.index_v_c, self._impulse_columns, lay.time_columns[nodes]])

    @property
    def _surface(self) -> tuple[Index, Index, Index]:
        return self.layout.index_q, self._times, self.par

    @property
    def _surface_columns(self) -> Index:
        return np.hstack([self.layout.index_q, self.layout.time_columns])

    @property
    def _surface_inside(self) -> tuple[Index, Index, Index]:
        """Arguments of the gaps inside the steps, to surfaces that stand still."""
        return self.layout.index_q_i.reshape(-1, self.layout.nq), np.full((1, 1), self.zero), self.par

    @property
    def _columns_inside(self) -> Index:
        q_i = self.layout.index_q_i.reshape(-1, self.layout.nq)
        return np.hstack([q_i, np.full((len(q_i), 1), NOWHERE)])

    @cached_property
    def _gap_rows(self) -> Index:
        return np.maximum(self.rows.gap, self.rows.contact)

    @cached_property
    def _gap_signs(self) -> Array:
        """d = -g for gaps, c = g for contacts."""
        return np.where(self.rows.contact == NOWHERE, -1.0, 1.0)

    @cached_property
    def _legendre(self) -> list[tuple[Index, tuple[Index, Index, Index], Index, float]]:
        """Where dL/dv(q, v, t) enters: rows, positions of (q, v, t), their unknowns, and the factor, at each end and collision whose
        velocities are unknowns."""
        lay, found = self.layout, []
        for row, node, v, sign in (
            (self.rows.velocity_B[None], np.array([0]), lay.index_v_B[None], -1.0),
            (self.rows.velocity_E[None], np.array([lay.total]), lay.index_v_E[None], -1.0),
            (self.rows.arrival, lay.collision_nodes, lay.index_v_a, -1.0),
            (self.rows.departure, lay.collision_nodes, lay.index_v_c, 1.0),
        ):
            if row.size:
                q = lay.index_q[node]
                found.append((row, (q, v, self._at(self._times, node)), np.hstack([q, v, lay.time_columns[node]]), sign))
        return found

    @cached_property
    def _terminal(self) -> tuple[tuple[Index, Index, Index], Index]:
        """Positions and unknowns of (q, v, t) at the final time; velocities and times that are no unknowns are zero."""
        lay = self.layout
        known = len(lay.index_v_E) > 0
        v = lay.index_v_E[None] if known else np.full((1, lay.nq), NOWHERE)
        q, t = lay.index_q[-1:], lay.time_columns[-1:]
        state = (q, np.where(v == NOWHERE, self.zero, v), np.where(t == NOWHERE, self.zero, t))
        return state, np.hstack([q, v, t])

    def _multiplier(self, rows: Index) -> Index:
        """Position of the multiplier of a row of r, of a zero where there is no row."""
        return np.where(rows == NOWHERE, self.zero, self.y + rows - 1)

    # Results ---------------------------------------------------------------------------------------------------------

    def _block(self, kernel: str, output: str, rows: Index, columns: Index, factors: Array | float = 1.0) -> Entries:
        """Entries of a matrix whose local rows and columns stand for the given rows and unknowns."""
        r, c = self.kernels.pattern(kernel, output)
        at = columns[:, c]
        return Entries(np.where(at == NOWHERE, NOWHERE, rows[:, r]), at, factors)

    def _curvature(self, kernel: str, arguments: tuple[Index, ...], unknowns: Index, sign: Array | float = 1.0) -> Element:
        """Element of an upper triangle of second derivatives in local unknowns.

        Two local unknowns may be one unknown (inputs that are constant in a step): their mixed derivative counts twice on the diagonal.
        """
        r, c = self.kernels.pattern(kernel, "hess")
        rows, columns = unknowns[:, r], unknowns[:, c]
        lost = (rows == NOWHERE) | (columns == NOWHERE)
        factors = sign * np.where((rows == columns) & (r != c), 2.0, 1.0)
        entries = Entries(np.where(lost, NOWHERE, np.minimum(rows, columns)), np.maximum(rows, columns), factors)
        return Element(kernel, arguments, (entries,))
