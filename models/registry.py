"""Models by name and from files: describe, build, load."""

from __future__ import annotations

import importlib.util
import inspect
import os
import secrets
import sys
import traceback
import types
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dmoc.base.arguments import place, shown
from dmoc.base.discretisation import known_order
from dmoc.base.errors import DmocError, ModelError
from dmoc.base.messages import LONGEST_PATH
from dmoc.base.progress import Listener
from dmoc.base.records import value_class
from dmoc.base.signatures import public
from dmoc.codegen.build import load_installed
from dmoc.codegen.kernels import Kernels
from dmoc.codegen.system_kernels import build as build
from dmoc.models import catalogue
from dmoc.problem.problem import Problem

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


@public(ModelError)
@value_class(frozen=True)
class Reference:
    """A model named by the user, with the fields of the problem it comes with; ``made`` makes
    its kernels of an order."""

    name: str
    defaults: Mapping[str, Any]
    system: Callable[[], MechanicalSystem] = field(repr=False)
    made: Callable[[int | None, Listener[str]], Kernels] = field(repr=False)

    def kernels(self, order: int | None = None, progress: Listener[str] = None) -> Kernels:
        """The kernels, which know how their model was named; None stands for the order that
        there is."""
        return replace(self.made(order, progress), reference=self.name)


@public(ModelError)
def find(reference: str) -> Reference:
    """Resolve the name of a shipped model or problem, or ``file.py:name``.

    The name in a file is a MechanicalSystem, a Problem, or a function without arguments that
    returns one of them.

    Raises
    ------
    ModelError
        If there is no such model, file or name, or it is of another kind.
    """
    if not isinstance(reference, str) or "\0" in reference or len(reference) > LONGEST_PATH:
        raise ModelError(
            f"model = {shown(reference)}: expected the name of a shipped model, or file.py:name, "
            "as a text."
        )
    path, _, name = reference.rpartition(":")
    if not path:
        return _shipped(reference)
    made = _from_file(Path(path).resolve(), name)
    where = f"{Path(path).resolve()}:{name}"
    if isinstance(made, Problem):
        defaults = {f.name: getattr(made, f.name) for f in fields(Problem) if f.name != "kernels"}
        kernels = made.kernels

        def no_system() -> MechanicalSystem:
            raise ModelError(
                f"{reference} is a Problem: name the MechanicalSystem to see its derivation."
            )

        def of_order(order: int | None, _: Listener[str]) -> Kernels:
            made_with = kernels.manifest.order
            if order not in (None, made_with):
                raise ModelError(
                    f"{reference} is a Problem with kernels of order {made_with}: name the "
                    f"MechanicalSystem, or build it with order={order}."
                )
            return kernels

        return Reference(where, defaults, no_system, of_order)
    system = made
    return Reference(
        where,
        {},
        lambda: system,
        lambda order, progress: build(
            system, order=2 if order is None else order, progress=progress
        ),
    )


@public(ModelError)
def load(reference: str, *, order: int | None = None) -> Kernels:
    """Return the kernels of a shipped model, or of ``file.py:name``; needs no SymPy for an
    installed model.

    ``order`` is that of the discretisation; None stands for what there is: 2, or that of a Problem
    in a file.

    Parameters
    ----------
    reference : str
    order : {2, 4, 6}, optional

    Returns
    -------
    Kernels

    Raises
    ------
    ModelError
        If there is no such model, file or name, or not of that order.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.load("cart_pendulum").coordinates
    ['alpha', 'x']
    """
    if order is not None:
        order = known_order(order)
    return find(reference).kernels(order)


def load_for_file(reference: str, order: int) -> Kernels:
    """Return the kernels of the model that a data file names: a shipped one, because what else a
    file may name is not run."""
    if reference not in catalogue.ENTRIES:
        raise ModelError(
            f"the solution was made with {reference!r}, and a file may name shipped models only: "
            "if you trust that model, name it yourself with --model file.py:name, or in Python "
            "give its kernels."
        )
    return load(reference, order=order)


