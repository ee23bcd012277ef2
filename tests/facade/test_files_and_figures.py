"""Solution files and figures."""

from __future__ import annotations

import errno
import os
import secrets
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dmoc
from dmoc.errors import OutputError, SolutionFileError
from dmoc.writing import write_whole


def test_a_saved_solution_comes_back_whole(solution: dmoc.Solution, tmp_path: Path) -> None:
    path = solution.save(tmp_path / "s.npz")
    again = dmoc.Solution.load(path)
    assert again.to_dict() == solution.to_dict()
    assert np.array_equal(again.unknowns, solution.unknowns)
    for a, b in zip(again.phases, solution.phases, strict=True):
        assert all(np.array_equal(getattr(a, n), getattr(b, n)) for n in "tqpvu")
    assert all(np.array_equal(again.multipliers[n], solution.multipliers[n]) for n in solution.multipliers)
    assert again.verify().passed
    assert [p.name for p in tmp_path.iterdir()] == ["s.npz"]
    with np.load(path, allow_pickle=False) as data:
        assert "header.json" in data.files


@pytest.mark.parametrize("damage", ["truncated", "text", "other", "missing"])
def test_a_damaged_file_is_one_sentence(solution: dmoc.Solution, tmp_path: Path, damage: str) -> None:
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
    assert link.is_symlink() and kept.read_bytes() == b"new" and kept.stat().st_mode & 0o777 == 0o640
    write_whole(Path(os.devnull), b"new")
    assert Path(os.devnull).is_char_device()


def test_nobody_can_lay_a_trap_where_a_file_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The temporary name is taken: what stands there is neither followed nor changed."""
    monkeypatch.setattr(secrets, "token_hex", lambda _: "foreseen")
    (tmp_path / "victim").write_text("old")
    (tmp_path / ".dmoc-foreseen").symlink_to(tmp_path / "victim")
    with pytest.raises(OutputError, match="File exists"):
        write_whole(tmp_path / "s.npz", b"new")
    assert (tmp_path / "victim").read_text() == "old" and (tmp_path / ".dmoc-foreseen").is_symlink()


@pytest.mark.parametrize("name", ["alpha", "x_1", "q_", "a__b", "theta_l_1", "l" * 64])
def test_every_name_of_a_model_can_be_drawn(solution: dmoc.Solution, name: str) -> None:
    t = solution.trajectory
    renamed = replace(t, coordinates=(name, "x"), inputs=(f"u_{name}",), model="other")
    replace(solution, trajectory=renamed).plot().canvas.draw()


def test_figure_shows_positions_momenta_with_jump_inputs_and_snapshots(solution: dmoc.Solution, tmp_path: Path) -> None:
    figure = solution.plot(tmp_path / "s.png")
    assert (tmp_path / "s.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    titles = [a.get_title() for a in figure.axes if a.get_title()]
    assert titles == ["before 'left': 0 to 0.0964 s", "after 'left': 0.0964 to 1 s"]
    momenta = next(a for a in figure.axes if a.get_ylabel() == "momenta")
    jump = solution.collisions[0]
    drawn = [line.get_xydata() for line in momenta.lines if len(line.get_xdata()) == 2 and line.get_linestyle() == ":"]
    assert any(np.allclose(sorted(d[:, 1]), sorted([jump.momentum_before[0], jump.momentum_after[0]])) for d in drawn)
    inputs = next(a for a in figure.axes if a.get_ylabel().startswith("input"))
    assert any("200" in text.get_text() for text in inputs.texts)


def test_bounds_near_the_inputs_are_drawn(seed: dmoc.Problem) -> None:
    figure = dmoc.solve(seed.but(bounds={"F": (-40, 40)}), verify=False).plot()
    inputs = next(a for a in figure.axes if a.get_ylabel().startswith("input"))
    levels = {float(np.asarray(line.get_ydata())[0]) for line in inputs.lines if line.get_linestyle() == "--"}
    assert {-40.0, 40.0} <= levels


def test_other_models_are_drawn_as_curves(block: dmoc.codegen.kernels.Kernels, tmp_path: Path) -> None:
    problem = dmoc.Problem(block, start={"x": 0.0}, goal={"x": 0.5, "x_dot": 0.0}, final_time=1.0, steps=20)
    figure = dmoc.solve(problem).plot(tmp_path / "b.pdf")
    assert len(figure.axes) == 3
    with pytest.raises(OutputError, match="no known format"):
        dmoc.solve(problem).plot(tmp_path / "b.xyz")


@pytest.mark.parametrize("order", [2, 4])
def test_shipped_models_are_drawn_as_themselves_at_both_orders(order: int) -> None:
    from dmoc.registry import find, is_shipped

    reference = find("cart_pendulum")
    solution = dmoc.solve(dmoc.Problem(reference.kernels(order), **reference.defaults | {"steps": 6}), "ipm", verify=False)
    assert is_shipped(solution.trajectory)
    other = replace(solution.trajectory, fingerprint="0" * 64)
    assert not is_shipped(other)
