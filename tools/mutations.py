"""Change single lines of the sources, one at a time, and see whether the tests notice.

Run:  .venv/bin/python tools/mutations.py [--only WORDS] [--list FILE] [--jobs N]

A list (``tools/mutations.toml``) has one entry for each change::

    [[change]]
    file = "check/verdict.py"
    old = '"energy error": 0.02'     # stands there once
    new = '"energy error": 0.2'
    tests = ["tests/check/test_limits.py"]     # optional: those nearest to it
    survives = "why no test can notice it"          # optional

Without ``tests`` the nearest are the files in ``tests`` that import the module, then the folder of
its layer, without those that are slow, then the slow ones of the nearest; last all that are not.

Changes are made in a copy of the checkout; compiled sources are compiled again there.  A test that
fails without the change too tells nothing.  Processes that run tests are forked from one that has
loaded the libraries, and share kernels where what is changed does not generate them.
The exit status is 1 if a change survives without a reason, dies in spite of one, or does not fit
the sources any more.
"""

from __future__ import annotations

import argparse
import filecmp
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from queue import SimpleQueue

ROOT = Path(__file__).resolve().parent.parent
LIST = ROOT / "tools" / "mutations.toml"
FAST, SLOW, IGNORE = ("-m", "not slow"), ("-m", "slow"), "--ignore="
COMPILED = {".pyx", ".pxd", ".pxi", ".c", ".h"}
NUMBERS = count(1)  # of changes
# Folders from which kernels do not follow: what is built is the same, whatever changes there.
AFTER_KERNELS = frozenset(
    """mechanics problem program guess solvers simulation check control report results inspection
    solving proving sequences fitting export planning cli""".split()
)
# What the process has loaded from which those that run tests are forked.
SERVER = get_context("forkserver")
SERVER.set_forkserver_preload(
    """numpy scipy.optimize scipy.sparse.linalg sympy.physics.mechanics matplotlib.figure
    pytest""".split()
)
# Of one group of tests, all that are not slow at most; pytest itself ends a test that hangs.
SECONDS = 600
NO_TESTS, NO_FILE = 5, 4  # pytest's exit status where nothing was collected, or is not there


@dataclass(frozen=True)
class Change:
    """One change, the tests that may notice it, and why it may survive."""

    file: str
    old: str
    new: str
    tests: tuple[str, ...] = ()
    survives: str = ""

    def __str__(self) -> str:
        return f"{self.file}: {' '.join(self.old.split())} -> {' '.join(self.new.split())}"


@dataclass(frozen=True)
class Failure:
    """Tests that failed, or among which one did, and what was said of it."""

    tests: tuple[str, ...]
    words: str
    stood: bool = True  # there were such tests


@dataclass(frozen=True)
class Fate:
    """What became of a change: "died", "survived" or "unfit", and what told it."""

    change: Change
    word: str
    evidence: str

    @property
    def expected(self) -> bool:
        return self.word == ("survived" if self.change.survives else "died")


