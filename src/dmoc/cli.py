"""The command line: models, derive, generate, build, solve, verify, plot, doctor.

Exit status: 0 solved and verified, 1 not solved, 2 wrong use or bad input.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Callable
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from dmoc.errors import DmocError, OutputError, ProblemError

if TYPE_CHECKING:
    from dmoc.nlp.problem import Problem
    from dmoc.simulation.check import Verification
    from dmoc.solution import Solution
    from dmoc.solvers.outcome import Iteration

app = typer.Typer(
    help="Discrete mechanics and optimal control for mechanical systems with collisions.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
out = Console()
err = Console(stderr=True)
NOT_SOLVED, BAD_INPUT = 1, 2

ModelArgument = Annotated[str, typer.Argument(help="Name of a shipped model or problem, or file.py:name.", show_default=False)]
JsonOption = Annotated[
    str | None,
    typer.Option("--json", metavar="FILE|-", help="Write the result as JSON; with - standard output is the JSON alone."),
]


class TextFormat(StrEnum):
    text = "text"
    latex = "latex"


class Form(StrEnum):
    condensed = "condensed"
    full = "full"


class Controls(StrEnum):
    constant = "constant"
    linear = "linear"


@app.callback()
def _options(debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks of errors.")] = False) -> None:
    del debug  # read by main, before anything can fail


@app.command()
def models() -> None:
    """List the shipped models and problems."""
    from dmoc.models import catalogue

    table = Table("name", "model", "what", box=None, header_style="bold")
    for name, entry in catalogue.ENTRIES.items():
        table.add_row(name, entry.model, entry.title + ("" if entry.problem else " - no problem, give one by options"))
    out.print(table)


@app.command()
def derive(
    model: ModelArgument,
    format_: Annotated[TextFormat, typer.Option("--format", help="Readable text, or a LaTeX document.")] = TextFormat.text,
    target: Annotated[Path | None, typer.Option("--out", help="Write to a file instead of standard output.")] = None,
) -> None:
    """Print every step of the derivation of a model."""
    from dmoc.registry import find
    from dmoc.symbolic.derivation import derive as derive_system

    derivation = derive_system(find(model).system())
    text = derivation.latex() if format_ is TextFormat.latex else str(derivation)
    if target is None:
        sys.stdout.write(text)
    else:
        _write_text(target, text)


@app.command()
def generate(
    model: ModelArgument,
    target: Annotated[
        Path | None, typer.Option("--out", help="Folder for the sources; by default a folder of the model's name.")
    ] = None,
) -> None:
    """Write the C and Cython sources of a model."""
    from dmoc.codegen.build import write_files
    from dmoc.codegen.text import c_files
    from dmoc.registry import find
    from dmoc.symbolic.kernels import model_spec

    files = c_files(model_spec(find(model).system()))
    folder = target or Path(find(model).system().name)
    try:
        paths = write_files(folder, files)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written ({error.strerror}): choose a writable folder.") from None
    for path in paths:
        out.print(str(path), highlight=False, soft_wrap=True)


@app.command()
def build(
    model: ModelArgument,
    force: Annotated[bool, typer.Option("--force", help="Build again even if the cache holds the kernels.")] = False,
) -> None:
    """Compile the kernels of a model into the cache."""
    from dmoc import registry

    kernels = registry.build(registry.find(model).system(), backend="compiled", force=force)
    state = f"built in {kernels.seconds:.2f} s" if kernels.seconds else "found in the cache"
    out.print(f"{kernels.name}: {state}, {kernels.module.__file__}", highlight=False, soft_wrap=True)


@app.command()
def solve(
    model: ModelArgument,
    sequence: Annotated[
        str | None, typer.Option(help="Surfaces in the order of the collisions, as left,right; '' for none.")
    ] = None,
    steps: Annotated[str | None, typer.Option(help="Steps of each phase, one number or one for each phase, as 100,50.")] = None,
    final_time: Annotated[
        str | None, typer.Option("--final-time", help="Largest final time in seconds, or its range, as 0.5:1.")
    ] = None,
    method: Annotated[str, typer.Option(help="Solver: slsqp, ipm (compiled interior point), ipopt, uno.")] = "slsqp",
    form: Annotated[
        Form, typer.Option(help="For slsqp: condensed, or the full program (small numbers of steps).")
    ] = Form.condensed,
    controls: Annotated[Controls | None, typer.Option(help="Inputs constant in a step, or linear between nodes.")] = None,
    set_: Annotated[list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Parameter value; repeatable.")] = None,
    bound: Annotated[
        list[str] | None, typer.Option(metavar="NAME=LOW:HIGH", help="Bounds of an input or coordinate; repeatable.")
    ] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="Start state: x, x_dot or p_x; a value, a range LOW:HIGH, or free; repeatable."),
    ] = None,
    goal: Annotated[list[str] | None, typer.Option(metavar="NAME=VALUE", help="Goal state, like --start; repeatable.")] = None,
    iterations: Annotated[int, typer.Option(help="Iteration limit.")] = 1000,
    seconds: Annotated[float | None, typer.Option(help="Time limit of the solver in seconds.")] = None,
    guess: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Start from a solution file with the same steps and number of collisions.")
    ] = None,
    target: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Write solution.npz (and the figure) into this folder.")
    ] = None,
    json_: JsonOption = None,
) -> None:
    """Solve an optimal control problem and check the solution by simulation."""
    from dmoc import api, registry
    from dmoc.solution import Solution

    neighbour = None if guess is None else Solution.load(guess)
    reference = registry.find(model)
    fields = dict(reference.defaults)
    if sequence is not None:
        fields["sequence"] = tuple(s for s in sequence.split(",") if s)
    if steps is not None:
        numbers = [_whole(part, "--steps") for part in steps.split(",")]
        fields["steps"] = numbers[0] if len(numbers) == 1 else numbers
    if final_time is not None:
        fields["final_time"] = (
            _value(final_time, "--final-time") if ":" in final_time else (None, _number(final_time, "--final-time"))
        )
    if controls is not None:
        fields["controls"] = controls.value
    for name, given in (("parameters", set_), ("bounds", bound), ("start", start), ("goal", goal)):
        option = {"parameters": "--set", "bounds": "--bound", "start": "--start", "goal": "--goal"}[name]
        pairs = dict(_pair(text, option) for text in given or [])
        fields[name] = {**fields.get(name, {}), **pairs}
        _replace_rest(fields[name], pairs)
    _prepare_folder(target)
    _prepare_file(json_)
    problem = _problem(reference.kernels(), fields)
    quiet = json_ == "-"
    with _Live(quiet) as live:
        solution = api.solve(
            problem, method, form=form.value, guess=neighbour, iterations=iterations, seconds=seconds, progress=live.show,
            reference=reference.name,
        )  # fmt: skip
    files = _save(solution, target)
    _emit(solution.to_dict(), json_)
    if not quiet:
        _summary(solution, files)
    raise typer.Exit(0 if solution.solved else NOT_SOLVED)


@app.command()
def verify(
    solution: Annotated[Path, typer.Argument(help="Solution file (.npz).", show_default=False)],
    model: Annotated[str | None, typer.Option(help="Model of the solution, if it has moved: file.py:name.")] = None,
    json_: JsonOption = None,
) -> None:
    """Check a solution by an independent simulation."""
    from dmoc import api, registry
    from dmoc.solution import Solution

    _prepare_file(json_)
    loaded = Solution.load(solution)
    kernels = registry.load(model or loaded.reference)
    api.check_same_model(loaded, kernels)
    check = loaded.verify(kernels)
    summary = {key: (value.tolist() if hasattr(value, "tolist") else value) for key, value in asdict(check).items()}
    _emit(summary, json_)
    if json_ != "-":
        _verification(check)
    raise typer.Exit(0 if check.passed else NOT_SOLVED)


@app.command()
def plot(
    solution: Annotated[Path, typer.Argument(help="Solution file (.npz).", show_default=False)],
    target: Annotated[
        Path | None, typer.Option("--out", help="Figure file (.png, .pdf, .svg); by default beside the solution, as .png.")
    ] = None,
) -> None:
    """Draw a solution: snapshots, positions, momenta, inputs."""
    from dmoc.solution import Solution

    path = target or solution.with_suffix(".png")
    Solution.load(solution).plot(path)
    out.print(str(path), highlight=False, soft_wrap=True)


@app.command()
def doctor() -> None:
    """Show compiler, versions, cache and optional parts, and what is missing."""
    import platform
    from importlib import metadata

    from dmoc.codegen.build import cache_directory, compiler, load_installed
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
        table.add_row("C compiler", f"[red]missing[/]: {error}")
        healthy = False
    cache = cache_directory()
    try:
        cache.mkdir(parents=True, exist_ok=True)
        writable = os.access(cache, os.W_OK)
    except OSError:
        writable = False
    entries = len([p for p in cache.iterdir() if p.is_dir()]) if cache.is_dir() else 0
    table.add_row(
        "kernel cache",
        f"{cache}, {entries} models" if writable else f"{cache} [red]cannot be written[/]: set DMOC_CACHE to a writable folder",
    )
    healthy = healthy and writable
    for name in catalogue.models():
        table.add_row(
            f"model {name}", "compiled" if load_installed(f"dmoc.generated.{name}") else "not compiled: built on first use"
        )
    for name, extra, what in (
        ("matplotlib", "plot", "draw figures"), ("ipyopt", "ipopt", "use method ipopt"), ("unopy", "uno", "use method uno"),
    ):  # fmt: skip
        try:
            table.add_row(name, metadata.version(name))
        except metadata.PackageNotFoundError:
            table.add_row(name, f"not installed: `pip install dmoc[{extra}]` to {what}")
    out.print(table)
    raise typer.Exit(0 if healthy else BAD_INPUT)


# Input ---------------------------------------------------------------------------------------------------------------


def _problem(kernels: Any, fields: dict[str, Any]) -> Problem:
    from dmoc.nlp.problem import Problem

    return Problem(kernels, **fields)


def _replace_rest(values: dict[str, Any], given: dict[str, Any]) -> None:
    """A velocity replaces the default momentum of the same coordinate, and the reverse."""
    for name in given:
        if name.endswith("_dot") and f"p_{name[:-4]}" not in given:
            values.pop(f"p_{name[:-4]}", None)
        if name.startswith("p_") and f"{name[2:]}_dot" not in given:
            values.pop(f"{name[2:]}_dot", None)


def _pair(text: str, option: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise ProblemError(f"{option} {text}: expected NAME=VALUE.")
    return name.strip(), _value(value, f"{option} {name.strip()}")


def _value(text: str, what: str) -> Any:
    """Read a number, a range LOW:HIGH with empty ends open, or free."""
    if text == "free":
        return None
    if ":" in text:
        low, _, high = text.partition(":")
        return (_number(low, what) if low else None, _number(high, what) if high else None)
    return _number(text, what)


def _number(text: str, what: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ProblemError(f"{what} = {text!r}: expected a number such as 0.5, or a range such as -1:1.") from None


def _whole(text: str, what: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ProblemError(f"{what} = {text!r}: expected a whole number.") from None


# Output --------------------------------------------------------------------------------------------------------------


def _prepare_folder(folder: Path | None) -> None:
    """Fail before a long solve rather than after it."""
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".dmoc-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(f"{folder} cannot be written ({error.strerror}): choose a writable folder.") from None


def _prepare_file(name: str | None) -> None:
    if name in (None, "-"):
        return
    path = Path(str(name))
    try:
        existed = path.exists()
        with path.open("a", encoding="utf-8"):
            pass
        if not existed:
            path.unlink()
    except OSError as error:
        raise OutputError(f"{name} cannot be written ({error.strerror}): choose a file in a writable folder.") from None


def _write_text(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror}): choose a writable place.") from None


def _emit(summary: dict[str, Any], target: str | None) -> None:
    text = json.dumps(_finite(summary), indent=2) + "\n"
    if target == "-":
        sys.stdout.write(text)
    elif target is not None:
        _write_text(Path(target), text)


def _finite(value: Any) -> Any:
    """JSON has no infinity: what is not finite becomes null."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    if isinstance(value, float) and value - value != 0.0:
        return None
    return value


