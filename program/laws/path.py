"""Path constraints r(q, v, u, t) >= 0 and bounds of quantities z(q, v, u, t), z - lower >= 0 and
upper - z >= 0: where they stand, their rows and terms.

A constraint without inputs stands at the quadrature points of every step, and at both ends of every
phase, which no point reaches; at order 2 one in coordinates and the time stands at every node
instead.  One with inputs stands where the inputs have values of their own::

    constant in a step       at the quadrature points
    linear between nodes     at every node, those at the ends of phases with the inputs of each side
    linear in a step         at both ends of every step, and at the quadrature points

One with forces stands where these are unknowns (:mod:`dmoc.program.force_unknowns`).
Of steps with nodes inside, a constraint without inputs stands at both ends too: a polynomial that
keeps it at its points may exceed it beside them.  A limit of inputs alone
that holds at both ends of a step holds in between, and has no other rows.  At the ends of phases
velocities are those before and after the collision; what the problem fixes there has no row, which
could not move.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.codegen.manifest import FunctionFacts
from dmoc.problem.design import by_design, moves_by_design
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Block, Bools, Counted, Entries, Index, Numbering
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.laws.law import Law
from dmoc.program.laws.sites import arguments_along, nodes_of_ends
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


KINDS = {"path": BoundKind.PATH, "quantity": BoundKind.BOUND, "peak": BoundKind.PEAK}


@record(frozen=True, eq=False)
class Side:
    """One side on which nr functions stay.

    It is sign * (function - value) >= 0 for those of the mask ``there``, with ``values``, both of
    shape (nr,). With ``unknowns``, shape (nr,), it is sign * function + unknown >= 0.
    """

    sign: float
    there: Bools
    values: Array
    unknowns: Index | None = None


@dataclass(eq=False, repr=False)
class PathLaw(Law):
    """The path constraints of a problem, or the bounds of its quantities.

    Attributes
    ----------
    lay : Layout
    name, kernel : str
        "path", "quantity" or "peak", and the name of the kernels, "path" or "quantity".
    rows : tuple of mappings
        What the functions depend on (:func:`~dmoc.symbolic.path_constraints.path_rows`).
    sides : tuple of Side
    at_ends : array of bool, shape (2 phases, nr)
        Which ones stand at the start and at the end of each phase; one without steps has a start
        alone.
    """

    lay: Layout
    name: str
    kernel: str
    rows: tuple[FunctionFacts, ...]
    sides: tuple[Side, ...]
    at_ends: Bools = field(init=False)
    at_points: Block = field(init=False)
    at_nodes: Block = field(init=False)
    at_ends_of_steps: Block = field(init=False)
    at_ends_of_phases: Block = field(init=False)

    @classmethod
    def of(cls, problem: Problem, lay: Layout) -> PathLaw:
        """The path constraints."""
        rows = tuple(problem.kernels.manifest.path_rows)
        every = Side(1.0, np.ones(len(rows), dtype=bool), np.zeros(len(rows)))
        return cls(lay, "path", "path", rows, (every,))

    @classmethod
    def of_quantities(cls, problem: Problem, lay: Layout) -> PathLaw:
        """The bounds of the quantities."""
        rows = tuple(problem.kernels.quantity_rows)
        return cls(lay, "quantity", "quantity", rows, _sides(problem))

    @classmethod
    def of_peaks(cls, problem: Problem, lay: Layout) -> PathLaw:
        """The peaks of the objective above their quantities, and above the negative ones."""
        rows = tuple(problem.kernels.quantity_rows)
        sides = []
        for (j, both), unknown in zip(problem.model.peaks_of, lay.index_peaks, strict=False):
            there, unknowns = np.arange(len(rows)) == j, np.full(len(rows), unknown)
            for sign in (-1.0, 1.0)[: 1 + both]:
                sides.append(Side(sign, there, np.zeros(len(rows)), unknowns))
        return cls(lay, "peak", "quantity", rows, tuple(sides))

    def bounding(self, problem: Problem) -> PathLaw:
        """The same rows with the bounds of another problem, which has the same quantities
        bounded."""
        other = copy(self)
        other.sides = _sides(problem)
        return other

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the functions."""
        return tuple(row["name"] for row in self.rows)

    def _which(self, kind: Callable[[FunctionFacts], Any]) -> Bools:
        return np.array([bool(kind(row)) for row in self.rows], dtype=bool)

    @cached_property
    def on_inputs(self) -> Bools:
        """Functions that contain inputs, shape (nr,)."""
        return self._which(lambda row: row["inputs"])

    @cached_property
    def on_states(self) -> Bools:
        """Functions that contain coordinates or velocities, shape (nr,)."""
        return self._which(lambda row: row["coordinates"] or row["velocities"])

    @cached_property
    def on_rates(self) -> Bools:
        """Functions that contain velocities and no inputs, shape (nr,)."""
        return self._which(lambda row: row["velocities"] and not row["inputs"])

    @cached_property
    def on_places(self) -> Bools:
        """Functions that contain coordinates and the time alone, shape (nr,)."""
        return ~self.on_inputs & ~self.on_rates & ~self.on_forces

    @cached_property
    def on_forces(self) -> Bools:
        """Functions that contain forces, shape (nr,)."""
        return self._which(lambda row: row.get("forces"))

    @property
    def idle(self) -> bool:
        """Whether there are no rows."""
        return not any(side.there.any() for side in self.sides)

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        if not self.idle:
            peaks = self.name == "peak"  # may be above what is fixed
            fixed = np.zeros(self.lay.size, dtype=bool) if peaks else limits[0] == limits[1]
            chosen = by_design(problem, f"{self.kernel}_point")
            self.at_ends = _ends(problem, self.lay, self.rows, fixed, not peaks, chosen)

    @property
    def _at_points(self) -> Bools:
        form = self.lay.form
        there = ~self.on_inputs | (form.width == 0) | (self.on_states & form.jumps)
        there &= ~(self.on_forces & bool(self.lay.inside))
        return there & (~self.on_places | bool(self.lay.inside))

    # Rows -----------------------------------------------------------------------------------------

    def inequalities(self, block: Numbering) -> None:
        if self.idle:
            return
        lay, count, kernel = self.lay, len(self.rows), self.kernel
        nouns = {"path": "path constraint ", "quantity": "bound of ", "peak": "peak of "}
        names = [nouns[self.name] + n for n in self.names]
        kind = KINDS[self.name]
        counted = partial(Counted, kind, self.names)
        scheme, steps, points = lay.scheme, np.arange(lay.total), lay.scheme.points
        inner, ends = ~np.isin(np.arange(lay.total + 1), lay.ends), nodes_of_ends(lay)
        by_node = (self.on_inputs & bool(lay.form.shared)) | (self.on_places & (not lay.inside))
        # Forces stand at all nodes of steps with nodes inside, other functions at their ends.
        per = scheme.degree + 1 if self.kernel == "quantity" and lay.force.count else 2
        by_step = np.zeros((lay.total, per, count), dtype=bool)
        by_step[:, [0, -1]] = self.on_inputs & lay.form.jumps & ~self.on_forces
        if lay.inside:  # what keeps its limit at a polynomial's points may exceed it beside them
            rates = np.zeros_like(by_step)
            rates[:, [0, -1]] = self.on_rates
            rates[:, -1] |= self.on_places
            rates |= self.on_forces
            # of the ends of phases, where velocities are known
            rates[lay.ends[: lay.stepped], 0] = False
            rates[lay.ends[1 : lay.stepped + 1] - 1, -1] = False
            by_step |= rates

        # The first of the three nodes that a row at a node depends on.
        first = np.arange(lay.total + 1) - 1

        def label(place: str) -> Any:
            return lambda k, j: f"{names[j % count]} {place.format(k)}"

        def at_end(k: int, j: int) -> str:
            side = "end" if k % 2 else "start"
            return f"{names[j % count]} at the {side} of phase {k // 2}"

        def made(name: str, where: Bools, says: Any, at: Index) -> Block:
            every = where.shape[1] // max(count, 1)
            there = [np.tile(side.there, every) for side in self.sides]
            return block(
                f"{self.name} {name}".rstrip(),
                np.hstack([where & side for side in there]),
                says,
                lambda s: np.tile(getattr(s, kernel), every * len(there)),
                at,
                counted=counted(at),
            )

        at_points = np.tile(self._at_points, (lay.total, points))
        self.at_points = made("", at_points, label("in step {}"), steps)
        self.at_nodes = made("at nodes", inner[:, None] & by_node, label("at node {}"), first)
        self.at_ends_of_steps = made(
            "at ends of steps", by_step.reshape(lay.total, -1), label("in step {}"), steps
        )
        self.at_ends_of_phases = made("at ends", self.at_ends, at_end, ends)

    # Terms ----------------------------------------------------------------------------------------

    def _by_side(self, block: Block) -> list[Index]:
        """The rows of a block for each side."""
        return np.split(block.index, len(self.sides), axis=1)

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        if self.idle:
            return []
        lay = self.lay
        k = np.flatnonzero((self.at_nodes.index != NOWHERE).any(axis=1))
        at = arguments_along(lay, places, k, self.kernel == "quantity")
        return [
            Term(self.kernel + name, at[name], (rows[own],), side.sign)
            for name, block, own in (
                ("", self.at_points, slice(None)),
                ("_ends", self.at_ends_of_steps, slice(None)),
                ("_node", self.at_nodes, k),
                ("_point", self.at_ends_of_phases, slice(None)),
            )
            for side, rows in zip(self.sides, self._by_side(block), strict=True)
            if name in at
        ]

    @property
    def _members(self) -> Iterator[tuple[Side, Index, Index]]:
        """Each side with the numbers of its rows, and the functions of these, shape (k,) each."""
        if self.idle:
            return
        blocks = self.at_points, self.at_nodes, self.at_ends_of_steps, self.at_ends_of_phases
        for block in blocks:
            for side, index in zip(self.sides, self._by_side(block), strict=True):
                where, column = np.nonzero(index != NOWHERE)
                yield side, index[where, column], column % len(self.rows)

    def entries(self, laws: Laws) -> list[Entries]:
        return [
            (rows, side.unknowns[which], np.ones(len(rows)))
            for side, rows, which in self._members
            if side.unknowns is not None
        ]

    def above(self, values: Array) -> Array:
        """Differences of peaks along the motion and their quantities, shape (peaks,), from the
        values of all rows (c | d)."""
        lowest = np.full(self.lay.size, np.inf)
        for side, rows, which in self._members:
            if side.unknowns is not None:
                np.minimum.at(lowest, side.unknowns[which], values[rows])
        along = dict.fromkeys(int(s.unknowns.max()) for s in self.sides if s.unknowns is not None)
        return lowest[list(along)]

    def constants(self) -> Iterator[tuple[int, float]]:
        for side, rows, which in self._members:
            if side.values.any():
                constants = -side.sign * side.values[which]
                yield from zip(rows.tolist(), constants.tolist(), strict=True)


