"""The committed sources of the shipped models."""

from __future__ import annotations

import difflib
import re
from pathlib import Path

import pytest

from dmoc.codegen.build import write_files
from dmoc.codegen.text import c_files
from dmoc.models import catalogue
from dmoc.symbolic.families import model_spec

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", catalogue.models())
def test_committed_sources_are_what_is_generated(name: str, request: pytest.FixtureRequest) -> None:
    folder = ROOT / "generated" / name
    files = c_files(model_spec(catalogue.system(name)))
    if request.config.getoption("--update"):
        write_files(folder, files)
    committed = {p.name for p in folder.iterdir() if p.is_file() and p.suffix != ".so"}
    assert committed == set(files)
    for file, text in files.items():
        stored = (folder / file).read_text(encoding="utf-8")
        difference = "".join(
            difflib.unified_diff(
                stored.splitlines(True),
                text.splitlines(True),
                f"committed {file}",
                f"generated {file}",
            )
        )
        assert not difference, difference


@pytest.mark.parametrize("name", catalogue.models())
def test_text_beside_arithmetic_is_four_lines_a_kernel(name: str) -> None:
    """What it is for, its arguments, their places, its entry; not each argument several times."""
    text = (ROOT / "generated" / name / "kernels.c").read_text(encoding="utf-8")
    others = [line for line in text.splitlines(True) if not re.match(r"    .* = .*[,;]$", line)]
    assert sum(map(len, others)) < 4 * 100 * text.count("ENTRY(")