def _save(solution: Solution, folder: Path | None) -> list[Path]:
    if folder is None:
        return []
    from dmoc.errors import MissingExtraError

    files = [solution.save(folder / "solution.npz")]
    try:
        solution.plot(folder / "solution.png")
        files.append(folder / "solution.png")
    except MissingExtraError as error:
        err.print(f"no figure: {error}", highlight=False)
    return files


class _Live:
    """Iterations on standard error while a solve runs; nothing if standard error is no terminal."""

    def __init__(self, quiet: bool) -> None:
        del quiet
        self._status = err.status("first guess") if err.is_terminal else None

    def __enter__(self) -> _Live:
        if self._status is not None:
            self._status.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._status is not None:
            self._status.stop()

    @property
    def show(self) -> Callable[[Iteration], None] | None:
        if self._status is None:
            return None
        status = self._status

        def update(i: Iteration) -> None:
            status.update(f"iteration {i.number}  cost {i.cost:.6g}  violation {i.violation:.1e}")

        return update


def _summary(solution: Solution, files: list[Path]) -> None:
    table = Table(show_header=False, box=None)
    colour = "green" if solution.solved else "red"
    message = solution.message.removesuffix(": " + "; ".join(solution.conflicts)) if solution.conflicts else solution.message
    table.add_row("status", f"[{colour}]{solution.status}[/]: {message}")
    for conflict in solution.conflicts:
        table.add_row("conflict", conflict)
    table.add_row("cost", f"{solution.cost:.7g}")
    for i, phase in enumerate(solution.phases):
        table.add_row(f"phase {i}", f"{phase.duration:.6g} s in {phase.steps} steps")
    table.add_row("final time", f"{solution.final_time:.6g} s")
    for c in solution.collisions:
        table.add_row(f"collision {c.surface}", f"at {c.time:.6g} s, impulse {c.impulse:.6g}")
    table.add_row("active bounds", ", ".join(solution.active_bounds) or "none")
    table.add_row("violation", f"{solution.max_violation:.1e}")
    table.add_row("optimality", f"{solution.optimality:.1e}")
    table.add_row("iterations", str(solution.iterations))
    table.add_row("seconds", ", ".join(f"{name} {value:.2f}" for name, value in solution.seconds.items()))
    if solution.verification:
        v = solution.verification
        state = "[green]passed[/]" if v["passed"] else "[red]failed[/]"
        table.add_row("simulation", f"{state}: terminal error {v['terminal_error']:.1e}, segment error {v['max_segment_defect']:.1e}, "
                      f"energy error {v['energy_error']:.1e}, contacts missed {len(v['missed_contacts'])}, extra {len(v['extra_contacts'])}")  # fmt: skip
    for path in files:
        table.add_row("written", str(path))
    out.print(table, highlight=False)


