"""What a problem states comes out as it was stated: bounds, limits of the time, surfaces that move
or are ignored, in closed forms."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from contact_problems import pushed
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, double_integrator, there_and_back

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import _best_time, initial_guesses
from dmoc.guess.transfer import times_of_inputs
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription

T = dynamicsymbols._t


def program(problem: dmoc.Problem) -> Transcription:
    return Transcription(problem, scale_of(problem, initial_guesses(problem)[0].x))


def test_a_range_at_an_end_leaves_the_bounds_of_the_way(block: Kernels) -> None:
    problem = dmoc.Problem(
        block, start={"x": (0.0, 0.9)}, goal={"x": (-2.0, 0.3)}, bounds={"x": (-1.0, 0.5)},
        steps=4, final_time=1.0,
    )  # fmt: skip
    nlp = program(problem)
    lower, upper = (nlp.limits[i][nlp.layout.index_q[:, 0]] for i in (0, 1))
    assert list(lower) == [0.0, -1.0, -1.0, -1.0, -1.0]
    assert list(upper) == [0.5, 0.5, 0.5, 0.5, 0.3]


@pytest.mark.parametrize("event", [0, 1])
@pytest.mark.parametrize(
    ("place", "refused"),
    [
        ((-2.0, -1.1), True), ((-2.0, -1.0), False), ((-2.0, 0.0), False), ((-2.0, 2.0), False),
        ((-0.2, 0.2), False), ((0.0, 2.0), False), ((0.5, 2.0), False), ((0.6, 2.0), True),
        ((None, -1.1), True), ((0.6, None), True), (-1.1, True), (-1.0, False), (0.6, True),
    ],
)  # fmt: skip
def test_a_place_of_an_event_overlaps_the_bounds_of_its_coordinate(
    block: Kernels, event: int, place: Any, refused: bool
) -> None:
    via = [{}, {"x": place}] if event else [{"x": place}, {}]
    stated = {"sequence": ["wall", "wall"], "via": via, "bounds": {"x": (-1.0, 0.5)}}
    if not refused:
        ends = place if isinstance(place, tuple) else (place, place)
        assert there_and_back(block, **stated).via_bounds[event, 0].tolist() == list(ends)
        return
    with pytest.raises(ProblemError, match=f"via of event {event + 1}: x = .* lies outside its b"):
        there_and_back(block, **stated)


@pytest.mark.slow
@pytest.mark.parametrize("order", [4, 6])
def test_nodes_inside_steps_keep_the_bounds_too(order: int) -> None:
    nlp = program(double_integrator(4, order).but(bounds={"x": (-1.0, 1.25)}))
    inside = nlp.layout.index_q_i
    assert inside.size and (nlp.limits[0][inside] == -1.0).all()
    assert (nlp.limits[1][inside] == 1.25).all()


def test_a_bound_on_the_surface_gives_way_where_it_is_hit(block: Kernels) -> None:
    """It would leave no interior: by 1e-3 of the coordinate's size, and nowhere else."""
    nlp = program(there_and_back(block, steps=4, bounds={"x": (-1.0, 1.0)}))
    upper = nlp.limits[1][nlp.layout.index_q[:, 0]]
    assert upper[4] == pytest.approx(1.001) and list(upper[1:4]) == [1.0] * 3


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4, 6])
def test_the_cost_of_an_input_that_is_constant_in_a_step_is_curved_by_its_time(order: int) -> None:
    """int u^2: 2 h for each step, whatever values of u a kernel is told at its ends."""
    nlp = program(double_integrator(5, order).but(controls="constant"))
    x, none = np.full(nlp.n, 0.3), np.zeros(nlp.n_eq + nlp.n_in)
    hessian = nlp.lagrangian_hessian(x, none[: nlp.n_eq], none[nlp.n_eq :]).toarray()
    u, h = nlp.layout.index_u[:, 0], nlp.physical(x)[nlp.layout.index_h[0]]
    expected = 2 * h * nlp.sizes[u] ** 2 / nlp.scale.cost
    assert hessian[u, u] == pytest.approx(expected, rel=1e-12)


