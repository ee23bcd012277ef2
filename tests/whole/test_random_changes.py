"""Random changes by syntax: what each kind makes of a line, what stays, and that a seed draws the
same ones again."""

from __future__ import annotations

import pytest
from mutations import groups_near, nearest
from pages import ROOT
from random_changes import LAYERS, Source, drawn


def made(text: str) -> dict[str, set[str]]:
    """What becomes of a text by each kind of change."""
    texts: dict[str, set[str]] = {}
    for edit in Source(text).edits():
        changed = text[: edit.begin] + edit.new + text[edit.end :]
        texts.setdefault(edit.kind, set()).add(changed.strip())
    return texts


@pytest.mark.parametrize(
    ("line", "kind", "changed"),
    [
        ("x = a + b * c", "sign", {"x = a - b * c"}),
        ("x = -a", "sign", {"x = a"}),
        ("x = a*b;", "factor", {"x = a/b;", "x = a;"}),
        ("x = a * (b + c)[0] - d", "factor", {"x = a / (b + c)[0] - d", "x = a - d"}),
        ("x = a < b", "comparison", {"x = a > b"}),
        ("x = a <= 3", "comparison", {"x = a >= 3", "x = a < 3"}),
        ("x = a != b", "comparison", {"x = a == b"}),
        ("x = a[0]", "index", {"x = a[-1]"}),
        ("x = a[-1]", "index", {"x = a[0]"}),
        ("x = a[1:, :-2]", "index", {"x = a[0:, :-2]", "x = a[1:, :0]"}),
        ("x = a[:, 2]", "index", {"x = a[:, 1]"}),
        ("x = a + b * c", "term", {"x = a"}),
        ("x = a - f(b, c + d)", "term", {"x = a", "x = a - f(b, c)"}),
        ("x = a and b", "term", {"x = a", "x = a or b"}),
        ("x = a or b", "term", {"x = a", "x = a and b"}),
        ("x = a && b;", "term", {"x = a;", "x = a || b;"}),
        ("x = f(a, b, c)", "arguments", {"x = f(b, a, c)"}),
        ("x = f(g(a, b), c)", "arguments", {"x = f(c, g(a, b))", "x = f(g(b, a), c)"}),
        ("x = max(a)", "end", {"x = min(a)"}),
        ("x = p->first", "end", {"x = p->last"}),
        ("x = a.any()", "end", {"x = a.all()"}),
        ("x = f(np.minimum)", "end", {"x = f(np.maximum)"}),
    ],
)  # fmt: skip
def test_a_kind_changes_a_line_in_its_ways(line: str, kind: str, changed: set[str]) -> None:
    assert made(f"{line}\n").get(kind) == changed


@pytest.mark.parametrize(
    "text",
    [
        '"""a + b[0] of f(a, b)."""',
        "x = 'a - b'",
        "# a + b",
        "#include <a-b.h>",
        "/* a*b[0]\n   f(a, b) */",
        "def f(a: int, b: int = 1) -> None:",
        "    raise Error(f(a, b), a + b)",
        "static double f(double *a, int b)",
        "double *x, **y;",
        "x = f(*a, **b)",
        "x = hypot(a, b)",
        "x = f(a, key=b)",
        "x = [0, 1]",
        "first = first_of(last)",
        "x = f(minimum)",
    ],
)
def test_what_says_nothing_stays(text: str) -> None:
    assert made(f"{text}\n") == {}


def test_a_head_ends_where_its_statement_does() -> None:
    assert made("def f(a,\n      b):\n    return a + b\n")["sign"] == {
        "def f(a,\n      b):\n    return a - b"
    }
    assert made("static int f(int a)\n{\n    return a + 1;\n}\n")["term"]


def test_a_seed_draws_the_same_changes_of_all_folders() -> None:
    folders = ["base", "motion", "planning"]
    changes = drawn(folders, 6, 1)
    assert changes == drawn(folders, 6, 1) != drawn(folders, 6, 2)
    assert [c.file.split("/")[0] for c in changes] == folders * 2
    for c in changes:
        assert (ROOT / c.file).read_text(encoding="utf-8").count(c.old) == 1 and c.new != c.old
    assert {"base", "simulation", "solvers", "export"} < set(LAYERS)


def test_the_nearest_tests_are_those_that_import_a_module_then_those_of_its_layer() -> None:
    first, second, last = nearest("solving/mesh/error.py")
    assert "tests/solving/mesh/test_estimates.py" in first
    assert (second, last) == (("tests/solving",), ("tests",))
    named, *others = next(nearest("guess/transfer.py"))
    assert named == "tests/guess/test_transfer.py" and others


def test_tests_run_once_and_slow_ones_of_the_nearest_before_those_of_all_layers() -> None:
    first, layer, slow, every = groups_near("check/planned_run.py")
    files = [word for word in first if word.endswith(".py")]
    assert {"tests/check/test_passing.py", "tests/check/test_event_times.py"} <= set(files)
    ignored = [f"--ignore={file}" for file in files]
    assert first == ("-m", "not slow", *files) and slow == ("-m", "slow", *files)
    assert layer == ("-m", "not slow", "tests/check", *ignored)
    assert every == ("-m", "not slow", "tests", *ignored, "--ignore=tests/check")


def test_tests_that_need_more_than_others_are_left_out() -> None:
    assert not any(
        "browser" in file or "processors" in file for file in next(nearest("models/registry.py"))
    )
