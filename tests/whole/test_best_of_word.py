"""Words with the best motion that is known of each: they are stated, what is kept leads back, and
only what is cheaper replaces it."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import best_of_word_known as known
import best_of_word_runs as runs
import numpy as np
import pytest
from best_of_word import summary
from best_of_word_known import Best
from best_of_word_peer import SUCCEEDED, RandomLine, WordTranscription
from best_of_word_problems import NAMED, STEPS, WORDS, Word
from best_of_word_runs import Answer
from ladder_casadi import SolvedMotion, transcribed

import dmoc

BEST = known.read()
FEW = {"compass gait": 20}  # steps of a phase that the peer needs no more of


def test_there_are_sixty_words_with_names_of_their_own() -> None:
    assert len(NAMED) == len(WORDS) >= 60
    assert set(BEST) == set(NAMED)


@pytest.mark.slow
@pytest.mark.parametrize("word", WORDS[3::6], ids=lambda word: word.name)
def test_what_is_known_of_a_word_leads_back_to_its_cost(word: Word) -> None:
    """Of every sixth: `make words` looks for a cheaper one of each."""
    best, problem = BEST[word.name], word.problem
    mesh = problem if problem.steps is None else problem.meshed(best.steps)
    solution = dmoc.solve(mesh, "ipm", guess=best.guess, starts=1)
    assert solution.status == "solved"
    assert solution.cost == pytest.approx(best.cost, rel=1e-4, abs=1e-9)


def test_what_is_dearer_or_not_confirmed_is_not_near() -> None:
    best = {"a": Best(100.0, (10,), "by hand"), "b": Best(-0.25, (10,), "by hand")}
    good = [Answer("a", "solved", 100.9), Answer("b", "solved", -0.2476)]
    bad = [Answer("a", "solved", 101.1), Answer("a", "not_verified", 99.0),
           Answer("b", "solved", -0.24)]  # fmt: skip
    assert all(answer.near(best) for answer in good)
    assert not any(answer.near(best) for answer in bad)
    assert summary([*good, *bad], best).startswith("2 of 5 within 1 %")


@pytest.mark.slow
def test_only_a_cheaper_motion_replaces_the_best_known_one(tmp_path: Path) -> None:
    word = NAMED["pendulum and wall, goal -2"]
    tries = [("starts", partial(dmoc.solve, word.problem, "ipm"))]
    dearer = replace(BEST[word.name], cost=20.0, source="by hand")
    better = known.improved(word, dearer, tries)
    assert better is not None and better.source == "starts"
    assert better.cost == pytest.approx(18.11194, rel=1e-5)  # the ladder: 18.11182
    cheaper = replace(dearer, cost=18.0)
    assert known.improved(word, cheaper, tries) is cheaper
    known.write({"word": better}, tmp_path / "best.json")
    assert known.read(tmp_path / "best.json") == {"word": better}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["masses on a rail", "contacts: stacked blocks", "a hopper leaves and lands", "compass gait",
     "arm's tip, nearly straight"],
)  # fmt: skip
def test_the_peer_states_the_same_problem(name: str) -> None:
    """Sliding and breaking away, landing, a gait, a goal of quantities: from the best motion known,
    another transcription leads to its cost."""
    word, best = NAMED[name], BEST[name]
    problem = word.problem if word.problem.steps is not None else word.problem.meshed(STEPS)
    motion = SolvedMotion(dmoc.solve(problem, "ipm", guess=best.guess, starts=1))
    few = problem.meshed(FEW[name]) if name in FEW else problem
    status, result = transcribed(word.statement, few, 60.0, motion, WordTranscription).solve()
    assert status in SUCCEEDED
    assert float(result["f"]) == pytest.approx(best.cost, rel=1e-3)


def test_random_lines_keep_the_bounds_of_durations_and_coordinates() -> None:
    problem = NAMED["a hop"].problem
    rng = np.random.default_rng(1)
    for _ in range(20):
        line = RandomLine.of(problem, rng)
        total = line.durations(2).sum()
        assert 0.45 <= total <= 0.6
        q = np.array([line.state(phase, s)[0] for phase in (0, 1) for s in (0.0, 0.5, 1.0)])
        low, high = problem.coordinate_bounds.T
        assert (q >= low).all() and (q <= high).all()
        assert q[2] == pytest.approx(q[3])  # at the hit


def test_a_run_is_told_in_a_table(tmp_path: Path) -> None:
    """The peer's best of its lines is found at its time; what it does not state has a dash."""
    cost = BEST["two discs"].cost
    answer = asdict(Answer("two discs", "solved", cost, 17, 15, 0.4))
    dear = asdict(Answer("a hop", "solved", 2 * BEST["a hop"].cost, 17, 15, 0.4))
    budgets = (0.1, 1.0)
    runs.keep(
        [{"name": "two discs", "default": answer, "budgets": [[b, answer] for b in budgets],
          "peer": [(0.05, 2 * cost), (0.2, cost)]},
         {"name": "a hop", "default": dear, "budgets": [[b, dear] for b in budgets],
          "not stated": "friction"}], tmp_path,
    )  # fmt: skip
    table = runs.report(tmp_path).markdown()
    assert "| 0.1 | 1, 50 % | 1, 100 % | 0, 0 % |" in table
    assert "| 1 | 1, 50 % | 1, 100 % | 1, 100 % |" in table
    every = (tmp_path / "best_of_word.md").read_text(encoding="utf-8")
    assert "| **2.0000** | 0.40 | 17 | 15 | - | - |" in every
    assert (tmp_path / "best_of_word.png").stat().st_size > 0
