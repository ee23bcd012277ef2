"""Words with the best motion that is known of each: they are stated, what is kept leads back, and
only what is cheaper replaces it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import best_of_word_known as known
import pytest
from best_of_word import Answer, summary
from best_of_word_known import Best
from best_of_word_problems import WORDS, Word

import dmoc

BEST = known.read()
WORD = {word.name: word for word in WORDS}


def test_there_are_sixty_words_with_names_of_their_own() -> None:
    assert len(WORD) == len(WORDS) >= 60
    assert set(BEST) == set(WORD)


@pytest.mark.slow
@pytest.mark.parametrize("word", WORDS, ids=lambda word: word.name)
def test_what_is_known_of_a_word_leads_back_to_its_cost(word: Word) -> None:
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
    word = WORD["pendulum and wall, goal -2"]
    tries = [("starts", partial(dmoc.solve, word.problem, "ipm"))]
    dearer = replace(BEST[word.name], cost=20.0, source="by hand")
    better = known.improved(word, dearer, tries)
    assert better is not None and better.source == "starts"
    assert better.cost == pytest.approx(18.11194, rel=1e-5)  # the ladder: 18.11182
    cheaper = replace(dearer, cost=18.0)
    assert known.improved(word, cheaper, tries) is cheaper
    known.write({"word": better}, tmp_path / "best.json")
    assert known.read(tmp_path / "best.json") == {"word": better}
