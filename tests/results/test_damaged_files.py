"""Files that are damaged, foreign or hostile: one sentence, or what they hold can be used;
nothing that a file names is run."""

from __future__ import annotations

import json
import os
import sqlite3
import struct
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from damage import SOLUTIONS, archive, damaged, members

import dmoc
from dmoc.base.errors import ModelError, SearchError, SolutionFileError
from dmoc.motion.scene import Scene, Shape
from dmoc.motion.trajectory import Collision, Phase, Trajectory
from dmoc.results import archive as archives
from dmoc.results import solution_file
from dmoc.results.schema import Either, Listed, Mapped, Number, Record, Refused, ShortArray
from dmoc.results.solution_file import FORMAT
from dmoc.sequences import nodes
from dmoc.sequences.journal import Journal


@pytest.fixture(scope="module")
def content(solution: dmoc.Solution) -> bytes:
    return solution.to_bytes()


@pytest.mark.slow
def test_damaged_files_are_refused_or_can_be_used() -> None:
    ends = list(damaged(48, seed=1))
    assert {ended for _, ended in ends} == {"refused", "loaded"}
    assert all(ended == "loaded" for kind, ended in ends if "no damage" in kind)


@pytest.mark.slow
def test_every_damage_to_a_solution_file_is_a_sentence(content: bytes) -> None:
    loaded = 0
    for i, damage in enumerate([*SOLUTIONS.values()] * 12):
        try:
            dmoc.Solution.from_bytes(damage(content, np.random.default_rng([2, i])))
            loaded += 1
        except SolutionFileError as error:
            assert "\n" not in str(error)
    assert 12 <= loaded <= 10 * 12


@pytest.mark.parametrize(
    ("record", "made"),
    [
        (solution_file.SOLUTION, dmoc.Solution), (solution_file.TRAJECTORY, Trajectory),
        (solution_file.PHASE, Phase), (solution_file.SCENE, Scene), (solution_file.SHAPE, Shape),
        (solution_file.COLLISION, Collision), (solution_file.MESH, dmoc.results.solution.Mesh),
        (nodes.NODE, nodes.Node), (nodes.START, nodes.Start),
    ],
)  # fmt: skip
def test_every_field_is_declared(record: Record, made: type) -> None:
    beside = {"kernels"} if made is dmoc.Solution else {"solution"} if made is nodes.Node else set()
    assert set(record.fields) == {f.name for f in fields(made)} - beside


def test_kinds_take_numbers_and_lists_of_them() -> None:
    """As a mapping of texts to numbers or lists of numbers needs it."""
    kind = Mapped(Either(Number(), ShortArray()))
    record = {"cost": 2.0, "q": np.array([1.0, 0.5])}
    written = kind.write(record, "", lambda *_: None)
    assert json.loads(json.dumps(written)) == {"cost": 2.0, "q": [1.0, 0.5]}
    again = kind.read(written, "", solution_file.Context())
    assert again["cost"] == 2.0 and np.array_equal(again["q"], record["q"])
    with pytest.raises(Refused, match=r"q\.1 is 'x', expected a number"):
        kind.read({"q": [1.0, "x"]}, "", solution_file.Context())


def test_a_size_is_the_same_wherever_it_appears() -> None:
    kind = Record(dict, {"names": Listed(Number(), "n"), "values": ShortArray("n")})
    with pytest.raises(Refused, match="values has 3 entries, expected 2"):
        kind.read({"names": [1, 2], "values": [1, 2, 3]}, "", solution_file.Context())


