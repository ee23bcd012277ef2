"""The referee of motions: motions in closed form keep the laws, and each law that is broken by
construction is named."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import contact_problems
import numpy as np
import pytest
import several_contacts
import superballs
from pages import ROOT
from referee import Judgement, judge, main
from referee_motion import read_claim
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor, block_system

import dmoc
from dmoc.base.errors import MotionError
from dmoc.codegen.kernels import Array

pytestmark = pytest.mark.slow

T = np.linspace(0.0, 0.5, 51)


@pytest.fixture(scope="module")
def wall() -> dmoc.Problem:
    """A unit mass before a wall at 1 with restitution 0.5."""
    return dmoc.Problem(
        dmoc.build(block_system()),
        start={"x": 0.0, "x_dot": (None, None)},
        bounds={"u": (-2.0, 2.0)},
        restitution=0.5,
    )


@pytest.fixture(scope="module")
def floor() -> dmoc.Problem:
    """A unit mass on a floor, mu g = 5, pushed along it."""
    system = block_on_floor("block_on_floor", 1.0, 10.0, 0.5)
    return dmoc.Problem(
        dmoc.build(system),
        start={"x": 0.0, "y": 0.0, "x_dot": (None, None)},
        restitution=0.0,
    )


Judge = Callable[..., Judgement]


@pytest.fixture
def judged(tmp_path: Path) -> Judge:
    def judged(
        problem: dmoc.Problem,
        claimed: float | None = None,
        form: str | None = None,
        **columns: Array,
    ) -> Judgement:
        path = tmp_path / "motion.csv"
        rows = zip(*np.broadcast_arrays(*columns.values()), strict=True)
        lines = [",".join(columns), *(",".join(map(repr, map(float, row))) for row in rows)]
        path.write_text("\n".join(lines))
        return judge(problem, read_claim(path, problem, form), claimed)

    return judged


def kinds(judgement: Judgement) -> set[str]:
    return {v.kind for v in judgement.violations}


def bounce(after: float) -> dict[str, Array]:
    """At 2 m/s to the wall, and back from it with another speed."""
    t = np.concatenate([T, T + 0.5])
    x = np.concatenate([2 * T, 1 + after * T])
    return {"t": t, "x": x, "x_dot": np.repeat([2.0, after], len(T)), "u": np.zeros(len(t))}


def test_what_periodic_says_is_judged(wall: dmoc.Problem, judged: Judge) -> None:
    """From x = 0 at 2 m/s to x = 0.5 at -1 m/s."""
    kept = wall.but(periodic={"x_dot": {"x_dot": -0.5}, "x": {"x": 1.0, "x_dot": 0.25}})
    assert judged(kept, **bounce(-1.0)).agrees
    missed = judged(wall.but(periodic={"x_dot": "-x_dot"}), **bounce(-1.0))
    assert [(v.kind, v.name) for v in missed.violations] == [("periodic", "x_dot")]
    assert missed.violations[0].amount == pytest.approx(1.0)


def test_a_bounce_with_the_restitution_of_the_wall_keeps_the_laws(
    wall: dmoc.Problem, judged: Judge
) -> None:
    judgement = judged(wall, **bounce(-1.0))
    assert judgement.agrees and not judgement.violations
    assert judgement.events == ("hits wall at 0.5 s",)


@pytest.mark.parametrize(("after", "broken"), [(-1.5, {"impact"}), (-2.4, {"impact", "energy"})])
def test_an_impact_beside_its_law_is_named(
    wall: dmoc.Problem, judged: Judge, after: float, broken: set[str]
) -> None:
    judgement = judged(wall, **bounce(after))
    assert kinds(judgement) == broken and not judgement.agrees
    (impact,) = [v for v in judgement.violations if v.kind == "impact"]
    assert impact.amount == pytest.approx(-1.0 - after)


def test_a_wall_that_is_entered_is_named(wall: dmoc.Problem, judged: Judge) -> None:
    judgement = judged(wall, t=4 * T, x=4 * T, x_dot=1 + 0 * T, u=0 * T)
    (entered,) = [v for v in judgement.violations if v.kind == "penetration"]
    assert entered.amount == pytest.approx(1.0)


def test_linear_inputs_and_their_cost_are_integrated(wall: dmoc.Problem, judged: Judge) -> None:
    t = 2 * T
    columns = {"t": t, "x": t**3 / 6, "x_dot": t**2 / 2, "u": t}
    judgement = judged(wall, 1 / 6, "linear", **columns)
    assert judgement.agrees and judgement.cost == pytest.approx(1 / 6, rel=1e-12)
    assert "as recomputed" in judgement.lines[1]
    held = judged(wall, **columns)
    assert held.cost == pytest.approx((t[:-1] ** 2).sum() * 0.01, rel=1e-12)


def test_limits_and_goals_that_are_missed_are_named(wall: dmoc.Problem, judged: Judge) -> None:
    problem = wall.but(goal={"x": 0.75, "x_dot": 1.0}, final_time=1.0)
    judgement = judged(problem, t=T, x=1.5 * T**2, x_dot=3 * T, u=3 + 0 * T)
    amounts = {(v.kind, v.name): v.amount for v in judgement.violations}
    assert amounts == pytest.approx({
        ("goal", "x"): 0.375, ("goal", "x_dot"): 0.5, ("input", "u"): 1.0, ("final time", "t"): 0.5,
    })  # fmt: skip
    assert judgement.goal_missed == pytest.approx({"x": 0.375, "x_dot": 0.5})


@pytest.fixture(scope="module")
def measured() -> dmoc.Problem:
    """The mass with two quantities, twice its place and its power, and an objective."""
    x, u = dynamicsymbols("x u")
    lead = x - 1.5 * dynamicsymbols._t
    system = replace(
        block_system("measured"),
        quantities={"lead": lead, "double": 2 * x, "power": u * x.diff()},
        objective=dmoc.final_time,
    )
    return dmoc.Problem(dmoc.build(system), start={"x": 0.0, "x_dot": (None, None), "double": 0.0})


def test_quantities_at_ends_and_along_the_way_are_judged(
    measured: dmoc.Problem, judged: Judge
) -> None:
    """x = 1.5 t^2 until 0.5 s: 2 x is 0.75, x - 1.5 t is -0.375, power 9 t, velocity 3 t."""
    motion = {"t": T, "x": 1.5 * T**2, "x_dot": 3 * T, "u": 3 + 0 * T}
    free = judged(measured, **motion, double=3 * T**2)
    assert free.agrees and any("objective is not recomputed" in note for note in free.notes)
    problem = measured.but(
        goal={"double": 0.5},
        periodic=["lead"],
        bounds={"power": (None, 4.0), "x_dot": (None, 1.25)},
    )
    amounts = {(v.kind, v.name): v.amount for v in judged(problem, **motion).violations}
    assert amounts == pytest.approx({
        ("goal", "double"): 0.25, ("periodic", "lead"): 0.375, ("quantity", "power"): 0.5,
        ("velocity", "x_dot"): 0.25,
    })  # fmt: skip


def test_frozen_time_is_cut_out_and_its_cost_is_told(wall: dmoc.Problem, judged: Judge) -> None:
    """The velocity turns round in 0.2 s of numerical time, with the input 1 held on."""
    s = np.linspace(0.0, 0.2, 11)
    t = np.concatenate([T, 0.5 + 0 * s, T + 0.5])
    clock = np.concatenate([T, 0.5 + s, 0.7 + T])
    v_0 = (1 - 0.125) / 0.5
    v_1 = -(v_0 + 0.5) / 2
    x = np.concatenate([v_0 * T + T**2 / 2, 1 + 0 * s, 1 + v_1 * T + T**2 / 2])
    v = np.concatenate([v_0 + T, np.linspace(v_0 + 0.5, v_1, 11), v_1 + T])
    judgement = judged(wall, 0.6, t=t, numerical_time=clock, x=x, x_dot=v, u=np.ones(len(t)))
    assert judgement.agrees, judgement.lines
    assert judgement.cost == pytest.approx(0.5) and judgement.frozen_cost == pytest.approx(0.1)
    assert "counts 0.1 of frozen time" in judgement.lines[1]
    assert [f["seconds"] for f in judgement.frozen] == pytest.approx([0.2])


def test_a_surface_that_the_sequence_lands_on_is_plastic(judged: Judge) -> None:
    """A drop from 0.2 that stays: the restitution is that of hits that are released."""
    y = dynamicsymbols("y")
    system = dmoc.MechanicalSystem(
        "dropped", [y], y.diff() ** 2 / 2 - 10 * y, {}, surfaces={"floor": y >= 0}
    )
    problem = dmoc.Problem(dmoc.build(system), start={"y": 0.2}, sequence=["+floor"])
    t = np.linspace(0.0, 0.2, 21)
    down = {"t": t, "y": 0.2 - 5 * t**2, "y_dot": -10 * t}
    rest = {"t": t + 0.2, "y": 0 * t, "y_dot": 0 * t}
    motion = {name: np.concatenate([down[name], rest[name]]) for name in down}
    assert judged(problem, **motion).agrees
    assert kinds(judged(problem.but(sequence=[]), **motion)) == {"impact"}


def slide(a: float) -> dict[str, Array]:
    """Along the floor at 3 m/s, with an acceleration that no input makes."""
    return {
        "t": T, "x": 3 * T + a * T**2 / 2, "y": 0 * T, "x_dot": 3 + a * T, "y_dot": 0 * T,
        "u": 0 * T,
    }  # fmt: skip


def test_sliding_with_the_friction_of_the_floor_keeps_the_laws(
    floor: dmoc.Problem, judged: Judge
) -> None:
    assert judged(floor, **slide(-5.0)).agrees


@pytest.mark.parametrize(
    ("a", "broken", "amount"),
    [(-5.9, "cone", 0.9), (-3.0, "slip", 2.0), (4.0, "slip", 4.0)],
)
def test_friction_beside_its_law_is_named(
    floor: dmoc.Problem, judged: Judge, a: float, broken: str, amount: float
) -> None:
    judgement = judged(floor, **slide(a))
    assert broken in kinds(judgement) and not judgement.agrees
    assert ("energy" in kinds(judgement)) == (a > 0)
    worst = max(v.amount for v in judgement.violations if v.kind == broken)
    assert worst == pytest.approx(amount, rel=1e-6)


def test_a_motion_that_hovers_is_pushed_at_a_distance(floor: dmoc.Problem, judged: Judge) -> None:
    hovers = {"x": T, "y": 0.3 + 0 * T, "x_dot": 1 + 0 * T, "y_dot": 0 * T}
    (push,) = judged(
        floor.but(start={"x": 0, "y": 0.3, "x_dot": 1}), t=T, u=0 * T, **hovers
    ).violations
    assert (push.kind, push.name) == ("distance", "floor") and push.amount == pytest.approx(0.3)


def test_rounding_errors_of_a_block_at_rest_are_no_energy(
    floor: dmoc.Problem, judged: Judge
) -> None:
    still = {"x": 0.5 + 0 * T, "y": 0 * T, "x_dot": 1e-26 * T, "y_dot": 1e-24 * T**2}
    problem = floor.but(start={"x": 0.5, "y": 0.0}, contacts=["floor"])
    assert judged(problem, t=T, u=0 * T, **still).agrees


def test_a_box_stands_and_slides_on_two_corners(tmp_path: Path) -> None:
    """Both corners rub along one line: how they share the friction is open."""
    problem = several_contacts.pushed()
    solution = dmoc.solve(problem, "ipm", starts=1)
    judgement = judge(problem, read_claim(solution.to_csv(tmp_path / "box.csv"), problem))
    assert judgement.agrees, judgement.lines
    assert judgement.cost == pytest.approx(several_contacts.PUSHED, rel=1e-2)


def test_linear_inputs_of_a_solution_of_one_phase_are_linear(tmp_path: Path) -> None:
    """A block that slides all along, of 2.09375 in closed form."""
    problem = contact_problems.sliding(20)
    solution = dmoc.solve(problem, "ipm", starts=1)
    judgement = judge(problem, read_claim(solution.to_csv(tmp_path / "block.csv"), problem))
    assert judgement.agrees, judgement.lines
    assert judgement.cost == pytest.approx(2.09375, rel=2e-3)


def test_the_cost_of_a_motion_that_cannot_be_simulated_is_unknown(judged: Judge) -> None:
    """A hit with tangential restitution beside a wall that touches has no law."""
    walled = superballs.pushed(surfaces={"floor": superballs.z >= 0.1, "wall": superballs.x >= 0})
    problem = dmoc.Problem(dmoc.build(walled), start={"x": 0, "z": 1.1, "a": 0}, restitution=0.5)
    falls = {"x": 0 * T, "z": 1.1 - 5 * T**2, "a": 0 * T}
    falls |= {"x_dot": 0 * T, "z_dot": -10 * T, "a_dot": 0 * T}
    judgement = judged(problem, t=T, u=0 * T, **falls)
    assert np.isnan(judgement.cost) and "unknown" in judgement.lines[0]


def test_a_contact_that_pulls_is_named(judged: Judge) -> None:
    y, u = dynamicsymbols("y u")
    system = dmoc.MechanicalSystem(
        "lifted", [y], y.diff() ** 2 / 2 - 10 * y, {}, [u], {y: u}, surfaces={"floor": y >= 0},
        cost=u**2,
    )  # fmt: skip
    problem = dmoc.Problem(dmoc.build(system), start={"y": 0.0}, restitution=0.0)
    (pull,) = judged(problem, t=T, y=0 * T, y_dot=0 * T, u=13 + 0 * T).violations
    assert (pull.kind, pull.name) == ("pull", "floor") and pull.amount == pytest.approx(3.0)


def test_an_unstable_motion_is_followed_in_windows(judged: Judge) -> None:
    """x = exp(-20 t) of x'' = 400 x with rounding errors, which grow by exp(20) in a second."""
    x, u = dynamicsymbols("x u")
    system = dmoc.MechanicalSystem(
        "unstable", [x], x.diff() ** 2 / 2 + 200 * x**2, {}, [u], {x: u}, cost=u**2
    )
    problem = dmoc.Problem(dmoc.build(system), start={"x": 1.0, "x_dot": (None, None)})
    t = np.linspace(0.0, 1.0, 201)
    place = np.exp(-20 * t).round(6)
    rate = -20 * place
    rate[0] += 1e-4
    judgement = judged(problem, t=t, x=place, x_dot=rate, u=0 * t)
    assert judgement.followed == "piecewise" and judgement.agrees, judgement.lines
    assert len(judgement.windows) == 20 and "open loop it is" in judgement.notes[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,x,v,u\n0,0,0,0\n1,0,0,0", "unknown column 'v'"),
        ("t,x\n0,0\n1,0", "no column 'u'"),
        ("t,x,u\n0,0,0\n1,0,0\n0.5,0,0", "falls from 1 in row 2 to 0.5"),
        ("t,x,u\n0,0,0\n1,,0", "x in row 2 is ''"),
        ("t [ms],x,u\n0,0,0\n1,0,0", "is in ms: convert it to s"),
        ("t,x,u\n0,0,0\n0,0,0", "takes time"),
        ("t,x,u,u\n0,0,0,0\n1,0,0,0", "stands twice"),
        ("# inputs: cubic\nt,x,u\n0,0,0\n1,0,0", "expected held or linear"),
        ("", "no column 't'"),
        ("t,x,u\n0,0,0\n1,1e308,0", "x in row 2 is '1e308': expected a finite number, at most 1e"),
        ("t,x,u\n0,0,0\n1,0,-1e101", "u in row 2 is '-1e101'"),
        ("t,x,u\n0,0,0\n1,inf,0", "x in row 2 is 'inf'"),
        ("t,x,u\n0,0,0\n1," + 131_073 * "0" + ",0", "is no table: field larger than field limit"),
    ],
)
def test_a_table_that_does_not_fit_is_refused_in_a_sentence(
    wall: dmoc.Problem, tmp_path: Path, text: str, words: str
) -> None:
    path = tmp_path / "motion.csv"
    path.write_text(text)
    with pytest.raises(MotionError, match=words):
        read_claim(path, wall)


def test_a_solution_keeps_the_laws_by_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from dmoc.models.registry import find

    stated = find("puck_table")
    problem = dmoc.Problem(stated.kernels(), **stated.defaults).but(
        sequence=["east", "north", "west"]
    )
    solution = dmoc.solve(problem, "ipm", starts=1)
    path = solution.to_csv(tmp_path / "puck.csv")
    assert main(["puck_table", str(path), "--claimed", str(solution.cost), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["cost"] == pytest.approx(solution.cost, rel=1e-6) and not printed["violations"]
    assert main([f"{ROOT}/examples/puck.py:system", str(path)]) == 2
    assert "error:" in capsys.readouterr().err


@pytest.mark.parametrize(("over", "kept"), [(3e-4, True), (1e-2, False)])
def test_a_path_constraint_may_be_exceeded_by_the_error_of_a_mesh(
    judged: Judge, over: float, kept: bool
) -> None:
    """It moves on beyond a limit of 1 in its square."""
    x, u = dynamicsymbols("x u")
    system = dmoc.MechanicalSystem(
        "limited", [x], x.diff() ** 2 / 2, {}, [u], {x: u}, cost=u**2,
        path_constraints={"limit": x**2 <= 1},
    )  # fmt: skip
    problem = dmoc.Problem(dmoc.build(system), start={"x": 0.0, "x_dot": (None, None)})
    way = {"x": 2 * T * (1 + over / 2), "x_dot": 2 + over + 0 * T}
    judgement = judged(problem, t=T, u=0 * T, **way)
    assert judgement.agrees == kept and kinds(judgement) == (set() if kept else {"path"})
