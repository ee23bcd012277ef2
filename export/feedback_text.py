"""The tables of a feedback as C."""

from __future__ import annotations

from typing import Any

from dmoc.base.arguments import shown
from dmoc.base.errors import ProblemError
from dmoc.control.feedback import Feedback
from dmoc.export.constants import Constants, initial, literal
from dmoc.motion.trajectory import Trajectory


def checked_feedback(feedback: Any, motion: Trajectory) -> Feedback:
    """A feedback along the motion that a solver carries."""
    if not isinstance(feedback, Feedback):
        raise ProblemError(
            f"feedback = {shown(feedback)}: expected what dmoc.feedback returns, or None."
        )
    if not feedback.fits(motion):
        raise ProblemError(
            "the feedback is that of another motion than the one that the solver carries: give "
            "the solution that it was made of as guess."
        )
    return feedback


def feedback_facts(feedback: Feedback) -> dict[str, Any]:
    """Facts about a feedback for the templates: its constants, its phases, its names."""
    c, phases = Constants(), list[str]()
    for g in feedback.phases:
        tables = (c.array("double", table) for table in (g.t, g.y, g.u, g.K))
        phases.append(initial(literal(g.begin), literal(g.end), len(g.t), *tables))
    low, high = (c.array("double", bound) for bound in feedback.bounds.T)
    return {
        "tables": c.lines, "phases": phases, "low": low, "high": high, "table_bytes": c.bytes,
        "states": feedback.states, "inputs": feedback.inputs,
    }  # fmt: skip
