"""Long functions in chunks: they compute what whole ones do, in one file or by several compilers at
once."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from commands import printed
from systems import chain_system

from dmoc.codegen import compiler, loops, text
from dmoc.codegen.border import Library
from dmoc.codegen.build import write_files
from dmoc.codegen.compiler import HEADERS, compile_library
from dmoc.codegen.printer import CPrinter, Listing, listing
from dmoc.codegen.schedule import functions_of
from dmoc.codegen.text import c_files
from dmoc.symbolic import families, kernel_family
from dmoc.symbolic.families import model_spec
from dmoc.symbolic.spec import ModelSpec


@pytest.fixture(scope="module")
def model() -> ModelSpec:
    """A double pendulum whose Lagrangian is a function of its own, as that of a large model."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(families, "LARGE_STEP", 0)
        return model_spec(chain_system(2), 4)


@pytest.fixture(scope="module")
def short_chunks(model: ModelSpec) -> dict[str, str]:
    """Its sources with chunks of a few operations."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text, "LONG", 15)
        patch.setattr(text, "CHUNK", 30)
        patch.setattr(loops, "LOOP", 3)
        return c_files(model)


def compiled(folder: Path, files: dict[str, str], name: str) -> Library:
    folder.mkdir()
    write_files(folder, files)
    compile_library(folder, compiler.compiler(), "kernels.so")
    return Library(folder / "kernels.so", name)


def test_chunks_have_the_bits_of_whole_functions(
    model: ModelSpec, short_chunks: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = compiled(tmp_path / "whole", c_files(model), model.name)
    one_file = compiled(tmp_path / "one", short_chunks, model.name)
    monkeypatch.setattr(compiler, "LARGE", 0)
    monkeypatch.setattr(compiler, "processors", lambda: 3)
    shares = compiled(tmp_path / "shares", short_chunks, model.name)
    rng = np.random.default_rng(1)
    for k in model.kernels:
        inputs = tuple(rng.uniform(0.5, 1.0, (5, a.size)) for a in k.inputs)
        values = whole.functions()[k.name].rows(inputs)
        for library in (one_file, shares):
            for a, b in zip(values, library.functions()[k.name].rows(inputs), strict=True):
                assert a.tobytes() == b.tobytes(), k.name
    assert sum(map(np.size, values)) and "lagrangian_2_part1" in short_chunks["kernels.c"]
    assert short_chunks["kernels.c"].count("for (int i = 0; i < ") > 5


def test_each_share_has_its_units_alone(short_chunks: dict[str, str], tmp_path: Path) -> None:
    """Every unit is compiled once, the longest ones by different compilers."""
    write_files(tmp_path, short_chunks)
    numbers = [int(n) for n in re.findall(r"#if UNIT\((\d+)\)", short_chunks["kernels.c"])]
    assert sorted(numbers) == [0, *range(max(numbers) + 1)]  # 0 has the table, too
    command = [*compiler.compiler(), "-E", "-P", f"-I{HEADERS}", "kernels.c"]
    whole, *shares = (
        len(printed(*command, *own, cwd=tmp_path)) for own in ([], *map(share, range(2)))
    )
    assert max(shares) < 1.1 * min(shares) and sum(shares) < 1.5 * whole


def share(number: int) -> list[str]:
    return ["-DDMOC_SHARES=2", f"-DDMOC_SHARE={number}"]


def test_sources_in_chunks_are_one_file_without_warnings(
    short_chunks: dict[str, str], tmp_path: Path
) -> None:
    write_files(tmp_path, short_chunks)
    flags = ["-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", f"-I{HEADERS}", "-c", "kernels.c"]
    for own in ([], share(1)):
        printed(*compiler.compiler(), *flags, *own, cwd=tmp_path)


def test_values_share_the_places_of_those_that_nobody_reads_any_more(model: ModelSpec) -> None:
    """The array on the stack is shorter than what goes through it."""
    spec = next(k for k in model.kernels if k.name == "dynamics")
    code = listing(spec, CPrinter)
    parts, size = text.cut(code, 5)
    chunks = [part for part in parts if isinstance(part, Listing)]
    stored = sum(p.startswith("W[") for c in chunks for places, _ in c.results for p in places)
    assert len(chunks) > 3 and 0 < size < stored
    assert sum(len(c.statements) for c in chunks) == len(code.statements)


def test_steps_of_large_models_are_loops_for_the_most_part() -> None:
    """Where there are many derivatives, those put together from functions keep a few forms."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(families, "LARGE_STEP", 0)
        patch.setattr(kernel_family, "MANY", 50)
        large = model_spec(chain_system(2), 4)
    spec = next(k for k in large.kernels if k.name == "step_hess")
    code = listing(spec, CPrinter, functions_of(large.kernels))
    parts, _ = text.cut(code, text.CHUNK)
    chunks = [part for part in parts if isinstance(part, Listing)]
    alone = [c.statements for c in chunks]
    results = [p for c in chunks for (p, *_), _ in c.results if not p.startswith("W[")]
    left = sum(map(len, alone)) + len(results)
    assert left < 0.6 * (len(code.statements) + len(code.results))
