"""The search over sequences: the best of all against a closed form, verdicts with evidence, workers, budgets, journal."""

from __future__ import annotations

import itertools
import json
import multiprocessing
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from systems import block_system

import dmoc
from dmoc.cli import main
from dmoc.codegen.kernels import Kernels
from dmoc.errors import SearchError
from dmoc.registry import find
from dmoc.sequences.engine import Progress, SearchResult
from dmoc.sequences.inner import extended
from dmoc.sequences.journal import Journal
from dmoc.sequences.nodes import Node, Verdict
from dmoc.trajectory import input_times

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def puck() -> dmoc.Problem:
    reference = find("puck_table")
    return dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 30})


@pytest.fixture(scope="module")
def found(puck: dmoc.Problem) -> SearchResult:
    return dmoc.search(puck, 3)


@pytest.fixture
def weak(block: Kernels) -> dmoc.Problem:
    """The block comes to 1/2 in the time there is: the wall is out of reach."""
    return dmoc.Problem(block, start={"x": 0.0}, goal={"x": 0.2}, steps=20, bounds={"u": (-1, 1)}, final_time=(None, 1.0))


def unfolded_cost(sequence: tuple[str, ...]) -> float:
    """Cost of the free motion to the goal's mirror image.

    For each axis, with velocities v0 and v1 at the ends, distance D and time T: 2 (v0^2 + v0 v1 + v1^2)/T - 6 (v0 + v1) D/T^2 + 6 D^2/T^3.
    """
    total, T = 0.0, 2.0
    for low, high, (q0, v0), (q1, v1) in (("west", "east", (0.3, 1.5), (0.4, 1.2)), ("south", "north", (0.2, 0.4), (0.7, -0.3))):
        sign = 1.0
        for wall in reversed([w for w in sequence if w in (low, high)]):
            q1 = -q1 if wall == low else 2.0 - q1
            sign = -sign
        D = q1 - q0
        v1 *= sign
        total += 2 * (v0**2 + v0 * v1 + v1**2) / T - 6 * (v0 + v1) * D / T**2 + 6 * D**2 / T**3
    return total


def outline(result: SearchResult) -> list[tuple[Any, ...]]:
    return [(n.sequence, n.verdict, n.cost, n.phases, n.minima, tuple(n.starts)) for n in result.nodes]


# The answer ----------------------------------------------------------------------------------------------------------


def test_the_best_sequence_is_that_of_the_closed_form(puck: dmoc.Problem, found: SearchResult) -> None:
    assert found.complete and len(found.nodes) == 1 + 4 + 16 + 64
    assert found.best is not None and found.best.sequence == ("east", "north", "west")
    assert found.best.verdict is Verdict.OPTIMAL
    assert unfolded_cost(found.best.sequence) == pytest.approx(0.415, rel=1e-12)
    assert found.best.cost == pytest.approx(0.415, rel=1e-3)
    # No unfolded motion of at most three collisions costs less, whether its order of hits is possible or not.
    walls = ("west", "east", "south", "north")
    every = [s for d in range(4) for s in itertools.product(walls, repeat=d)]
    assert min(unfolded_cost(s) for s in every) == pytest.approx(0.415, rel=1e-12)
    # The sequence that the problem comes with, solved alone, ends in a far worse motion.
    assert dmoc.solve(puck, method="ipm", verify=False).cost > 2 * found.best.cost


def test_nodes_cost_what_a_separate_solve_costs(puck: dmoc.Problem, found: SearchResult) -> None:
    for node in found.nodes[:21:3]:
        durations = [(0.02, None)] * (len(node.sequence) + 1) if node.sequence else None
        alone = dmoc.solve(puck.but(sequence=node.sequence, durations=durations), method="ipm", iterations=200, verify=False)
        automatic = next(s for s in node.starts if s.name == "automatic")
        if alone.status == "solved" and automatic.status == "solved":
            assert automatic.cost == pytest.approx(alone.cost, rel=1e-9)
        if node.cost is not None and alone.status == "solved":
            assert node.cost <= alone.cost * (1 + 1e-9)


