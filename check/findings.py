"""What one look at a motion comes to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike

from dmoc.base.records import record
from dmoc.codegen.kernels import Array


@record(frozen=True, eq=False)
class Findings:
    """Errors by the names that :data:`~dmoc.check.verdict.PASSING` has for them, what contradicts
    the motion, in sentences, and by the same names where errors come from."""

    measured: Mapping[str, float]
    contradictions: tuple[str, ...] = ()
    origins: Mapping[str, str] = field(default_factory=dict)


def together(*looks: Findings) -> Findings:
    """The findings of several looks at different things as one."""
    return Findings(
        {name: error for look in looks for name, error in look.measured.items()},
        tuple(sentence for look in looks for sentence in look.contradictions),
        {name: origin for look in looks for name, origin in look.origins.items()},
    )


def largest(a: ArrayLike) -> float:
    """The largest entry above 0 of an array of any shape (...); infinite if one is not a number."""
    most = float(np.asarray(a).max(initial=0.0))
    return most if most >= 0 else np.inf


def infinite_where_none(a: Array) -> Array:
    """An array of shape (...), infinite where it is not a number."""
    return np.where(np.isnan(a), np.inf, a)
