"""The pages of the manual and the README run, and say what is printed."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import matplotlib
import pytest
from pages import DOCS, ROOT, TROUBLESHOOTING, agrees, commands_of, run, updated, write_shared

from dmoc.base import errors
from dmoc.cli.app import command_line
from dmoc.sequences.nodes import Verdict
from dmoc.solvers.outcome import Status
from dmoc.solving.multistart.effort import Effort

pytestmark = pytest.mark.slow

PAGES = sorted(
    page
    for page in (*DOCS.rglob("*.md"), ROOT / "README.md", TROUBLESHOOTING)
    if "```python" in page.read_text() and not page.is_relative_to(DOCS / "_build")
)


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.fixture
def folder(tmp_path: Path, without_library: None) -> Iterator[Path]:
    """A folder where pages run."""
    write_shared(tmp_path)
    with matplotlib.rc_context(), pytest.MonkeyPatch.context() as patch:
        patch.setenv("MPLBACKEND", "Agg")
        yield tmp_path


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_page_prints_what_it_shows(
    page: Path,
    folder: Path,
    effort: Callable[..., Effort],
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With as many starts as users have."""
    monkeypatch.setattr(Effort, "of", effort)
    text = page.read_text()
    if request.config.getoption("--update"):
        page.write_text(updated(text, folder))
        return
    outputs = [(block.content, printed) for block, printed in run(text, folder)]
    assert all(outputs == "" or agrees(outputs, printed) for outputs, printed in outputs), outputs


def test_outputs_are_told_apart(tmp_path: Path) -> None:
    page = "```python\nprint(1 + 1)\n```\n\n```output\n3\n```\n"
    ((block, printed),) = run(page, tmp_path)
    assert printed == "2\n" and not agrees(block.content, printed)
    assert "```output\n2\n```" in updated(page, tmp_path)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_of_a_page_are_understood(
    page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from typer.testing import CliRunner

    """In this process alone: tests/cli/test_search.py tries several."""
    monkeypatch.chdir(folder)
    for arguments in commands_of(re.sub(r"--workers \d+", "--workers 1", page.read_text())):
        with warnings.catch_warnings():
            result = CliRunner().invoke(command_line(arguments), arguments)
        assert result.exit_code in (0, 1), (arguments, result.output)


def test_every_error_and_every_status_has_an_entry() -> None:
    kinds = {n for n, e in vars(errors).items() if isinstance(e, type)} - {"DmocError"}
    entries = _headings(TROUBLESHOOTING)
    assert kinds <= entries, kinds - entries
    verdicts = DOCS / "verdicts.md"
    assert {str(s) for s in Status} <= _headings(verdicts)
    assert all(f"- `{v.value}`: " in verdicts.read_text() for v in Verdict)
    links = TROUBLESHOOTING.read_text()
    assert all(f"(../docs/verdicts.md#{s})" in links for s in Status)


def test_equations_that_docstrings_cite_are_on_the_theory_page() -> None:
    labels = set(re.findall(r"^\$\$ \(([\w-]+)\)$", (DOCS / "theory.md").read_text(), re.MULTILINE))
    assert len(labels) > 20
    places = (*ROOT.glob("[a-z]*/*.py"), *ROOT.glob("src/dmoc/*.py"))
    cited = {label for p in places for label in re.findall(r":eq:`([\w-]+)`", p.read_text())}
    assert cited and cited <= labels, cited - labels


def test_every_diagram_of_the_manual_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    import drawings

    from dmoc.report.style import DARK, LIGHT

    named = re.findall(r"^```\{diagram\} (\w+)$", (DOCS / "theory.md").read_text(), re.MULTILINE)
    assert len(named) == 8 and set(named) == set(drawings.DRAWINGS)
    for draw, style in zip(drawings.DRAWINGS.values(), 4 * (LIGHT, DARK), strict=True):
        assert all(axes.has_data() or axes.texts for axes in draw(style).axes)


def _headings(page: Path) -> set[str]:
    return set(re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE))
