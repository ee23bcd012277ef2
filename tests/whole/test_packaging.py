"""The package map, and what a source distribution holds."""

from __future__ import annotations

import runpy
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest
import setuptools
from setuptools.command.egg_info import FileList

ROOT = Path(__file__).resolve().parents[2]
MADE = {"__pycache__", "figures", ".hypothesis"}  # folders that runs leave behind


@pytest.fixture
def arguments(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What setup.py says, in its folder."""
    import Cython.Build

    seen: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", lambda **arguments: seen.update(arguments))
    monkeypatch.setattr(Cython.Build, "cythonize", lambda extensions, **_: extensions)
    monkeypatch.chdir(ROOT)
    runpy.run_path(str(ROOT / "setup.py"))
    return seen


def test_package_map_names_every_folder(arguments: dict[str, Any]) -> None:
    """setup.py maps each folder with an __init__.py; in a checkout, each layer has its link for
    type checkers."""
    ignored = {"build", "tests", "examples", "benchmarks", "docs", "dist"}
    folders = {
        str(p.parent.relative_to(ROOT))
        for p in ROOT.rglob("__init__.py")
        if not ignored & {(top := p.relative_to(ROOT).parts[0])}
        and not top.startswith(".")
        and not any(q.is_symlink() for q in p.parents)
    }
    assert set(arguments["package_dir"].values()) == folders
    layers = {
        ROOT / folder
        for package, folder in arguments["package_dir"].items()
        if package.count(".") == 1 and not folder.startswith("src/")
    }
    links = {p.resolve() for p in (ROOT / "src" / "dmoc").iterdir() if p.is_symlink()}
    # A source distribution holds no links.
    assert links == (layers if (ROOT / ".git").exists() else set())


def test_a_source_distribution_holds_every_source_of_the_packages(
    arguments: dict[str, Any],
) -> None:
    for package, folder in arguments["package_dir"].items():
        patterns = ["*.py", *arguments["package_data"].get(package, [])]
        for path in (ROOT / folder).iterdir():
            if path.is_file() and path.suffix != ".so":
                assert any(fnmatch(path.name, pattern) for pattern in patterns), path
    templates = (ROOT / "codegen" / "templates").iterdir()
    patterns = arguments["package_data"]["dmoc.codegen"]
    assert all(
        any(fnmatch(f"templates/{p.name}", pattern) for pattern in patterns) for p in templates
    )


def test_a_source_distribution_holds_what_its_tests_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    held = FileList()
    for line in (ROOT / "MANIFEST.in").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            held.process_template_line(line)
    files = {
        str(p.relative_to(ROOT))
        for folder in ("tests", "examples", "docs", "benchmarks")
        for p in (ROOT / folder).rglob("*")
        if p.is_file() and not MADE & set(p.parts)
    }
    assert files and files <= set(held.files)
    assert {"Makefile", "CHANGELOG.md", "CONTRIBUTING.md"} <= set(held.files)
