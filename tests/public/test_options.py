"""Options of a solve, a search, a batch and their commands: the same names, with one default."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from inspect import signature
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from typer.testing import CliRunner

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.base.options import option, options_of, read
from dmoc.cli.app import command_line
from dmoc.cli.groups import passed_on, spread
from dmoc.cli.typed import typed
from dmoc.cli.words import option as about
from dmoc.sequences.keywords import SearchKeywords
from dmoc.solving.keywords import BatchKeywords, Keywords
from dmoc.solving.many import OPTIONS


def defaults_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Keywords with their defaults, and arguments without."""
    return {name: p.default for name, p in signature(function).parameters.items()}


@pytest.mark.parametrize(
    ("function", "options", "others"),
    [
        (dmoc.solve, Keywords, {"problem", "guess", "progress"}),
        (dmoc.search, SearchKeywords, {"problem"}),
        (dmoc.solve_many, BatchKeywords, {"problems"}),
    ],
)
def test_every_keyword_is_an_option_that_is_read(
    function: Callable[..., Any], options: Any, others: set[str]
) -> None:
    defaults = defaults_of(function)
    assert {f.name for f in fields(options)} == defaults.keys() - others
    for f in fields(options):
        assert f.name == "options" or f.default == defaults[f.name]


def test_a_batch_takes_what_a_solve_does() -> None:
    of_batch = defaults_of(dmoc.solve_many)
    assert not OPTIONS & of_batch.keys()
    left = defaults_of(dmoc.solve).keys() - OPTIONS - of_batch.keys()
    assert left == {"problem", "reference"}
    assert of_batch.keys() - {"problems"} == defaults_of(dmoc.sweep).keys() - {
        "problem", "parameters", "start", "goal", "bounds", "design",
    }  # fmt: skip


@pytest.mark.parametrize("name", ["solve", "search", "sweep"])
def test_an_option_of_a_command_has_the_default_of_its_function(name: str) -> None:
    commands: dict[str, Any] = vars(typer.main.get_command(command_line()))["commands"]
    defaults = defaults_of(getattr(dmoc, name))
    shared = [p for p in commands[name].params if p.name in defaults.keys() - {"start", "goal"}]
    assert len(shared) >= 4
    assert all(p.default == defaults[p.name] for p in shared)


@pytest.mark.parametrize(
    ("name", "keywords"),
    [("solve", Keywords), ("search", SearchKeywords), ("sweep", BatchKeywords)],
)
def test_a_command_has_the_keywords_with_a_help(name: str, keywords: Any) -> None:
    commands: dict[str, Any] = vars(typer.main.get_command(command_line()))["commands"]
    helps = {p.name: p.help for p in commands[name].params}
    with_help = {name: one.help for name, one in options_of(keywords).items() if one.help}
    assert len(with_help) >= 3 and with_help.items() <= helps.items()
    assert "executor" not in helps and "progress" not in helps and "reference" not in helps


@dataclass(frozen=True)
class Bakery:
    """Keywords of a function that nobody has written yet."""

    loaves: int = option(2, "whole", "How many.", least=1, most=9)
    heat: float | None = option(None, "positive", "In kelvin.", expected="expected heat")
    kind: str = option("rye", "choice", "Of bread.", choices=("rye", "oat"))
    seeds: Sequence[str] | None = option(None, "names", "On top.", of="seeds")
    oven: str | None = option(None, "path", "Where.")
    twice: bool = option(False, "flag", "Once more.")
    baker: str = option("nobody", "text")


def baked(words: Sequence[str]) -> tuple[int, str, dict[str, Any]]:
    """Status, output, and what the function of a command is called with."""
    calls = list[dict[str, Any]]()

    def bake(*, name: Annotated[str, about(help="Of it.")] = "x", keywords: Bakery) -> None:
        calls.append({"name": name, **passed_on(keywords)})

    one = typer.Typer(pretty_exceptions_enable=False)
    one.command()(typed(spread(bake)))
    result = CliRunner().invoke(one, list(words))
    return result.exit_code, result.output, calls[0] if calls else {}


def test_a_keyword_with_a_help_is_an_option_without_another_line() -> None:
    assert baked([])[2] == {
        "name": "x", "loaves": 2, "heat": None, "kind": "rye", "seeds": None, "oven": None,
        "twice": False,
    }  # fmt: skip
    words = "--name y --loaves 3 --heat 500 --kind oat --seeds poppy,flax --oven o.db --twice"
    code, output, call = baked(words.split())
    assert code == 0, output
    assert call == {
        "name": "y", "loaves": 3, "heat": 500.0, "kind": "oat", "seeds": ("poppy", "flax"),
        "oven": Path("o.db"), "twice": True,
    }  # fmt: skip
    assert read(Bakery, call, ProblemError).kind == "oat"


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("--kind wheat", "'wheat' is not one of 'rye', 'oat'"),
        ("--loaves many", "integer"),
        ("--baker me", "No such option"),
        ("--no-twice", "No such option"),
    ],
)
def test_what_is_no_option_or_no_value_of_one_is_refused(words: str, reason: str) -> None:
    code, output, call = baked(words.split())
    assert code == 2 and reason in output and not call


def test_a_keyword_is_read_or_refused_by_its_name() -> None:
    assert read(Bakery, {"heat": None, "other": 1}, ProblemError) == Bakery()
    with pytest.raises(ProblemError, match=r"loaves = 10: expected at most 9\."):
        read(Bakery, {"loaves": 10}, ProblemError)
    with pytest.raises(ProblemError, match=r"seeds has the entry 1: expected seeds by name"):
        read(Bakery, {"seeds": [1]}, ProblemError)
