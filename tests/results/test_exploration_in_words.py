"""What starts have led to is told in one way, wherever it is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import dmoc
from dmoc.results.exploration import exploration_in_words
from dmoc.results.solution import Minimum
from dmoc.solvers.outcome import Status

OTHER = Minimum(2.0, 3, Status.SOLVED, (24,))


@pytest.mark.parametrize(
    ("starts", "agreeing", "others", "unseen", "words"),
    [
        (
            10, 10, 0, 1 / 12,
            "all 10 starts led to it, the first of them random 7, which leaves open that about 8% "
            "of further ones lead to another minimum",
        ),
        (
            28, 26, 0, 1 / 28,
            "26 of 28 starts led to it, the first of them random 7, none to another one, which "
            "leaves open that about 4% of further ones lead to another minimum",
        ),
        (
            40, 9, 1, 0.1,
            "9 of 40 starts led to it, the first of them random 7, others to one other minimum; "
            "about 10% of further ones would lead to a minimum not met so far, cheaper or not",
        ),
        (
            40, 9, 2, 0.12,
            "9 of 40 starts led to it, the first of them random 7, others to 2 other minima; about "
            "12% of further ones would lead to a minimum not met so far, cheaper or not, as "
            "dmoc.solve with starts=160 tries in 4 times the time",
        ),
        (
            40, 9, 1, None,
            "9 of 40 starts led to it, the first of them random 7, others to one other minimum",
        ),
        (40, 0, 2, 0.3, "40 starts led to 2 minima on a coarse mesh alone"),
        (40, 0, 0, None, "none of 40 starts on a coarse mesh led to a motion"),
    ],
)  # fmt: skip
def test_starts_are_told_with_what_further_ones_may_lead_to(
    starts: int, agreeing: int, others: int, unseen: float | None, words: str
) -> None:
    solution: Any = SimpleNamespace(
        starts=starts, agreeing_starts=agreeing, others=(OTHER,) * others, unseen_share=unseen,
        first_start="random 7",
    )  # fmt: skip
    assert exploration_in_words(solution) == words


def test_message_report_and_json_say_the_same(seed: dmoc.Problem, tmp_path: Path) -> None:
    solution = dmoc.solve(seed.but(steps=30), "ipm", starts=12)
    words = exploration_in_words(solution)
    assert f"of 12 starts led to it, the first of them {solution.first_start}" in words
    assert solution.message.endswith(words)
    told = " ".join(solution.report(tmp_path / "report.html").read_text().split())
    assert f"On a coarse mesh {words}. Minima are local" in told
    summary = solution.to_dict()
    assert summary["unseen_share"] == solution.unseen_share is not None
    with_other = replace(solution, others=(OTHER,)).to_dict()
    assert with_other["others"] == [
        {"cost": 2.0, "found": 3, "status": Status.SOLVED, "steps": (24,)}
    ]
