"""The moment until which something may take."""

from __future__ import annotations

import math
import time

from dmoc.base.records import value_class

# Seconds that are left, at least, for those who take no less than a positive number.
LEAST = 1e-9


@value_class(frozen=True)
class Deadline:
    """A moment of the performance counter, infinite where there is no limit.

    To other processes, which may be on other machines, it travels on the clock of the day, which
    they have in common.
    """

    at: float = math.inf

    @classmethod
    def after(cls, seconds: float | None) -> Deadline:
        """The deadline of a limit that begins now; None is no limit."""
        return ENDLESS if seconds is None else cls(time.perf_counter() + seconds)

    @property
    def ends(self) -> bool:
        """Whether there is a limit."""
        return self.at < math.inf

    @property
    def passed(self) -> bool:
        return time.perf_counter() >= self.at

    @property
    def left(self) -> float:
        """Seconds that are left; 0 afterwards."""
        return max(self.at - time.perf_counter(), 0.0)

    @property
    def seconds(self) -> float | None:
        """The seconds that are left as users give a limit: a positive number, or None for no
        limit."""
        return max(self.left, LEAST) if self.ends else None

    def share(self, share: float) -> Deadline:
        """The deadline of a share of the time that is left."""
        now = time.perf_counter()
        return Deadline(now + share * (self.at - now))

    def __reduce__(self) -> tuple[object, ...]:
        return _arrived, (self.at - time.perf_counter() + time.time(),)


ENDLESS = Deadline()


def _arrived(at: float) -> Deadline:
    """A deadline that has travelled."""
    return Deadline(at - time.time() + time.perf_counter())
