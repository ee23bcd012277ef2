"""Solvers in C compiled for other processors, which run there as here: qemu emulates them."""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import dmoc
from dmoc.models.registry import find

FLAGS = ("-static", "-std=c11", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror")
# What ELF calls processors, and what zig and qemu do.
PROCESSORS = {"arm": (40, "arm-linux-musleabihf"), "aarch64": (183, "aarch64-linux-musl")}


def run(*command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    reference = find("cart_pendulum")
    problem = dmoc.Problem(reference.kernels(2), **reference.defaults).but(steps=50)
    target = tmp_path_factory.mktemp("solver") / "swing_up"
    dmoc.generate_solver(problem, target)
    return target


def built(target: str, folder: Path, main: str, program: Path) -> str:
    """A program of the folder for a processor, with its C library."""
    others = ("main.c", "test.c")
    sources = [main, *sorted(p.name for p in folder.glob("*.c") if p.name not in others)]
    zig = (sys.executable, "-m", "ziglang", "cc", "-target", target, *FLAGS)
    done = run(*zig, *sources, "-lm", "-o", str(program), folder=folder)
    assert done.returncode == 0, done.stderr
    return str(program)


@pytest.fixture(scope="module")
def here(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """What the program prints on this processor, from the first motion with another mass."""
    own = tmp_path_factory.mktemp("own") / "main"
    program = built(f"{platform.machine()}-linux-musl", folder, "main.c", own)
    done = run(program, "first", "parameters.m_c=1.2", folder=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("processor", PROCESSORS)
def test_the_same_digits_on_other_processors(
    processor: str, folder: Path, here: str, tmp_path: Path
) -> None:
    machine, target = PROCESSORS[processor]
    qemu = shutil.which(f"qemu-{processor}-static") or shutil.which(f"qemu-{processor}")
    assert qemu, "apt-get install qemu-user-static"
    program = built(target, folder, "main.c", tmp_path / "main")
    assert int.from_bytes(Path(program).read_bytes()[18:20], "little") == machine
    there = run(qemu, program, "first", "parameters.m_c=1.2", folder=folder)
    assert there.stdout == here
    tried = run(qemu, built(target, folder, "test.c", tmp_path / "test"), folder=folder)
    assert tried.returncode == 0 and tried.stdout.endswith("passed\n"), tried.stdout
