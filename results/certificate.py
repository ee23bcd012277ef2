"""What is proved of an answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from dmoc.base.arguments import shown
from dmoc.base.errors import ProblemError
from dmoc.base.table import Shown, Table, passed

# How far the cost of an answer may be from that of the minimum near it, relative to its size.
COST_AS_SAID = 1e-3


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
    def row(self) -> tuple[Any, ...]:
        """What the table of its solution shows."""
        words = "".join(f": {sentence}" for sentence in self.fails) or self._words
        if self.cost:
            words += f"; its cost lies in [{self.cost[0]:.15g}, {self.cost[1]:.15g}]"
        return "certificate", (passed(self.proved), (words, ""))

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


def wrong(certificate: Certificate, cost: float, scale: Mapping[str, float]) -> str | None:
    """A sentence about the certificate of a motion of another cost."""
    low, high = certificate.cost or (cost, cost)
    near = COST_AS_SAID * max(abs(cost), scale.get("cost", 0.0))
    if low <= high and low - near <= cost <= high + near:
        return None
    return (
        f"the certificate is of a motion whose cost lies in [{low:.9g}, {high:.9g}], and the cost "
        f"of this one is {cost:.9g}"
    )


def checked(certificate: Certificate, cost: float, scale: Mapping[str, float]) -> Certificate:
    """The certificate; raise ProblemError where it is none, or of a motion of another cost."""
    if not isinstance(certificate, Certificate):
        raise ProblemError(
            f"certificate = {shown(certificate)}: expected what dmoc.certify returns."
        )
    if sentence := wrong(certificate, cost, scale):
        raise ProblemError(f"{sentence}: certify this solution.")
    return certificate
