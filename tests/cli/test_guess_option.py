"""--guess on the command line: a file, or keyframes by name."""

from __future__ import annotations

from pathlib import Path

import pytest

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.cli.option_values import read_guess


def test_keyframes_by_name() -> None:
    assert read_guess(None) is None
    given = ["alpha=0.47,0.3,1.57", "F=0", "durations=0.2,0.8"]
    expected = {"alpha": [0.47, 0.3, 1.57], "F": [0.0], "durations": [0.2, 0.8]}
    assert read_guess(given) == expected


def test_a_file_may_have_an_equals_sign_in_its_name(seed: dmoc.Problem, tmp_path: Path) -> None:
    known = dmoc.solve(seed.but(steps=10), "ipm", starts=1, verify=False)
    path = known.save(tmp_path / "l=0.5.npz")
    found = read_guess([str(path)])
    assert isinstance(found, dmoc.Solution)
    assert found.cost == known.cost


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["alpha=1,up"], "--guess alpha = 'up': expected numbers such as"),
        (["alpha="], "--guess alpha = '': expected numbers such as"),
        (["=1"], "--guess =1: expected NAME=V1,V2,..., each name once."),
        (["F=1", "F=2"], "--guess F=2: expected NAME=V1,V2,..., each name once."),
        (["known.npz", "F=1"], "--guess known.npz stands beside others: give one file"),
    ],
)
def test_what_does_not_fit_is_one_sentence(given: list[str], message: str) -> None:
    with pytest.raises(ProblemError) as caught:
        read_guess(given)
    assert str(caught.value).startswith(message)
