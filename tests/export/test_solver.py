"""Solvers in C: what they solve is what the compiled method solves in Python, from the same start,
with the numbers of the day of export and with others; nothing is wrong with their memory."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from carried_folder import compiled, run
from carried_problems import CASES, design, linkage
from joint_problems import bob
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.export.motion_text import derived_tables
from dmoc.export.solver import carried_by, memory_of
from dmoc.models.registry import find
from dmoc.program.extraction import trajectory
from dmoc.program.transcription import Transcription
from dmoc.solvers.ipm import solve_ipm
from dmoc.solvers.judge import judged
from dmoc.solvers.outcome import SENTENCES, Duals, Options, Outcome, Status

CODES = ("solved", "infeasible", "iteration_limit", "time_limit", "stalled", "interrupted")
BAD_NUMBER, OUTSIDE, UNPHYSICAL, NO_REST = 7, 8, 9, 10


@dataclass(frozen=True)
class Answer:
    status: int
    cost: float
    iterations: int
    x: np.ndarray


def answered(program: str, folder: Path, *words: str) -> Answer:
    done = run(program, *words, folder=folder)
    assert done.returncode in (0, 1) and not done.stderr, done.stderr
    lines = done.stdout.splitlines()
    facts = dict(line.split(" ", 1) for line in lines[:5])
    numbers = [float(x) for line in lines[5:] if not line[0].isalpha() for x in line.split()]
    status = int(facts["status"].split(":")[0])
    return Answer(status, float(facts["cost"]), int(facts["iterations"]), np.array(numbers))


def in_python(nlp: Transcription, x: np.ndarray, duals: Duals | None) -> Outcome:
    with np.errstate(all="ignore"):
        return judged(nlp, solve_ipm(nlp, x, Options(), duals), Options())


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_same_answers_as_in_python(case: str, tmp_path: Path) -> None:
    """From the first motion digit by digit, momenta, velocities and forces too; with other numbers,
    from the same answer and its multipliers, to 1e-9 of the sizes of the unknowns."""
    made, numbers, stated = CASES[case]
    problem, folder = made(), tmp_path / "carried"
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    assert solution.status == "solved", solution.message
    dmoc.generate_solver(problem, folder, guess=solution)
    carried, counts = carried_by("carried", problem, solution)
    nlp, program = carried.nlp, compiled(folder)
    missing = set(numbers) - {n.name for n in carried.numbers.taken}
    assert not missing, carried.numbers.kept
    for words, x, duals in ((("first",), carried.first, None), ((), carried.x, carried.duals)):
        here, there = in_python(nlp, x, duals), answered(program, folder, *words)
        assert (there.status, there.iterations) == (CODES.index(here.status), here.iterations)
        np.testing.assert_allclose(there.x[: nlp.n] / nlp.sizes, here.x, rtol=0, atol=1e-12)
        tables_are_those_of(nlp, there.x)
    assert there.iterations == counts[1]
    other = Transcription(stated(nlp.problem), nlp.scale)
    here = in_python(other, carried.x, carried.duals)
    words = [f"{name}={value!r}" for name, value in numbers.items()]
    there = answered(program, folder, *words)
    assert (CODES[there.status], here.status) == ("solved", "solved")
    assert abs(there.cost - nlp.scale.cost * other.cost(here.x)) <= 1e-9 * (1 + abs(there.cost))
    scaled = there.x[: nlp.n] / nlp.sizes
    np.testing.assert_allclose(scaled, here.x, rtol=0, atol=1e-9)
    assert np.abs(scaled - carried.x).max() > 1e-3


def tables_are_those_of(nlp: Transcription, x: np.ndarray) -> None:
    """Tables behind the unknowns x are what Python finds of them."""
    names = nlp.kernels.surfaces, nlp.kernels.tangents
    tables = {
        t.name: x[nlp.n :][t.first : t.first + t.rows * t.columns].reshape(t.rows, -1)
        for t in derived_tables(nlp)
    }
    row = 0
    for phase in trajectory(nlp, x[: nlp.n] / nlp.sizes).phases:
        rows, by_kind = slice(row, row := row + len(phase.t)), {"reaction": phase.reaction}
        for kind, every, there in zip(
            ("normal", "tangential"), names, (phase.closed, phase.rubbing), strict=True
        ):
            by_kind[kind] = np.zeros((len(phase.t), len(every)))
            by_kind[kind][:, [every.index(name) for name in there]] = getattr(phase, kind)
        if not phase.steps:  # impulses end with the last event
            by_kind = {kind: 0 * forces for kind, forces in by_kind.items()}
        by_kind |= {"momenta": phase.p, "velocities": phase.v}
        for kind, expected in by_kind.items():
            if kind in tables:
                size = 1 + np.abs(expected).max()
                np.testing.assert_allclose(tables[kind][rows], expected, rtol=0, atol=1e-11 * size)
            else:
                assert not expected.any()
    assert row == len(tables["momenta"])


@pytest.fixture(scope="module")
def program(folder: Path) -> str:
    return compiled(folder)


def test_numbers_that_do_not_fit(folder: Path, program: str) -> None:
    """What is no number, a bound above its own, a name that there is not: nothing is solved."""
    for word, message in (
        ("final_time=nan", "final_time: expected a finite number"),
        ("bounds.u.high=-31", "bounds.u.high: expected bounds with room between them"),
        ("goal.z=1", "goal.z=1: expected NAME=VALUE with one of these names:"),
        ("goal.x", "goal.x: expected NAME=VALUE"),
    ):
        done = run(program, word, folder=folder)
        assert done.returncode == 2
        assert done.stderr.startswith(message), done.stderr


def test_states_that_leave_a_constraint_are_no_answer(folder: Path, program: str) -> None:
    """The rod has 1 m: fixed values settle its rows at the goal, which is looked at afterwards."""
    done = run(program, "goal.x=0.9", folder=folder)
    ends = f"status {OUTSIDE}", f"status {CODES.index('infeasible')}"
    assert any(end in done.stdout for end in ends)
    assert done.returncode == 1


@pytest.mark.slow
def test_a_place_at_an_event_keeps_the_bounds_of_its_coordinate(tmp_path: Path) -> None:
    reference = find("puck_table")
    stated = {**reference.defaults, "sequence": ["east"], "steps": 8, "via": [{"y": 0.4}]}
    problem = dmoc.Problem(reference.kernels(), **{**stated, "bounds": {"y": (-1.0, 0.8)}})
    target = tmp_path / "exp"  # nothing of it has the name of a function of C
    dmoc.generate_solver(problem, target)
    program = compiled(target)
    assert answered(program, target, "via.0.y=0.5").status == 0
    done = run(program, "via.0.y=0.9", folder=target)
    assert done.returncode == 2
    assert done.stderr.startswith("via.0.y: expected no more than its upper bound")


@pytest.mark.slow
def test_positions_behind_a_surface_are_no_answer(tmp_path: Path) -> None:
    """The block starts behind the wall at 1."""
    problem = design().but(design={}, goal={"x": 0.5, "x_dot": 0})
    target = tmp_path / "thrown"
    dmoc.generate_solver(problem, target)
    program = compiled(target)
    assert answered(program, target, "start.x=0.2").status == 0
    assert answered(program, target, "start.x=1.2").status in (1, OUTSIDE)


@pytest.mark.slow
def test_what_slides_where_it_sticks_is_no_answer(tmp_path: Path) -> None:
    """The block rests on its floor: fixed values settle the rows of its sticking."""
    system = block_on_floor("carried_rest", 1.0, 10.0, 0.5, cost=dynamicsymbols("u") ** 2)
    problem = dmoc.Problem(
        dmoc.build(system), {"x": 0.0, "y": 0.0}, {"x": 0.0}, contacts=["floor"], steps=8,
        final_time=1.0,
    )  # fmt: skip
    target = tmp_path / "resting"
    dmoc.generate_solver(problem, target)
    program = compiled(target)
    assert answered(program, target).status == 0
    for word in ("start.x=0.1", "start.y=0.05", "start.y=-0.1"):  # slides, hovers, sinks
        assert answered(program, target, word).status in (1, OUTSIDE), word


@pytest.mark.slow
def test_problems_that_are_refused(tmp_path: Path) -> None:
    problem = linkage(2)
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    with pytest.raises(ProblemError, match=r"takes \d+ bytes of memory and \d+ bytes of constants"):
        dmoc.generate_solver(problem, tmp_path / "small", guess=solution, most_bytes=10_000)
    with pytest.raises(ProblemError, match="no solution to begin with"):
        dmoc.generate_solver(problem.but(bounds={"u": (-0.1, 0.1)}), tmp_path / "weak")
    numpy = dmoc.build(bob(), backend="numpy")
    with pytest.raises(ProblemError, match="run on NumPy"):
        dmoc.generate_solver(problem.but(kernels=numpy), tmp_path / "numpy")
    assert not list(tmp_path.iterdir())


DRIVER = r"""
#include "bob.h"
#include <stdio.h>
#include <string.h>

