"""What becomes of a motion that the check confirms and whose error is larger than was asked for."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from dmoc.solvers.outcome import Options, Status
from dmoc.solving import answer


@dataclass(frozen=True)
class Answer:
    """What is looked at of a solution."""

    status: Status
    error_estimate: float | None
    verification: Any
    collisions: tuple[Any, ...] = ()
    cause: str = "as fine as it gets"
    starts: int = 0
    agreeing_starts: int = 0
    first_start: str = ""
    unseen_share: float | None = None
    others: tuple[Any, ...] = ()


def loosened(monkeypatch: pytest.MonkeyPatch, found: Answer) -> Answer:
    """Asked for an error of 1e-6, where one of 1e-3 is a solution too."""
    monkeypatch.setattr(answer, "refined", lambda *_: found)
    monkeypatch.setattr(answer, "ended", lambda refined, _: refined)
    request: Any = SimpleNamespace(tolerance=1e-6, options=Options(), loose=1e-3)
    problem: Any = SimpleNamespace(phase_steps=(4,))
    met = {"starts": 5, "agreeing_starts": 3, "first_start": "random 2", "unseen_share": 0.2}
    first: Any = SimpleNamespace(**met, others=("other",))
    case: Any = SimpleNamespace(problem=problem, guess=None, of_mesh=request)
    kept: Any = answer._refined(first, case)
    assert {name: getattr(kept, name) for name in met} == met and kept.others == ("other",)
    result: Answer = kept
    return result


@pytest.mark.parametrize(
    ("error", "passed", "status", "ended"),
    [
        (1e-4, True, "not_verified", "solved"), (1e-3, True, "not_verified", "solved"),
        (2e-3, True, "not_verified", "not_verified"), (None, True, "not_verified", "not_verified"),
        (1e-4, False, "not_verified", "not_verified"), (1e-4, None, "not_verified", "not_verified"),
        (1e-4, True, "stalled", "stalled"), (1e-7, True, "solved", "solved"),
    ],
)  # fmt: skip
def test_a_confirmed_motion_with_a_larger_error_is_solved(
    monkeypatch: pytest.MonkeyPatch,
    error: float | None,
    passed: bool | None,
    status: str,
    ended: str,
) -> None:
    check = None if passed is None else SimpleNamespace(passed=passed)
    kept = loosened(monkeypatch, Answer(Status(status), error, check))
    assert kept.status == ended
    assert ("confirmed by simulation; as fine" in kept.cause) == (ended != status)


@pytest.mark.parametrize(
    ("grazes", "status"),
    [
        ((), "solved"), ((False,), "solved"), ((True,), "grazes"), ((True, False), "grazes"),
        ((False, True, False), "grazes"), ((False, False), "solved"), ((True, True), "grazes"),
    ],
)  # fmt: skip
def test_one_collision_without_effect_is_enough_to_graze(
    monkeypatch: pytest.MonkeyPatch, grazes: tuple[bool, ...], status: str
) -> None:
    collisions = tuple(SimpleNamespace(grazes=g) for g in grazes)
    check = SimpleNamespace(passed=True)
    found = Answer(Status.NOT_VERIFIED, 1e-4, check, collisions)
    assert loosened(monkeypatch, found).status == status
