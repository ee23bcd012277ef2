"""Solution files: written whole, read whole, refused in one sentence."""

from __future__ import annotations

import errno
import os
import secrets
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dmoc
from dmoc.base.errors import OutputError, SolutionFileError
from dmoc.base.files import check_file, write_whole


def test_a_saved_solution_comes_back_whole(solution: dmoc.Solution, tmp_path: Path) -> None:
    path = solution.save(tmp_path / "s.npz")
    again = dmoc.Solution.load(path)
    assert again.to_dict() == solution.to_dict()
    assert np.array_equal(again.unknowns, solution.unknowns)
    for a, b in zip(again.phases, solution.phases, strict=True):
        for name in "tqpvu":
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    assert (
        again.multipliers.keys() == solution.multipliers.keys() and "momentum" in again.multipliers
    )
    for name, values in solution.multipliers.items():
        np.testing.assert_array_equal(again.multipliers[name], values, err_msg=name)
    assert again.verify().passed
    assert [p.name for p in tmp_path.iterdir()] == ["s.npz"]
    with np.load(path, allow_pickle=False) as data:
        assert "header.json" in data.files


@pytest.mark.parametrize("damage", ["truncated", "text", "other", "missing"])
def test_a_damaged_file_is_one_sentence(
    solution: dmoc.Solution, tmp_path: Path, damage: str
) -> None:
    path = tmp_path / "s.npz"
    if damage == "truncated":
        solution.save(path)
        path.write_bytes(path.read_bytes()[:3000])
    elif damage == "text":
        path.write_text("not a solution")
    elif damage == "other":
        np.savez(path, a=np.zeros(3))
    with pytest.raises(SolutionFileError) as error:
        dmoc.Solution.load(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_an_unwritable_place_leaves_the_old_file(
    solution: dmoc.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        solution.save(tmp_path / "no" / "such" / "s.npz")
    old = tmp_path / "s.npz"
    old.write_text("old")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left on device"):
        solution.save(old)
    assert old.read_text() == "old" and [p.name for p in tmp_path.iterdir()] == ["s.npz"]


def test_a_file_keeps_its_link_and_its_mode_and_a_device_stays_one(tmp_path: Path) -> None:
    kept, link = tmp_path / "kept", tmp_path / "link"
    kept.write_text("old")
    kept.chmod(0o640)
    link.symlink_to(kept)
    write_whole(link, b"new")
    assert (
        link.is_symlink() and kept.read_bytes() == b"new" and kept.stat().st_mode & 0o777 == 0o640
    )
    write_whole(Path(os.devnull), b"new")
    assert Path(os.devnull).is_char_device()


def test_nobody_can_lay_a_trap_where_a_file_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The temporary name is taken: what stands there is neither followed nor changed."""
    monkeypatch.setattr(secrets, "token_hex", lambda _: "foreseen")
    (tmp_path / "victim").write_text("old")
    (tmp_path / ".dmoc-foreseen").symlink_to(tmp_path / "victim")
    with pytest.raises(OutputError, match="File exists"):
        write_whole(tmp_path / "s.npz", b"new")
    assert (tmp_path / "victim").read_text() == "old" and (tmp_path / ".dmoc-foreseen").is_symlink()


@pytest.mark.parametrize("name", ["n" * 300, "folder/" + "n" * 300, "n" * 3000])
def test_a_name_that_the_file_system_does_not_take_is_told_before_the_work(
    tmp_path: Path, name: str
) -> None:
    for refuse in (check_file, lambda path: write_whole(path, b"")):
        with pytest.raises(OutputError, match="cannot be written") as error:
            refuse(tmp_path / name)
        assert len(str(error.value)) < 300


@pytest.mark.parametrize("path", [None, 5, b"a", "a\0b", "", "\ud800", Path("a\0b"), object()])
def test_what_is_no_path_is_told(path: Any) -> None:
    with pytest.raises(OutputError, match="expected the path of a file"):
        write_whole(path, b"")