def _shipped(name: str) -> Reference:
    entry = catalogue.ENTRIES.get(name)
    if entry is None and name.endswith(".py"):
        file = place(name)
        raise ModelError(f"{file} names a file without an object in it: expected {file}:name.")
    if entry is None and name.endswith(".npz"):
        raise ModelError(
            f"{shown(name)} names a file of a result: expected a model; read a solution with "
            "dmoc.Solution.load, a simulation with dmoc.Simulation.load."
        )
    if entry is None:
        models = ", ".join(sorted(catalogue.ENTRIES))
        raise ModelError(
            f"unknown model {shown(name)}: expected one of {models}, or a file as file.py:name."
        )
    model = entry.model

    def kernels(order: int | None, progress: Listener[str]) -> Kernels:
        installed = load_installed(f"dmoc.generated.{model}") if order in (None, 2) else None
        if installed:
            return replace(installed, system=lambda: catalogue.system(model))
        return build(
            catalogue.system(model), order=2 if order is None else order, progress=progress
        )

    return Reference(name, dict(entry.problem or {}), lambda: catalogue.system(model), kernels)


def _from_file(path: Path, name: str) -> Any:
    """Run a model file as if it were imported, and return the system or the problem that it
    names."""
    from dmoc.symbolic.system import MechanicalSystem

    if not os.path.isfile(path):
        raise ModelError(
            f"{place(path)} does not exist: name a Python file and an object in it, as "
            "file.py:name."
        )
    spec = importlib.util.spec_from_file_location(f"_dmoc_model_{secrets.token_hex(16)}", path)
    if spec is None or spec.loader is None:
        raise ModelError(f"{place(path)} is not a Python file: expected a name ending in .py.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up there, some of them later
    with _paths_kept(), _as_sentences(path):
        # As if the file were run: what lies beside it can be imported.
        sys.path.insert(0, str(path.parent))
        spec.loader.exec_module(module)
        made = _made(module, path, name)
    if not isinstance(made, (MechanicalSystem, Problem)):
        raise ModelError(
            f"{name} in {place(path)} is {shown(made)}: expected a MechanicalSystem or a Problem."
        )
    return made


def _made(module: types.ModuleType, path: Path, name: str) -> Any:
    made = getattr(module, name, None)
    if made is None:
        raise ModelError(
            f"{place(path)} defines no {shown(name)}: expected a MechanicalSystem, a Problem, or a "
            "function that returns one."
        )
    if not callable(made):
        return made
    parameters = inspect.signature(made).parameters.values()
    needed = [
        p.name
        for p in parameters
        if p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    ]
    if needed:
        raise ModelError(
            f"{name} in {path} needs the arguments {', '.join(needed)}: expected a function that "
            "needs none."
        )
    return made()


@contextmanager
def _paths_kept() -> Iterator[None]:
    """Leave the places of modules as they were, whatever is done to them."""
    paths, places = sys.path, list(sys.path)
    try:
        yield
    finally:
        sys.path, sys.path[:] = paths, places


@contextmanager
def _as_sentences(path: Path) -> Iterator[None]:
    """Say in one sentence what goes wrong in a model file, whatever it is."""
    try:
        yield
    except (DmocError, KeyboardInterrupt):
        raise
    except SyntaxError as error:
        raise ModelError(f"{path} cannot be read: {error.msg} in line {error.lineno}.") from None
    except SystemExit:
        raise ModelError(f"{path} ends the program: a model file must not call sys.exit.") from None
    except BaseException as error:  # also what derives from nothing else
        text = " ".join("".join(traceback.format_exception_only(error)).split()).partition(": ")[2]
        line = next(
            (
                f.lineno
                for f in reversed(traceback.extract_tb(error.__traceback__))
                if f.filename == str(path)
            ),
            "?",
        )
        raise ModelError(
            f"{path} cannot be loaded: {type(error).__name__} in line {line}: "
            f"{text or 'no message'}; correct the file."
        ) from error