def test_every_node_has_evidence(found: SearchResult) -> None:
    for node in found.nodes:
        assert node.evidence and node.starts and node.seconds > 0 and node.attempts == 1
        assert (node.cost is None) == (not node.minima)
        if node.cost is not None:
            assert node.cost in node.minima and len(node.phases) == len(node.sequence) + 1
    assert sum(found.counts.values()) == len(found.nodes)
    assert any("shortest phase" in note for note in found.notes)
    text = json.dumps(found.to_dict())
    assert json.loads(text)["best"] == ["east", "north", "west"]


def test_unreachable_prunes_and_says_why(weak: dmoc.Problem) -> None:
    result = dmoc.search(weak, 4)
    assert [(n.sequence, n.verdict) for n in result.nodes] == [((), Verdict.OPTIMAL), (("wall",), Verdict.UNREACHABLE)]
    evidence = " | ".join(result.nodes[1].evidence)
    assert "final time <= 1 s is violated by 0.424 s" in evidence  # sqrt(2) to the wall, and the shortest phase after it
    assert "the shortest time at full input is about 1.41 s, the bounds allow 0.99 s" in evidence


def test_infeasible_is_not_unreachable(block: Kernels) -> None:
    """The wall can be hit, and the goal cannot be reached after it: the children are looked at."""
    problem = dmoc.Problem(block, start={"x": 0.0}, goal={"x": -5.0}, steps=20, bounds={"u": (-3, 3)}, final_time=(None, 1.0))
    result = dmoc.search(problem, 2)
    assert [n.verdict for n in result.nodes] == [
        Verdict.INFEASIBLE,
        Verdict.INFEASIBLE,
        Verdict.UNREACHABLE,
    ]  # 2 * 0.82 s and more
    assert result.best is None
    assert all("the goal of x is missed" in n.evidence[0] for n in result.nodes[:2])


def test_more_collisions_may_still_pay(seed: dmoc.Problem) -> None:
    result = dmoc.search(seed.but(steps=40), 1)
    assert result.best is None or len(result.best.sequence) == 1
    deeper = dmoc.search(seed.but(steps=60), 2)
    assert deeper.best is not None and deeper.best.sequence == ("left", "left")
    assert any("more may cost less" in note for note in deeper.notes)


def test_seeded_starts_show_minima(puck: dmoc.Problem) -> None:
    a, b = (dmoc.search(puck, 1, starts=2, seed=3, surfaces=["east"]) for _ in range(2))
    assert outline(a) == outline(b)
    assert [s.name for s in a.nodes[1].starts if s.name.startswith("seeded")] == ["seeded 1", "seeded 2"]


def test_the_parents_motion_is_bent_to_the_surface(puck: dmoc.Problem) -> None:
    parent = dmoc.solve(puck.but(sequence=[]), method="ipm", verify=False)
    child = puck.but(sequence=["east"])
    x = extended(parent, child)
    from dmoc.nlp.layout import Layout

    lay = Layout.of(child)
    assert np.isfinite(x).all()
    assert x[lay.index_q[30, 0]] == pytest.approx(1.0)
    assert x[lay.index_h] @ np.array(lay.steps) == pytest.approx(2.0)


def test_a_collision_that_must_be_followed_by_another_is_reachable(puck: dmoc.Problem) -> None:
    """A fast puck under weak forces hits the west wall after the east wall, like it or not: (east) has no motion, (east, west) has."""
    fast = puck.but(
        start={"x": 0.3, "y": 0.5, "x_dot": 3.0, "y_dot": 0.0},
        goal={},
        final_time=0.8,
        steps=10,
        bounds={"f_x": (-0.2, 0.2), "f_y": (-0.2, 0.2)},
    )
    result = dmoc.search(fast, 2, surfaces=["east", "west"])
    verdicts = {n.sequence: n.verdict for n in result.nodes}
    assert verdicts["east",] is Verdict.INFEASIBLE
    assert verdicts["east", "west"] in (Verdict.OPTIMAL, Verdict.UNVERIFIED)


def test_solutions_can_be_checked_again(found: SearchResult) -> None:
    assert found.best is not None and found.best.solution is not None
    assert found.best.solution.verify().passed


