"""Numbers that a solver takes, and the constants it is written with, one by one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from systems import block_system, there_and_back

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.export import numbers
from dmoc.export.constants import WIDTH, Constants
from dmoc.export.numbers import (
    NOT_ONE,
    Number,
    SolverNumbers,
    _flat,
    _in_short,
    _numbers,
    _range,
    _with,
    moved_arrays,
    numbers_of,
)
from dmoc.export.program_text import _held, _number_rows, _state, count_of, shape_of
from dmoc.guess.automatic import initial_guesses
from dmoc.mechanics.contact_mode import Mode
from dmoc.program.layout import Layout
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription


@pytest.mark.parametrize(
    ("value", "way", "change"),
    [
        (1.0, 1.0, 2.0**-6),
        (3.0, 1.0, 2.0**-4),
        (-3.0, -1.0, -(2.0**-4)),
        (0.25, 1.0, 2.0**-8),
        (0.0, 1.0, 2.0**-15),  # as of a thousandth
    ],
)
def test_a_number_is_changed_by_a_power_of_two(value: float, way: float, change: float) -> None:
    assert Number(("bounds", "u"), value, way=way).change == change


def test_a_number_is_named_by_where_it_stands() -> None:
    assert Number(("via", 0, "x"), 1.0, side=1).name == "via.0.x.high"
    assert Number(("bounds", "u"), 1.0, side=0).name == "bounds.u.low"
    assert Number(("final_time",), 1.0).name == "final_time"


def test_one_member_of_what_is_stated_is_replaced() -> None:
    whole = [{"x": 1, "y": 2}, {"x": 3}]
    assert _with(whole, [], 1, "new") == [{"x": 1, "y": 2}, "new"]
    assert _with(whole, [], 0, "new") == ["new", {"x": 3}]
    assert _with(whole, [0], "y", 9) == {"x": 1, "y": 9}
    assert _range(2.0, 2.0) == 2.0
    assert _range(-np.inf, 3.0) == (None, 3.0) and _range(1.0, np.inf) == (1.0, None)


@pytest.mark.parametrize("fixed", [[0], [1, 2], [3], [0, 3], []])
def test_momenta_that_follow_from_states_are_no_numbers(
    fixed: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither their lower nor their upper bounds are; what stands behind these is."""
    arrays = [np.arange(1.0, 5.0), np.arange(11.0, 15.0), np.arange(21.0, 27.0)]
    monkeypatch.setattr(numbers, "moved_arrays", lambda data, results: arrays)
    monkeypatch.setattr(numbers, "_results", lambda data: None)
    monkeypatch.setattr(numbers, "assembled", lambda structure, numbers: SimpleNamespace(data=None))
    nlp: Any = SimpleNamespace(structure=None)
    lower, upper, others = np.split(_flat(nlp, nlp, np.array(fixed, np.intp)), [4, 8])
    kept = ~np.isin(np.arange(4), fixed)
    np.testing.assert_array_equal(lower, arrays[0] * kept)
    np.testing.assert_array_equal(upper, arrays[1] * kept)
    np.testing.assert_array_equal(others, arrays[2])


@pytest.fixture(scope="module")
def nlp(block: Kernels) -> Transcription:
    problem = there_and_back(block, steps=4, bounds={"u": (-100.0, 90.0)}, restitution=0.5)
    return Transcription(problem, scale_of(problem, initial_guesses(problem)[0].x))


def test_programs_of_other_forms_differ_in_more_than_numbers(
    nlp: Transcription, block: Kernels
) -> None:
    def apart(scale: Any = nlp.scale, **fields: Any) -> Any:
        stated = {"steps": 4, "bounds": {"u": (-80.0, 90.0)}, "restitution": 0.5} | fields
        return _numbers(nlp, Transcription(there_and_back(block, **stated), scale))

    wider, base = apart(), nlp.numbers
    assert (wider.lower != base.lower).any() and (wider.upper == base.upper).all()
    for changed, name in (
        ({"restitution": 0.4}, "factors"),
        ({"parameters": {"m": 3.0}}, "parameters"),
    ):
        assert (getattr(apart(**changed), name) != getattr(base, name)).any()
    assert apart(steps=5) is None and apart(start={"x": (0, 0.1)}) is None
    assert apart(replace(nlp.scale, p=2 * nlp.scale.p)) is None


def test_a_parameter_has_its_place_behind_unknowns_rows_and_two_more(nlp: Transcription) -> None:
    numbers = numbers_of(nlp)
    (mass,) = (i for i, n in enumerate(numbers.taken) if n.name == "parameters.m")
    at = list(nlp.kernels.parameters).index("m") + nlp.n + nlp.n_eq + nlp.n_in + 2
    rows, _ = _number_rows(nlp, numbers)
    assert f", {at}, " in rows[mass]
    assert {n.pool for n in numbers.taken if n.path[0] != "parameters"} == {NOT_ONE}


