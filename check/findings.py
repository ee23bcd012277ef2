"""What one look at a motion comes to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Findings:
    """Errors by the names that :data:`~dmoc.check.verdict.PASSING` has for them, and what
    contradicts the motion, in sentences."""

    measured: Mapping[str, float]
    contradictions: tuple[str, ...] = ()
