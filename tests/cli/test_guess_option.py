"""--guess on the command line: a file, or keyframes by name."""

from __future__ import annotations

from pathlib import Path

import dmoc
from dmoc.cli.option_values import read_guess


def test_keyframes_by_name() -> None:
    assert read_guess(None) is None
    words = ["alpha=0.47,0.3,1.57", "F=0", "durations=0.2,0.8"]
    expected = {"alpha": [0.47, 0.3, 1.57], "F": [0.0], "durations": [0.2, 0.8]}
    assert read_guess(words) == expected


def test_a_file_may_have_an_equals_sign_in_its_name(seed: dmoc.Problem, tmp_path: Path) -> None:
    solution = dmoc.solve(seed.but(steps=10), "ipm", starts=1, verify=False)
    path = solution.save(tmp_path / "l=0.5.npz")
    guess = read_guess([str(path)])
    assert isinstance(guess, dmoc.Solution)
    assert guess.cost == solution.cost