def test_declared_sizes_are_refused_before_anything_is_unpacked(
    content: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = members(content)
    bomb = archive(parts | {"solution.unknowns.npy": bytes(2**25)})
    read: list[str] = []
    opened = archives.zipfile.ZipFile.open

    def spy(self: object, member: archives.zipfile.ZipInfo, *rest: object) -> object:
        read.append(member.filename)
        return opened(self, member, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(archives.zipfile.ZipFile, "open", spy)
    with pytest.raises(SolutionFileError, match=r"solution\.unknowns\.npy' is too large"):
        dmoc.Solution.from_bytes(bomb)
    assert "solution.unknowns.npy" not in read and read
    read.clear()
    monkeypatch.setattr(archives, "LARGEST", 2**20)
    with pytest.raises(SolutionFileError, match="declares more than 1048576 bytes"):
        dmoc.Solution.from_bytes(bomb)
    assert not read


@pytest.mark.parametrize(
    ("declared", "numbers", "refused"),
    [
        ((6,), 6, False), ((2, 3), 6, False), ((0,), 0, False), ((0, 3), 0, False),
        ((6,), 5, True), ((6,), 7, True), ((2, 3), 7, True), ((2, 3), 0, True), ((0,), 1, True),
        ((5,), 5, True), ((7,), 7, True), ((3, 2), 6, True), ((6, 1), 6, True),
    ],
)  # fmt: skip
def test_an_array_has_the_shape_that_is_asked_for_and_as_many_numbers(
    declared: tuple[int, ...], numbers: int, refused: bool
) -> None:
    """Six numbers, two rows of three, or none are asked for."""
    asked = {(2, 3): (2, 3), (3, 2): (2, 3), (0,): (0,), (0, 3): (0, 3)}.get(declared, (6,))
    shape = ", ".join(map(str, declared)) + "," * (len(declared) == 1)
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape}), }}\n".encode()
    values = np.arange(float(numbers))
    content = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + values.tobytes()
    read: Any = SimpleNamespace(_read=lambda name, most: content)
    if not refused:
        array = archives.Archive.array(read, "x", asked)
        np.testing.assert_array_equal(array, values.reshape(asked))
        return
    with pytest.raises(Refused, match="'x' has another shape than declared"):
        archives.Archive.array(read, "x", asked)


def test_a_file_of_another_format_says_so(content: bytes) -> None:
    parts = members(content)
    written = f'"format": {FORMAT}'.encode()
    parts["header.json"] = parts["header.json"].replace(written, b'"format": 5', 1)
    with pytest.raises(
        SolutionFileError, match=f"has format 5, expected {FORMAT}: solve the problem again"
    ):
        dmoc.Solution.from_bytes(archive(parts))


