"""Steps of the phases on finer meshes."""

from __future__ import annotations

from collections.abc import Sequence

# A phase whose steps are shorter than the longest ones by this factor keeps its number of them: it
# has shrunk, and steps that shrink with it would divide rounding errors by next to nothing.
SHORTER = 16.0


def finer(durations: Sequence[float], steps: Sequence[int], wanted: Sequence[int]) -> list[int]:
    """The steps that are wanted of each phase, those that there are of phases that have shrunk."""
    h = [duration / max(n, 1) for duration, n in zip(durations, steps, strict=True)]
    return [
        n if SHORTER * h_i < max(h) else more for h_i, n, more in zip(h, steps, wanted, strict=True)
    ]