def main(arguments: Sequence[str] | None = None) -> int:
    """Try the changes of a list and print their fates."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--list", type=Path, default=LIST, help="the changes, as TOML")
    parser.add_argument("--only", default="", help="those whose text contains this")
    parser.add_argument("--jobs", type=int, default=2, help="copies that work side by side")
    options = parser.parse_args(arguments)
    entries = tomllib.loads(options.list.read_text(encoding="utf-8"))["change"]
    changes = [Change(**{**e, "tests": tuple(e.get("tests", ()))}) for e in entries]
    changes = [c for c in changes if options.only in str(c)]
    unexpected = survivors = 0
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory() as folder:
        for fate in fates(changes, Path(folder), max(options.jobs, 1)):
            unexpected += not fate.expected
            survivors += fate.word == "survived"
            mark = " " if fate.expected else "!"
            reason = f" ({fate.change.survives})" if fate.change.survives else ""
            print(f"{mark} {fate.word:9}{fate.change}{reason}: {fate.evidence[:160]}", flush=True)
    print(f"{len(changes)} changes, {survivors} survived, {unexpected} not as expected")
    return 1 if unexpected else 0


def fates(changes: Sequence[Change], folder: Path, jobs: int) -> Iterator[Fate]:
    """The fates of changes, in their order, tried in some copies of the checkout."""
    copies: SimpleQueue[Copy] = SimpleQueue()
    unchanged = copied(folder / "unchanged") if changes else folder
    for number in range(min(jobs, len(changes))):
        own = shutil.copytree(unchanged, folder / f"copy{number}", symlinks=True)
        copies.put(Copy(own, unchanged))

    def tried(change: Change) -> Fate:
        copy = copies.get()
        try:
            return fate(change, copy)
        finally:
            copies.put(copy)

    with ThreadPoolExecutor(max(jobs, 1)) as pool:
        yield from pool.map(tried, changes)


def copied(to: Path) -> Path:
    """A copy of the checkout with what was compiled in it."""
    left_out = (".git", ".venv", "dist", "docs/_build", "*.egg-info", "__pycache__", ".hypothesis")
    shutil.copytree(ROOT, to, symlinks=True, ignore=shutil.ignore_patterns(*left_out))
    if not built(to):
        sys.exit("the unchanged sources do not compile: `make mutations` installs what it takes")
    return to


@dataclass(frozen=True)
class Copy:
    """A folder with the sources that are changed, and one beside it in which nothing is."""

    folder: Path
    unchanged: Path

    def write(self, file: str, text: str) -> None:
        """Write a file, later than what was compiled, and with a time of its own, by which its
        bytecode is told from that of other changes."""
        path = self.folder / file
        path.write_text(text, encoding="utf-8")
        now = int(time.time()) + next(NUMBERS)
        os.utime(path, (now, now))

    def restore(self, file: str) -> None:
        """Take back a change, and what was compiled with it."""
        shutil.copy2(self.unchanged / file, self.folder / file)
        if Path(file).suffix in COMPILED:
            for path in self.unchanged.rglob("*"):
                own = self.folder / path.relative_to(self.unchanged)
                if path.is_file() and not (own.is_file() and filecmp.cmp(path, own)):
                    shutil.copy2(path, own)


def fate(change: Change, copy: Copy) -> Fate:
    """Make a change in a copy, run the tests nearest to it, and take it back."""
    path = copy.folder / change.file
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    if text.count(change.old) != 1:
        return Fate(change, "unfit", f"the old text stands there {text.count(change.old)} times")
    shared = change.file.partition("/")[0] in AFTER_KERNELS
    groups = [change.tests] if change.tests else groups_near(change.file)
    try:
        copy.write(change.file, text.replace(change.old, change.new))
        compiles = path.suffix not in COMPILED or built(copy.folder)
        ran = (run(group, copy, shared) for group in groups)
        failed = next(filter(None, ran), None) if compiles else None
    finally:
        copy.restore(change.file)
    if not compiles:
        return Fate(change, "unfit", "it does not compile")
    if failed is None:
        named = (" ".join(w for w in g if not w.startswith(IGNORE)) for g in groups)
        return Fate(change, "survived", "in " + ", ".join(named))
    if not failed.stood:
        return Fate(change, "unfit", failed.words)
    if fails_anyway(failed.tests, copy):
        return Fate(change, "unfit", f"without the change it fails too: {failed.words}")
    return Fate(change, "died", failed.words)


def run(tests: tuple[str, ...], copy: Copy, shared: bool = True) -> Failure | None:
    """Run tests in a copy; the first that fails, or all where none says so; None where all pass.
    They have a session of their own: what a change lets a test end is not this process."""
    with tempfile.TemporaryDirectory() as folder:
        printed = Path(folder) / "printed"
        kernels = copy.unchanged.parent / "kernels" if shared else Path(folder) / "kernels"
        process = SERVER.Process(target=run_pytest, args=(tests, copy.folder, kernels, printed))
        process.start()
        process.join(SECONDS)
        if process.exitcode is None:
            os.killpg(process.pid or 0, signal.SIGKILL)
            return Failure(tests, f"{' '.join(tests)} took more than {SECONDS} s")
        text = printed.read_text(encoding="utf-8", errors="replace")
    if process.exitcode in (0, NO_TESTS):
        return None
    if process.exitcode == NO_FILE:
        return Failure(tests, f"{' '.join(tests)}: no such tests", stood=False)
    lines = [x for x in text.splitlines() if x.startswith(("FAILED", "ERROR"))]
    if not lines:
        return Failure(tests, text[-160:])
    return Failure((lines[0].partition(" ")[2].split(" - ")[0],), lines[0])


def run_pytest(tests: tuple[str, ...], folder: Path, kernels: Path, printed: Path) -> None:
    """In a process of its own: run tests of a folder, whose sources come before an installation."""
    os.setsid()
    os.chdir(folder)
    with printed.open("w") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
    os.environ |= {"PYTHONPATH": f"{folder / 'src'}", "DMOC_TEST_KERNELS": f"{kernels}", "CI": "1"}
    sys.path[:] = [f"{folder}", f"{folder / 'src'}", *(p for p in sys.path if p != f"{ROOT}/tools")]
    import pytest

    sys.exit(pytest.main(["-x", "-q", "-n", "0", *tests]))


@cache
def fails_anyway(tests: tuple[str, ...], copy: Copy) -> bool:
    """Whether tests fail in a copy in which nothing is changed."""
    return run(tests, copy) is not None


def groups_near(file: str) -> list[tuple[str, ...]]:
    """What runs the tests near a file, each once: the fast ones, and before those of all other
    layers the slow ones of the nearest."""
    near, groups, done = list(nearest(file)), list[tuple[str, ...]](), list[str]()
    for group in near:
        groups.append((*FAST, *group, *done))
        done += [f"{IGNORE}{tests}" for tests in group]
    return [*groups[:-1], (*SLOW, *near[0]), groups[-1]]


def nearest(file: str) -> Iterator[tuple[str, ...]]:
    """Groups of tests near a file: those that import its module, the most closely named and those
    with the fewest other modules first, then the folder of its layer, then all."""
    parts = [part for part in Path(file).with_suffix("").parts if part not in ("src", "dmoc")]
    layer = parts[0] if len(parts) > 1 else "public"
    package, stem = ".".join(["dmoc", *parts[:-1]]), parts[-1]
    names = (f"{package}.{stem} ", f"from {package} import {stem}")
    files = [
        path for path in sorted((ROOT / "tests").rglob("test_*.py"))
        if not {*path.relative_to(ROOT).parts} & left_out()
    ]  # fmt: skip
    texts = {path: path.read_text(encoding="utf-8") for path in files}
    near = [p for p, text in texts.items() if any(name in text for name in names)]
    near.sort(key=lambda p: (stem not in p.stem, texts[p].count("from dmoc.")))
    if near:
        yield tuple(str(p.relative_to(ROOT)) for p in near)
    if (ROOT / "tests" / layer).is_dir():
        yield (f"tests/{layer}",)
    yield ("tests",)


@cache
def left_out() -> frozenset[str]:
    """Folders whose tests need more than `make test` has."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return frozenset(project["tool"]["pytest"]["ini_options"]["norecursedirs"])


def built(copy: Path) -> bool:
    """Compile what has changed in a copy."""
    words = [sys.executable, "setup.py", "--quiet", "build_ext", "--inplace"]
    run = subprocess.run(words, cwd=copy, capture_output=True, check=False)
    return run.returncode == 0


if __name__ == "__main__":
    sys.exit(main())
