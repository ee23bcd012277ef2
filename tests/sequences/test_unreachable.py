"""Whether a sequence without a motion is infeasible, or its collisions alone cannot be reached."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.base.deadline import ENDLESS
from dmoc.sequences import node_solve
from dmoc.sequences.nodes import Verdict


@pytest.mark.parametrize(
    ("sequence", "whole", "there", "verdict", "evidence"),
    [
        (("wall",), (0.1, True), (0.2, True), Verdict.UNREACHABLE, "alone"),
        (("wall",), (0.1, True), (1e-9, True), Verdict.INFEASIBLE, "whole"),  # its end is too far
        (("wall",), (0.1, True), (0.2, False), Verdict.INFEASIBLE, "whole"),  # was not least
        (("wall",), (0.1, False), (0.2, True), Verdict.INFEASIBLE, "whole"),
        ((), (0.1, True), (0.2, True), Verdict.INFEASIBLE, "whole"),  # there are none
    ],
)
def test_collisions_that_no_motion_reaches_are_told_apart(
    sequence: tuple[str, ...],
    whole: tuple[float, bool],
    there: tuple[float, bool],
    verdict: Verdict,
    evidence: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The collisions are looked at with a start that is free where it is periodic, without a goal,
    and in as much time as there is."""
    changes = list[dict[str, Any]]()

    def changed(**fields: Any) -> Any:
        changes.append(fields)
        return "collisions"

    def least(problem: Any, deadline: Any) -> Any:
        (violation, least), words = (
            (there, "alone") if problem == "collisions" else (whole, "whole")
        )
        return SimpleNamespace(x=np.zeros(1), violation=violation, least=least, sentences=(words,))

    monkeypatch.setattr(node_solve, "_least", least)
    coarse: Any = SimpleNamespace(
        but=changed, start={"x": 0.0}, relations=[SimpleNamespace(starts=("y", "x"))],
        final_time_bounds=(1.0, 3.0),
    )  # fmt: skip
    task: Any = SimpleNamespace(sequence=sequence, problem=SimpleNamespace(sequence=sequence))
    node: Any = node_solve._without_minimum(task, coarse, [], ENDLESS)
    assert (node.verdict, node.sequence) == (verdict, sequence)
    assert node.evidence[0].startswith("no motion was found from 0 starts")
    assert node.evidence[1:] == (evidence,)
    stated = {
        "start": {"y": None, "x": 0.0}, "goal": {}, "periodic": (), "final_time": (None, 3.0),
    }  # fmt: skip
    assert changes == ([stated] if sequence and whole[1] else [])
