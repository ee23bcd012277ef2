"""Scenes in solution files: as they were, refused where they do not fit, and not needed."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from damage import archive, members

import dmoc
from dmoc.base.errors import SolutionFileError


def test_scene_and_units_come_back_as_they_were(solution: dmoc.Solution) -> None:
    motion = dmoc.Solution.from_bytes(solution.to_bytes()).trajectory
    assert motion.units == solution.trajectory.units == {"alpha": "rad", "x": "m", "F": "N"}
    scene, saved = motion.scene, solution.trajectory.scene
    assert scene is not None and saved is not None and scene.shapes == saved.shapes
    for a, b in zip((*scene.times, *scene.values), (*saved.times, *saved.values), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_file_of_this_format_must_say_whether_there_is_a_scene(solution: dmoc.Solution) -> None:
    parts = {k: v for k, v in members(solution.to_bytes()).items() if ".scene." not in k}
    header = json.loads(parts["header.json"])
    del header["solution"]["trajectory"]["scene"]
    parts["header.json"] = json.dumps(header).encode()
    with pytest.raises(SolutionFileError, match=r"trajectory\.scene is missing"):
        dmoc.Solution.from_bytes(archive(parts))


def _columns(scene: dict[str, Any]) -> None:
    scene["shapes"][0]["size"] = 6


def _kind(scene: dict[str, Any]) -> None:
    scene["shapes"][0]["kind"] = "cloud"


def _start(scene: dict[str, Any]) -> None:
    scene["shapes"][1]["start"] = 0


def _markup(scene: dict[str, Any]) -> None:
    scene["shapes"][0]["name"] = "<b>"


def _phases(scene: dict[str, Any]) -> None:
    scene["times"].pop()


def _fewer(scene: dict[str, Any]) -> None:
    scene["shapes"].pop()


@pytest.mark.parametrize("damage", [_columns, _kind, _start, _markup, _phases, _fewer])
def test_a_scene_that_does_not_fit_together_is_refused(
    solution: dmoc.Solution, damage: Callable[[dict[str, Any]], None]
) -> None:
    parts = members(solution.to_bytes())
    header = json.loads(parts["header.json"])
    damage(header["solution"]["trajectory"]["scene"])
    parts["header.json"] = json.dumps(header).encode()
    with pytest.raises(SolutionFileError) as caught:
        dmoc.Solution.from_bytes(archive(parts))
    assert "scene" in str(caught.value) and "\n" not in str(caught.value)
