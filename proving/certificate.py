"""What is proved of an answer."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from dmoc.base.table import Shown, Table, passed


@dataclass(frozen=True)
class Certificate(Shown):
    """What :func:`dmoc.certify` proves of an answer, or what it could not prove.

    Attributes
    ----------
    fails : tuple of str
        Conditions that fail or are not decided, a sentence each; empty where all is proved.
    cost : tuple of float, or None
        The minimum's cost lies between these two; None where there is no proof.
    radius : float
        No unknown of the minimum is further from the answer than this times its size; infinite
        where there is no proof.
    unknowns : int
        How many unknowns the program has that are not fixed.
    active : int
        How many inequalities and bounds hold with equality, each with a multiplier that is not
        zero and has the right sign.
    slack : float
        The others leave at least this, relative to their sizes.
    held : tuple of str
        Forces that others have the effect of: the program does not determine them, and they are
        what the answer says.
    left_out : tuple of str
        Rows that depend on others at the answer: the minimum is one of the program without them,
        and misses them by at most 1e-8 of their sizes.
    seconds : float
    """

    fails: tuple[str, ...]
    cost: tuple[float, float] | None = None
    radius: float = float("inf")
    unknowns: int = 0
    active: int = 0
    slack: float = 0.0
    held: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    seconds: float = 0.0

    @property
    def proved(self) -> bool:
        """Whether a strict local minimum of the discrete program lies this near."""
        return not self.fails

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        rows: list[tuple[Any, ...]] = [("certificate", (passed(self.proved), (self._words, "")))]
        if self.cost:
            rows.append(("cost", f"in [{self.cost[0]:.15g}, {self.cost[1]:.15g}]"))
        if self.proved:
            rows.append(("active", f"{self.active} of the inequalities and bounds"))
        if self.held:
            rows.append(("as they are", ", ".join(self.held)))
        if self.left_out:
            rows.append(("left out", ", ".join(self.left_out)))
        rows += [("not proved", sentence) for sentence in self.fails]
        return Table(tuple(rows), title="Certificate")

    @property
    def _words(self) -> str:
        if not self.proved:
            return ": no minimum is proved to lie near this answer"
        return (
            ": a strict local minimum of the discrete program, which no other one is near, lies "
            f"within {self.radius:.1e} of this answer, in sizes of its {self.unknowns} unknowns"
        )

    def to_dict(self) -> dict[str, Any]:
        """The same as plain data."""
        return {"proved": self.proved, **asdict(self)}
