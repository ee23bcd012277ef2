"""The table of tolerances that several modules have in common."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from dmoc.base import tolerances

ROOT = Path(__file__).parents[2]
SOURCE = (ROOT / "src" / "dmoc").iterdir()
NAMES = {name for name in vars(tolerances) if name.isupper()} - {"ITERATIONS"}


def constants(path: Path) -> Iterator[str]:
    """Names that a module assigns at its top."""
    for node in ast.parse(path.read_text()).body:
        for target in node.targets if isinstance(node, ast.Assign) else ():
            yield from (leaf.id for leaf in ast.walk(target) if isinstance(leaf, ast.Name))


def test_each_name_of_the_table_stands_there_alone() -> None:
    modules = [path for folder in SOURCE for path in (ROOT / folder.name).rglob("*.py")]
    table = ROOT / "base" / "tolerances.py"
    assert table in modules and len(modules) > 200
    again = {
        str(path.relative_to(ROOT)): same
        for path in modules
        if path != table and (same := NAMES & set(constants(path)))
    }
    assert not again


def test_what_counts_as_zero_grows_from_rounding_to_what_solvers_leave() -> None:
    """Double precision has 2e-16, solves end below 1e-6 of optimality and 1e-10 of violation."""
    t = tolerances
    assert 1e3 * 2.0**-52 < t.ROUNDING < t.VIOLATION < t.SAME < t.BALANCED < t.KEPT
    assert t.KEPT <= t.OPTIMALITY < t.SAME_COST