def _sides(problem: Problem) -> tuple[Side, ...]:
    """Sides on which a problem bounds its quantities."""
    bounds = problem.quantity_bounds
    there = np.isfinite(bounds)
    values = np.where(there, bounds, 0.0)
    return tuple(
        Side(sign, there[:, i], values[:, i])
        for i, sign in enumerate((1.0, -1.0))
        if there[:, i].any() or not i
    )


def _ends(
    problem: Problem, lay: Layout, rows: Sequence[FunctionFacts], fixed: Bools,
    at_contacts: bool, chosen: Bools,
) -> Bools:  # fmt: skip
    """Mask of the path constraints at the start and at the end of each phase, shape (2 phases, nr);
    contacts fix coordinates if ``at_contacts``, ``chosen`` are the rows that depend on the
    design."""
    nodes = nodes_of_ends(lay)
    velocity = np.zeros(len(nodes), dtype=bool)
    ends = problem.start_bounds, problem.goal_bounds
    for at, p, v in ((0, lay.index_p_B, lay.index_v_B), (-1, lay.index_p_E, lay.index_v_E)):
        at_rest = bool(fixed[lay.index_q[nodes[at]]].all() and fixed[p].all())
        at_rest &= not moves_by_design(problem, ends[at])
        velocity[at] = at_rest or bool(len(v) and fixed[v].all())
    at_contact = _fixed_at_contacts(problem, lay) & at_contacts
    stands = np.zeros((len(nodes), len(rows)), dtype=bool)
    for j, row in enumerate(rows):
        place = list(row["coordinates"])
        for end, node in enumerate(nodes):
            if row["inputs"] or (row.get("forces") and end == 2 * lay.stepped):
                own = lay.form.shared or (row.get("forces") and lay.inside)
                stands[end, j] = bool(own and end < 2 * lay.stepped)
                continue
            # The same place as at the end of the phase before.
            again = end > 0 and end % 2 == 0 and not row["velocities"]
            fixed_there = bool((fixed[lay.index_q[node, place]] | at_contact[end, place]).all())
            fixed_there &= bool(velocity[end]) or not row["velocities"]
            fixed_there &= not chosen[j] and (end == 0 or not row["time"])
            stands[end, j] = not (again or fixed_there)
    return stands


def _fixed_at_contacts(problem: Problem, lay: Layout) -> Bools:
    """Coordinates that the contact of a collision fixes at the ends of the phases beside it."""
    model, chosen = problem.model, by_design(problem, "surface")
    fixed = np.zeros((lay.phases + lay.stepped, lay.nq), dtype=bool)
    for i, event in enumerate(problem.touch.events):
        on = model.surface_coordinates[event.surface] if event.impact else []
        if len(on) == 1 and not (event.surface in model.moving or chosen[event.surface]):
            fixed[2 * i + 1 : 2 * i + 3, on] = True
    return fixed
