"""The package map, and what a source distribution holds."""

from __future__ import annotations

import ast
import platform
import re
import runpy
import sys
import tomllib
import zipfile
from fnmatch import fnmatch
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import setuptools
from setuptools.command.egg_info import FileList

import dmoc

ROOT = Path(__file__).resolve().parents[2]
MADE = {"__pycache__", "figures", ".hypothesis"}  # folders that runs leave behind
# What `make docs` makes.
MANUAL = (
    "docs/_build/", "docs/diagrams/", "docs/examples/", "docs/reference/names/",
    "docs/sg_execution_times",
)  # fmt: skip


@pytest.fixture
def arguments(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What setup.py says, in its folder."""
    seen: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", lambda **arguments: seen.update(arguments))
    cython = SimpleNamespace(cythonize=lambda extensions, **_: extensions)
    monkeypatch.setitem(sys.modules, "Cython.Build", cython)
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


def test_a_changed_source_of_an_extension_is_compiled_again(arguments: dict[str, Any]) -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    (sources,) = re.findall(r"^SOURCES := (.*)$", text, re.M)
    patterns = re.sub(r"\$\(wildcard ([^)]*)\)", r"\1", sources).split()
    for extension in arguments["ext_modules"]:
        for path in extension.sources + extension.depends:
            if not path.endswith(("kernels.h", "memoryviews.c")):  # Cython writes the latter
                assert any(fnmatch(path, pattern) for pattern in patterns), path


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
        for folder in ("tests", "examples", "docs", "benchmarks", "tools")
        for p in (ROOT / folder).rglob("*")
        if p.is_file() and not MADE & set(p.parts)
    }
    files = {name for name in files if not name.startswith(MANUAL)}
    assert files and files <= set(held.files)
    assert {"Makefile", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff"} <= set(held.files)


@pytest.fixture
def release() -> dict[str, Any]:
    """What tools/release.py defines."""
    return runpy.run_path(str(ROOT / "tools" / "release.py"))


def test_a_release_needs_its_section_of_the_changelog(release: dict[str, Any]) -> None:
    unreleased = release["unreleased"]
    assert unreleased(dmoc.__version__, (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")) == ""
    assert unreleased("1.2.3", "## [1.2.3] - 2026-01-31\n") == ""
    for text in ("## [1.2.3]\n", "## [1.2.30] - 2026-01-31\n", "## [1x2.3] - 2026-01-31\n"):
        assert unreleased("1.2.3", text).startswith("CHANGELOG.md has no section '## [1.2.3] - ")


def test_a_wheel_with_what_does_not_belong_there_is_refused(
    release: dict[str, Any], tmp_path: Path
) -> None:
    info = "dmoc-1.0.dist-info/licenses/LICENSE"
    good = {*release["NEEDED"], info, "dmoc/program/a.cpython-311-x86_64-linux-gnu.so"}

    def wrong(names: set[str]) -> list[str]:
        wheel = tmp_path / "dmoc-1.0-cp311-cp311-manylinux_2_17_x86_64.whl"
        with zipfile.ZipFile(wheel, "w") as archive:
            for name in names:
                archive.writestr(name, "")
        sentences: list[str] = release["wrong_in"](wheel)
        return sentences

    assert wrong(good) == []
    for name in ("tests/test_a.py", "dmoc/base/a.o", "dmoc/base/a.cpython-312-x86_64-linux-gnu.so"):
        (sentence,) = wrong({*good, name})
        assert f"holds {name}, which does not belong there" in sentence
    assert any("lacks dmoc/py.typed" in s for s in wrong(good - {"dmoc/py.typed"}))


def test_interpreters_that_run_are_found(release: dict[str, Any]) -> None:
    assert release["version_of"](sys.executable) == platform.python_version().rpartition(".")[0]
    assert release["version_of"]("no-such-python") == ""


def test_the_project_says_what_it_runs_on(release: dict[str, Any]) -> None:
    """Versions of Python that are named are those that wheels are built for."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = [c.split(" :: ")[-1] for c in project["classifiers"] if ":: Python :: 3." in c]
    assert set(named) <= set(release["VERSIONS"])
    assert project["requires-python"] == f">={named[0]}"


def test_type_checkers_see_the_fields_of_a_problem() -> None:
    """Its __init__ for type checkers says what its fields say, but for the model."""
    (problem,) = (
        node
        for node in ast.parse((ROOT / "problem" / "problem.py").read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef) and node.name == "Problem"
    )
    fields = [
        (node.target.id, ast.unparse(node.annotation))
        for node in problem.body
        if isinstance(node, ast.AnnAssign)
        and isinstance(node.target, ast.Name)
        and not ast.unparse(node.annotation).startswith("ClassVar")
    ]
    (signature,) = (node.body[0] for node in problem.body if isinstance(node, ast.If))
    assert isinstance(signature, ast.FunctionDef)
    _, _, *arguments = [(a.arg, ast.unparse(a.annotation or a)) for a in signature.args.args]
    assert arguments == fields[1:] and len(arguments) > 10
