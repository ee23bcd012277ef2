"""The list of changes that the tests have to notice fits the sources and the tests."""

from __future__ import annotations

import runpy
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAYERS = """base motion symbolic codegen mechanics problem program guess solvers simulation check
report results inspection solving sequences cli""".split()


@pytest.fixture(scope="module")
def changes() -> list[Any]:
    """The entries of the list, as the tool reads them."""
    change = runpy.run_path(str(ROOT / "tools" / "mutations.py"))["Change"]
    text = (ROOT / "tools" / "mutations.toml").read_text(encoding="utf-8")
    return [change(**entry) for entry in tomllib.loads(text)["change"]]


def test_every_change_stands_once_in_its_file(changes: list[Any]) -> None:
    for c in changes:
        assert (ROOT / c.file).read_text(encoding="utf-8").count(c.old) == 1, str(c)
        assert c.new != c.old, str(c)
    assert len({(c.file, c.old, c.new) for c in changes}) == len(changes) >= 100


def test_every_change_names_tests_that_are_there(changes: list[Any]) -> None:
    for c in changes:
        assert c.tests, str(c)
        for test in c.tests:
            file, _, name = test.partition("::")
            assert f"\ndef {name}" in (ROOT / file).read_text(encoding="utf-8"), test


def test_every_layer_is_changed_and_few_changes_survive(changes: list[Any]) -> None:
    for layer in LAYERS:
        assert any(c.file.startswith(f"{layer}/") for c in changes), layer
    assert sum(bool(c.survives) for c in changes) <= 10