static double memory[2][BOB_MEMORY];

static int stop(void *user, int iteration, double cost, double violation, double mu, int restoring)
{
    (void)cost, (void)violation, (void)mu, (void)restoring;
    return ++*(int *)user, iteration >= 2;
}

static double seconds(void) { return 1e9; }

int main(void)
{
    printf("%zu %d\n", dmoc_solver_memory(&bob_problem)/sizeof(double), BOB_MEMORY);
    const size_t bytes = dmoc_solver_memory(&bob_problem);
    printf("%d\n", dmoc_solver_begin(&bob_problem, memory[0], bytes - 1) == NULL);
    dmoc_solver *a = dmoc_solver_begin(&bob_problem, memory[0], sizeof memory[0]);
    dmoc_solver *b = dmoc_solver_begin(&bob_problem, memory[1], sizeof memory[1]);
    dmoc_limits limits = dmoc_solver_limits();
    int heard = 0;
    limits.report = stop, limits.user = &heard;
    dmoc_solver_from_first_motion(a);
    printf("%d", dmoc_solver_solve(a, &limits));
    printf(" %d\n", heard);
    limits.report = NULL, limits.iterations = 1;
    dmoc_solver_from_first_motion(a);
    printf("%d\n", dmoc_solver_solve(a, &limits));
    limits.iterations = 100, limits.seconds = -1, limits.clock = seconds;
    dmoc_solver_from_first_motion(a);
    printf("%d\n", dmoc_solver_solve(a, &limits));
    /* The other one knows nothing of it; it gets on from what it has solved itself. */
    dmoc_solver_set(b, BOB_FINAL_TIME, 1.1);
    printf("%d", dmoc_solver_solve(b, NULL));
    printf(" %d", dmoc_solver_solve(b, NULL));
    printf(" %d\n", dmoc_solver_end(b).iterations);
    const int found = dmoc_solver_find(&bob_problem, "final_time");
    printf("%g %d\n", dmoc_solver_get(a, BOB_FINAL_TIME), found);
    int count, rows, columns;
    const double *t = dmoc_solver_times(b, &count);
    const double *q = dmoc_solver_table(b, BOB_TABLE_Q, &rows, &columns);
    printf("%d %.9f %d %d %.9f\n", count, t[count - 1], rows, columns, q[2*rows - 2]);
    /* Multipliers of the final time: minus the slope of the cost. */
    static double y[1000], z[1000], x[1000];
    dmoc_solver_multipliers(b, y, z);
    memcpy(x, dmoc_solver_unknowns(b), sizeof(double)*(size_t)dmoc_solver_size(&bob_problem));
    dmoc_solver_from(b, x);
    const int again = dmoc_solver_solve(b, NULL);
    printf("%d %d\n", again, dmoc_solver_rows(&bob_problem));
    for (int r = 0; r < dmoc_solver_rows(&bob_problem); ++r)
        printf("%.12g\n", y[r]);
    /* From several starts; the rod leaves no numbers for a speed, so that there is no rest. */
    printf("%d", dmoc_solver_explore(b, 3, 7, NULL));
    printf(" %d %d\n", dmoc_solver_end(b).starts, dmoc_solver_shift(b, 0.1));
    for (int status = 0; status <= DMOC_NO_REST + 1; ++status)
        printf("%s\n", dmoc_solver_sentence(status));
    return 0;
}
"""


def test_what_a_solver_says(folder: Path) -> None:
    """Memory, limits, interruptions, two solvers beside each other, tables, multipliers and
    sentences."""
    (folder / "driver.c").write_text(DRIVER)
    done = run(compiled(folder, "driver.c"), folder=folder)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    needed, macro = map(int, lines[0].split())
    assert macro - 160 <= needed <= macro
    assert lines[1:5] == ["1", f"{CODES.index('interrupted')} 2", "2", "3"]
    assert lines[5].startswith("0 0") and int(lines[5].split()[2]) <= 2
    assert lines[6].split()[0] == "1"
    assert lines[7] == "13 1.100000000 13 2 0.600000000"
    rows = int(lines[8].split()[1])
    assert lines[8].split()[0] == "0"
    problem = linkage(2).but(final_time=1.1)
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    momenta = solution.multipliers["momentum"].ravel()
    row = np.array(lines[9 : 9 + rows], dtype=float)
    off = [np.abs(row - y).min() for y in momenta]
    assert max(off) <= 1e-6 * np.abs(momenta).max()
    assert lines[9 + rows] == f"0 3 {NO_REST}"
    sentences = lines[10 + rows :]
    for i, status in enumerate(CODES):
        assert sentences[i] == SENTENCES[Status(status)]
    assert sentences[BAD_NUMBER].startswith("a number does not fit")
    assert sentences[OUTSIDE].startswith("the motion penetrates") and sentences[-1] == ""
    assert sentences[UNPHYSICAL].startswith("a mass, friction or restitution")
    assert sentences[NO_REST].startswith("the first event is over, nothing is left")


REFUSALS = r"""
#include "bob.h"
#include <math.h>
#include <stdio.h>

