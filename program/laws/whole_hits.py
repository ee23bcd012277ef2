"""Laws of hits that go as a whole, from the rates before them: which impulses, and whether it
sticks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from dmoc.codegen.kernels import Array
from dmoc.motion.impact_laws import BALL, RETURNING
from dmoc.program.laws.ball import bounced
from dmoc.program.laws.tangential import returned


class WholeHit(Protocol):
    """Impulses along normal and tangents until the moments of a hit and of the whole, shape
    (moments + 1, 1 + directions), and its friction."""

    @property
    def path(self) -> Array: ...

    @property
    def friction(self) -> int: ...


WHOLE_HITS: dict[str, Callable[[Array, Array, float, float, float], WholeHit]] = {
    RETURNING: returned,
    BALL: bounced,
}
