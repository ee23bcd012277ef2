"""Modes of steps beside hits, a letter for each step."""

from __future__ import annotations

from typing import Any

import pytest

from dmoc.sequences.relaxed_motion import at_hits, cleaned


@pytest.mark.parametrize(
    ("steps", "nodes", "after"),
    [
        ("aabbb", [2], "aabbb"),  # it changes there
        ("aabbb", [3], "aaabb"),  # a step before it
        ("aabbb", [1], "abbbb"),  # a step after it
        ("abbbb", [2], "aabbb"), ("aaaab", [3], "aaabb"), ("aaaab", [4], "aaaab"),
        ("aaabbb", [5], "aaabbb"), ("aaabbb", [1], "aaabbb"),  # two steps from it
        ("aaaa", [2], "aaaa"), ("abbbbc", [2, 4], "aabbcc"), ("abbb", [0], "abbb"),
        ("abbb", [], "abbb"),
    ],
)  # fmt: skip
def test_what_changes_a_step_beside_a_hit_changes_with_it(
    steps: str, nodes: list[int], after: str
) -> None:
    modes: Any = list(steps)
    merged: Any = at_hits(modes, nodes)
    assert "".join(merged) == after and "".join(modes) == steps


@pytest.mark.parametrize(
    ("steps", "fewest", "after"),
    [
        ("aaabaaa", 2, "aaaaaaa"), ("aabaaab", 2, "aaaaaaa"), ("baaaa", 2, "aaaaa"),
        ("aaabbccc", 2, "aaabbccc"), ("aaabbcccc", 3, "aaacccccc"), ("aaaabbccc", 3, "aaaaaaccc"),
        ("ab", 3, "bb"), ("a", 3, "a"), ("aabb", 1, "aabb"),
    ],
)  # fmt: skip
def test_a_mode_of_few_steps_becomes_that_of_its_longer_neighbour(
    steps: str, fewest: int, after: str
) -> None:
    modes: Any = list(steps)
    merged: Any = cleaned(modes, fewest)
    assert "".join(merged) == after and "".join(modes) == steps