static double memory[BOB_MEMORY];

static void solve_with(dmoc_solver *s, const dmoc_limits *limits)
{
    const char *expected;
    const int status = dmoc_solver_solve(s, limits), number = dmoc_solver_wrong(s, &expected);
    printf("%d %d - %s\n", status, number, expected ? expected : "");
}

int main(void)
{
    dmoc_solver *s = dmoc_solver_begin(&bob_problem, memory, sizeof memory);
    const int numbers[] = {BOB_FINAL_TIME, BOB_GOAL_X};
    const double values[] = {-1, 0, 1e-61, 1e61, 1e101, -1e101, 1e-101, NAN, INFINITY};
    for (int i = 0; i < 2; ++i) {
        const double before = dmoc_solver_get(s, numbers[i]);
        for (int k = 0; k < 9; ++k) {
            dmoc_limits none = dmoc_solver_limits();
            none.iterations = 0;
            dmoc_solver_set(s, numbers[i], values[k]);
            solve_with(s, &none);
        }
        dmoc_solver_set(s, numbers[i], before);
    }
    for (int k = 0; k < 8; ++k) {
        const double no[] = {NAN, 0, -1, INFINITY};
        dmoc_limits limits = dmoc_solver_limits();
        *(k < 4 ? &limits.violation : &limits.optimality) = no[k % 4];
        solve_with(s, &limits);
    }
    dmoc_limits limits = dmoc_solver_limits();
    limits.seconds = NAN;
    solve_with(s, &limits);
    limits = dmoc_solver_limits(), limits.iterations = -1;
    solve_with(s, &limits);
    solve_with(s, NULL);
    return 0;
}
"""


def test_numbers_and_limits_that_are_none_are_refused(folder: Path) -> None:
    """Those that a problem in Python refuses: times that are not positive, what is not finite or
    overflows in squares; tolerances that nothing or everything would meet."""
    (folder / "refusals.c").write_text(REFUSALS)
    done = run(compiled(folder, "refusals.c"), folder=folder)
    assert done.returncode == 0, done.stderr
    lines = [line.split(maxsplit=3) for line in done.stdout.splitlines()]
    taken = [int(line[0]) != BAD_NUMBER for line in lines]
    time, place, limits = taken[:9], taken[9:18], taken[18:]
    assert not any(time) and lines[0][3] == "a positive time from 1e-60 to 1e60 s"
    assert place == [True, True, True, True, False, False, True, False, False]
    assert lines[13][3] == "a magnitude of at most 1e100"
    assert not any(limits[:-1]) and limits[-1]
    assert {line[1] for line in lines[18:28]} == {"-1"}
    assert all(line[3].startswith("positive tolerances") for line in lines[18:28])


@pytest.mark.slow
def test_speeds_at_the_ends_of_a_constraint(tmp_path: Path) -> None:
    """They are what the rod leaves: from below with 0.5 m/s to the side costs another effort."""
    rest = {"x_dot": 0, "y_dot": 0}
    problem = linkage(2).but(start={"x": 0, "y": -1} | rest, steps=24)
    dmoc.generate_solver(problem, tmp_path / "bob")
    program = compiled(tmp_path / "bob")
    moved = answered(program, tmp_path / "bob", "start.x_dot=0.5")
    own = dmoc.solve(problem.but(start={"x": 0, "y": -1, "x_dot": 0.5, "y_dot": 0}), starts=1)
    assert moved.cost == pytest.approx(own.cost, rel=1e-7)
    wrong = run(program, "start.y_dot=0.5", folder=tmp_path / "bob")
    assert wrong.returncode == 2 and "velocities that keep the constraints" in wrong.stderr


def test_memory_is_what_is_said(folder: Path) -> None:
    problem = linkage(2)
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    carried, _ = carried_by("bob", problem, solution)
    assert f"#define BOB_MEMORY {memory_of(carried)}\n" in (folder / "bob.h").read_text()
