"""Problems without their sequence: they are stated, run and told."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import nosnoc_problems
import pytest
import twenty
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from systems import block_system
from twenty_problems import CASES

import dmoc

pytestmark = pytest.mark.slow

CASE = {case.name: case for case in CASES}


def test_twenty_have_two_contacts_or_events_and_more() -> None:
    assert len(CASES) == len(CASE) == 23
    assert all(case.cost > 0 and case.source for case in CASES)
    several = [
        len({*case.system().surfaces, *case.system().tangents}) > 1
        or sum(len(word.split()) for word in case.word) > 1
        for case in CASES
    ]
    assert sum(several) == 20


def test_what_only_hits_move_is_struck_in_the_right_order() -> None:
    """Of all motions, random ones are hardly ever folded at the bumper, then at the wall.  The hits
    fix all times and speeds; before and after them the cart's motion is a cubic."""
    result = dmoc.search(CASE["bank"].problem(), strategy="propose")
    assert result.best is not None and result.best.sequence == ("bumper", "wall")
    e, after = 0.9, 2 / 0.9 / 1.9  # cart's speed at the bumper: the block leaves the wall at 1 m/s
    first = 2.0 - 0.5 * e - 0.8
    rest = 2.0 - first
    struck = 4 * after**2 / first - 6 * after / first**2 + 3 / first**3
    back = 3 * (-0.8 - (1 - e) / 2 * after * rest) ** 2 / rest**3
    assert struck + back == pytest.approx(CASE["bank"].cost, rel=1e-6)
    assert result.best.cost == pytest.approx(struck + back, rel=1e-4)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_words_name_what_the_system_may_touch(case: twenty.Case) -> None:
    system = case.system()
    touching = {*system.surfaces, *system.tangents}
    parts = [part for word in (*case.word, *case.contacts) for part in word.split()]
    assert {part.lstrip("+-").partition(":")[0] for part in parts} <= touching


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_problem_is_stated(case: twenty.Case) -> None:
    assert case.problem().sequence == () and case.named.sequence == case.word


def test_a_run_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Proposals find the closed form of the block; what is written is not solved again."""
    (record,) = twenty.every(["block"], ["propose"], 30.0, tmp_path)
    assert record["agrees"] and record["cost"] == pytest.approx(CASE["block"].cost, rel=1e-3)
    monkeypatch.setattr(twenty, "run", None)
    assert twenty.every(["block"], ["propose"], 30.0, tmp_path) == [record]


def test_nosnoc_that_is_missing_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nosnoc_problems, "version", lambda: None)
    (record,) = twenty.unit("puck", "nosnoc", 1.0, tmp_path)
    table = twenty.section([{"problem": "puck", "tool": "nosnoc", **record}], 1.0).markdown()
    assert "pip install nosnoc==0.2.0" in table and "not installed" in table


@pytest.mark.parametrize("e", [1.0, 0.5, 0.0])
def test_behind_a_wall_the_clock_stands_while_the_law_of_impact_comes_about(e: float) -> None:
    system = block_system()
    problem = dmoc.Problem(dmoc.build(system), {"x": 0.0}, restitution=e, final_time=1.0)
    stated = nosnoc_problems.NosnocStatement(system, problem, nosnoc_problems.SETTINGS[0])
    _, motions = stated.regions()
    behind = ca.Function("behind", [stated.x], [ca.substitute(motions[:, -1], stated.u, 1.0)])

    way = solve_ivp(
        lambda t, x: behind(ca.DM(x)).full().ravel(), (0, 1.5), [1.0, 2.0, 0.3, 0.7], rtol=1e-10,
        atol=1e-12, dense_output=True,
    )  # fmt: skip
    over = brentq(lambda t: way.sol(t)[0] - 1.0 if e else way.sol(t)[1], 1e-3, 1.5)
    assert way.sol(over)[1] == pytest.approx(-2.0 * e, abs=1e-6)
    assert way.sol(over)[2:] == pytest.approx([0.3, 0.7])


def test_the_table_tells_what_is_best_and_what_is_refused() -> None:
    records = [
        {"problem": "discs", "tool": "propose", "cost": 59.1, "agrees": True, "word": ["discs"],
         "contacts": [], "often": [7, 26], "seconds": 1.0, "cpu": 0.5, "status": "complete"},
        {"problem": "discs", "tool": "tree", "cost": 70.0, "agrees": False, "word": [],
         "contacts": [], "refused": "impact at 1 s", "status": "complete"},
        {"problem": "discs", "tool": "nosnoc", "status": "more than 60 s"},
        {"problem": "puck", "tool": "tree", "status": "stopped", "seconds": 60.0, "cpu": 60.0},
    ]  # fmt: skip
    table = twenty.section(records, 60.0).markdown()
    texts = [
        "| 59.1*", "7 of 26", "(70)", "more than 60 s", "none", "2038.85", "counts frozen time",
        "discs, tree: impact at 1 s", "CRISP, push box",
    ]  # fmt: skip
    assert not [text for text in texts if text not in table]