def test_bounds_of_an_input_move_the_bounds_of_its_unknowns(nlp: Transcription) -> None:
    """Each in its own size, and nothing else; among the arrays upper bounds follow lower ones."""
    numbers = numbers_of(nlp)
    taken = {n.name: n for n in numbers.taken}
    data, u = nlp.assembled.data, nlp.layout.index_u.ravel()
    for name, first in (("bounds.u.low", 0), ("bounds.u.high", data.n)):
        number = taken[name]
        np.testing.assert_array_equal(np.sort(number.entries), np.sort(u + first))
        np.testing.assert_allclose(number.slopes, 1 / nlp.sizes[u])
    rows, changes = _number_rows(nlp, numbers)
    assert len(rows) == len(numbers.taken) and len(changes) == sum(
        len(n.entries) for n in numbers.taken
    )
    arrays, at = moved_arrays(data, numbers.results), 0
    for number, row in zip(numbers.taken, rows, strict=True):
        assert f'"{number.name}"' in row and f" {at}, {len(number.entries)}," in row
        for entry in number.entries:
            array, place = map(int, changes[at].strip("{} ").split(",")[:2])
            assert sum(map(len, arrays[:array])) + place == entry and place < len(arrays[array])
            at += 1


def test_factors_that_nothing_moves_are_left_out(nlp: Transcription) -> None:
    """Of three results that stand behind the others the middle one is moved."""
    data = nlp.assembled.data
    results = [SimpleNamespace(factors=lambda data, k=k: np.zeros(k)) for k in (2, 3, 4)]
    others = sum(map(len, moved_arrays(data, ())))
    entries = np.array([1, others + 2, others + 4])
    number = Number(("bounds", "u"), 1.0, entries=entries, slopes=np.ones(3))
    stated: Any = (number,), (), (None, None), tuple(results)
    short = _in_short(data, SolverNumbers(*stated))
    assert short.results == (results[1],)
    np.testing.assert_array_equal(short.taken[0].entries, [1, others, others + 2])


@pytest.mark.parametrize(
    ("index", "count", "shape"),
    [
        (np.arange(6).reshape(3, 2), 6, (3, 2)),
        (np.arange(3), 3, (3, 1)),
        (np.array([[0, 1], [-1, 2]]), 3, (3, 1)),
        (np.arange(12).reshape(2, 3, 2), 12, (2, 6)),
    ],
)
def test_tables_have_rows_and_columns(
    index: np.ndarray, count: int, shape: tuple[int, int]
) -> None:
    block: Any = SimpleNamespace(index=index, count=count)
    assert shape_of(block) == shape


def test_a_matrix_of_a_kernel_has_as_many_values_as_entries() -> None:
    assert count_of({"rows": [0, 1, 1], "shape": [9, 9]}) == 3
    assert count_of({"shape": [2, 3]}) == 6


def test_what_is_closed_or_ignored_is_told_apart() -> None:
    contacts = SimpleNamespace(
        surface_numbers={"a": 0, "b": 1, "c": 2}, pull=np.zeros(3, dtype=bool)
    )
    problem = SimpleNamespace(
        model=SimpleNamespace(nc=3), touch=SimpleNamespace(contacts=contacts), ignored=["c"]
    )
    nlp: Any = SimpleNamespace(problem=problem)
    np.testing.assert_array_equal(_held(nlp, Mode((0,))), [2, 1, 0])
    np.testing.assert_array_equal(_held(nlp, Mode()), [1, 1, 0])


def test_lines_of_constants_are_as_full_as_their_width_allows() -> None:
    """For numbers of 1 to 24 characters, in any order."""
    values = [float(v) for v in np.random.default_rng(3).normal(size=400) ** 9] + [0.0, 1.0, -1.0]
    c = Constants()
    c.array("double", values)
    head, *lines, foot = c.lines
    assert head.endswith("[403] = {") and foot == "};"
    words = [line.split() for line in lines]
    assert [float(w.rstrip(",")) for line in words for w in line] == values
    assert all(line.startswith("    ") and len(line) <= WIDTH for line in lines)
    for line, (first, *_) in zip(lines, words[1:], strict=False):
        assert len(line) + 1 + len(first) > WIDTH


def test_a_fixed_state_names_its_numbers() -> None:
    state: Any = SimpleNamespace(
        names=("start.x", "", "start.v"), values=np.array([1.0, 2.0]), momenta=np.array([7])
    )
    taken = [Number(("start", "v"), 1.0), Number(("start", "x"), 1.0)]
    c = Constants()
    text = _state(c, state, taken)
    assert text.startswith("{1,") and "{ 1, -1, 0, };" in " ".join(" ".join(c.lines).split())
    assert _state(c, None, taken) == "{0, NULL, NULL, NULL}"


def test_a_phase_after_the_last_event_has_no_duration(block: Kernels) -> None:
    problem = there_and_back(block, goal={}, final_time=None, durations=[(0.2, 0.9), 0])
    stated = [n.name for n in numbers._stated(problem, (None, None))]
    assert [name for name in stated if name.startswith("durations")] == [
        "durations.0.low", "durations.0.high",
    ]  # fmt: skip


def test_each_number_has_its_kind() -> None:
    """What a solver in C refuses follows from it; the earliest of two times may be none."""
    kinds = {
        "parameters.m": "parameter", "start.x": "state", "start.x_dot": "state",
        "restitution.wall": "share", "bounds.u.low": "bound", "bounds.u.high": "bound",
    }  # fmt: skip
    fixed, within = {"final_time": "time"}, {"final_time.high": "time"}
    within["final_time.low"] = "earliest time"
    kernels = dmoc.build(block_system())
    for final_time, of_time in ((1.0, fixed), ((0.5, 2.0), within)):
        problem = there_and_back(kernels, bounds={"u": (-9, 9)}, final_time=final_time)
        problem = problem.but(restitution=0.5)
        states = numbers._state(problem, Layout.of(problem), "start")
        stated = {n.name: n.kind for n in numbers._stated(problem, (states, None))}
        expected = kinds | of_time
        assert {name: stated[name] for name in expected} == expected
