"""Names of unknowns and rows in sentences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from dmoc.program.blocks import Bools
from dmoc.program.transcription import Transcription

MOST_NAMED = 4


def row_name(nlp: Transcription, row: int) -> str:
    """The name of a row of (c | d)."""
    blocks = (*nlp.equalities, *nlp.inequalities)
    block = next(b for b in blocks if (b.numbers == row).any())
    return block.name_of(int(np.flatnonzero(block.numbers == row)[0]))


def bound_name(nlp: Transcription, unknown: int) -> str:
    """The name of a bound of an unknown."""
    return f"the bound of {nlp.layout.names()[unknown]}"


def counted(nlp: Transcription, mask: Bools) -> tuple[str, ...]:
    """Names of unknowns, those of one kind at several places together."""
    names = nlp.layout.names()
    kinds = Counter(names[i].partition(" at ")[0] for i in np.flatnonzero(mask))
    return tuple(f"{name} ({count})" if count > 1 else name for name, count in kinds.items())


def listed(names: Sequence[str]) -> str:
    """The first of some names."""
    *first, last = names[:MOST_NAMED]
    return f"{', '.join(first)} and {last}" if first else last
