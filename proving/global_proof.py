"""What is proved of all motions of a sequence."""

from __future__ import annotations

import enum
import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.base.table import Shown, Table, passed
from dmoc.proving.paving import MOST_KEPT, MOST_SHOWN, Paving
from dmoc.report.paving_figure import Paved, plot_paving
from dmoc.results.solution import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# Where a solve states hits in energies (theory, law).
IN_RATES = "with hits stated in the rates of the gaps"


class Claim(enum.StrEnum):
    """What a proof shows of the motions of a sequence."""

    OPTIMAL = "optimal (proved)"  # none costs less than the motion by more than the gap
    IMPOSSIBLE = "impossible (proved)"  # there is none
    OPEN = "open"  # time ran out, or what is left out keeps the bound away from the cost


@dataclass(frozen=True, repr=False)
class Proof(Shown):
    """Result of :func:`dmoc.prove`.

    Attributes
    ----------
    claim : Claim
    solution : Solution or None
        The best motion that is known.
    bound : float
        No motion costs less; infinite where there is none at all.
    asked : float
        The gap that was asked for, relative to the cost.
    least : float
        What the bound may be below any cost by, in its unit: a cost may be zero.
    limit : float
        Motions that cost as much count as none; infinite where no cost can be larger.
    durations : tuple of pairs of float
        The durations of the phases that were covered, in seconds.
    final_time : pair of float
        The final times that were covered, in seconds.
    steps : tuple of int
        Steps of each phase of the program that the proof is of.
    order : int
        Order of its steps.
    in_rates : bool
        Whether a solve on this mesh states hits as balances of energies, and the proof does not.
    left_out : tuple of str
        Conditions that no bound takes into account.
    boxes, waiting : int
        Boxes of durations that were looked at, and that are left to do.
    seconds : float
    paving : Paving or None
        The boxes with their bounds, of proofs in one or two durations.
    """

    claim: Claim
    solution: Solution | None
    bound: float
    asked: float
    least: float
    limit: float
    durations: tuple[tuple[float, float], ...]
    final_time: tuple[float, float]
    steps: tuple[int, ...]
    order: int
    in_rates: bool = False
    left_out: tuple[str, ...] = ()
    boxes: int = 0
    waiting: int = 0
    seconds: float = 0.0
    paving: Paving | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        cost = "" if self.cost is None else f", cost {self.cost:.7g}, at least {self.bound:.7g}"
        return f"<Proof: {self.claim}{cost}>"

    @property
    def cost(self) -> float | None:
        """Cost of the best motion that is known."""
        return None if self.solution is None else self.solution.cost

    @property
    def gap(self) -> float | None:
        """How far the bound is below the cost, relative to it, and 0 where that is next to nothing
        beside the sizes of the problem; None without a motion."""
        if self.cost is None:
            return None
        below = self.cost - self.bound
        return 0.0 if below <= self.least else below / max(abs(self.cost), self.least)

    @property
    def proved(self) -> bool:
        """Whether the motion is the best one, or there is none."""
        return self.claim is not Claim.OPEN

    @property
    def statement(self) -> str:
        """What exactly is proved, in a sentence."""
        program = (
            f"of the discrete program of {' + '.join(map(str, self.steps))} steps of order "
            f"{self.order}"
        ) + (f", {IN_RATES}," if self.in_rates else "")
        if self.claim is Claim.IMPOSSIBLE:
            dear = "" if self.limit == float("inf") else f" that costs less than {self.limit:.3g}"
            return f"no motion {program} has this sequence{dear}"
        if self.bound == -float("inf"):
            return "nothing: no bound was found yet"
        return f"every motion {program} with this sequence costs at least {self.bound:.9g}"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        rows: list[tuple[Any, ...]] = [
            ("claim", (passed(self.proved), (f": {self.claim}", ""))),
            ("proved", self.statement),
        ]
        if self.solution is not None and self.gap is not None:
            rows.append(("best motion", f"cost {self.solution.cost:.9g}, {self.solution.status}"))
            rows.append(("gap", f"{self.gap:.1e} of the cost, {self.asked:g} asked for"))
        spans = [f"{low:.3g} to {high:.3g} s" for low, high in self.durations]
        rows.append(("durations", "; ".join(spans)))
        if self.left_out:
            rows.append(("left out", ", ".join(self.left_out)))
        left = f", {self.waiting} are left to do" if self.waiting else ""
        rows.append(("boxes", f"{self.boxes} in {self.seconds:.2f} s{left}"))
        return Table(tuple(rows), title="Proof")

    def plot(self, path: str | os.PathLike[str] | None = None, *, style: str = "light") -> Figure:
        """Draw the boxes over the durations that decide the others, one or two: bounds by shades,
        what holds no motion or is not done by hatches, and the best motion; write the figure if a
        path is given.  ``style`` is "light" or "dark".

        Raises
        ------
        ProblemError
            If more durations decide, or there are too many boxes.
        """
        if self.paving is None:
            raise ProblemError(
                f"the proof has {self.boxes} boxes in the durations of {len(self.durations)} "
                f"phases: a figure shows those of 1 or {MOST_SHOWN} that decide the others, at "
                f"most {MOST_KEPT} boxes."
            )
        return plot_paving(self._paved(self.paving), path, style=style)

    def _paved(self, paving: Paving) -> Paved:
        """What the figure shows."""
        bound, beyond, cost = paving.bound, paving.beyond, self.cost
        aim = beyond if cost is None else cost - max(self.asked * abs(cost), self.least)
        bounded = self.limit == float("inf")  # what motions cost
        empty = paving.without_motion(cost) if cost is not None and bounded else bound >= beyond
        regions = paving.regions()
        there = np.array([len(region) > 0 for region in regions])
        dear = "" if bounded else f" below {self.limit:.3g}"
        free = [*paving.free]
        best = [phase.duration for phase in self.solution.phases] if self.solution else []
        return Paved(
            [region for region in regions if len(region)], bound[there], empty[there],
            (bound < aim)[there], f"no motion{dear}", [f"duration of phase {i} [s]" for i in free],
            paving.linear.durations[free, 1], cost, np.array(best)[free] if best else None,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """The same as plain data."""
        return {
            "claim": str(self.claim),
            "proved": self.proved,
            "statement": self.statement,
            "cost": self.cost,
            "bound": _plain(self.bound),
            "gap": self.gap,
            "asked": self.asked,
            "limit": _plain(self.limit),
            "durations": [list(span) for span in self.durations],
            "final_time": list(self.final_time),
            "steps": list(self.steps),
            "order": self.order,
            "left_out": list(self.left_out),
            "boxes": self.boxes,
            "waiting": self.waiting,
            "seconds": self.seconds,
            "solution": None if self.solution is None else self.solution.to_dict(),
        }


def _plain(number: float) -> float | None:
    """A number, or nothing where JSON has none."""
    return number if abs(number) < float("inf") else None