def _verification(check: Verification) -> None:
    table = Table(show_header=False, box=None)
    table.add_row("simulation", "[green]passed[/]" if check.passed else f"[red]failed[/]: {check.message}")
    table.add_row("terminal error", f"{check.terminal_error:.3e} of the motion's range (open loop)")
    table.add_row("largest defect", f"{check.max_defect:.3e} per step, {check.segment_defects.max(initial=0.0):.3e} per segment")
    table.add_row("energy error", f"{check.energy_error:.3e}")
    contacts = ", ".join(f"{c.surface} at {c.time:.6g} s" for c in check.contacts)
    table.add_row("contacts", contacts or "none")
    table.add_row("missed, extra", f"{len(check.missed_contacts)}, {len(check.extra_contacts)}")
    table.add_row("penetration", f"{check.penetration:.1e} between nodes")
    out.print(table, highlight=False)


def main() -> None:
    """Run the command line; errors become one sentence and exit status 2."""
    debug = "--debug" in sys.argv
    if debug:
        sys.argv.remove("--debug")  # so that it may stand anywhere
    else:
        warnings.showwarning = lambda message, *_, **__: err.print(f"warning: {message}", highlight=False, soft_wrap=True)
    try:
        app()
    except DmocError as error:
        if debug:
            raise
        err.print(f"error: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(BAD_INPUT)
    except KeyboardInterrupt:
        err.print("interrupted")
        sys.exit(130)


if __name__ == "__main__":
    main()
