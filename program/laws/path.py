"""Path constraints r(q, v, u, t) >= 0: where they stand, their rows and terms.

A constraint without inputs stands at the quadrature points of every step, and at both ends of every
phase, which no point reaches.  One with inputs stands where the inputs have values of their own::

    constant in a step       at the quadrature points
    linear between nodes     at every node, those at the ends of phases with the inputs of each side
    linear in a step         at both ends of every step, and at the quadrature points

Of steps with nodes inside, a constraint that contains velocities and no inputs stands at both ends
too: a polynomial that keeps it at its points may exceed it beside them.  A limit of inputs alone
that holds at both ends of a step holds in between, and has no other rows.  At the ends of phases
velocities are those before and after the collision; what the problem fixes there has no row, which
could not move.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Block, Bools, Counted, Index, Numbering
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.laws.law import Law
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False)
class PathLaw(Law):
    """The path constraints of a problem.

    Attributes
    ----------
    lay : Layout
    names : tuple of str
        Of the rows; empty for limits of hidden unknowns.
    on_inputs, on_states, on_rates : arrays of bool, shape (nr,)
        Which ones contain inputs, which ones coordinates or velocities, and which ones velocities
        and no inputs.
    at_ends : array of bool, shape (2 phases, nr)
        Which ones stand at the start and at the end of each phase.
    """

    lay: Layout
    names: tuple[str, ...]
    on_inputs: Bools
    on_states: Bools
    on_rates: Bools
    at_ends: Bools = field(init=False)
    at_points: Block = field(init=False)
    at_nodes: Block = field(init=False)
    at_ends_of_steps: Block = field(init=False)
    at_ends_of_phases: Block = field(init=False)

    @classmethod
    def of(cls, problem: Problem, lay: Layout) -> PathLaw:
        rows = problem.kernels.manifest["path_rows"]
        return cls(
            lay,
            tuple(row["name"] or "" for row in rows),
            np.array([row["inputs"] for row in rows], dtype=bool),
            np.array([bool(row["coordinates"]) or row["velocities"] for row in rows], dtype=bool),
            np.array([row["velocities"] and not row["inputs"] for row in rows], dtype=bool),
        )

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        rows = problem.kernels.manifest["path_rows"]
        self.at_ends = _ends(problem, self.lay, rows, limits[0] == limits[1])

    @property
    def _at_points(self) -> Bools:
        form = self.lay.form
        return ~self.on_inputs | (form.width == 0) | (self.on_states & form.jumps)

    # Rows -----------------------------------------------------------------------------------------

    def inequalities(self, block: Numbering) -> None:
        lay, count = self.lay, len(self.names)
        names = [f"path constraint {n}" if n else "limit of a hidden unknown" for n in self.names]
        counted = partial(Counted, BoundKind.PATH, self.names)
        steps, points = np.arange(lay.total), lay.scheme.points
        inner, ends = ~np.isin(np.arange(lay.total + 1), lay.ends), _nodes_of_ends(lay)
        by_node = self.on_inputs & bool(lay.form.shared)
        by_step = np.tile(self.on_inputs & lay.form.jumps, (lay.total, 2))
        if (
            lay.inside
        ):  # a velocity that keeps its limit between its points may exceed it beside them
            rates = np.tile(self.on_rates, (lay.total, 2))
            rates[lay.ends[:-1], :count] = (
                False  # of the ends of phases, where velocities are known
            )
            rates[lay.ends[1:] - 1, count:] = False
            by_step |= rates

        # The first of the three nodes that a row at a node depends on.
        first = np.arange(lay.total + 1) - 1

        def label(place: str) -> Any:
            return lambda k, j: f"{names[j % count]} {place.format(k)}"

        def at_end(k: int, j: int) -> str:
            side = "end" if k % 2 else "start"
            return f"{names[j]} at the {side} of phase {k // 2}"

        self.at_points = block(
            "path",
            np.tile(self._at_points, (lay.total, points)),
            label("in step {}"),
            lambda s: np.tile(s.path, points),
            steps,
            counted=counted(steps),
        )
        self.at_nodes = block(
            "path at nodes",
            inner[:, None] & by_node,
            label("at node {}"),
            lambda s: s.path,
            first,
            counted=counted(first),
        )
        self.at_ends_of_steps = block(
            "path at ends of steps",
            by_step,
            label("in step {}"),
            lambda s: np.tile(s.path, 2),
            steps,
            counted=counted(steps),
        )
        self.at_ends_of_phases = block(
            "path at ends", self.at_ends, at_end, lambda s: s.path, ends, counted=counted(ends)
        )

    # Terms ----------------------------------------------------------------------------------------

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay = self.lay
        blocks = self.at_points, self.at_nodes, self.at_ends_of_steps, self.at_ends_of_phases
        points, nodes, ends_of_steps, ends = (block.index for block in blocks)
        step = places.step(np.arange(lay.total))
        terms = [Term("path", step, (points,)), Term("path_ends", step, (ends_of_steps,))]
        k = np.flatnonzero((nodes != NOWHERE).any(axis=1))
        if len(k):
            q = lay.index_q
            u, h = lay.of_kernels[lay.row_u_k[k]], lay.index_h[lay.phase_of_step[k]][:, None]
            around = (q[k - 1], q[k], q[k + 1], u, h, places.times(k))
            terms.append(Term("path_node", around, (nodes[k],)))
        at = _nodes_of_ends(lay)
        inputs = np.stack([lay.row_u_k[lay.ends[:-1]], lay.row_u_kp1[lay.ends[1:] - 1]], axis=1)
        state = (lay.index_q[at], places.known(_velocities(lay)), lay.of_kernels[inputs.ravel()])
        terms.append(Term("path_point", (*state, places.times(at)), (ends,)))
        return terms


def _nodes_of_ends(lay: Layout) -> Index:
    """Nodes at the start and at the end of each phase, shape (2 phases,)."""
    return np.stack([lay.ends[:-1], lay.ends[1:]], axis=1).ravel()


def _velocities(lay: Layout) -> Index:
    """Unknown velocities at the start and at the end of each phase, shape (2 phases, nq); nowhere
    where they are not needed."""
    velocities = np.full((2 * lay.phases, lay.nq), NOWHERE)
    velocities[1:-1:2], velocities[2::2] = lay.impact.v_a, lay.impact.v_c
    for row, index in ((0, lay.index_v_B), (-1, lay.index_v_E)):
        if len(index):
            velocities[row] = index
    return velocities


def _ends(problem: Problem, lay: Layout, rows: Any, fixed: Bools) -> Bools:
    """Which path constraints stand at the start and at the end of each phase."""
    nodes = _nodes_of_ends(lay)
    velocity = np.zeros(len(nodes), dtype=bool)
    for row, p, v in ((0, lay.index_p_B, lay.index_v_B), (-1, lay.index_p_E, lay.index_v_E)):
        at_rest = bool(fixed[lay.index_q[nodes[row]]].all() and fixed[p].all())
        velocity[row] = at_rest or bool(len(v) and fixed[v].all())
    at_contact = _known_at_contacts(problem, lay)
    stands = np.zeros((len(nodes), len(rows)), dtype=bool)
    for j, row in enumerate(rows):
        place = list(row["coordinates"])
        for end, node in enumerate(nodes):
            if row["inputs"]:
                stands[end, j] = bool(lay.form.shared)
                continue
            # The same place as at the end of the phase before.
            again = end > 0 and end % 2 == 0 and not row["velocities"]
            fixed_there = bool((fixed[lay.index_q[node, place]] | at_contact[end, place]).all())
            fixed_there &= bool(velocity[end]) or not row["velocities"]
            fixed_there &= end == 0 or not row["time"]
            stands[end, j] = not (again or fixed_there)
    return stands


def _known_at_contacts(problem: Problem, lay: Layout) -> Bools:
    """Coordinates that the contact of a collision fixes at the ends of the phases beside it."""
    model = problem.model
    fixed = np.zeros((2 * lay.phases, lay.nq), dtype=bool)
    for i, event in enumerate(problem.touch.events):
        on = model.surface_coordinates[event.surface] if event.impact else []
        if len(on) == 1 and event.surface not in model.moving:
            fixed[2 * i + 1 : 2 * i + 3, on] = True
    return fixed
