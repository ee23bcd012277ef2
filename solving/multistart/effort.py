"""How many starts are tried, and what those that were tried say of minima that were not met."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import value_class
from dmoc.guess.random_motions import IN_TURN
from dmoc.solving.multistart.minima import Basin

# Where a collision of every minimum has no effect, so many times more starts go by without a
# cheaper one.
PATIENCE = 6


@value_class(frozen=True)
class Effort:
    """How many starts are tried, and what is done with what they find."""

    # Random starts at first, random ones in each later round and motions beside the minima that
    # were met, and the most of all these.
    first: int = 12
    random: int = 16
    kinds: Sequence[int] = IN_TURN  # of random motions
    beside: int = 16
    most: int = 300
    lasts: bool = False  # once there is a motion, until the time is used, however many these are
    # No more are needed where all have led to one minimum; or where the best one was met so often,
    # so many starts on the average have met each, so many have met no cheaper one since, and at
    # most such a share of further starts is expected to meet a minimum not met so far: of all, and
    # of those that are not beside a minimum.
    often: int = 5
    each: int = 6
    unseen: float = 0.06
    unseen_far: float = 0.15
    # Minima that are refined at least, and at most, where cheaper coarse ones are left.
    refined: int = 4
    most_refined: int = 16
    settles: bool = True  # minima that are not confirmed are looked at on a finer mesh
    widens: bool = True  # limits of inputs, to tighten them, where no start leads to a motion
    share: float | None = None  # of the time that all have; by default more where none leads on
    iterations: int | None = None  # of a start; by default as many as it seems to take
    guesses: int | None = None  # automatic ones that are tried at most
    total: int | None = None  # all starts, where their number is given
    seed: int = 0
    verifies: bool = True  # minima are checked by simulation before they are ranked

    @classmethod
    def of(
        cls, starts: int | None, seed: int, verifies: bool = True, most: int | None = None
    ) -> Effort:
        """The effort of a given number of starts, or else of as many as it seems to take, perhaps
        with a largest number ``most`` beside a motion that is known."""
        widens, most = starts is None and most is None, cls.most if most is None else most
        return cls(widens=widens, most=most, total=starts, seed=seed, verifies=verifies)

    def suffices(self, minima: Sequence[Basin], starts: int, unbeaten: int) -> bool:
        """Whether so many starts, of which some minima have come, are enough; ``unbeaten`` of them
        came after the one that has met the best minimum first."""
        if self.total is not None or not minima:
            return False
        if len(minima) == 1 and minima[0].starts == starts:
            return True
        every, far = met_by_cost(minima).T
        seen = unseen_share(every) <= self.unseen and unseen_share(far) <= self.unseen_far
        with_effect = [basin for basin in minima if not basin.grazes]
        best = int(met_by_cost(with_effect or minima)[0, 0])
        often = best >= self.often and every.sum() >= self.each * len(every)
        patience = 1 if with_effect else PATIENCE
        return seen and often and unbeaten >= patience * self.beside


def met_by_cost(minima: Sequence[Basin]) -> NDArray[np.intp]:
    """Starts that have met each cost of some minima, the cheapest first, whatever the durations,
    and those of them that were not beside a minimum: shape (costs, 2).  Where a motion may wait,
    many minima cost the same."""
    counts, before = list[list[int]](), None
    for basin in minima:
        if before is None or not basin.costs_as(before):
            counts.append([0, 0])
        counts[-1][0] += basin.starts
        counts[-1][1] += basin.far
        before = basin
    return np.array(counts, np.intp).reshape(-1, 2)


def unseen_share(counts: NDArray[np.intp]) -> float:
    """Estimated share of further starts that lead to a minimum of another cost, among those that
    lead to one (Good 1953, after Turing): the share of costs met once, as if one more had been.
    ``counts`` are the starts that have met each cost, shape (costs,)."""
    return float((np.count_nonzero(counts == 1) + 1) / (counts.sum() + 2))