# Strategies and budgets ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("strategy", ["best-first", "beam"])
def test_strategies_find_the_same_best_with_fewer_nodes(puck: dmoc.Problem, found: SearchResult, strategy: str) -> None:
    result = dmoc.search(puck, 3, strategy=strategy, beam=4, max_nodes=60 if strategy == "best-first" else None)
    assert result.best is not None and found.best is not None
    assert result.best.sequence == found.best.sequence
    assert len(result.nodes) < len(found.nodes) and not result.complete and result.notes


def test_budgets_end_the_search_and_keep_the_best(puck: dmoc.Problem) -> None:
    few = dmoc.search(puck, 3, max_nodes=5)
    assert len(few.nodes) == 5 and not few.complete and "limit of 5 nodes" in few.notes[0]
    begin = time.perf_counter()
    short = dmoc.search(puck, 3, seconds=0.5)
    assert time.perf_counter() - begin < 5 and "time of 0.5 s" in short.notes[0] and short.nodes


def test_an_interruption_returns_what_was_found(puck: dmoc.Problem) -> None:
    seen: list[Progress] = []

    def interrupt(p: Progress) -> None:
        seen.append(p)
        if len(seen) == 4:
            raise KeyboardInterrupt

    result = dmoc.search(puck, 3, progress=interrupt)
    assert len(result.nodes) == 4 and result.best is not None and "interrupted" in result.notes[0]
    assert seen[-1].best is not None and sum(seen[-1].counts.values()) == 4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"max_collisions": -1}, "at least 0"),
        ({"max_collisions": 40}, "at most 12"),
        ({"strategy": "random"}, "exhaustive, best-first, beam"),
        ({"surfaces": ["up"]}, "unknown surface 'up'"),
        ({"workers": 0}, "at least 1"),
        ({"method": "newton"}, "slsqp"),
        ({"resume": True}, "name it"),
        ({"node_seconds": 0.0}, "positive"),
        ({"shortest_phase": -1.0}, "0 or more"),
        ({"max_nodes": 0}, "at least 1"),
        ({"max_nodes": 2.5}, "whole number"),
        ({"seconds": -5.0}, "positive"),
        ({"seconds": float("nan")}, "positive"),
        ({"seed": -1}, "at least 0"),
        ({"surfaces": ["east", "east"]}, "each surface once"),
        ({"surfaces": []}, "at least one of"),
        ({"surfaces": "east"}, "expected a list"),
    ],
)
def test_wrong_arguments_are_refused(puck: dmoc.Problem, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(SearchError, match=message):
        dmoc.search(puck, **{"max_collisions": 1, **arguments})


def test_problems_that_cannot_be_searched_are_refused(puck: dmoc.Problem) -> None:
    with pytest.raises(SearchError, match="one number for every phase"):
        dmoc.search(puck.but(steps=[20, 20, 20, 20]))
    with pytest.raises(SearchError, match="fewer steps or collisions"):
        dmoc.search(puck.but(steps=300), 3, method="slsqp")
    with pytest.raises(SearchError, match="shortest_phase"):
        dmoc.search(puck.but(durations=[(0.1, None)] * 4))


# Workers -------------------------------------------------------------------------------------------------------------


def test_the_answer_does_not_depend_on_the_workers(puck: dmoc.Problem) -> None:
    one = dmoc.search(puck, 2)
    assert outline(dmoc.search(puck, 2, workers=2)) == outline(one)
    with ThreadPoolExecutor(1) as pool:
        assert outline(dmoc.search(puck, 2, executor=pool)) == outline(one)


def test_a_worker_that_dies_costs_an_attempt(puck: dmoc.Problem) -> None:
    killed = threading.Event()

    def kill(p: Progress) -> None:
        if sum(p.counts.values()) == 3 and not killed.is_set():
            killed.set()
            multiprocessing.active_children()[0].kill()

    result = dmoc.search(puck, 2, workers=2, progress=kill)
    assert killed.is_set() and result.complete
    assert outline(result) == outline(dmoc.search(puck, 2))
    assert 1 <= sum(n.attempts == 2 for n in result.nodes) <= 2


def test_workers_that_die_between_two_nodes_lose_nothing(puck: dmoc.Problem) -> None:
    def kill(p: Progress) -> None:
        if sum(p.counts.values()) == 1:
            for child in multiprocessing.active_children():
                child.kill()
            time.sleep(0.5)

    assert len(dmoc.search(puck, 1, workers=2, progress=kill).nodes) == 5


def test_workers_do_not_outlive_the_search(tmp_path: Path) -> None:
    journal = tmp_path / "journal.sqlite"
    running = subprocess.Popen(
        command("--workers", "2", "--journal", str(journal)),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and _count(journal) < 3:
        time.sleep(0.02)
    running.kill()
    running.wait()
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline and _session(running.pid):
        time.sleep(0.1)
    assert not _session(running.pid)


def _session(leader: int) -> list[int]:
    """Living processes of a session."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == leader and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found


def test_a_broken_executor_ends_the_search_with_what_there_is(puck: dmoc.Problem) -> None:
    pool = ThreadPoolExecutor(1)

    def close(p: Progress) -> None:
        pool.shutdown(wait=False)

    result = dmoc.search(puck, 2, executor=pool, progress=close)
    assert len(result.nodes) == 1 and not result.complete and "takes no more work" in result.notes[0]


def test_an_error_in_a_node_is_its_answer(puck: dmoc.Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    import dmoc.sequences.inner as inner

    def fail(*_: Any, **__: Any) -> Any:
        raise ZeroDivisionError("by chance")

    monkeypatch.setattr(inner, "initial_guesses", fail)
    result = dmoc.search(puck, 1)
    assert {n.verdict for n in result.nodes} == {Verdict.FAILED} and len(result.nodes) == 5
    assert "ZeroDivisionError: by chance" in result.nodes[0].evidence[0]


class Flaky(Executor):
    """Fails the first ``times`` submissions of one sequence."""

    def __init__(self, sequence: tuple[str, ...], times: int) -> None:
        self.sequence, self.times = sequence, times

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if args[0].sequence == self.sequence and self.times > 0:
            self.times -= 1
            future.set_exception(ConnectionError("lost"))
        else:
            future.set_result(fn(*args, **kwargs))
        return future


def test_a_lost_node_is_tried_once_more_and_then_recorded(puck: dmoc.Problem) -> None:
    once = dmoc.search(puck, 1, executor=Flaky(("east",), 1))
    assert next(n for n in once.nodes if n.sequence == ("east",)).attempts == 2
    twice = dmoc.search(puck, 1, executor=Flaky(("east",), 2))
    lost = next(n for n in twice.nodes if n.sequence == ("east",))
    assert lost.verdict is Verdict.FAILED and lost.attempts == 2 and "ConnectionError: lost" in lost.evidence[0]
    assert len(twice.nodes) == 5


def test_a_node_over_its_time_is_tried_once_more(puck: dmoc.Problem) -> None:
    result = dmoc.search(puck, 0, node_seconds=1e-6)
    assert result.nodes[0].verdict is Verdict.FAILED and result.nodes[0].attempts == 2
    assert "time_limit" in result.nodes[0].evidence[0]


def test_a_cluster_of_two_processes() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples" / "search_dask.py")], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "2 workers, 21 sequences" in done.stdout and "best: east, west" in done.stdout


# Journal -------------------------------------------------------------------------------------------------------------


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "dmoc", "search", "puck_table", "--steps", "30", "--max-collisions", "2", *arguments]


def test_a_killed_search_goes_on(tmp_path: Path, puck: dmoc.Problem) -> None:
    journal = tmp_path / "journal.sqlite"
    running = subprocess.Popen(command("--journal", str(journal)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and _count(journal) < 4:
        time.sleep(0.02)
    running.send_signal(signal.SIGKILL)
    running.wait()
    before = _seconds(journal)
    assert 4 <= len(before) < 21
    done = subprocess.run(command("--journal", str(journal), "--resume", "--json", "-"), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert len(result["nodes"]) == 21 and result["complete"]
    for node in result["nodes"]:
        if tuple(node["sequence"]) in before:
            assert node["seconds"] == before[tuple(node["sequence"])]  # not solved again
    plain = dmoc.search(puck, 2)
    assert [n["cost"] for n in result["nodes"]] == pytest.approx([n.cost for n in plain.nodes], rel=1e-12)


def _count(journal: Path) -> int:
    return len(_seconds(journal)) if journal.exists() else 0


def _seconds(journal: Path) -> dict[tuple[str, ...], float]:
    try:
        database = sqlite3.connect(journal)
        rows = [json.loads(r) for (r,) in database.execute("SELECT summary FROM nodes")]
        database.close()
    except sqlite3.DatabaseError:
        return {}
    return {tuple(r["sequence"]): r["seconds"] for r in rows}


def test_ctrl_c_ends_the_command_with_the_best_so_far(tmp_path: Path) -> None:
    for workers in ("1", "2"):
        journal = tmp_path / f"journal{workers}.sqlite"
        arguments = command("--max-collisions", "5", "--workers", workers, "--journal", str(journal), "--json", "-")
        # A shell that starts the tests in the background has its children ignore the signal.
        listening = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
        running = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=listening)
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline and _count(journal) < 4:
            time.sleep(0.02)
        running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=60)
        result = json.loads(out)
        assert running.returncode == 0, err
        assert not result["complete"] and "interrupted" in result["notes"][0] and 4 <= len(result["nodes"]) < 200


def test_ctrl_c_in_the_solve_after_a_diagnosis_ends_the_search(puck: dmoc.Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every solve of a node passes an interrupt on, also the one that starts from the motion of least violation."""
    from dmoc.sequences import inner
    from dmoc.solvers.diagnosis import Diagnosis

    problem = puck.but(sequence=["east"], steps=10)
    failed = replace(dmoc.solve(problem, "ipm", verify=False), status="infeasible")
    diagnosed: list[bool] = []

    def no_violation(_: dmoc.Problem, __: object, x: np.ndarray, ___: object) -> Diagnosis:
        diagnosed.append(True)
        return Diagnosis(x, 0.0, True, (), (), ())

    monkeypatch.setattr(inner, "diagnose", no_violation)
    monkeypatch.setattr(inner, "solve", lambda *_, **__: replace(failed, status="interrupted") if diagnosed else failed)
    with pytest.raises(KeyboardInterrupt):
        inner.solve_node(inner.Task(problem, None, "ipm", 0, 0, 10.0))


def test_a_journal_of_another_problem_is_refused(puck: dmoc.Problem, tmp_path: Path) -> None:
    path = tmp_path / "journal.sqlite"
    dmoc.search(puck, 0, journal=path)
    with pytest.raises(SearchError, match="exists: resume it"):
        dmoc.search(puck, 0, journal=path)
    with pytest.raises(SearchError, match="another problem"):
        dmoc.search(puck.but(parameters={"m": 2.0}), 0, journal=path, resume=True)
    with pytest.raises(SearchError, match="another problem"):
        dmoc.search(puck, 0, starts=1, journal=path, resume=True)
    with pytest.raises(SearchError, match="does not exist"):
        dmoc.search(puck, 0, journal=tmp_path / "none", resume=True)
    with sqlite3.connect(tmp_path / "foreign") as foreign:
        foreign.execute("CREATE TABLE foreign_data (a)")
    with pytest.raises(SearchError, match="something else"):
        dmoc.search(puck, 0, journal=tmp_path / "foreign", resume=True)
    (tmp_path / "empty").touch()  # left by a search that was killed at once
    assert len(dmoc.search(puck, 0, journal=tmp_path / "empty", resume=True).nodes) == 1
    broken = tmp_path / "broken"
    broken.write_text("no database at all")
    with pytest.raises(SearchError, match="cannot be used as a journal"):
        dmoc.search(puck, 0, journal=broken, resume=True)
    deeper = dmoc.search(puck, 1, journal=path, resume=True)
    assert len(deeper.nodes) == 5


def test_what_failed_gets_another_chance(puck: dmoc.Problem, tmp_path: Path) -> None:
    path = tmp_path / "journal.sqlite"
    assert dmoc.search(puck, 0, journal=path, node_seconds=1e-6).nodes[0].verdict is Verdict.FAILED
    assert dmoc.search(puck, 0, journal=path, resume=True).nodes[0].verdict is Verdict.OPTIMAL


def test_nodes_survive_the_journal(found: SearchResult) -> None:
    for node in found.nodes[:6]:
        sequence, summary, data = node.to_row()
        again = Node.from_row(sequence, summary, data)
        assert again.to_dict() == node.to_dict()
        if node.solution is not None:
            assert again.solution is not None
            np.testing.assert_array_equal(again.solution.unknowns, node.solution.unknowns)


# What is seen --------------------------------------------------------------------------------------------------------


def test_figures_are_drawn(found: SearchResult, weak: dmoc.Problem, tmp_path: Path) -> None:
    found.plot(tmp_path / "tree.png")
    found.plot_best(tmp_path / "best.pdf")
    dmoc.search(weak.but(goal={"x": -5.0}), 1).plot_best(tmp_path / "none.png")
    assert all((tmp_path / f).stat().st_size > 1000 for f in ("tree.png", "best.pdf", "none.png"))


def test_the_command_writes_and_tells(tmp_path: Path) -> None:
    done = subprocess.run(command("--out", str(tmp_path / "out"), "--workers", "2"), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "best: east, west" in done.stdout and "optimal" in done.stdout
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"solution.npz", "tree.png", "best.png"}
    assert dmoc.Solution.load(tmp_path / "out" / "solution.npz").verify().passed
    wrong = subprocess.run(command("--strategy", "beam", "--beam", "0"), capture_output=True, text=True)
    assert wrong.returncode == 2 and "beam = 0" in wrong.stderr and "Traceback" not in wrong.stderr


def in_process(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["dmoc", "search", "puck_table", "--steps", "20", "--max-collisions", "1", *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0)


def test_inputs_of_order_4_are_drawn_at_their_times(tmp_path: Path) -> None:
    kernels = dmoc.build(block_system(), order=4)
    problem = dmoc.Problem(kernels, start={"x": 0.0}, goal={"x": 0.5, "x_dot": 0.0}, steps=6, final_time=1.0)
    result = dmoc.search(problem, 1)
    figure = result.plot_best(tmp_path / "best.png")
    assert result.best is not None and result.best.solution is not None
    motion = result.best.solution.trajectory
    inputs = next(a for a in figure.axes if a.get_ylabel() == "$u$")
    drawn = [line.get_xydata() for line in inputs.lines if line.get_color() == "#D55E00"]
    assert len(drawn) == len(motion.phases)
    for line, phase in zip(drawn, motion.phases, strict=True):
        np.testing.assert_array_equal(line, np.column_stack([input_times(motion.controls, phase.t), phase.u[:, 0]]))
    assert (tmp_path / "best.png").stat().st_size > 1000


def test_a_search_keeps_its_result_where_a_figure_fails(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("no [room]")

    monkeypatch.setattr("dmoc.report.tree.plot_motions", fail)
    assert in_process(monkeypatch, "--out", str(tmp_path / "o")) == 0
    out, err = capsys.readouterr()
    assert "best: " in out and "written: " in out
    assert err.endswith("best.png was not drawn: ValueError: no [room]\n") and err.count("\n") == 1
    assert {p.name for p in (tmp_path / "o").iterdir()} == {"solution.npz", "tree.png"}


def test_a_search_that_a_full_disk_breaks_off_is_no_success(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What was found is told and written, the node whose row had no room included."""
    add, added = Journal.add, []

    def full(journal: Journal, node: Node) -> None:
        if added:
            raise sqlite3.OperationalError("database or disk is full")
        added.append(node)
        add(journal, node)

    monkeypatch.setattr(Journal, "add", full)
    journal = tmp_path / "journal"
    assert (
        in_process(monkeypatch, "--journal", str(journal), "--out", str(tmp_path / "o"), "--json", str(tmp_path / "j.json")) == 2
    )
    out, err = capsys.readouterr()
    assert "best: " in out and "2 sequences" in out and "note: journal" in out
    assert (
        err
        == f"error: journal {journal} could not be written (database or disk is full): the result is that of a search that was broken off.\n"
    )
    assert len(json.loads((tmp_path / "j.json").read_text())["nodes"]) == 2
    assert (tmp_path / "o" / "solution.npz").exists()
    monkeypatch.undo()
    assert in_process(monkeypatch, "--journal", str(journal), "--resume") == 0
