"""Solutions against published and closed-form answers, limits, and honest failures."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from math import sqrt
from typing import Any

import numpy as np
import pytest
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols
from systems import dropped_ball, landing_system, there_and_back

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.models.registry import find
from dmoc.program.transcription import Transcription
from dmoc.solvers.kkt import residuals
from dmoc.solvers.outcome import Duals, Iteration

pytestmark = pytest.mark.slow


def test_seed_reaches_the_reference(solution: dmoc.Solution) -> None:
    assert solution.status == "solved"
    assert solution.cost == pytest.approx(129.6024, rel=1e-5)
    assert [p.duration for p in solution.phases] == pytest.approx([0.09640, 0.90360], abs=1e-5)
    assert solution.max_violation <= 1e-10
    assert solution.optimality <= 1e-6
    assert solution.active_bounds == ("final time <= 1 s",)
    (collision,) = solution.collisions
    jump = collision.momentum_after - collision.momentum_before
    # Grad g = (-1, 0): only alpha's momentum jumps.
    assert jump == pytest.approx([collision.impulse, 0.0], abs=1e-10)
    assert solution.verification is not None and solution.verification.passed


def test_seed_at_200_steps_reaches_the_reference(seed: dmoc.Problem) -> None:
    assert dmoc.solve(seed.but(steps=200)).cost == pytest.approx(129.8979, rel=1e-5)


def test_solution_satisfies_the_optimality_conditions_of_an_independent_evaluation(
    seed: dmoc.Problem, solution: dmoc.Solution
) -> None:
    """The gradient of the Lagrangian by differences of the constraint functions vanishes in the
    free unknowns."""
    nlp = Transcription(seed)
    y = np.concatenate([solution.multipliers[b.name].ravel() for b in nlp.equalities if b.count])
    w = np.concatenate([solution.multipliers[b.name].ravel() for b in nlp.inequalities if b.count])
    x = solution.unknowns
    assert x.flags.writeable  # it is the caller's
    assert residuals(nlp, x, Duals(y, w, solution.multipliers["bounds"])).optimality < 1e-6

    def lagrangian(x: np.ndarray) -> float:
        return nlp.cost(x) + float(y @ nlp.equality(x)) - float(w @ nlp.inequality(x))

    rng = np.random.default_rng(3)
    for _ in range(20):
        d = rng.normal(size=nlp.n) * np.where(nlp.lower == nlp.upper, 0.0, 1.0)
        d[nlp.layout.index_h] *= 1e-3
        slope = (lagrangian(x + 1e-5 * d) - lagrangian(x - 1e-5 * d)) / 2e-5
        assert abs(slope) < 1e-5 * np.abs(nlp.equality_jacobian(x).T @ y).max()


def test_condensed_and_full_forms_agree(seed: dmoc.Problem) -> None:
    few = seed.but(steps=12)
    a, b = (dmoc.solve(few, form=form, verify=False) for form in ("condensed", "full"))
    assert a.status == b.status == "solved"
    assert a.cost == pytest.approx(b.cost, rel=1e-9)


def test_linear_controls_approach_the_same_optimum(seed: dmoc.Problem) -> None:
    linear = answer_of(seed.but(controls="linear"))
    assert linear.cost == pytest.approx(129.986, rel=5e-3)
    assert linear.phases[0].u.shape == (101, 1)


def test_hanging_pendulum_swings_up_past_lost_controllability() -> None:
    reference = find("cart_pendulum_hanging")
    solution = answer_of(dmoc.Problem(reference.kernels(), **reference.defaults))
    alpha = np.concatenate([p.q[:, 0] for p in solution.phases])
    assert alpha[0] == pytest.approx(-np.pi / 2) and alpha[-1] == pytest.approx(np.pi / 2)


def test_other_parameters_solve(seed: dmoc.Problem) -> None:
    assert dmoc.solve(seed.but(parameters={"m_c": 2.0, "l": 0.7})).solved


def test_bounds_of_the_input_are_kept_and_named(seed: dmoc.Problem) -> None:
    solution = answer_of(seed.but(bounds={"F": (-25, 25)}))
    assert max(np.abs(p.u).max() for p in solution.phases) == pytest.approx(25, abs=1e-9)
    assert any(name.startswith("F >= -25") for name in solution.active_bounds)


def test_several_collisions_solve(seed: dmoc.Problem) -> None:
    solution = answer_of(seed.but(sequence=["lower", "upper"]))
    assert [c.surface for c in solution.collisions] == ["lower", "upper"]
    assert min(c.impulse for c in solution.collisions) > 0


def test_block_and_wall_approaches_its_closed_form_to_second_order(block: Kernels) -> None:
    """By unfolding the wall: J = 24, the hit at 0.5 s with speed 3; the error falls as h^2."""
    errors = []
    for steps in (10, 20, 40):
        solution = answer_of(there_and_back(block, steps=steps))
        errors.append(abs(solution.cost - 24.0))
        assert solution.collisions[0].time == pytest.approx(0.5, abs=1e-8)
        assert solution.collisions[0].impulse == pytest.approx(6.0, rel=2e-2)
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates == pytest.approx([2, 2], abs=0.1)


def test_double_integrator_without_collision_has_its_closed_form(block: Kernels) -> None:
    """Rest to rest over 0.5 in 1 s: int u^2/2 = 6 * 0.5^2 = 1.5."""
    solution = dmoc.solve(
        dmoc.Problem(
            block, start={"x": 0.0}, goal={"x": 0.5, "x_dot": 0.0}, final_time=1.0, steps=100
        )
    )
    assert solution.cost == pytest.approx(1.5, rel=1e-3) and solution.solved


def test_bouncing_mass_needs_no_force_where_gravity_suffices() -> None:
    q, u = dynamicsymbols("q u")
    system = replace(dropped_ball(), name="mass", inputs=[u], forces={q: u}, cost=u**2 / 2)
    problem = dmoc.Problem(
        system, start={"q": 0.5}, goal={"q": 0.5, "q_dot": 0.0}, sequence=["floor"],
        final_time=(None, 2.0),
    )  # fmt: skip
    solution = answer_of(problem)
    assert solution.cost < 1e-12
    assert [p.duration for p in solution.phases] == pytest.approx(
        [sqrt(2 * 0.5 / 9.81)] * 2, rel=1e-6
    )


def test_puck_bounces_off_bent_surfaces(puck: Kernels) -> None:
    """By symmetry the straight line through the centre hits the rim at (3, 0) after bouncing
    back; energy and normal are checked by simulation."""
    problem = dmoc.Problem(
        puck, start={"x": 1.5, "y": 0.0}, goal={"x": 1.5, "y": 1.0}, sequence=["rim"],
        final_time=1.0, steps=60,
    )  # fmt: skip
    solution = answer_of(problem)
    (collision,) = solution.collisions
    normal = 2 * collision.position
    np.testing.assert_allclose(
        collision.momentum_after - collision.momentum_before, -collision.impulse * normal, atol=1e-9
    )
    assert collision.position @ collision.position == pytest.approx(9.0)


def test_coarse_steps_are_not_called_solved(seed: dmoc.Problem) -> None:
    solution = dmoc.solve(seed.but(steps=10))
    assert solution.status == "not_verified"
    assert "simulation" in solution.message and ", take " in solution.message


def test_limits_are_kept_and_the_best_iterate_is_returned(seed: dmoc.Problem) -> None:
    seen: list[Iteration] = []
    few = dmoc.solve(seed, iterations=3, progress=seen.append)
    assert few.status == "iteration_limit" and few.iterations == 3 == len(seen)
    assert np.isfinite(few.cost)
    late = dmoc.solve(seed, seconds=1e-3)
    assert late.status == "time_limit"


def test_interruption_keeps_the_best_iterate(seed: dmoc.Problem) -> None:
    def interrupt(i: Iteration) -> None:
        if i.number == 4:
            raise KeyboardInterrupt

    solution = dmoc.solve(seed, starts=1, progress=interrupt)
    assert solution.status == "interrupted" and solution.iterations == 4
    assert len(solution.phases) == 2


@pytest.mark.parametrize(
    ("place", "keywords", "kept"),
    [
        ("dmoc.solving.mesh.one_mesh.starts_of", {"starts": 1}, False),
        ("dmoc.solving.multistart.exploration.explored", {}, False),
        ("dmoc.solving.multistart.ranking.checked", {}, False),
        ("dmoc.solving.mesh.one_mesh.checked", {"starts": 1}, True),
        ("dmoc.solving.answer.checked", {"starts": 1, "tolerance": 0.05}, True),
        ("dmoc.solving.case.solved_from", {"starts": 1}, True),
    ],
)
def test_ctrl_c_outside_of_a_method_is_a_status_too(
    place: str, keywords: dict[str, Any], kept: bool, seed: dmoc.Problem,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """In the guess, the exploration, the check, and what follows: what there is by then is kept."""
    module, name = place.rsplit(".", 1)
    work, calls = getattr(import_module(module), name), 0

    def interrupted_once(*arguments: Any, **keywords: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == 1:
            raise KeyboardInterrupt
        return work(*arguments, **keywords)

    problem = seed.but(steps=10)
    monkeypatch.setattr(place, interrupted_once)
    stopped = dmoc.solve(problem, "ipm", **keywords)
    assert calls and stopped.status == "interrupted"
    assert "interrupted" in stopped.message and len(stopped.phases) == 2
    monkeypatch.undo()
    alone = dmoc.solve(problem, "ipm", starts=1, verify=False)
    assert (stopped.cost == pytest.approx(alone.cost, rel=1e-3)) is kept


def test_a_neighbouring_solution_is_a_good_start(
    seed: dmoc.Problem, solution: dmoc.Solution
) -> None:
    near = seed.but(parameters={"m_c": 1.05})
    warm = answer_of(near, guess=solution)
    assert warm.iterations <= dmoc.solve(near, starts=1).iterations
    # Interpolated.
    assert dmoc.solve(seed.but(steps=50), guess=solution, verify=False).status == "solved"


def test_a_motion_without_inputs_is_found_by_its_start(capfd: pytest.CaptureFixture[str]) -> None:
    """A ball shot up from the floor so that its peak after two elastic bounces is 0.5: v0 =
    sqrt(2 g 0.5)."""
    problem = dmoc.Problem(
        dropped_ball(), start={"q": 0.0, "q_dot": None}, goal={"q": 0.5, "q_dot": 0.0},
        sequence=["floor", "floor"], steps=100, final_time=(None, 5),
    )  # fmt: skip
    solution = answer_of(problem)
    assert solution.phases[0].v[0, 0] == pytest.approx(sqrt(2 * 9.81 * 0.5), rel=1e-4)
    assert capfd.readouterr().out == ""


def test_merging_collisions_are_not_called_infeasible_nor_solved(block: Kernels) -> None:
    """Two hits of one wall cost least when they merge: the phase between them shrinks to its
    bound."""
    problem = dmoc.Problem(
        block, start={"x": 0.0}, goal={"x": 0.0, "x_dot": 0.0}, sequence=["wall", "wall"],
        final_time=2.0, steps=40,
    )  # fmt: skip
    free = dmoc.solve(problem)
    assert free.status == "not_verified" and free.max_violation < 1e-6
    assert [b for b in free.active_bounds if b.startswith("duration of phase 1 >= 0.002")]
    kept = answer_of(problem.but(durations=[(None, None), (0.4, None), (None, None)]))
    assert kept.phases[1].duration == pytest.approx(0.4)
    assert "duration of phase 1 >= 0.4 s" in kept.active_bounds


def test_the_time_limit_holds_within_an_iteration(seed: dmoc.Problem, reads: list[int]) -> None:
    """An iteration of slsqp reads the clock in every trial point."""
    numbers: list[int] = []

    def ended(seconds: float) -> int:
        reads[0] = 0
        numbers.clear()
        dmoc.solve(
            seed.but(steps=20), "slsqp", seconds=seconds, starts=1, verify=False,
            progress=lambda _: numbers.append(reads[0]),
        )  # fmt: skip
        return reads[0]

    ended(500)
    first, second, third = numbers[:3]
    assert second - first > 3 < third - second
    late = [ended(seconds) - seconds for seconds in range(first, second + 1)]
    # With a look at the clock between iterations alone, it would be an iteration.
    assert max(late) - min(late) <= 2


def test_that_there_is_no_motion_is_told_by_the_method_that_soon_knows(seed: dmoc.Problem) -> None:
    """SLSQP took ten times as long as the exploration, which had found nothing."""
    weak = seed.but(steps=30, bounds={**seed.bounds, "F": (-1.0, 1.0)})
    solution = dmoc.solve(weak, "slsqp")
    assert solution.status == "infeasible" and solution.method == "ipm"
    assert "slsqp was not tried" in solution.message and solution.conflicts


@pytest.mark.parametrize("steps", [20, 40])
def test_a_method_that_stalls_at_a_motion_begins_there_again(steps: int) -> None:
    """A block that slides from rest to rest: m^2 6 d^2/T^3 + F^2 T/2 with friction F = mu m g."""
    problem = dmoc.Problem(
        landing_system(), start={"x": 0, "y": 0}, goal={"x": 1, "x_dot": 0},
        contacts=["floor:slip+"], final_time=1, steps=steps, parameters={"g": 9.81},
    )  # fmt: skip
    for friction in (0.2, 0.35, 0.5):
        solution = answer_of(problem.but(parameters={"g": 9.81, "mu": friction}), starts=1)
        assert solution.cost == pytest.approx(6 + (9.81 * friction) ** 2 / 2, rel=6e-3)
