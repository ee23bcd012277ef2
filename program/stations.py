"""Where impulses act along phases."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dmoc.base.discretisation import Discretisation
from dmoc.base.records import value_class
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Bools, Index


@value_class(frozen=True)
class Stations:
    """The stations of impulses along phases, one row each, in the order of time; a phase without
    steps has none.

    With steps of degree 1 they are the nodes of each phase; those that two phases share come twice.
    With steps of degree d > 1 they are the d + 1 nodes of each step, its start, those inside it and
    its end, with impulses of the step's own.

    Places are numbered along the whole motion: node k is place d k, those inside the step after it
    follow.
    """

    steps: tuple[int, ...]
    scheme: Discretisation

    @property
    def own(self) -> bool:
        """Whether steps that meet have impulses of their own at the node between them."""
        return self.scheme.inside > 0

    @cached_property
    def _counts(self) -> list[int]:
        """Rows of each phase."""
        return [n * (self.scheme.degree + 1) if self.own else n + (n > 0) for n in self.steps]

    def rows(self, i: int) -> slice:
        """Rows of the stations of phase i."""
        first = sum(self._counts[:i])
        return slice(first, first + self._counts[i])

    @cached_property
    def phase(self) -> Index:
        """Phase of each station, shape (rows,)."""
        return np.repeat(np.arange(len(self.steps)), self._counts)

    @cached_property
    def number(self) -> Index:
        """Node of its step at which a station is, from 0 to d, shape (rows,); 0 where steps share
        nodes."""
        rows = np.arange(len(self.phase))
        return rows % (self.scheme.degree + 1) if self.own else np.zeros_like(rows)

    @cached_property
    def within(self) -> Array:
        """Place of each station in its step, from 0 to 1, shape (rows,)."""
        return np.asarray(np.sort(self.scheme.nodes)[self.number])

    @cached_property
    def place(self) -> Index:
        """Place of each station along the whole motion, shape (rows,)."""
        return self.step * self.scheme.degree + self.number if self.own else self._shared

    @cached_property
    def _shared(self) -> Index:
        """Node of each station where steps share nodes, shape (rows,)."""
        return np.arange(len(self.phase)) - self.phase

    @cached_property
    def step(self) -> Index:
        """Step of each station, shape (rows,). A node that steps share has the step that begins
        there, the last node of a phase the step that ends there."""
        if self.own:
            return np.arange(len(self.phase)) // (self.scheme.degree + 1)
        return self._shared - self.is_last

    @cached_property
    def is_first(self) -> Bools:
        """Whether a station is the first one of its phase, shape (rows,)."""
        return np.diff(self.phase, prepend=-1) > 0

    @cached_property
    def is_last(self) -> Bools:
        """Whether a station is the last one of its phase, shape (rows,)."""
        return np.diff(self.phase, append=len(self.steps)) > 0

    @cached_property
    def begins(self) -> Bools:
        """Whether a station stands at the start of its phase, or of its step where steps have
        impulses of their own, shape (rows,). All but the motion's first share their place with the
        end before."""
        return self.number == 0 if self.own else self.is_first

    @cached_property
    def ends(self) -> Bools:
        """Whether a station stands at the end of its phase, or of its step where steps have
        impulses of their own, shape (rows,)."""
        return self.number == self.scheme.degree if self.own else self.is_last

    @cached_property
    def share(self) -> Array:
        """Share of a step for which the impulse of each station stands, shape (rows,): 1 at a node
        that steps share, 1/2 at the ends of phases, else its weight in the quadrature of
        Lobatto."""
        if self.own:
            return np.asarray(self.scheme.weights[self.number])
        return np.where(self.is_first | self.is_last, 0.5, 1.0)

    @cached_property
    def size(self) -> Array:
        """The size of an impulse over that of one of a whole step, shape (rows, 1)."""
        return (self.share if self.own else np.ones(len(self.phase)))[:, None]

    def label(self, row: int) -> str:
        """The place of a row in words."""
        number, step = int(self.number[row]), int(self.step[row])
        if not self.own:
            return f"at node {self.place[row]} in phase {self.phase[row]}"
        if self.begins[row] or self.ends[row]:
            return f"at the {'end' if number else 'start'} of step {step}"
        inner = f"at inner node {number - 1} of" if self.scheme.inside > 1 else "inside"
        return f"{inner} step {step}"

    def by_step(self, values: Index) -> Index:
        """Values of the rows of a phase by steps: all of each, if they are its own, else that at
        its end; shape (steps, n)."""
        return values.reshape(-1, self.scheme.degree + 1) if self.own else values[1:, None]

    def at_nodes(self, forces: Array) -> tuple[Array, Array]:
        """Forces at the nodes of a phase, the mean of both sides, and at those inside its steps,
        from those of its rows (rows, m)."""
        if not self.own:
            return forces, np.zeros((0, forces.shape[1]))
        steps = forces.reshape(-1, self.scheme.degree + 1, forces.shape[1])
        between = (steps[:-1, -1] + steps[1:, 0]) / 2
        nodes = np.vstack([steps[:1, 0], between, steps[-1:, -1]])
        return nodes, np.ascontiguousarray(steps[:, 1:-1].reshape(-1, forces.shape[1]))
