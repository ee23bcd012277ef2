"""Where impulses act along phases."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dmoc.base.discretisation import Discretisation
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Bools, Index


@dataclass(frozen=True)
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
        """Those of phase i."""
        first = sum(self._counts[:i])
        return slice(first, first + self._counts[i])

    @cached_property
    def phase(self) -> Index:
        return np.repeat(np.arange(len(self.steps)), self._counts)

    @cached_property
    def number(self) -> Index:
        """The place of each in its step, from 0 to d; 0 where steps share them."""
        rows = np.arange(len(self.phase))
        return rows % (self.scheme.degree + 1) if self.own else np.zeros_like(rows)

    @cached_property
    def within(self) -> Array:
        """The place of each in its step, from 0 to 1."""
        return np.asarray(np.sort(self.scheme.nodes)[self.number])

    @cached_property
    def place(self) -> Index:
        return self.step * self.scheme.degree + self.number if self.own else self._shared

    @cached_property
    def _shared(self) -> Index:
        """The nodes of phases that share them."""
        return np.arange(len(self.phase)) - self.phase

    @cached_property
    def step(self) -> Index:
        """The step of each; of a node that steps share the one that begins there, of the last one
        of a phase that which ends there."""
        if self.own:
            return np.arange(len(self.phase)) // (self.scheme.degree + 1)
        return self._shared - self.is_last

    @cached_property
    def is_first(self) -> Bools:
        """Of a phase."""
        return np.diff(self.phase, prepend=-1) > 0

    @cached_property
    def is_last(self) -> Bools:
        """Of a phase."""
        return np.diff(self.phase, append=len(self.steps)) > 0

    @cached_property
    def begins(self) -> Bools:
        """Those at the place where something has ended before: a phase, or the step before."""
        return self.number == 0 if self.own else self.is_first

    @cached_property
    def ends(self) -> Bools:
        """Those at which a step ends that has impulses of its own, or a phase."""
        return self.number == self.scheme.degree if self.own else self.is_last

    @cached_property
    def share(self) -> Array:
        """What each stands for, in steps."""
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
