"""The command line, called in a folder of its own."""

from __future__ import annotations

import shlex
import sys
from functools import cache
from pathlib import Path

import pytest
import typer.main
from commands import FALLING, Model, Run

from dmoc.cli import main

COMMANDS = cache(typer.main.get_command)  # Typer reads all signatures anew whenever it is called


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Run:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(typer.main, "get_command", COMMANDS)

    def call(words: str = "", *more: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["dmoc", *shlex.split(words), *more])
        with pytest.raises(SystemExit) as end:
            main()
        out, err = capsys.readouterr()
        code = end.value.code
        return (code if isinstance(code, int) else 0), out, err

    return call


@pytest.fixture
def file(tmp_path: Path) -> Model:
    """Writes a file of models with a line that makes `s`, and names that."""

    def write(line: str) -> str:
        (tmp_path / "system.py").write_text(FALLING + line)
        return "system.py:s"

    return write
