"""What makes the matrix K of an optimum singular, as floating point has it: constraints that depend
on each other, or unknowns that can change at no cost."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Index
from dmoc.proving.factorisation import SignedFactors
from dmoc.proving.names import MOST_NAMED, listed, row_name
from dmoc.proving.optimality_system import OptimalitySystem

# A matrix whose rows have the size 1 is singular for rounding errors below this, so many inverse
# iterations tell.  What has the first one of these shares of the largest part is named, the second
# one may be left out, and below the last one it takes no part.
SINGULAR, ITERATIONS = 1e-9, 3
TAKES_PART, MAY_GO, NO_PART = 0.3, 0.03, 1e-6


class Null:
    """What K makes nothing of: shares of unknowns, shape (n,), and of rows, shape (m,); zeros where
    K is regular."""

    def __init__(self, system: OptimalitySystem, factors: SignedFactors) -> None:
        self.nlp = system.nlp
        v, least = np.random.default_rng(0).normal(size=(system.size, 1)), np.inf
        with np.errstate(all="ignore"):
            for _ in range(ITERATIONS):
                v = factors.solve(v / np.linalg.norm(v))
                least = 1 / float(np.linalg.norm(v))
        found = least < SINGULAR and np.isfinite(v).all()
        self.x, self.rows = system.parts(
            np.abs(v[:, 0]) / np.abs(v).max() if found else 0 * v[:, 0]
        )

    def follows(self, y: Array) -> int | None:
        """A row that follows from others, where rows alone depend on each other: an inequality with
        the least of the multipliers y, shape (m,), if there is one, else an equation of the fewest
        of their kind."""
        if not self.rows.max(initial=0.0) > 0 or self.x.max() > NO_PART * self.rows.max():
            return None
        e, takes_part = self.nlp.n_eq, self.rows > NO_PART
        inequalities = np.flatnonzero(takes_part[e:] & (self.rows[e:] > TAKES_PART)) + e
        if takes_part[e:].any():
            among = inequalities if len(inequalities) else np.flatnonzero(takes_part[e:]) + e
            return int(among[np.argmin(np.abs(y[among]))])
        may_go = self.rows > MAY_GO * self.rows.max()
        kinds = (b.numbers for b in self.nlp.equalities if may_go[b.numbers].any())
        fewest = min(kinds, key=len)
        return int(fewest[np.argmax(self.rows[fewest])])

    @cached_property
    def sentence(self) -> str:
        """What is said of it; nothing where K is regular."""
        nlp, x, rows = self.nlp, self.x, self.rows
        if not max(x.max(initial=0.0), rows.max(initial=0.0)) > 0:
            return ""
        if x.max() >= rows.max():
            names = nlp.layout.names()
            moved = [names[i] for i in np.argsort(-x) if x[i] > TAKES_PART]
            return (
                f"the cost does not change in second order with {listed(moved)}: a continuum of "
                "minima may go through this answer, and none of them is strict."
            )
        first: Index = np.argsort(-rows)[:MOST_NAMED]
        named = [row_name(nlp, i) for i in first if rows[i] > TAKES_PART]
        return (
            f"active constraints depend on each other: {listed(named)}. Their multipliers are not "
            "determined."
        )
