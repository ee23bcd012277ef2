"""What hits add to integrals: impulses, approaches, departures and losses that are bounded and
priced."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from hit_problems import coupled, thrown
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError
from dmoc.guess.automatic import initial_guesses
from dmoc.inspection.kernel_check import kernel_errors
from dmoc.program.scaling import scale_of

X, Y, U, W = dynamicsymbols("x y u w")
M, RISE = sp.symbols("m rise")
T = dynamicsymbols._t
E, P = 0.8, 4.0


def block(integrals: dict[str, Any], **more: Any) -> dmoc.MechanicalSystem:
    """A block that is pushed against a wall at x = 1, and away from another one at x = -1."""
    return dmoc.MechanicalSystem(
        "priced", [X], M * X.diff() ** 2 / 2, {M: 1.0}, inputs=[U], forces={X: U},
        surfaces={"wall": X <= 1, "left": X >= -1}, cost=U**2, integrals=integrals, **more,
    )  # fmt: skip


def there_and_back(
    integrals: dict[str, Any], bound: tuple[float | None, float] | None = None, **more: Any
) -> dmoc.Problem:
    names = dict.fromkeys(integrals, bound) if bound else {}
    stated = {"sequence": ["wall"], "final_time": 1, "steps": 80, "restitution": E}
    objective = {k: more.pop(k) for k in ("objective",) if k in more}
    return dmoc.Problem(
        block(integrals, **objective), {"x": 0}, {"x": 0, "x_dot": 0, **names}, **{**stated, **more}
    )  # fmt: skip


def best(approach: float) -> float:
    """The least cost with a speed before the hit, at the best time: cubics on both sides."""
    tau = np.linspace(0.01, 0.99, 9801)

    def cubic(x: float, v: float, v_end: float, time: Any) -> Any:  # from x, v to 0, v_end
        return 4 * (3 * x**2 / time**3 + 3 * x * (v + v_end) / time**2
                    + (v**2 + v * v_end + v_end**2) / time)  # fmt: skip

    there = cubic(-1.0, 0.0, approach, tau)
    return float((there + cubic(1.0, -E * approach, 0.0, 1 - tau)).min())


def test_a_bound_of_the_impulse_holds_the_speed() -> None:
    """The speed before the hit is P/(m (1 + e)), where the free optimum is faster."""
    impulse = {"blow": dmoc.impulse("wall")}
    free = dmoc.solve(there_and_back(impulse), "ipm")
    assert free.solved and free.trajectory.totals["blow"] == pytest.approx(
        free.collisions[0].impulse
    )
    slack = dmoc.solve(there_and_back(impulse, (None, 7.0)), "ipm")
    assert slack.cost == pytest.approx(free.cost, rel=1e-9)
    held = dmoc.solve(there_and_back(impulse, (None, P)), "ipm")
    assert held.solved and held.active_bounds == ("blow <= 4",)
    assert held.collisions[0].impulse == pytest.approx(P)
    assert held.collisions[0].rate_before == pytest.approx(P / (1 + E), rel=1e-4)
    assert held.cost == pytest.approx(best(P / (1 + E)), rel=1e-3)


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("kind", ["approach", "departure", "loss", "impulse"])
def test_what_a_hit_has(kind: str, order: int) -> None:
    kernels = dmoc.build(block({"own": getattr(dmoc, kind)("wall") ** 2 + U**2}), order=order)
    problem = dmoc.Problem(
        kernels, {"x": 0}, {"x": 0, "x_dot": 0}, sequence=["wall"], final_time=1, steps=20,
        restitution=E,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm")
    assert solution.solved, solution.message
    before, after = (p.v[k, 0] for p, k in zip(solution.phases, (-1, 0), strict=True))
    of_hit = {
        "approach": before, "departure": -after, "loss": (before**2 - after**2) / 2,
        "impulse": before - after,
    }  # fmt: skip
    total = solution.trajectory.totals["own"]
    assert total == pytest.approx(of_hit[kind] ** 2 + solution.cost, rel=1e-6)


def test_hits_are_counted_by_surface_and_number() -> None:
    integrals = {
        "all": dmoc.impulse("wall"), "second": dmoc.impulse("wall", 2),
        "left": dmoc.impulse("left") * (2 + X),
    }  # fmt: skip
    problem = dmoc.Problem(
        block(integrals), {"x": 0}, {"x": 0}, sequence=["wall", "left", "wall"], steps=12,
        final_time=2, restitution=1.0,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm")
    first, left, last = (c.impulse for c in solution.collisions)
    expected = {"all": first + last, "second": last, "left": left}
    assert solution.solved
    assert solution.trajectory.totals == pytest.approx(expected, rel=1e-7)


def test_a_price_has_derivatives_and_is_checked() -> None:
    problem = there_and_back(
        {"wear": dmoc.impulse("wall") ** 2}, objective=3 * dmoc.total("wear"), steps=20
    )
    solution = dmoc.solve(problem, "ipm")
    free = dmoc.solve(there_and_back({"wear": dmoc.impulse("wall") ** 2}, steps=20), "ipm")
    assert solution.solved and solution.collisions[0].impulse < 0.8 * free.collisions[0].impulse
    slopes = dmoc.sensitivities(problem, solution)
    more, less = (
        dmoc.solve(problem.but(parameters={"m": m}), "ipm", guess=solution).cost
        for m in (1.001, 0.999)
    )
    assert slopes["parameters"]["m"] == pytest.approx((more - less) / 0.002, rel=1e-5)
    wrong = solution.trajectory
    wrong = wrong.__class__(**{**vars(wrong), "totals": {"wear": 1.1 * wrong.totals["wear"]}})
    assert not dmoc.verify(wrong, problem.kernels).passed


def test_a_total_of_hits_alone_has_the_size_of_what_they_add() -> None:
    """A guess hits with some speed, which a thousandfold mass makes a thousandfold impulse."""
    problem = there_and_back({"blow": dmoc.impulse("wall")}, objective=dmoc.total("blow"), steps=10)
    light, heavy = (
        scale_of(p, initial_guesses(p)[0].x).totals[0]
        for p in (problem, problem.but(parameters={"m": 1000.0}))
    )
    assert light > 1 and heavy == pytest.approx(1000 * light)


@pytest.mark.slow
def test_sequences_are_searched_with_bounds_of_hits() -> None:
    problem = there_and_back({"blow": dmoc.impulse("wall")}, (None, P), steps=20)
    found = dmoc.search(problem.but(sequence=()), max_collisions=1, events=["wall"])
    of_word = {node.sequence: node.cost for node in found.nodes}
    assert of_word[("wall",)] == pytest.approx(best(P / (1 + E)), rel=0.02)
    assert dmoc.search(problem.but(sequence=()), max_collisions=1, strategy="propose").nodes


@pytest.mark.slow
def test_landings_and_hits_with_friction_count_their_normal_impulse() -> None:
    integrals = {"blow": dmoc.impulse("floor"), "lost": dmoc.loss("floor")}
    system = coupled().__class__(**{**_fields(coupled()), "integrals": integrals})
    for word in ("floor:slip-", "+floor:slip-"):
        problem = dmoc.Problem(
            system, sequence=[word], restitution=0.5, parameters={"mu": 0.1},
            **thrown((-1.0, -1.0), {"x": 0.0, "y": 0.0}),
        )  # fmt: skip
        solution = dmoc.solve(problem, "ipm", starts=1)
        assert solution.solved, solution.message
        p, v = ([getattr(s, n)[k] for s, k in zip(solution.phases, (-1, 0), strict=True)]
                for n in ("p", "v"))  # fmt: skip
        lost = (p[0] @ v[0] - p[1] @ v[1]) / 2
        expected = {"blow": solution.collisions[0].impulse, "lost": lost}
        assert solution.trajectory.totals == pytest.approx(expected, rel=1e-6)


def _fields(system: dmoc.MechanicalSystem) -> dict[str, Any]:
    return {name: getattr(system, name) for name in system.__dataclass_fields__ if name[0] != "_"}


def test_the_kernel_is_that_of_90_digits() -> None:
    own = dmoc.impulse("wall") * dmoc.approach("wall") + dmoc.departure("left") ** 3 * Y
    own += dmoc.loss("wall", 1) * sp.sin(X) * T
    system = dmoc.MechanicalSystem(
        "moving", [X, Y], M * (X.diff() ** 2 + (2 + sp.cos(X)) * Y.diff() ** 2) / 2, {M: 1.3},
        inputs=[U], forces={X: U}, integrals={"own": own},
        surfaces={"wall": X * Y <= 1 + T**2, "left": -sp.sin(Y) <= X},
    )  # fmt: skip
    errors = {k.kernel: k.error for k in kernel_errors(system, dmoc.build(system))}
    assert {"hit_sum", "hit_sum_jac", "hit_sum_hess"} <= {*errors}
    assert max(errors.values()) < 1e-12


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (lambda: dmoc.impulse("floor"), "hits of 'floor', which is no surface.*wall, left"),
        (lambda: dmoc.impulse("wall") * U, "u.* in a term of hits"),
        (lambda: dmoc.loss("wall") * X.diff(), "in a term of hits: expected"),
        (lambda: dmoc.impulse("wall") * dmoc.impulse("left"), "expected those of one surface"),
        (lambda: dmoc.impulse("wall", 1) * dmoc.loss("wall"), "all or one number"),
        (lambda: dmoc.impulse("wall", 0), "expected a whole number of at least 1"),
        (lambda: dmoc.impulse(3), r"impulse\(3\): expected the name of a surface"),
        (lambda: sp.Abs(dmoc.impulse("wall")), "Abs|kink"),
    ],
)  # fmt: skip
def test_what_adds_nothing_is_refused(value: Any, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        block({"own": value()})


def test_prices_of_hits_belong_into_integrals() -> None:
    with pytest.raises(ModelError, match="impulse"):
        block({}, objective=dmoc.impulse("wall"))


def test_the_derivation_says_what_hits_add() -> None:
    said = str(dmoc.derive(block({"wear": U**2 + dmoc.impulse("wall") ** 2})))
    assert "Each hit of wall adds impulse(wall)**2 to wear" in " ".join(said.split())


def test_a_parameter_and_a_definition_may_be_of_hits_alone() -> None:
    """The price of a blow is nowhere else; what depends on the place is 3 at the wall, x = 1."""
    price, far = sp.Symbol("price"), dynamicsymbols("far")
    system = dmoc.MechanicalSystem(
        "hit_alone", [X], X.diff() ** 2 / 2, {price: 2.0}, inputs=[U], forces={X: U},
        surfaces={"wall": X <= 1}, cost=U**2, definitions={far: X**2 + 2},
        integrals={"blow": dmoc.impulse("wall"), "pain": price * far * dmoc.impulse("wall")},
    )  # fmt: skip
    problem = dmoc.Problem(
        system, {X: 0}, {X: 0, "x_dot": 0}, sequence=["wall"], final_time=1, steps=10
    )
    totals = dmoc.solve(problem, "ipm", verify=False).trajectory.totals
    assert totals["blow"] > 1 and totals["pain"] == pytest.approx(6 * totals["blow"])


def test_an_input_may_have_the_name_of_what_a_hit_has() -> None:
    impulse = dynamicsymbols("impulse")
    system = dmoc.MechanicalSystem(
        "named", [X], X.diff() ** 2 / 2, inputs=[impulse], forces={X: impulse},
        surfaces={"wall": X <= 1}, integrals={"effort": impulse**2},
    )  # fmt: skip
    assert system.integrands["effort"] == impulse**2


def test_a_landing_departs_with_no_more_than_rounding_errors() -> None:
    """A bar falls flat on both ends, whose rates after it are zero but for their last digits."""
    y, a = dynamicsymbols("y a")
    bar = dmoc.MechanicalSystem(
        "flat", [X, y, a], (X.diff() ** 2 + y.diff() ** 2 + a.diff() ** 2 / 12) / 2 - 9.81 * y,
        inputs=[U], forces={a: U},
        surfaces={"left": y >= sp.sin(a) / 2, "right": y >= -sp.sin(a) / 2},
        integrals={"parts": dmoc.departure("left"), "effort": U**2},
        objective=dmoc.total("parts") + dmoc.total("effort"),
    )  # fmt: skip
    problem = dmoc.Problem(
        bar, {X: 0, y: 0.3, a: 0}, {}, sequence=["+left +right"], final_time=0.6, steps=10
    )
    solution = dmoc.solve(problem)
    assert solution.solved, solution.message