def test_the_latest_time_is_the_one_that_is_stated() -> None:
    """The least int u^2 from rest to rest falls with the time as 12/T^3."""
    problem = double_integrator(20).but(final_time=(0.1, 1.5))
    solution = answer_of(problem, "ipm", starts=1)
    assert solution.final_time == pytest.approx(1.5, rel=1e-7)
    assert solution.cost == pytest.approx(12 / 1.5**3, rel=5e-3)


@pytest.mark.slow
def test_a_surface_that_comes_nearer_limits_the_time_of_a_fixed_goal() -> None:
    """The wall 2 - t is at the goal x = 1 after a second: 6/T^3 with T = 1."""
    x = dynamicsymbols("x")
    system = replace(block_system("closing"), surfaces={"wall": x <= 1 + sp.Symbol("wall") - T})
    problem = dmoc.Problem(
        system, start={"x": 0, "x_dot": 0}, goal={"x": 1, "x_dot": 0}, steps=20,
        final_time=(0.1, 3.0),
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1)
    assert solution.final_time == pytest.approx(1.0, rel=1e-6)
    assert solution.cost == pytest.approx(6.0, rel=1e-2)


def test_a_surface_that_is_ignored_holds_nothing_back(block: Kernels) -> None:
    """From rest to rest through the wall at 1: 6 d^2/T^3."""
    problem = dmoc.Problem(
        block, start={"x": 0, "x_dot": 0}, goal={"x": (2, 3), "x_dot": 0}, ignored=["wall"],
        steps=20, final_time=1.0,
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1)
    assert solution.cost == pytest.approx(24.0, rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_a_hit_on_a_wall_that_moves_keeps_newtons_law(order: int) -> None:
    """3 m/s against 1 + 0.5 t with e = 0.6: 0.5 - 0.6 2.5 after it, exactly, as lines are."""
    x = dynamicsymbols("x")
    system = replace(block_system("fleeing"), surfaces={"wall": x <= sp.Symbol("wall") + T / 2})
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0, "x_dot": 3.0}, sequence=["wall"], steps=4,
        final_time=1.0, restitution=0.6,
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1)
    assert solution.cost == pytest.approx(0.0, abs=1e-9)
    assert solution.phases[1].v[:, 0] == pytest.approx(-1.0, abs=1e-6)
    assert solution.collisions[0].time == pytest.approx(0.4, abs=1e-6)


def test_one_node_says_the_bounds_of_all_at_which_a_contact_sticks() -> None:
    """The first one, unless another is fixed."""
    free = pushed(4).but(
        start={"x": None}, goal={}, contacts=["rail:stick"], sequence=[], bounds={"x": (-1.0, 0.5)}
    )
    for problem, first in ((free, -1.0), (free.but(goal={"x": 0.25}), -np.inf)):
        nlp = program(problem)
        low = nlp.limits[0][nlp.layout.index_q[:, 0]]
        assert low[0] == first and (low[1:-1] == -np.inf).all()


def test_inputs_that_jump_are_told_inside_of_their_steps() -> None:
    """A little after the node where a step begins, and before the one where it ends."""
    times = times_of_inputs("stages", np.array([0.0, 1.0, 3.0]))
    assert times == pytest.approx([0.0, 1.0, 1.0, 3.0], abs=1e-5)
    assert times[0] > 0 and times[1] < 1 < times[2] and times[3] < 3


def test_of_times_that_keep_the_inputs_the_cheapest_is_taken() -> None:
    """An excess of less than a thousandth is none."""
    tried = {1.0: (2e-4, 5.0), 2.0: (9e-4, 3.0), 3.0: (0.5, 1.0), 4.0: (np.nan, 0.0)}
    planner: Any = SimpleNamespace(
        problem=SimpleNamespace(
            phases=1,
            phase_steps=(20,),
            limits={},
            kernels=SimpleNamespace(integrals=[], manifest=SimpleNamespace(path_limits=[])),
            model=SimpleNamespace(has_objective=False),
        ),
        trials=lambda choice, times, steps: np.array([tried[t] for t in times]).T,
        around_other_inputs=False,
    )
    assert _best_time(planner, (0,), np.array(list(tried)), ENDLESS) == 2.0
    assert _best_time(planner, (0,), np.array([3.0, 4.0]), ENDLESS) == 3.0
    assert _best_time(planner, (0,), np.array([4.0, 4.0]), ENDLESS) == 4.0
