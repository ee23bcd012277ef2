"""Folders of solvers in C: their names, their sources, other compilers, and how they test
themselves."""

from __future__ import annotations

import errno
import os
import shutil
import sys
from pathlib import Path

import pytest
import sympy as sp
import ziglang
from c_objects import WARNINGS
from carried_folder import compiled, run
from carried_problems import linkage
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import OutputError

MINE = ("main.c", "test.c", "driver.c", "refusals.c")


def test_folders_that_are_refused(tmp_path: Path) -> None:
    problem = linkage(2)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes").write_text("mine")
    with pytest.raises(OutputError, match="full exists and is not an empty folder: name a new one"):
        dmoc.generate_solver(problem, tmp_path / "full")
    for name in ("two words", "9lives", "dmoc_solver", "main"):
        with pytest.raises(OutputError, match="no free name in C"):
            dmoc.generate_solver(problem, tmp_path / name)
    assert [p.name for p in tmp_path.iterdir()] == ["full"]


@pytest.mark.parametrize("is_new", [True, False])
def test_a_full_disk_leaves_no_half_of_a_folder(
    is_new: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same command works when there is room again."""
    problem, target, writes = linkage(2), tmp_path / "bob", iter(range(100))
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    if not is_new:
        target.mkdir()

    def full(_: int) -> None:
        if next(writes) == 7:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as disk:
        disk.setattr(os, "fsync", full)
        with pytest.raises(OutputError, match="No space left on device"):
            dmoc.generate_solver(problem, target, guess=solution)
    assert target.exists() is not is_new and not [*tmp_path.rglob("*.*")]
    assert len(dmoc.generate_solver(problem, target, guess=solution)) > 20


@pytest.mark.slow
@pytest.mark.parametrize("title", ["*/ int stray = 1; /*", "a **/ b", "/*/ c", "a /* b", "*/*/ d"])
def test_a_title_stays_in_its_comment(title: str, tmp_path: Path) -> None:
    """Nothing that a user writes is C, and no compiler warns of it."""
    x, u = dynamicsymbols("x u")
    sled = dmoc.MechanicalSystem(
        "sled", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2, title=title
    )
    problem = dmoc.Problem(dmoc.build(sled), {x: 0}, {x: 1, "x_dot": 0}, steps=4, final_time=1)
    dmoc.generate_solver(problem, tmp_path / "sled")
    header = (tmp_path / "sled" / "sled.h").read_text()
    comment, _, code = header.partition("*/")
    assert code.startswith("\n#ifndef SLED_HEADER") and title[-1] in comment
    compiled(tmp_path / "sled")


@pytest.mark.parametrize("name", ["math", "passes", "clean", "2nd", "swing-up"])
def test_names_that_something_else_has_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="no free name in C"):
        dmoc.generate_solver(linkage(2), tmp_path / name)


@pytest.mark.slow
def test_names_that_differ_in_capitals_alone(tmp_path: Path) -> None:
    """Parameters m and M, and the tables of the times and of friction."""
    x, u = dynamicsymbols("x u")
    m, M = sp.symbols("m M")
    sled = dmoc.MechanicalSystem(
        "sled", [x], (m + M) * x.diff() ** 2 / 2, {m: 1.0, M: 2.0}, [u], {x: u},
        tangents={"belt": x - dynamicsymbols._t / 5}, friction={"belt": 0.5}, cost=u**2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(sled), {"x": 0, "x_dot": 1}, {"x": 1, "x_dot": 0.5}, contacts=["belt:slip+"],
        steps=8, final_time=1.5,
    )  # fmt: skip
    dmoc.generate_solver(problem, tmp_path / "sled")
    program = compiled(tmp_path / "sled")
    assert run(program, "parameters.M=2.5", folder=tmp_path / "sled").returncode == 0


def test_the_sources_are_those_of_the_package(folder: Path) -> None:
    import dmoc.export
    import dmoc.program
    import dmoc.solvers

    places = [Path(p) for m in (dmoc.export, dmoc.program, dmoc.solvers) for p in m.__path__]
    for name in ("interior_point.c", "ldl.c", "passes.c", "dmoc_solver.c"):
        (own,) = [p / name for p in places if (p / name).exists()]
        assert (folder / name).read_text() == own.read_text()
    every = "".join(p.read_text() for p in folder.glob("*.[ch]") if p.name not in MINE)
    for word in ("malloc", "calloc", " free(", "<time.h>", "<stdlib.h>", "<stdio.h>"):
        assert word not in every


@pytest.mark.slow
@pytest.mark.parametrize("language", [("cc", "-std=c11"), ("c++", "-x", "c++", "-std=c++17")])
def test_clang_has_nothing_against_it(
    language: tuple[str, ...], folder: Path, tmp_path: Path
) -> None:
    """Neither as C nor as C++; zig's compiler is clang."""
    zig = str(Path(ziglang.__file__).with_name("zig"))
    for source in sorted(folder.glob("*.c")):
        if source.name != "driver.c":
            command = (zig, *language, *WARNINGS, "-c", source.name, "-o", str(tmp_path / "o"))
            done = run(*command, folder=folder)
            assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("tool", ["make", "cmake"])
def test_the_folder_tests_itself(tool: str, folder: Path, tmp_path: Path) -> None:
    """An optimising compiler sees more that is worth a warning; cmake need not optimise, too."""
    target = shutil.copytree(
        folder, tmp_path / "bob", ignore=shutil.ignore_patterns("driver*", "*.o")
    )
    if tool == "make":
        flags = f"CFLAGS=-O2 {' '.join(WARNINGS)}"
        done = run("make", "--no-print-directory", flags, "test", folder=target)
    else:
        cmake = (sys.executable, "-m", "cmake")
        run(*cmake, "-B", "build", "-DCMAKE_BUILD_TYPE=Debug", folder=target)
        run(*cmake, "--build", "build", folder=target)
        done = run("build/test_bob", folder=target)
    assert done.returncode == 0 and done.stdout.rstrip().endswith("passed"), done.stdout
    text = (target / "test.c").read_text()
    (target / "test.c").write_text(text.replace("const double cost = ", "const double cost = 1 + "))
    if tool == "make":
        assert run("make", "test", folder=target).returncode != 0
