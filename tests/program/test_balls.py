"""Hits of balls in both tangential directions: solved, checked, with derivatives."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from answers import answer_of
from balls import RATES, START, VALUES, bounced, e_t, spun

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array, Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.hit_course import courses_at
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription
from dmoc.sequences.neighbours import other_returns
from dmoc.sequences.relaxation import Relaxation
from dmoc.sequences.settings import settings_of

# Of the hit after the throw of RATES from the height of START.
BEFORE = np.array([1.0, 0.5, -np.sqrt(4 + 2 * 9.81 * 0.2)]), np.array([0.0, 30.0, 10.0])


@pytest.fixture(scope="module")
def kernels() -> Kernels:
    system = spun(tangential_restitution={"floor": e_t}, parameters=VALUES | {e_t: 0.0})
    return dmoc.build(system, backend="numpy")


def throw(
    kernels: Kernels, word: str, friction: float, back: float = 0.0, **more: Any
) -> dmoc.Problem:
    fields: dict[str, Any] = {
        "start": START | RATES, "sequence": [word], "steps": 2, "final_time": 0.2,
        "restitution": 0.8, "parameters": {"mu": friction, "e_t": back},
    }  # fmt: skip
    return dmoc.Problem(kernels, **(fields | more))


@pytest.mark.parametrize(
    ("word", "friction", "back"), [("stick", 0.2, 0.0), ("slip", 0.1, 0.0), ("stick", 0.2, 0.5)]
)
def test_a_hit_is_that_of_the_closed_form(
    kernels: Kernels, tmp_path: Path, word: str, friction: float, back: float
) -> None:
    v, omega, impulse = bounced(*BEFORE, friction, 0.8, back)
    for said in (f"floor:{word}", "floor") if back == 0 else (f"floor:{word}",):
        solution = answer_of(throw(kernels, said, friction, back), starts=1)
        hit, after = solution.collisions[0], solution.trajectory.phases[1].v[0]
        assert hit.word == f"floor:{word}"
        assert after == pytest.approx([*v, *omega])
        c = 10 * hit.time  # how far the directions of the floor have turned
        turned = np.array([[np.cos(c), -np.sin(c)], [np.sin(c), np.cos(c)]])
        T = turned @ [hit.tractions["floor"], hit.tractions["floor_2"]]
        assert [*T, hit.impulse] == pytest.approx(impulse)
    assert solution.trajectory.friction == {"floor": friction, "floor_2": friction}
    assert solution.trajectory.tangential_restitution == {"floor": back}
    again = dmoc.Solution.load(solution.save(tmp_path / "solution.npz"))
    assert again.collisions[0].word == f"floor:{word}"


@pytest.mark.parametrize(("word", "friction"), [("slip", 0.2), ("stick", 0.1)])
def test_the_other_way_is_infeasible(kernels: Kernels, word: str, friction: float) -> None:
    solution = dmoc.solve(throw(kernels, f"floor:{word}", friction), starts=1)
    assert solution.status == "infeasible"


def test_the_check_refuses_other_impulses(kernels: Kernels) -> None:
    solution = answer_of(throw(kernels, "floor:slip", 0.02), starts=1)
    hit = solution.collisions[0]
    T = np.array([*hit.tractions.values()])

    def verdict(tractions: Array, **more: Any) -> str:
        named = dict(zip(hit.tractions, tractions.tolist(), strict=True))
        other = replace(hit, tractions=named, **more)
        trajectory = replace(solution.trajectory, collisions=(other,))
        return str(dmoc.verify(trajectory, kernels).message)

    assert not verdict(T)
    assert "error of the law of impact" in verdict(T[::-1])
    assert "floor would need an impulse of friction of" in verdict(2 * T)
    assert "goes slip, not stick as planned" in verdict(0 * T, course="stick")


def test_a_hit_that_grazes_has_no_impulse(kernels: Kernels) -> None:
    for word in ("floor:slip", "floor:stick"):
        problem = throw(kernels, word, 0.2)
        x = initial_guesses(problem)[0].x
        nlp = Transcription(problem, scale_of(problem, x), False, (0,))
        law, T_c = nlp.laws.ball, nlp.layout.contact.T_c[0]
        J = nlp.equality_jacobian(x / nlp.sizes).toarray()[law.rests.index[0]]
        assert (np.flatnonzero(J.any(axis=0)) == np.sort(T_c)).all()
        assert not (law.stops.count or law.slides.count or law.holds.count or law.goes_on.count)


def test_friction_and_restitution_have_derivatives(kernels: Kernels) -> None:
    """Of the time until a ball that slides at its hit has come to a place."""
    fields: dict[str, Any] = {"goal": {"x": 0.4}, "final_time": (0.2, 2)}
    problem = throw(kernels, "floor:slip", 0.02, **fields)
    slopes = dmoc.sensitivities(problem, answer_of(problem, starts=1, verify=False))

    def time(e: float, friction: float) -> float:
        v, _, _ = bounced(*BEFORE, friction, e)
        until = (-2 - BEFORE[0][2]) / 9.81
        return float(until + (0.4 - until) / v[0])

    small = 1e-5
    assert slopes["parameters"]["mu"] == pytest.approx(
        (time(0.8, 0.02 + small) - time(0.8, 0.02 - small)) / (2 * small), rel=1e-6
    )
    assert slopes["restitution"]["floor"] == pytest.approx(
        (time(0.8 + small, 0.02) - time(0.8 - small, 0.02)) / (2 * small), rel=1e-6
    )


def test_a_search_goes_the_other_way_and_closes_nothing(kernels: Kernels) -> None:
    problem = throw(kernels, "floor:slip", 0.1)
    assert [*other_returns(problem.touch, ["floor:slip"])] == [("floor:stick",)]
    state = [(np.array([*problem.start_position]), np.concatenate(BEFORE), 0.0)]
    assert str(courses_at(problem, state)[0]) == "slip"
    assert str(courses_at(problem.but(parameters={"mu": 0.2}), state)[0]) == "stick"
    settings = settings_of(problem, {"strategy": "propose", "method": "slsqp"})
    assert not Relaxation.of(problem, settings).left_open.surfaces
    with pytest.raises(ProblemError, match="hits with friction: event 1"):
        dmoc.prove(problem)


def test_friction_is_found_from_hits(kernels: Kernels) -> None:
    rates = np.array([[1.0, 0.5, -2.0], [0.3, -0.7, -1.5]])
    after = np.array([bounced(v, np.zeros(3), 0.05, 0.8)[0] for v in rates])
    names = ("x_dot", "y_dot", "z_dot")
    table = {f"{n} before": row for n, row in zip(names, rates.T.tolist(), strict=True)}
    table |= {f"{n} after": row for n, row in zip(names, after.T.tolist(), strict=True)}
    hits = dmoc.Problem(
        kernels, start=START | {"z": 0.1}, sequence=["floor"], steps=2, restitution=0.8,
        parameters={"mu": 0.01},
    )  # fmt: skip
    found = dmoc.fit(hits, table, {"mu": (0, 1)}, sigma=dict.fromkeys(names, 0.01))
    assert found["mu"] == pytest.approx(0.05)
