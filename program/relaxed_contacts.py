"""The unknown impulses of contacts that no word says, at every node."""

from __future__ import annotations

import numpy as np

from dmoc.base.records import record
from dmoc.mechanics.touch import Touch
from dmoc.program.blocks import Index, Numbering


@record(frozen=True, eq=False)
class RelaxedUnknowns:
    """Normal impulses P_r, shape (nodes, nc), and tangential ones T_r, shape (nodes, nt), of what
    is left open; a touch that leaves nothing open has no rows."""

    P_r: Index
    T_r: Index

    @classmethod
    def of(cls, block: Numbering, steps: int, touch: Touch) -> RelaxedUnknowns:
        names, nodes = touch.contacts, steps + 1 if touch.open else 0
        presses = np.zeros((nodes, len(names.surfaces)), dtype=bool)
        rubs = np.zeros((nodes, len(names.tangents)), dtype=bool)
        if touch.open:
            presses[:, touch.open.surfaces] = True
            rubs[:, touch.open.tangents] = True
        blocks = (
            block(
                "P_r",
                presses,
                lambda k, j: f"impulse of {names.surfaces[j]} at node {k}",
                lambda s: s.lam / steps,
            ),
            block(
                "T_r",
                rubs,
                lambda k, j: f"friction impulse of {names.tangents[j]} at node {k}",
                lambda s: s.friction / steps,
            ),
        )
        return cls(*(b.index for b in blocks))
