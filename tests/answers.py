"""Solutions that have to be there."""

from __future__ import annotations

from typing import Any

import dmoc


def answer_of(problem: dmoc.Problem, *arguments: Any, **options: Any) -> dmoc.Solution:
    """The solution of a problem, which is solved and, where that is asked for, confirmed."""
    solution = dmoc.solve(problem, *arguments, **options)
    assert solution.status == "solved", solution.message
    return solution
