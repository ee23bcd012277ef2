"""What programs of one form share: the same numbers as without sharing, also in several threads."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import contact_problems
import joint_problems
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import initial_guesses
from dmoc.models.registry import find
from dmoc.program import layout, structure_cache
from dmoc.program.scaling import scale_of
from dmoc.program.structure_cache import MEMORY, bytes_of
from dmoc.program.transcription import Transcription
from dmoc.solvers.kkt_layout import kkt_layout

# Of a problem with one hit, of one with contacts that last and friction, and of one with a joint:
# the first change numbers alone, the others the form.
CHANGES: list[dict[str, Any]] = [
    {"parameters": {"l": 0.45, "m_p": 1.2}}, {"bounds": {"F": (-150.0, 150.0)}},
    {"start": {"alpha": 0.45, "x": 0.1}}, {"restitution": 0.5},
    {"final_time": (0.1, 1.0)}, {"final_time": 0.5}, {"restitution": 0.0}, {"sequence": ("upper",)},
    {"sequence": ("lower", "lower")}, {"steps": (9, 11)}, {"controls": "linear"},
    {"periodic": ("alpha_dot",), "start": {"alpha": 0.45, "x": 0.1}, "goal": {}},
    {"goal": {"alpha": 1.5, "alpha_dot": (0.0, 1.0), "x": (-1.0, None)}},
    {"bounds": {"x_dot": (-2.0, 3.0)}}, {"bounds": {"x_dot": (None, 3.0)}},
    {"start": {"alpha": (0.4, 0.5), "x": 0.0}},
]  # fmt: skip
CONTACTS: list[dict[str, Any]] = [
    {"parameters": {"m": 1.5, "g": 4.0}},
    {"start": {"x": 0.1, "y": 0.0}, "goal": {"x": 1.2, "x_dot": 0.0}},
    {"via": [{"x": 0.5}], "bounds": {"u": (-9.0, 9.0)}},
    {"parameters": {"mu": 0.15}},  # a factor of the forces
    {"contacts": ["floor:slip-"]},  # a sign of them
    {"contacts": ["floor"]},
    {"contacts": ["floor"], "sequence": ["floor:slip+"]},
    {"sequence": ["floor:slip-"]},
    {"sequence": []},
    {"sequence": ["-floor"]},
    {"sequence": ["floor:stick", "floor:slip+"]},
    {"sequence": ["side floor:slip-"]},
    {"sequence": ["side floor:slip-"], "restitution": 0.5},
    {"sequence": ["side floor:stick"]},
    {"ignored": ["side"]},
    *(
        {"contacts": [], "start": {"x": 0.0, "y": 0.2}, "restitution": 0.5, "sequence": [word]}
        for word in (
            "floor:slip+", "floor:slip-", "floor:stick", "floor:slip+:stick",
            "floor:slip+:stick:late", "+floor:slip+", "+floor:stick",
        )
    ),
]  # fmt: skip
JOINTS: list[dict[str, Any]] = [
    {"start": {"x": 0.6, "y": -0.8}},
    {"goal": {"x": -0.5}},
    {"bounds": {"u": (-7.0, 7.0)}},
    {"restitution": 0.5},
    {"final_time": (0.4, 3.0)},
    {"sequence": []},
    {"sequence": ["wall", "wall"]},
    {"start": {"x": 0.0, "y": -1.0, "x_dot": None, "y_dot": None}},
    {"goal": {"x": 0.6, "y": -0.8, "x_dot": 0.0, "y_dot": 0.0}},
    {"periodic": ["x", "x_dot", "y_dot"], "goal": {}},
]
# Whether goals are rows, and whether the first collision grazes.
WAYS = [(False, False), (True, False), (False, True)]
# A problem and changes of it, how many change numbers alone, and how many forms the others have.
Family = tuple[dmoc.Problem, list[dict[str, Any]], int, int]


def forget() -> None:
    MEMORY.clear()
    layout._shared.cache_clear()


@pytest.fixture(autouse=True)
def alone() -> Iterator[None]:
    """No structure is known before a test."""
    forget()
    yield
    forget()


@pytest.fixture
def small(seed: dmoc.Problem) -> dmoc.Problem:
    return seed.but(steps=10)


@pytest.fixture(params=["a hit", "contacts", "joints"])
def family(request: pytest.FixtureRequest, small: dmoc.Problem) -> Family:
    task: dict[str, Any]
    if request.param == "a hit":
        return small, CHANGES, 4, len(CHANGES) - 4
    if request.param == "joints":
        system = joint_problems.bob(surfaces={"wall": joint_problems.X <= 0.8})
        start, goal = {"x": 0.0, "y": -1.0}, {"x": -0.6}
        task = {"start": start, "goal": goal, "sequence": ["wall"], "steps": 6, "final_time": 2.0}
        return dmoc.Problem(dmoc.build(system), **task), JOINTS, 4, len(JOINTS) - 4
    block = contact_problems.floor("beside")
    system = replace(block, surfaces={**block.surfaces, "side": contact_problems.X <= 9})
    task = {"start": {"x": 0, "y": 0}, "goal": {"x": 1, "x_dot": 0}}
    words: dict[str, Any] = {"contacts": ["floor:slip+"], "sequence": ["floor:stick"]}
    problem = dmoc.Problem(dmoc.build(system), **task, **words, steps=6, final_time=4)
    # A restitution and a direction of sliding are numbers here, too.
    return problem, CONTACTS, 5, len(CONTACTS) - 7


def numbers(problem: dmoc.Problem, goal_as_rows: bool = False, graze: bool = False) -> list[Array]:
    """Values, derivatives, patterns and names of a program at a start; its first collision may
    graze."""
    x = initial_guesses(problem)[0].x
    grazing = (0,) if graze and len(problem.sequence) else ()
    nlp = Transcription(problem, scale_of(problem, x), goal_as_rows, grazing)
    point = nlp.scaled(x) + 1e-3 * np.sin(np.arange(nlp.n))
    y, w = np.cos(np.arange(nlp.n_eq)), np.sin(1 + np.arange(nlp.n_in))
    hessian, order = nlp.lagrangian_hessian(point, y, w, 0.7), kkt_layout(nlp)
    return [
        *(nlp.values(point), nlp.slopes(point), nlp.lower, nlp.upper, nlp.sizes, nlp.row_sizes),
        *(nlp.assembled.jacobian.indptr, nlp.assembled.jacobian.indices),
        *(hessian.data, hessian.indices, hessian.indptr, order.place, order.from_jac, order.row),
    ]


@pytest.mark.slow
def test_sharing_changes_no_number(family: Family) -> None:
    first, changes, *_ = family
    ranges: list[dict[str, Any]] = [{"final_time": (None, end)} for end in (1.0, 0.9)]
    wide = [{}, *changes, *ranges]
    every = [(change, *way) for way in WAYS for change in (wide if way == WAYS[0] else wide[::3])]
    alone = []
    for change, *way in every:
        forget()
        alone.append(numbers(first.but(**change), *way))
    forget()
    for _ in range(2):  # first made, then shared, by problems that have nothing made
        for (change, *way), expected in zip(every, alone, strict=True):
            again = numbers(first.but(**change), *way)
            for a, b in zip(again, expected, strict=True):
                np.testing.assert_array_equal(a, b)


@pytest.mark.slow
def test_other_numbers_share_a_structure_and_other_forms_do_not(family: Family) -> None:
    problem, changes, alike, forms = family
    structures = [Transcription(problem.but(**change)).structure for change in ({}, *changes)]
    first, *others = structures
    assert [s is first for s in others] == [True] * alike + [False] * (len(changes) - alike)
    assert len({id(s) for s in others[alike:]}) == forms  # no two forms are one
    hits = problem.sequence == ("lower",)  # whose law may be that of the rates
    assert (Transcription(problem.in_rates()).structure is not first) == hits


def test_names_are_those_of_the_problem_not_of_the_one_that_was_first(small: dmoc.Problem) -> None:
    programs = [Transcription(small.but(final_time=(None, latest))) for latest in (1.0, 2.0)]
    labels = [nlp.laws.ends.latest.name_of(0) for nlp in programs]
    assert labels == ["final time <= 1 s", "final time <= 2 s"]
    assert programs[0].laws.step is programs[1].laws.step


def test_threads_may_share(small: dmoc.Problem) -> None:
    problems = [small.but(parameters={"l": 0.4 + 0.01 * i}) for i in range(8)]
    alone = [numbers(p) for p in problems]
    forget()
    with ThreadPoolExecutor(4) as pool:
        for shared, expected in zip(pool.map(numbers, problems), alone, strict=True):
            for a, b in zip(shared, expected, strict=True):
                np.testing.assert_array_equal(a, b)


def test_whatever_a_form_holds_is_part_of_its_key(small: dmoc.Problem) -> None:
    """A change of any single entry of any array, of a factor's place or of a name gives another
    key."""
    form, _ = Transcription(small)._form()

    def changed(array: Any) -> Any:
        other = np.array(array)
        if other.size:
            other.flat[other.size // 2] += 1
        return other

    kernels, linear = form.kernels, form.linear
    manifest = kernels.manifest
    others = [
        replace(form, n=form.n + 1),
        replace(form, m=form.m + 1),
        replace(form, equalities=form.equalities + 1),
        replace(form, parameters=changed(form.parameters)),
        *(
            replace(form, linear=replace(linear, **{name: changed(getattr(linear, name))}))
            for name in ("rows", "columns")
        ),
        *(
            replace(form, kernels=replace(kernels, manifest=replace(manifest, **other)))
            for other in ({"fingerprint": "x"}, {"code": "x"}, {"design": ["l"]})
        ),
        replace(form, kernels=replace(kernels, module=None)),  # of another backend
    ]
    for i, term in enumerate(form.terms):
        terms = [
            replace(term, kernel=f"{term.kernel}_"),
            replace(term, factor=np.asarray(term.factor) + 1),
            *(
                replace(term, **{name: (*parts[:k], changed(parts[k]), *parts[k + 1 :])})
                for name, parts in (("arguments", term.arguments), ("rows", term.rows))
                for k in range(len(parts))
                if parts[k].size
            ),
        ]
        others += [replace(form, terms=[*form.terms[:i], t, *form.terms[i + 1 :]]) for t in terms]
    (name, index), *rest = form.blocks
    for blocks in ([("x", index), *rest], [*rest, (name, index)], [(name, changed(index)), *rest]):
        others.append(replace(form, blocks=blocks))
    assert len({form.digest, *(other.digest for other in others)}) == 1 + len(others)
    assert Transcription(small)._form()[0].digest == form.digest


def test_structures_are_forgotten_by_their_bytes(
    small: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    structures = MEMORY.structures._values
    first = Transcription(small)
    kkt_layout(first)
    one = bytes_of(first.structure, set())
    assert one > first.structure.jacobian.indices.nbytes + first.structure.hessian.indices.nbytes
    monkeypatch.setattr(structure_cache, "MOST_BYTES", 3 * one)
    for steps in (11, 12, 13, 14, 15):
        kkt_layout(Transcription(small.but(steps=steps)))
        assert sum(bytes_of(s, set()) for s in structures.values()) <= 4 * one
    assert 1 <= len(structures) < 5
    assert first.structure not in structures.values()  # it was the oldest


def test_what_is_shared_counts_once() -> None:
    shared, other = np.zeros(10), np.zeros(5)
    assert bytes_of((shared, {"again": [shared, other]}), set()) == 8 * 15


def test_a_program_for_another_thread_has_numbers_of_its_own() -> None:
    """Both evaluate at the same time; what they evaluate is the same."""
    reference = find("puck_table")
    problem = dmoc.Problem(reference.kernels(), **reference.defaults).but(sequence=["east"])
    x = initial_guesses(problem)[0].x
    nlp = Transcription(problem, scale_of(problem, x))
    other, at = nlp.beside(), nlp.scaled(x)
    assert other.program is not nlp.program and other.program.data is nlp.program.data
    np.testing.assert_array_equal(other.values(at), nlp.values(at))
    assert other.values(at) is not nlp.values(at)


def test_kernels_of_numpy_with_more_derivatives_have_structures_of_their_own() -> None:
    """By m alone, and by m and k, of which a problem chooses m: generated code, in which they
    differ, there is none."""
    m, k = sp.symbols("m k")
    x, u = dynamicsymbols("x u")
    spring = dmoc.MechanicalSystem(
        "sprung", [x], m * x.diff() ** 2 / 2 - k * x**2 / 2, {m: 1.0, k: 2.0}, [u], {x: u},
        cost=u**2 / m,
    )  # fmt: skip
    plain = dmoc.build(spring, backend="numpy")
    ends = {"start": {"x": 0.0}, "goal": {"x": 1.0}, "steps": 4, "final_time": 1.0}
    m_alone, both = (
        dmoc.Problem(plain, **ends, design=dict.fromkeys(names, (0.5, 3.0)))
        for names in ("m", "mk")
    )
    of_both = dmoc.Problem(both.kernels, **ends, design=m_alone.design)
    assert (m_alone.kernels.design, of_both.kernels.design) == (["m"], ["m", "k"])
    first, second = numbers(m_alone), numbers(of_both)
    for a, b in zip(first, second, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)
    structures = [Transcription(p).structure for p in (m_alone, of_both, both)]
    assert len({id(s) for s in structures}) == 3
