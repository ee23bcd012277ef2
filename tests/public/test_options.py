"""Options of a solve, a search, a batch and their commands: the same names, with one default."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, fields
from inspect import signature
from typing import Any

import pytest
import typer

import dmoc
from dmoc.cli.app import app
from dmoc.sequences.settings import Settings
from dmoc.solving.many import OPTIONS
from dmoc.solving.request import Keywords


def defaults_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Keywords with their defaults, and arguments without."""
    return {name: p.default for name, p in signature(function).parameters.items()}


@pytest.mark.parametrize(
    ("function", "options", "others"),
    [
        (dmoc.solve, Keywords, {"problem", "guess", "progress"}),
        (dmoc.search, Settings, {"problem"}),
    ],
)
def test_every_keyword_is_an_option_that_is_read(
    function: Callable[..., Any], options: Any, others: set[str]
) -> None:
    defaults = defaults_of(function)
    assert {f.name for f in fields(options)} == defaults.keys() - others
    for f in fields(options):
        assert f.default in (MISSING, defaults[f.name])


def test_a_batch_takes_what_a_solve_does() -> None:
    of_batch = defaults_of(dmoc.solve_many)
    assert not OPTIONS & of_batch.keys()
    left = defaults_of(dmoc.solve).keys() - OPTIONS - of_batch.keys()
    assert left == {"problem", "reference"}
    assert of_batch.keys() - {"problems"} == defaults_of(dmoc.sweep).keys() - {
        "problem", "parameters", "start", "goal", "bounds",
    }  # fmt: skip


@pytest.mark.parametrize("name", ["solve", "search", "sweep"])
def test_an_option_of_a_command_has_the_default_of_its_function(name: str) -> None:
    commands: dict[str, Any] = vars(typer.main.get_command(app))["commands"]
    defaults = defaults_of(getattr(dmoc, name))
    shared = [p for p in commands[name].params if p.name in defaults.keys() - {"start", "goal"}]
    assert len(shared) >= 4
    assert all(p.default == defaults[p.name] for p in shared)
