"""The table of many solves: CSV, data frame, file."""

from __future__ import annotations

import csv
import sys
import types
from dataclasses import fields, replace
from pathlib import Path

import block_and_wall
import numpy as np
import pytest
import sympy as sp
from damage import SOLUTIONS
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import MissingExtraError, OutputError, SolutionFileError
from dmoc.results.batch import table_of_batch
from dmoc.results.batch_file import BATCH, FILE
from dmoc.results.result_file import content_of, result_in


@pytest.fixture(scope="module")
def batch() -> dmoc.Batch:
    problem = block_and_wall.problem(0.8, 8)
    swept = dmoc.sweep(problem, {"m": [1.0, 2.0]}, start={"x": [0.0, 2.0]}, verify=False)
    assert swept.status == ("solved", "refused") * 2
    return swept


def test_the_csv_has_every_number_in_full(batch: dmoc.Batch, tmp_path: Path) -> None:
    with batch.to_csv(tmp_path / "table.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [*rows[0]] == [
        "m", "start x", "status", "cost", "final_time", "collisions", "time_1", "impulse_1",
        "iterations", "check", "seconds", "message",
    ]  # fmt: skip
    assert [float(r["cost"] or "nan") for r in rows] == pytest.approx(batch.cost, nan_ok=True)
    assert float(rows[0]["time_1"]) == batch.collision_times[0, 0]
    assert rows[1]["cost"] == rows[1]["time_1"] == "" and rows[1]["message"] == batch.message[1]


def test_a_file_gives_the_table_back(batch: dmoc.Batch, tmp_path: Path) -> None:
    loaded = dmoc.Batch.load(batch.save(tmp_path / "table.npz"))
    stored = {BATCH.attributes.get(name, name) for name in BATCH.fields}
    for name in stored:
        np.testing.assert_equal(getattr(loaded, name), getattr(batch, name))
    assert content_of(FILE, loaded) == content_of(FILE, batch)
    assert {f.name for f in fields(dmoc.Batch)} == stored | {"solutions"}


@pytest.mark.parametrize("rows", [0, 1, 39, 40, 41, 57])
def test_what_a_table_leaves_out_is_counted(batch: dmoc.Batch, rows: int) -> None:
    """It shows 40 rows at most."""
    every = np.arange(float(rows))
    longer = replace(
        batch, varied={"m": every}, status=("solved",) * rows, cost=every, final_time=every,
        iterations=every, collision_times=every[:, None], message=("",) * rows, design={},
    )  # fmt: skip
    table = table_of_batch(longer)
    assert [row[0] for row in table.rows] == [f"{m:.6g}" for m in every[:40]]
    left = [note for note in table.notes if " more: " in note]
    assert left == (
        [f"... and {rows - 40} more: --out FILE, or save(), has all of them"] * (rows > 40)
    )


def test_an_empty_table_has_a_file_too(tmp_path: Path) -> None:
    empty = dmoc.solve_many([])
    assert len(dmoc.Batch.load(empty.save(tmp_path / "empty.npz"))) == 0


@pytest.mark.slow
def test_every_damage_to_a_file_is_a_sentence(batch: dmoc.Batch) -> None:
    content, refused = content_of(FILE, batch), 0
    for i, damage in enumerate([*SOLUTIONS.values()] * 6):
        with np.errstate(invalid="ignore"):  # a column may have NaN
            damaged = damage(content, np.random.default_rng([3, i]))
        try:
            result_in(FILE, damaged, "it")
        except SolutionFileError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 30


def test_what_is_no_file_of_a_batch_is_refused(batch: dmoc.Batch, tmp_path: Path) -> None:
    solution = dmoc.solve(block_and_wall.problem(0.8, 8), verify=False)
    with pytest.raises(SolutionFileError, match="is the file of a solution: read it with dmoc"):
        dmoc.Batch.load(solution.save(tmp_path / "solution.npz"))
    with pytest.raises(SolutionFileError, match="is the file of a batch, which has no motions"):
        dmoc.Solution.load(batch.save(tmp_path / "table.npz"))


def test_more_messages_than_a_file_holds_are_refused_before_it_is_written(
    batch: dmoc.Batch, tmp_path: Path
) -> None:
    long = replace(batch, message=tuple(f"{i}{'x' * 2**20}" for i in range(4)))
    with pytest.raises(OutputError, match="write it with to_csv"):
        long.save(tmp_path / "table.npz")
    assert not list(tmp_path.iterdir())


def test_a_data_frame_needs_pandas(batch: dmoc.Batch, monkeypatch: pytest.MonkeyPatch) -> None:
    pandas = types.ModuleType("pandas")
    pandas.DataFrame = dict  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pandas", pandas)
    assert batch.to_frame()["cost"][0] == batch.cost[0]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtraError, match="pip install pandas"):
        batch.to_frame()


@pytest.mark.slow
def test_a_parameter_may_be_called_like_a_result(tmp_path: Path) -> None:
    """Masses 1 and 2 on a line: what a parameter is and what a result is are both kept."""
    x, u = dynamicsymbols("x u")
    cost, time_1 = sp.symbols("cost time_1")
    kernels = dmoc.build(
        dmoc.MechanicalSystem(
            "reserved", coordinates=[x], inputs=[u],
            lagrangian=cost * x.diff(dynamicsymbols._t) ** 2 / 2, forces={x: u},
            surfaces={"wall": x <= time_1}, parameters={cost: 1.0, time_1: 1.0}, cost=u**2 / 2,
        )
    )  # fmt: skip
    problem = dmoc.Problem(kernels, start={"x": 0.0}, goal={"x": 0.5}, steps=4, final_time=1.0)
    batch = dmoc.sweep(problem, {"cost": [1.0, 2.0], "time_1": [1.0]})
    assert list(batch.varied["cost"]) == [1.0, 2.0]
    table = batch.columns()
    assert table["parameter cost"] == [1.0, 2.0] and table["parameter time_1"] == [1.0, 1.0]
    assert table["cost"] == list(batch.cost) and table["cost"][1] == pytest.approx(
        4 * table["cost"][0]
    )
    assert list(batch.to_frame().columns) == list(table) == list(batch.to_dict()["columns"])
    loaded = dmoc.Batch.load(batch.save(tmp_path / "table.npz"))
    assert loaded.columns().keys() == table.keys()
    assert "parameter cost" in str(batch)
    with batch.to_csv(tmp_path / "table.csv").open(newline="", encoding="utf-8") as stream:
        assert len(set(next(csv.reader(stream)))) == len(table)


def test_a_table_says_how_many_were_tried_a_second(batch: dmoc.Batch) -> None:
    for seconds, rate in ((0.5, batch.tried / 0.5), (8.0, batch.tried / 8.0)):
        (*_, last) = table_of_batch(replace(batch, total_seconds=seconds)).notes
        assert last.endswith(f"; in {seconds:.1f} s ({rate:.1f} a second)")
