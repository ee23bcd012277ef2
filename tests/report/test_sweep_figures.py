"""Figures of sweeps: what was solved is drawn, what was not is marked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dmoc.base.errors import ProblemError
from dmoc.report.sweep_figure import plot_sweep


def test_one_value_gives_the_cost_and_the_times_in_its_order(tmp_path: Path) -> None:
    varied = {"m_c": np.array([3.0, 1.0, 2.0])}
    cost, end = np.array([9.0, 1.0, np.nan]), np.array([3.0, 1.0, np.nan])
    times = np.array([[0.3, 0.4], [0.1, np.nan], [np.nan, np.nan]])
    solved = np.array([True, True, False])
    figure = plot_sweep(varied, cost, end, times, solved, tmp_path / "sweep.png")
    above, below = figure.axes
    assert below.get_xlabel() == "$m_{c}$" and above.get_ylabel() == "cost"
    line, missing = above.get_lines()
    np.testing.assert_array_equal(line.get_xydata(), [[1, 1], [2, np.nan], [3, 9]])
    assert list(missing.get_xdata()) == [2.0]
    labels = [text.get_text() for text in below.get_legend().get_texts()]
    assert labels == ["collision 1", "collision 2", "end", "not solved"]
    np.testing.assert_array_equal(below.get_lines()[1].get_ydata(), [np.nan, np.nan, 0.4])
    assert (tmp_path / "sweep.png").read_bytes().startswith(b"\x89PNG")


def test_two_values_give_a_map_with_crosses_where_nothing_was_solved() -> None:
    x, y = (v.ravel() for v in np.meshgrid([1.0, 2.0, 4.0], [10.0, 30.0], indexing="ij"))
    solved = ~((x == 2) & (y == 30))
    figure = plot_sweep({"l": x, "start alpha": y}, x * y, x, np.zeros((6, 0)), solved)
    axes = figure.axes[0]
    assert axes.get_ylabel() == r"start $\alpha$"
    grid = axes.collections[0].get_array()
    np.testing.assert_array_equal(np.ma.filled(grid, np.nan), [[10, 20, 40], [30, np.nan, 120]])
    np.testing.assert_array_equal(axes.get_lines()[0].get_xydata(), [[2.0, 30.0]])


def test_nothing_solved_and_single_values_are_drawn_too() -> None:
    none, nan = np.array([False]), np.array([np.nan])
    for varied in ({"m": np.array([1.0])}, {"m": np.array([1.0]), "l": np.array([2.0])}):
        assert plot_sweep(varied, nan, nan, np.zeros((1, 0)), none).axes


def test_other_numbers_of_values_have_no_figure() -> None:
    with pytest.raises(ProblemError, match="varies 0 values"):
        plot_sweep({}, np.zeros(0), np.zeros(0), np.zeros((0, 0)), np.zeros(0, dtype=bool))
