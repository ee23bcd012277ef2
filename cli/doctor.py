"""The command ``dmoc doctor``: what is installed, and what is missing."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Annotated

from rich.table import Table
from rich.text import Text

from dmoc.cli.console import emit, out
from dmoc.cli.shared_options import BAD_INPUT
from dmoc.cli.words import option
from dmoc.solving.methods import METHODS

PACKAGES = ("numpy", "scipy", "sympy")


class PartState(StrEnum):
    """What a part is like: there, not there and not needed, or a reason for trouble."""

    OK = "ok"
    ABSENT = "absent"
    WRONG = "wrong"


COLOURS = {PartState.OK: "", PartState.ABSENT: "dim", PartState.WRONG: "red"}


@dataclass(frozen=True)
class Finding:
    """What was found of one part, and what cures it."""

    part: str
    found: str
    state: PartState = PartState.OK
    cure: str = ""


def doctor(
    json_: Annotated[bool, option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Show compiler, versions, cache and optional parts, what is missing, and what cures it."""
    findings = [*_versions(), _compiler(), _cache(), *_models(), *_extras()]
    wrong = [f.part for f in findings if f.state is PartState.WRONG]
    if json_:
        emit({"well": not wrong, "parts": [asdict(f) for f in findings]}, "-")
    else:
        _print(findings, wrong)
    sys.exit(BAD_INPUT if wrong else 0)


def versions() -> str:
    """dmoc, Python and what kernels run on, in a line."""
    import platform
    from importlib.metadata import version

    from dmoc.base.errors import BuildError
    from dmoc.codegen.compiler import compiler

    try:
        backend = f"kernels are compiled by {' '.join(compiler())}"
    except BuildError:
        backend = "kernels run on NumPy, because there is no C compiler"
    return f"dmoc {version('dmoc')}, Python {platform.python_version()}; {backend}"


def _print(findings: list[Finding], wrong: list[str]) -> None:
    table = Table("part", "state", box=None, header_style="bold")
    for f in findings:
        cure = f"; {f.cure}" if f.cure else ""
        table.add_row(f.part, Text(f"{f.found}{cure}", style=COLOURS[f.state]))
    out.print(table)
    if wrong:
        out.print(Text(f"Not well: {', '.join(wrong)}.", style="red"))
        return
    absent = sum(f.state is PartState.ABSENT for f in findings)
    rest = f"; {absent} optional part{'s are' if absent > 1 else ' is'} not there" if absent else ""
    out.print(Text(f"All is well{rest}.", style="green"))


def _versions() -> Iterator[Finding]:
    import platform
    from importlib.metadata import version

    yield Finding("python", platform.python_version())
    for name in ("dmoc", *PACKAGES):
        yield Finding(name, version(name))


def _compiler() -> Finding:
    """Whether a library can be compiled, by compiling one."""
    from dmoc.base.errors import BuildError
    from dmoc.codegen.compiler import tried_compiler

    try:
        return Finding("C compiler", " ".join(tried_compiler()))
    except BuildError as error:
        cure = (
            f"{error} Until then shipped models are solved with their compiled kernels, others "
            "with NumPy kernels, which are much slower."
        )
        return Finding("C compiler", "cannot be used", PartState.WRONG, cure)


def _cache() -> Finding:
    """Whether built kernels can be kept."""
    from dmoc.codegen.build import cache_directory
    from dmoc.codegen.private_files import make_folder, objection

    cache = cache_directory()
    try:
        make_folder(cache)
        why = objection(cache.resolve()) or _full(cache)
    except OSError as error:
        why = f"it cannot be written ({error.strerror})"
    if why:
        return Finding(
            "kernel cache", f"{cache} is not used", PartState.WRONG,
            f"{why}: set DMOC_CACHE to a folder of your own",
        )  # fmt: skip
    entries = sum(1 for p in cache.iterdir() if p.is_dir())
    return Finding("kernel cache", f"{cache}, {entries} model{'' if entries == 1 else 's'}")


def _full(cache: object) -> str:
    """Why nothing can be written into a folder; empty if it can."""
    import tempfile

    try:
        with tempfile.TemporaryFile(dir=str(cache)) as file:
            file.write(bytes(4096))
    except OSError as error:
        return f"it cannot be written ({error.strerror})"
    return ""


def _models() -> Iterator[Finding]:
    from dmoc.base.errors import BuildError
    from dmoc.codegen.build import load_installed
    from dmoc.models import catalogue

    for name in catalogue.models():
        try:
            kernels = load_installed(f"dmoc.generated.{name}")
        except BuildError as error:
            yield Finding(f"model {name}", "cannot be used", PartState.WRONG, str(error))
            continue
        yield Finding(f"model {name}", "compiled" if kernels else "built on first use")


def _extras() -> Iterator[Finding]:
    from importlib.metadata import PackageNotFoundError, version

    extras = [("matplotlib", "plot", "draws figures")]
    extras += [
        (m.package, m.name, f"is behind method {m.name}") for m in METHODS.values() if m.package
    ]
    extras += [("imageio-ffmpeg", "mp4", "writes mp4 where the machine has no ffmpeg")]
    extras += [("dask", "dask", "lets other machines search")]
    extras += [("mujoco-core", "robots", "reads URDF and MJCF")]
    extras += [("ziglang", "cc", "compiles where there is no other compiler")]
    for name, extra, what in extras:
        try:
            yield Finding(name, version(name))
        except PackageNotFoundError:
            cure = f"pip install 'dmoc[{extra}]' ({what})"
            yield Finding(name, "not installed", PartState.ABSENT, cure)
