"""Carried solvers whose ends slide against the word of a phase, or move where they stick."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from carried_folder import compiled, run
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor

import dmoc
from dmoc.export.loaded_solver import LoadedSolver, load_solver

pytestmark = pytest.mark.slow

U = dynamicsymbols("u")
# 1 m in 1 s is a size of 1 m/s.
KEPT = 1e-6


def carried(folder: Path, order: int = 2, **stated: Any) -> LoadedSolver:
    """A block that is pushed over a floor for 1 m in 1 s."""
    system = block_on_floor("carried_block", 1.0, 10.0, 0.1, cost=U**2 / 2)
    fields: dict[str, Any] = {"final_time": 1.0, "steps": 12} | stated
    problem = dmoc.Problem(dmoc.build(system, order=order), **fields)
    dmoc.generate_solver(problem, folder / "block", guess=dmoc.solve(problem, "ipm", starts=1))
    return load_solver(folder / "block")


def ends(v_0: float, v_1: float, x_1: float = 1.0) -> dict[str, Any]:
    return {"start": {"x": 0, "y": 0, "x_dot": v_0}, "goal": {"x": x_1, "x_dot": v_1}}


def status_with(solver: LoadedSolver, end: str, value: float) -> str:
    before = dict(solver.numbers)
    solver.set(**{end: {"x_dot": value}})
    status = solver.solve("answer").status
    solver.set(**{end: {"x_dot": before[f"{end}.x_dot"]}})
    return status


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("sign", [1, -1])
def test_what_slides_against_its_word_is_no_answer(order: int, sign: int, tmp_path: Path) -> None:
    word = "floor:slip+" if sign > 0 else "floor:slip-"
    solver = carried(tmp_path, order, contacts=[word], **ends(sign, sign, sign))
    for end in ("start", "goal"):
        for against in (2.0, 0.1, 2 * KEPT):
            assert status_with(solver, end, -sign * against) == "outside", (end, against)
        for along in (2.0, 0.0, -KEPT / 2):
            assert status_with(solver, end, sign * along) == "solved", (end, along)
    solver.set(start={"x_dot": -2 * sign})
    assert "slides against its word" in solver.solve("answer").message


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("end", ["start", "goal"])
def test_what_moves_where_it_sticks_is_no_answer(order: int, end: str, tmp_path: Path) -> None:
    """It begins at rest and slides, or slides and ends at rest."""
    words = ["floor:stick", "floor:slip+"]
    first, second = words if end == "start" else words[::-1]
    stated = ends(0, 1) if end == "start" else ends(1, 0)
    solver = carried(tmp_path, order, contacts=[first], sequence=[second], **stated)
    for value in (0.5, -0.5):  # steps of order 4 have no such motion
        assert status_with(solver, end, value) == ("outside" if order == 2 else "infeasible"), value
    for value in (2 * KEPT, -2 * KEPT):
        assert status_with(solver, end, value) == "outside", value
    for value in (0.0, KEPT / 2, -KEPT / 2):
        assert status_with(solver, end, value) == "solved", value


@pytest.mark.parametrize("order", [2, 4])
def test_a_free_end_does_not_slide_back(order: int, tmp_path: Path) -> None:
    """From 3 m/s the least effort over 1 m in 1 s goes beyond it, and back."""
    x = dynamicsymbols("x")
    system = dmoc.MechanicalSystem(
        "carried_rail", [x], x.diff() ** 2 / 2, inputs=[U], forces={x: U}, tangents={"rail": x},
        friction={"rail": 1.0}, cost=U**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {"x": 0, "x_dot": 1}, {"x": 1}, steps=12, final_time=1.0,
        contacts=["rail:slip+"],
    )  # fmt: skip
    dmoc.generate_solver(problem, tmp_path / "rail", guess=dmoc.solve(problem, "ipm", starts=1))
    solver = load_solver(tmp_path / "rail")
    assert status_with(solver, "start", 3.0) == "outside"
    assert status_with(solver, "start", 1.2) == "solved"


JUDGE = r"""
#include "dmoc_inside.h"
#include "block.h"
#include <stdio.h>

static double memory[BLOCK_MEMORY];

int main(void)
{
    dmoc_solver *s = dmoc_solver_begin(&block_problem, memory, sizeof memory);
    const double *T = dmoc_solver_table(s, BLOCK_TABLE_T, NULL, NULL);
    const double *x = dmoc_solver_unknowns(s);
    int row;
    double by;
    while (scanf("%d %lf", &row, &by) == 2) {
        const ptrdiff_t i = T - x + row;
        const double before = s->x[i];
        s->x[i] += by/s->program.sizes[i];
        carried_read_out(s);
        printf("%d\n", carried_all_inside(s));
        s->x[i] = before;
    }
    return 0;
}
"""


@pytest.mark.parametrize("order", [2, 4])
def test_both_ends_of_every_phase_are_looked_at(order: int, tmp_path: Path) -> None:
    """It slides, sticks and slides on.  An impulse of friction at an end of a phase that is changed
    changes the momentum of 1 kg there by as much, which is 0 beside what sticks."""
    solver = carried(
        tmp_path, order, contacts=["floor:slip+"], sequence=["floor:stick", "floor:slip+"],
        steps=10, durations=[(0.2, None)] * 3, **ends(1, 1),
    )  # fmt: skip
    for end in ("start", "goal"):
        assert status_with(solver, end, -2.0) == "outside"
        assert status_with(solver, end, 1.2) == "solved"
    stations, tried, expected = solver.tables["T"][0] // 3, list[tuple[int, float]](), list[bool]()
    for phase, speeds in enumerate(((1, 0), (0, 0), (0, 1))):
        for last, speed in enumerate(speeds):
            row = phase * stations + last * (stations - 1)
            for v in (speed, 2.0, 2 * KEPT, KEPT / 2, -KEPT / 2, -2 * KEPT, -2.0):
                tried.append((row, (speed - v) * (-1) ** last))
                expected.append(abs(v) < KEPT if phase == 1 else v > -KEPT)
    folder = tmp_path / "block"
    (folder / "judge.c").write_text(JUDGE)
    text = "".join(f"{row} {by!r}\n" for row, by in tried)
    done = run(compiled(folder, "judge.c"), folder=folder, stdin=text)
    assert done.returncode == 0, done.stderr
    inside = [line == "1" for line in done.stdout.split()]
    assert dict(zip(tried, inside, strict=True)) == dict(zip(tried, expected, strict=True))
