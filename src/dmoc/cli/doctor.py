"""The command ``dmoc doctor``: what is installed, and what is missing."""

from __future__ import annotations

import os

import typer
from rich.table import Table
from rich.text import Text

from dmoc.cli.options import BAD_INPUT
from dmoc.cli.output import coloured
from dmoc.cli.writing import out
from dmoc.solving.methods import METHODS


def doctor() -> None:
    """Show compiler, versions, cache and optional parts, and what is missing."""
    import platform
    from importlib import metadata

    from dmoc.codegen.build import cache_directory, compiler, load_installed
    from dmoc.codegen.private import make_folder
    from dmoc.errors import BuildError
    from dmoc.models import catalogue

    table = Table("part", "state", box=None, header_style="bold")
    table.add_row("python", platform.python_version())
    for name in ("dmoc", "numpy", "scipy", "sympy", "symengine", "cython"):
        table.add_row(name, metadata.version(name))
    healthy = True
    try:
        table.add_row("C compiler", " ".join(compiler()))
    except BuildError as error:
        table.add_row("C compiler", Text.assemble(coloured(False, "missing"), f": {error}"))
        healthy = False
    cache = cache_directory()
    try:
        make_folder(cache)
        writable = os.access(cache, os.W_OK)
    except OSError:
        writable = False
    entries = len([p for p in cache.iterdir() if p.is_dir()]) if cache.is_dir() else 0
    table.add_row(
        "kernel cache",
        f"{cache}, {entries} models"
        if writable
        else Text.assemble(
            f"{cache} ",
            coloured(False, "cannot be written"),
            ": set DMOC_CACHE to a writable folder",
        ),
    )
    healthy = healthy and writable
    for name in catalogue.models():
        table.add_row(
            f"model {name}",
            "compiled"
            if load_installed(f"dmoc.generated.{name}")
            else "not compiled: built on first use",
        )
    extras = [("matplotlib", "plot", "draw figures")]
    extras += [(m.package, m.name, f"use method {m.name}") for m in METHODS.values() if m.package]
    for name, extra, what in extras:
        try:
            table.add_row(name, metadata.version(name))
        except metadata.PackageNotFoundError:
            table.add_row(name, f"not installed: `pip install 'dmoc[{extra}]'` to {what}")
    out.print(table)
    raise typer.Exit(0 if healthy else BAD_INPUT)
