"""The kernel cache: found again, rebuilt when damaged, safe for several processes, and machines
without a compiler."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import sysconfig
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from systems import block_system

import dmoc
from dmoc.base.errors import BuildError
from dmoc.codegen import build, compiler
from dmoc.codegen.build import LIBRARY
from dmoc.models.registry import find

pytestmark = pytest.mark.slow


def entry(cache: Path) -> Path:
    (folder,) = (p for p in cache.iterdir() if p.is_dir() and p.name.startswith("cached-"))
    return folder


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def works(kernels: dmoc.codegen.kernels.Kernels) -> bool:
    one = np.ones((1, 1))
    return bool(
        kernels.call("dynamics", one, one, one, one, np.array([[3.0, 1.0]]))[0][0, 0] == 3.0
    )


def test_a_second_build_finds_the_first(own_cache: Path) -> None:
    first = dmoc.build(block_system("cached"))
    second = dmoc.build(block_system("cached"))
    assert first.seconds > 0 and second.seconds == 0
    assert works(first) and works(second)
    assert first.module == second.module and dmoc.load("puck_table") == dmoc.load("puck_table")


@pytest.mark.parametrize("damage", ["truncate", "remove", "text"])
def test_a_damaged_entry_is_built_again(own_cache: Path, damage: str) -> None:
    dmoc.build(block_system("cached"))
    library = entry(own_cache) / LIBRARY
    if damage == "truncate":
        content = library.read_bytes()
        library.unlink()  # this process has it mapped
        library.write_bytes(content[:1000])
    elif damage == "remove":
        library.unlink()
    else:
        (entry(own_cache) / "manifest.json").write_text("{")
    again = dmoc.build(block_system("cached"))
    assert again.seconds > 0 and works(again)


def test_another_model_of_the_same_name_gets_an_entry_of_its_own(own_cache: Path) -> None:
    """Both are used in turn, though their libraries have the same symbols."""
    system = block_system("cached")
    masses = {c: dmoc.build(replace(system, lagrangian=c * system.lagrangian)) for c in (1, 2)}
    one, par = np.ones((1, 1)), np.array([[3.0, 1.0]])
    for c, kernels in (*masses.items(), *masses.items()):
        assert kernels.call("dynamics", one, one, one, one, par)[0][0, 0] == 3.0 * c


def test_two_processes_building_at_once_both_succeed(own_cache: Path) -> None:
    program = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r}); import systems, dmoc;"
        "k = dmoc.build(systems.block_system('cached')); assert k.backend == 'compiled'"
    )
    running = [
        subprocess.Popen(
            [sys.executable, "-c", program], env={**os.environ, "DMOC_CACHE": str(own_cache)}
        )
        for _ in range(2)
    ]
    assert [p.wait() for p in running] == [0, 0]
    entry(own_cache)


def test_without_a_compiler_numpy_takes_over_with_a_warning(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.warns(RuntimeWarning, match=r"no C compiler was found \(CC=no-such-compiler\)"):
        kernels = dmoc.build(block_system("cached"))
    assert kernels.backend == "numpy" and works(kernels)
    with pytest.raises(BuildError, match="install gcc or clang"):
        dmoc.build(block_system("cached"), backend="compiled")


def test_the_compiler_of_a_package_serves_where_there_is_no_other(
    own_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, flags: tuple[str, ...]
) -> None:
    """Its kernels have the digits of those of the usual one, at random arguments."""
    system = find("cart_pendulum").system()
    usual = dmoc.build(system, backend="compiled")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path / "other"))
    monkeypatch.setattr(compiler, "FLAGS", flags)
    assert compiler.tried_compiler()[1:4] == ["-m", "ziglang", "cc"]
    own, random = dmoc.build(system, backend="compiled"), np.random.default_rng(0)
    for kernel, facts in own.manifest.kernels.items():
        inputs = [random.uniform(0.1, 1.0, (5, size)) for _, size in facts["inputs"]]
        for a, b in zip(own.call(kernel, *inputs), usual.call(kernel, *inputs), strict=True):
            np.testing.assert_array_equal(a, b, kernel)
    monkeypatch.setitem(sys.modules, "ziglang", None)
    with pytest.raises(BuildError, match=r"no C compiler was found: .* `pip install 'dmoc\[cc\]'`"):
        compiler.compiler()


def test_a_warning_names_the_line_that_called(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However deep inside the package it is given: a problem builds its system's kernels."""
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.warns(RuntimeWarning, match="no C compiler") as caught:
        dmoc.Problem(block_system("cached"), start={"x": 0.0}, final_time=1.0)
    assert [warning.filename for warning in caught] == [__file__]


def test_a_build_takes_a_compiler_and_nothing_of_python(
    own_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither Cython nor Python's headers, and one call of the compiler."""
    command = tmp_path / "compiler"
    command.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/calls\nexec cc "$@"\n')
    command.chmod(0o700)
    monkeypatch.setenv("CC", str(command))
    monkeypatch.setitem(sys.modules, "Cython", None)
    kernels = dmoc.build(block_system("cached"), backend="compiled")
    (call,) = (tmp_path / "calls").read_text().splitlines()
    assert works(kernels) and sysconfig.get_path("include") not in call


@pytest.mark.parametrize("command", ["false", "true"])
def test_a_failing_compiler_shows_its_output(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """One that makes nothing fails too."""
    monkeypatch.setenv("CC", command)
    with pytest.raises(BuildError, match="the compiler failed"):
        dmoc.build(block_system("cached"))
    assert not [p for p in own_cache.iterdir() if p.is_dir()]


def test_an_unwritable_cache_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DMOC_CACHE", "/proc/no-such-place")
    with pytest.raises(BuildError, match="set DMOC_CACHE to a writable folder"):
        dmoc.build(block_system("cached"))


def test_an_unknown_backend_is_refused() -> None:
    with pytest.raises(BuildError, match="expected one of auto, compiled, numpy"):
        dmoc.build(block_system(), backend="gpu")


def test_kernels_travel_between_processes(
    own_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a shared cache they are found there; without one they are built from the sources that
    travel along."""
    x = np.array([[0.3]])
    for kernels in (dmoc.build(block_system()), dmoc.build(block_system(), backend="numpy")):
        sent = pickle.dumps(kernels)
        for folder in (own_cache, tmp_path / "elsewhere"):
            monkeypatch.setenv("DMOC_CACHE", str(folder))
            again = pickle.loads(sent)
            assert again.backend == kernels.backend and again.manifest == kernels.manifest
            par = np.array([list(again.parameters.values())], dtype=float)
            assert again.call("surface", x, x, par)[0] == kernels.call("surface", x, x, par)[0]


def test_problems_and_solutions_travel_between_processes(seed: dmoc.Problem) -> None:
    problem = pickle.loads(pickle.dumps(seed.but(steps=20)))
    solution = pickle.loads(pickle.dumps(dmoc.solve(problem, method="ipm", verify=False)))
    assert solution.cost == dmoc.solve(seed.but(steps=20), method="ipm", verify=False).cost


def test_another_generator_has_entries_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys, source = set(), tmp_path / "families.py"
    monkeypatch.setattr(build, "_sources", lambda _: [source])
    monkeypatch.setattr(build, "_generator", build._generator.__wrapped__)
    for text in ("a = 1", "a = 2"):
        source.write_text(text)
        keys.add(build._entry_key("model"))
    assert len(keys) == 2
