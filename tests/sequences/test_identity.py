"""A journal belongs to one problem and to settings of one kind."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.models.registry import find
from dmoc.sequences import search
from dmoc.sequences.identity import SEARCHED, facts, identity
from dmoc.sequences.settings import Settings

SETTINGS = Settings(
    max_collisions=2, surfaces=("lower", "upper"), events=None, strategy="tree", beam=4,
    starts=0, seed=0, method="ipm", workers=1, executor=None, seconds=None, node_seconds=None,
    max_nodes=None, shortest_phase=0.01, journal=None, resume=False, progress=None,
)  # fmt: skip
OTHER_FIELDS: dict[str, Any] = {
    "start": {"x": 0.1}, "goal": {"x": 0.2}, "steps": 21, "final_time": (None, 2.0),
    "bounds": {"F": (-26, 26)}, "parameters": {"m_c": 1.1}, "controls": "linear",
    "restitution": 0.5, "periodic": ("p_x",), "minimal_times": True, "contacts": ("lower",),
    "via": (), "ignored": ("lower",), "design": {"m_c": (0.5, 2.0)},
}  # fmt: skip
OTHER_SETTINGS: dict[str, Any] = {
    "surfaces": ("lower",), "events": ("lower",), "starts": 1, "seed": 1, "method": "slsqp",
    "shortest_phase": 0.02,
}  # fmt: skip


@pytest.fixture(scope="module")
def problem() -> dmoc.Problem:
    reference = find("cart_pendulum")
    return dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 20, "sequence": ()})


def changed(problem: dmoc.Problem, name: str) -> dmoc.Problem:
    if name == "kernels":
        return problem.but(kernels=dmoc.build(find("cart_pendulum").system(), order=4))
    value = OTHER_FIELDS[name]
    if name == "contacts":  # the start is off them
        return problem.unchecked(contacts=value)
    return problem.but(
        **{name: {**getattr(problem, name), **value} if isinstance(value, dict) else value}
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", [f.name for f in fields(dmoc.Problem) if f.name not in SEARCHED])
def test_every_field_of_a_problem_tells_its_journal_from_others(
    problem: dmoc.Problem, name: str
) -> None:
    assert identity(changed(problem, name), SETTINGS) != identity(problem, SETTINGS)


@pytest.mark.parametrize(
    "other",
    [
        {"goal": {"x": 1, "effort": (None, 3)}}, {"goal": {"x": 1, "push": 0}},
        {"bounds": {"x_dot": (None, 2)}}, {"bounds": {"push": (None, 2)}},
    ],
)  # fmt: skip
def test_quantities_and_integrals_tell_journals_apart(other: dict[str, Any]) -> None:
    x, u = dynamicsymbols("x u")
    system = dmoc.MechanicalSystem(
        "told_apart", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2,
        quantities={"push": u}, integrals={"effort": u**2}, surfaces={"wall": x <= 2},
    )  # fmt: skip
    problem = dmoc.Problem(system, {"x": 0}, {"x": 1}, steps=10, final_time=1)
    assert identity(problem.but(**other), SETTINGS) != identity(problem, SETTINGS)


@pytest.mark.parametrize("name", [*OTHER_SETTINGS])
def test_settings_of_a_node_tell_its_journal_from_others(problem: dmoc.Problem, name: str) -> None:
    assert identity(problem, replace(SETTINGS, **{name: OTHER_SETTINGS[name]})) != identity(
        problem, SETTINGS
    )


def test_a_field_that_is_added_counts(problem: dmoc.Problem) -> None:
    assert SEARCHED == ("sequence", "durations")  # what the search sets itself, node by node
    counted = {name.partition(".")[2] for name in facts(problem, SETTINGS)} - {""}
    stated = {f.name for f in fields(dmoc.Problem)} - {*SEARCHED}
    assert counted == stated | OTHER_SETTINGS.keys()


def test_the_same_problem_in_other_words_has_the_same_journal(problem: dmoc.Problem) -> None:
    same = problem.but(
        start=dict(reversed(list(problem.start.items()))),
        restitution=dict.fromkeys(problem.kernels.surfaces, 1),
        parameters={
            name: float(value)
            for name, value in problem.kernels.parameters.items()
            if value is not None
        }
        | problem.parameters,
        sequence=["lower"],
    )
    budget = replace(
        SETTINGS, max_collisions=5, strategy="beam", workers=3, seconds=1.0, node_seconds=60.0,
        resume=True,
    )  # fmt: skip
    assert identity(same, budget) == identity(problem, SETTINGS)


def test_nodes_of_proposed_sequences_are_not_those_of_a_tree(problem: dmoc.Problem) -> None:
    """They begin with relaxed motions alone."""
    tree, proposing, both = (
        identity(problem, replace(SETTINGS, strategy=strategy))
        for strategy in ("tree", "propose", "both")
    )
    assert tree != proposing == both


def test_steps_that_a_problem_leaves_open_are_those_of_its_first_mesh(
    problem: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two phases of them; those that are stated stay."""
    taken = list[tuple[Any, Any]]()
    monkeypatch.setattr(
        search, "_searched", lambda stated, problem, _: taken.append((stated.steps, problem.steps))
    )
    left_open = problem.but(steps=None)
    dmoc.search(left_open)
    dmoc.search(problem)
    assert taken == [(None, 2 * max(left_open.phase_steps)), (20, 20)]
