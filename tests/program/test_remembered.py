"""What is remembered of programs is not taken for others: a change of anything that it follows from
makes it anew."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import double_integrator

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.program import scaling
from dmoc.program.iterate import Iterate
from dmoc.program.laws.laws import rows_follow_from
from dmoc.program.layout import Layout
from dmoc.program.structure_cache import MEMORY, MOST, Recent
from dmoc.program.transcription import Transcription
from dmoc.solvers.kkt_layout import kkt_layout


@pytest.fixture(autouse=True)
def alone() -> Iterator[None]:
    MEMORY.clear()
    yield
    MEMORY.clear()


def walled(**more: Any) -> dmoc.MechanicalSystem:
    """A mass between two walls, whose speed and whose work have bounds."""
    x, u = dynamicsymbols("x u")
    m, drag, room = sp.symbols("m drag room")
    rate = x.diff()
    return dmoc.MechanicalSystem(
        "walled", [x], m * rate**2 / 2, {m: 1.0, drag: 0.1, room: 2.0}, [u], {x: u - drag * rate},
        surfaces={"left": x >= -room, "right": x <= room}, cost=u**2,
        quantities={"power": u * rate, "push": u}, **more,
    )  # fmt: skip


@pytest.fixture(scope="module")
def walls() -> Kernels:
    return dmoc.build(walled())


def stated(kernels: Kernels, **changes: Any) -> dmoc.Problem:
    fields: dict[str, Any] = {
        "start": {"x": 0.0}, "goal": {"x": 1.0}, "sequence": ["right"], "steps": 4,
        "final_time": (0.5, 3.0), "restitution": 0.5, "bounds": {"power": (-9.0, 9.0)},
    }  # fmt: skip
    return dmoc.Problem(kernels, **fields | changes)


def test_what_a_motion_reaches_is_remembered_for_that_motion_alone(
    walls: Kernels, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each parameter and each unknown, the model, its code, what runs it and the form are part of
    the key; bounds, which it does not follow from, are not."""
    problem = stated(walls)
    lay, x = Layout.of(problem), initial_guesses(problem)[0].x
    monkeypatch.setattr(scaling, "_measured", lambda at: (at.problem, at.lay, at.x))

    def reached(problem: dmoc.Problem, lay: Any = lay, x: np.ndarray = x) -> Any:
        return scaling._reached(Iterate(problem, lay, x))

    first = reached(problem)
    same = stated(walls, bounds={"power": (-8.0, 9.0)}, goal={"x": 0.5})
    assert reached(problem) is first and reached(same, x=x.copy()) is first
    others = [reached(stated(walls, parameters={n: 1.5})) for n in ("m", "drag", "room")]
    for k in (0, len(x) // 2, -1):
        moved = x.copy()
        moved[k] += 1e-9
        others.append(reached(problem, x=moved))
    for changed in ({"fingerprint": "x"}, {"code": "x"}):
        manifest = replace(walls.manifest, **changed)
        others.append(reached(stated(replace(walls, manifest=manifest))))
    others.append(reached(stated(dmoc.build(walled(), backend="numpy"))))
    others.append(reached(problem, lay=Layout.of(stated(walls, sequence=["left"]))))
    assert len({id(o) for o in (first, *others)}) == 1 + len(others)


ROWS: list[dict[str, Any]] = [
    {"final_time": 1.0}, {"final_time": (None, 3.0)}, {"final_time": (0.5, None)},
    {"ignored": ["left"]}, {"restitution": 0.0}, {"restitution": {"right": 0.5, "left": 0.0}},
    {"bounds": {"power": (-9.0, 9.0), "x_dot": (-2.0, 2.0)}},
    {"bounds": {"power": (-9.0, 9.0), "x_dot": (-2.0, 2.5)}},
    {"bounds": {"power": (-9.0, None)}}, {"bounds": {"power": (None, 9.0)}},
    {"bounds": {"push": (-9.0, 9.0)}}, {"bounds": {}},
    {"bounds": {"power": (-9.0, 9.0)}, "periodic": {"x_dot": "x_dot"}},
    {"bounds": {"power": (-9.0, 9.0)}, "periodic": {"x_dot": ("x_dot", (-1.0, 1.0))}},
    {"sequence": ["left"]}, {"steps": 5}, {"controls": "linear"},
]  # fmt: skip


def test_rows_follow_from_each_part_of_the_statement_that_they_follow_from(walls: Kernels) -> None:
    def key(problem: dmoc.Problem, grazing: tuple[int, ...] = ()) -> Any:
        return rows_follow_from(problem, Layout.of(problem), np.array(grazing, dtype=np.intp))

    problem = stated(walls)
    keys = [key(problem), key(problem, (0,)), key(problem.in_rates())]
    keys += [key(stated(walls, **change)) for change in ROWS]
    for changed in ({"fingerprint": "x"}, {"code": "x"}, {"design": ["m"]}):
        manifest = replace(walls.manifest, **changed)
        keys.append(key(stated(replace(walls, manifest=manifest))))
    keys.append(key(stated(dmoc.build(walled(), backend="numpy"))))
    laws = dmoc.build(walled(restitution={"right": dmoc.approach_speed / 9}), backend="numpy")
    keys += [key(stated(laws, restitution={"left": 0.5})), key(stated(laws))]
    assert None not in keys and len(set(keys)) == len(keys)
    for same in (
        {"start": {"x": 0.1}}, {"final_time": (0.6, 2.0)}, {"parameters": {"m": 2.0}},
        {"restitution": 0.4},
    ):  # fmt: skip
        assert key(stated(walls, **same)) == keys[0]


def test_the_analysis_of_a_linear_system_is_that_of_its_fixed_unknowns() -> None:
    """Programs of one structure, of which the first, a middle or the last free unknown is fixed."""
    problem = double_integrator(4)
    every = [Transcription(problem) for _ in range(4)]
    free = np.flatnonzero(every[0].lower < every[0].upper)
    for nlp, k in zip(every[1:], (free[0], free[len(free) // 2], free[-1]), strict=True):
        nlp.lower, nlp.upper = nlp.lower.copy(), nlp.upper.copy()
        nlp.lower[k] = nlp.upper[k] = 0.0
    layouts = [kkt_layout(nlp) for nlp in every]
    assert len({id(nlp.structure) for nlp in every}) == 1
    assert len({id(layout) for layout in layouts}) == 4
    assert kkt_layout(Transcription(problem.but(goal={**problem.goal, "x": 0.9}))) is layouts[0]


def test_what_was_not_asked_for_the_longest_is_forgotten_first() -> None:
    recent: Recent[int] = Recent()
    made: list[int] = []

    def of(key: int) -> int:
        def make() -> int:
            made.append(key)
            return key

        return recent.of(key, make)

    for key in range(MOST):
        of(key)
    assert of(0) == 0 and made == list(range(MOST))
    of(MOST)  # 1 goes, for 0 has been asked for since
    assert [of(0), of(2), of(MOST)] == [0, 2, MOST] and made == list(range(MOST + 1))
    of(1)
    assert made[-1] == 1 and recent.of(None, lambda: 7) == 7