@pytest.mark.parametrize("place", ["folder", "device", "pipe"])
def test_what_is_no_file_is_refused(tmp_path: Path, place: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    path = {"folder": tmp_path, "device": Path("/dev/zero"), "pipe": tmp_path / "pipe"}[place]
    with pytest.raises(SolutionFileError, match="is a folder or a device"):
        dmoc.Solution.load(path)


def test_unfinished_solves_keep_what_is_not_finite(solution: dmoc.Solution) -> None:
    stalled = replace(
        solution,
        status="stalled",
        optimality=np.nan,
        multipliers={"bounds": np.array([np.inf, np.nan])},
    )
    again = dmoc.Solution.from_bytes(stalled.to_bytes())
    assert np.isnan(again.optimality) and np.isinf(again.multipliers["bounds"][0])
    with pytest.raises(SolutionFileError, match="not finite"):
        dmoc.Solution.from_bytes(replace(stalled, status="solved").to_bytes())


def test_motions_that_do_not_fit_together_are_refused(solution: dmoc.Solution) -> None:
    t = solution.trajectory
    first, last = t.phases
    (hit,) = t.collisions
    none = Phase(*(a[:0] for a in (last.t, last.q, last.p, last.v, last.u)))
    for wrong, change in {
        "2 phases and 0 collisions": {"collisions": ()},
        "0 phases and 1 collisions": {"phases": ()},
        "the times of phase 1 do not increase": {"phases": (first, none)},
        "the times of phase 0 do not increase": {"phases": (replace(first, t=first.t[::-1]), last)},
        "phase 1 does not begin where the time before it ends": {
            "phases": (first, replace(last, t=last.t + 0.1))
        },
        "is not where its phase ends": {"collisions": (replace(hit, time=0.9),)},
        "has no coefficient of restitution": {"collisions": (replace(hit, surface="ceiling"),)},
        "phase 0 has 99 rows of inputs for 100 steps": {
            "phases": (replace(first, u=first.u[1:]), last)
        },
        "phase 0 has 3 nodes inside 100 steps": {
            "phases": (replace(first, q_inside=first.q[:3]), last)
        },
        "a lower bound above the upper one": {"input_bounds": t.input_bounds[:, ::-1]},
        r"phases\.1\.q has a value that is not a number from -1e\+150 to 1e\+150": {
            "phases": (first, replace(last, q=last.q * 1e200))
        },
        r"parameters\.l is 1e\+200, expected a number from": {
            "parameters": {**t.parameters, "l": 1e200}
        },
        r"phases\.1\.q has 100 entries, expected 101": {
            "phases": (first, replace(last, q=last.q[1:]))
        },
        r"momentum_after has 1 entries, expected 2": {
            "collisions": (replace(hit, momentum_after=hit.momentum_after[1:]),)
        },
    }.items():
        content = replace(solution, trajectory=replace(t, **change)).to_bytes()
        with pytest.raises(SolutionFileError, match=wrong):
            dmoc.Solution.from_bytes(content)


@pytest.mark.slow
def test_a_file_with_other_names_than_its_model_is_refused(solution: dmoc.Solution) -> None:
    t = solution.trajectory
    for change in (
        {"parameters": dict(list(t.parameters.items())[1:])},
        {"parameters": {f"k_{name}": value for name, value in t.parameters.items()}},
        {"coordinates": ("beta", "x")},
        {"restitution": {"lower": 1.0}},
    ):
        loaded = dmoc.Solution.from_bytes(
            replace(solution, trajectory=replace(t, **change)).to_bytes()
        )
        with pytest.raises(SolutionFileError, match="its model 'cart_pendulum'"):
            loaded.verify()
        loaded.plot()  # as curves where it is not the shipped model's


@pytest.mark.slow
def test_a_data_file_runs_nothing_that_it_names(solution: dmoc.Solution, tmp_path: Path) -> None:
    model = tmp_path / "model.py"
    model.write_text(f"open({str(tmp_path / 'ran')!r}, 'w').close()\ns = 1\n")
    for reference in (f"{model}:s", "model.py:s", f"{tmp_path}/model.py:s"):
        loaded = dmoc.Solution.from_bytes(replace(solution, reference=reference).to_bytes())
        with pytest.raises(
            ModelError, match=r"a file may name shipped models only.*--model file.py:name"
        ):
            loaded.verify()
        loaded.plot()
    assert not (tmp_path / "ran").exists()


# Journals -----------------------------------------------------------------------------------------


def test_a_journal_with_more_than_its_tables_is_refused_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "j"
    Journal(path, "a", False).close()
    with Journal(path, "a", True) as journal:
        assert journal.finished() == {}
    with sqlite3.connect(path) as database:
        database.execute("CREATE TRIGGER t AFTER INSERT ON nodes BEGIN DELETE FROM nodes; END")
    database.close()
    before = path.read_bytes()
    with pytest.raises(SearchError, match="something else"):
        Journal(path, "a", True)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "row",
    [
        ("[]", "{}", None),
        ("[]", None, None),
        ('["lower"]', b"\xff", b"x"),
        ("[]", '{"sequence": [], "verdict": "feasible"}', b""),
        ("[]", "[" * 100_000, None),
    ],
)
def test_rows_of_other_kinds_are_one_sentence(tmp_path: Path, row: tuple[object, ...]) -> None:
    path = tmp_path / "j"
    with Journal(path, "a", False) as journal:
        journal.database.execute("INSERT INTO nodes VALUES (?, ?, ?)", row)
    with (
        Journal(path, "a", True) as journal,
        pytest.raises(SearchError, match=r"is damaged: start anew with another file\.\n"),
    ):
        journal.finished()


def test_a_row_with_the_motion_of_another_sequence_is_refused(
    solution: dmoc.Solution, tmp_path: Path
) -> None:
    path = tmp_path / "j"
    node = nodes.Node(("lower",), nodes.Verdict.FEASIBLE, solution.cost, solution=solution)
    with Journal(path, "a", False) as journal:
        journal.add(node)
        assert journal.finished()["lower",].cost == solution.cost
        for wrong in (
            replace(node, sequence=("upper",)),
            replace(node, cost=1.0),
            replace(node, verdict=nodes.Verdict.FAILED),
        ):
            journal.database.execute("DELETE FROM nodes")
            journal.add(wrong)
            with pytest.raises(SearchError, match="is damaged"):
                journal.finished()


def test_a_header_that_says_one_thing_twice_is_refused(content: bytes) -> None:
    """JSON would take the last of both, another program perhaps the first."""
    parts = members(content)
    twice = parts["header.json"].replace(b'"status":', b'"status": "grazes", "status":', 1)
    assert json.loads(twice)["solution"]["status"] == "solved"
    with pytest.raises(SolutionFileError, match="a field twice"):
        dmoc.Solution.from_bytes(archive(parts | {"header.json": twice}))
