"""Where a solve begins whose first part others have done (rows.py)."""

from __future__ import annotations

from dmoc.base.records import record
from dmoc.problem.problem import Problem
from dmoc.solvers.outcome import Ending
from dmoc.solving.starts import Starts


@record(frozen=True, eq=False)
class Beginning:
    """Where the solve of a problem begins, the one of a number.

    Attributes
    ----------
    number : int
    problem : Problem
    starts : Starts
    end : Ending
        Where the compiled method has come from the first start.
    seconds : float
        Time that both have taken.
    """

    number: int
    problem: Problem
    starts: Starts
    end: Ending
    seconds: float
