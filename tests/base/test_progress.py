"""Progress: to a function, on a terminal, in a notebook, as plain lines, or nowhere."""

from __future__ import annotations

import io
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import block_and_wall
import pytest

import dmoc
from dmoc.base.errors import BuildError, DmocError, ProblemError, SearchError
from dmoc.base.progress import listener

pytestmark = pytest.mark.slow


def problem() -> dmoc.Problem:
    return block_and_wall.problem(1.0, 8)


CALLS: dict[str, Callable[[Any], object]] = {
    "build": lambda p: dmoc.build(block_and_wall.system(), backend="numpy", progress=p),
    "solve": lambda p: dmoc.solve(problem(), "ipm", starts=1, progress=p),
    "solve_many": lambda p: dmoc.solve_many([problem()] * 2, progress=p),
    "sweep": lambda p: dmoc.sweep(problem(), {"m": [1.0, 2.0]}, progress=p),
    "search": lambda p: dmoc.search(problem(), 1, progress=p),
}
LAST = {
    "build": "block: deriving equations and derivatives",
    "solve": "iteration ",
    "solve_many": "2 of 2: 2 solved  ",
    "sweep": "2 of 2: 2 solved  ",
    "search": "2 feasible",
}


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLS)
def test_a_function_is_called_with_what_shows_itself_as_a_line(name: str) -> None:
    seen: list[Any] = []
    CALLS[name](seen.append)
    assert seen and str(seen[-1]).startswith(LAST[name])


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("progress", [True, False, None])
def test_nothing_is_shown_where_there_is_no_terminal(
    name: str, progress: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    CALLS[name](progress)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", CALLS)
def test_lines_are_written_wherever_standard_error_leads(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    CALLS[name]("lines")
    out, err = capsys.readouterr()
    assert not out and err.splitlines()[0] in {
        "block: looking for its kernels", "first guess", "first solve", "first sequence",
    }  # fmt: skip


def test_lines_come_every_second(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [100.0]
    monkeypatch.setattr("time.perf_counter", lambda: now[0])
    with listener("lines", "first") as tell:
        assert tell is not None
        for now[0], text in (
            (100.5, "too soon"),
            (101.0, "in time"),
            (101.9, "soon"),
            (102.0, "on"),
        ):
            tell(text)
    assert capsys.readouterr().err.splitlines() == ["first", "in time", "on"]


def test_a_line_on_a_terminal_shows_text_as_it_is_and_goes_when_it_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    with listener(True, "first [bold]guess") as tell:
        assert tell is not None
    assert "first [bold]guess" in terminal.getvalue()
    assert terminal.getvalue().endswith("\x1b[2K")  # the line is cleared
    assert dmoc.solve(problem(), "ipm", starts=1, progress=True).status == "solved"


def test_a_notebook_shows_a_line_below_its_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    """What IPython's kernels do, without one: a display that is updated and left empty."""
    lines: list[str] = []

    class Handle:
        def update(self, data: dict[str, str], raw: bool) -> None:
            assert raw
            lines.append(data["text/plain"])

    def display(data: dict[str, str], raw: bool, display_id: bool) -> Handle:
        assert raw and display_id
        lines.append(data["text/plain"])
        return Handle()

    shell = types.SimpleNamespace(kernel=object())
    modules = {
        "IPython": types.SimpleNamespace(get_ipython=lambda: shell),
        "IPython.display": types.SimpleNamespace(display=display),
    }
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    assert dmoc.solve(problem(), "ipm", starts=1, progress=True).status == "solved"
    assert lines[:2] == ["", "first guess"] and lines[-1] == ""


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("progress", [1, 0, "line", [print], {}])
def test_what_progress_cannot_be_is_one_sentence(name: str, progress: Any) -> None:
    error: type[DmocError] = {"build": BuildError, "search": SearchError}.get(name, ProblemError)
    with pytest.raises(error, match=r"progress = .*: expected a function of one argument, True"):
        CALLS[name](progress)


@pytest.mark.slow
def test_a_build_tells_what_it_does(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path))
    seen: list[str] = []
    dmoc.build(block_and_wall.system(), progress=seen.append)
    assert seen == ["block: deriving equations and derivatives", "block: compiling"]
    dmoc.build(block_and_wall.system(), progress=seen.append)
    assert len(seen) == 2  # from the cache there is nothing to do
