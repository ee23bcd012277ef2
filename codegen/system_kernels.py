"""Kernels of a mechanical system: derived, generated, compiled and loaded."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

from dmoc.base.arguments import check_known, choice, flag, shown
from dmoc.base.discretisation import known_order
from dmoc.base.errors import BuildError, ModelError, ProblemError
from dmoc.base.names import bounded_momentum, momentum_name, name_of
from dmoc.base.progress import Listener, listener
from dmoc.base.signatures import public
from dmoc.codegen.build import build_cached, numpy_kernels
from dmoc.codegen.kernels import Kernels
from dmoc.codegen.manifest import Manifest

if TYPE_CHECKING:
    from dmoc.symbolic.spec import ModelSpec
    from dmoc.symbolic.system import MechanicalSystem

    GivenModel: TypeAlias = Kernels | MechanicalSystem  # what kernels_of takes

BACKENDS = ("auto", "compiled", "numpy")


@public(ModelError)
def build(
    system: MechanicalSystem,
    *,
    order: int = 2,
    backend: str = "auto",
    force: bool = False,
    progress: Listener[str] = None,
) -> Kernels:
    """Derive, generate, compile and load the kernels of a system; cached by content.

    Parameters
    ----------
    system : MechanicalSystem
    order : {2, 4, 6}
        Order of the discretisation: 2 is the midpoint rule; 4 takes quadratic steps with two Gauss
        points, which costs about twice as much a step and needs far fewer of them; 6 takes cubic
        steps with three.
    backend : {"auto", "compiled", "numpy"}
        "auto" compiles, and falls back to NumPy with a warning on a machine without a C compiler.
    force : bool
        Build again even if the cache holds the kernels.
    progress : callable, bool or "lines", optional
        Called with what is being done, a text.  True shows it in a line on a terminal or in a
        notebook, "lines" writes it to standard error.

    Raises
    ------
    ModelError
        If there is no system, or the order is another one.
    GenerationError
        If an expression cannot be turned into C.
    BuildError
        If the compiler is missing (with backend="compiled") or fails.

    Returns
    -------
    Kernels

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> kernels = dmoc.build(find("puck_table").system(), backend="numpy")
    >>> kernels.coordinates, kernels.inputs, list(kernels.surfaces)
    (['x', 'y'], ['f_x', 'f_y'], ['west', 'east', 'south', 'north'])
    """
    from dmoc.symbolic.system import MechanicalSystem

    if not isinstance(system, MechanicalSystem):
        raise ModelError(f"system = {shown(system)}: expected a MechanicalSystem.")
    order = known_order(order)
    choice(backend, "backend", BACKENDS, BuildError)
    flag(force, "force", BuildError)
    with listener(progress, f"{system.name}: looking for its kernels", BuildError) as tell:
        return _built(system, order, backend, force, tell)


def _built(
    system: MechanicalSystem, order: int, backend: str, force: bool = False,
    tell: Callable[[str], object] | None = None, design: Sequence[str] = (),
) -> Kernels:  # fmt: skip
    """Kernels of a system, with derivatives by the parameters ``design``."""
    from dmoc.codegen.text import c_files, manifest, numpy_text
    from dmoc.symbolic.families import model_key, model_spec

    def deriving() -> ModelSpec:
        if tell is not None:
            tell(f"{system.name}: deriving equations and derivatives")
        return model_spec(system, order, design)

    def compiling() -> None:
        if tell is not None:
            tell(f"{system.name}: compiling")

    def plain() -> Kernels:
        model = deriving()
        return numpy_kernels(Manifest.read(manifest(model)), numpy_text(model))

    if backend == "numpy":
        kernels = plain()
    else:
        kernels = build_cached(
            system.name,
            model_key(system, order, design),
            lambda: c_files(deriving()),
            plain if backend == "auto" else None,
            force,
            compiling,
        )
    return replace(kernels, system=lambda: system)


def kernels_of(model: Any, order: int, design: Sequence[str] = ()) -> Kernels:
    """Kernels as they are, or those of a system of an order, with derivatives by the parameters
    ``design``; what is neither is a ProblemError."""
    if isinstance(model, Kernels):
        return _by_design(model, design)
    from dmoc.symbolic.system import MechanicalSystem

    if isinstance(model, MechanicalSystem):
        names = _in_order(map(name_of, model.parameters), design)
        return _built(model, order, "auto", design=names)
    raise ProblemError(
        f"kernels = {shown(model)}: expected the kernels of a model (dmoc.build, dmoc.load), or a "
        "MechanicalSystem."
    )


def with_momenta(model: Any, bounds: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Kernels or a system whose quantities have the momenta that ``bounds`` name, and the bounds of
    these quantities instead; what is neither is as it was."""
    coordinates = [name_of(q) for q in getattr(model, "coordinates", ())]
    own = {momentum_name(q): bounded_momentum(q) for q in coordinates}
    for name, quantity in own.items():
        if name in bounds and quantity in bounds:
            raise ProblemError(f"bounds give {name} and {quantity}, the same momentum: give one.")
    named = {own.get(name, name): value for name, value in bounds.items()}
    missing = [q for q in coordinates if bounded_momentum(q) in named]
    missing = [q for q in missing if bounded_momentum(q) not in model.quantities]
    if not missing:
        return model, named
    from dmoc.symbolic.path_constraints import with_momenta as system_with_momenta

    if not isinstance(model, Kernels):
        return system_with_momenta(model, missing), named
    if model.system is None:
        raise ProblemError(
            f"the bounds of {', '.join(map(momentum_name, missing))} need kernels with these "
            f"momenta, and those of {model.name!r} do not know their system: state the problem "
            "with the MechanicalSystem."
        )
    system, order = system_with_momenta(model.system(), missing), model.manifest.order
    made = _built(system, order, model.backend, design=model.design)
    return replace(made, reference=model.reference), named


def _in_order(parameters: Iterable[str], design: Sequence[str]) -> list[str]:
    """Names of parameters in the order of the model."""
    names = list(parameters)
    for name in design:
        check_known(name, names, "parameter", "in design")
    return [name for name in names if name in design]


def _by_design(kernels: Kernels, design: Sequence[str]) -> Kernels:
    """Kernels that have derivatives by some parameters: themselves, or others of their system."""
    names = _in_order(kernels.parameters, design)
    if set(names) <= set(kernels.design):
        return kernels
    if kernels.system is None:
        raise ProblemError(
            f"the kernels of {kernels.name!r} have no derivatives by {', '.join(names)} and do not "
            "know their system: state the problem with the MechanicalSystem."
        )
    order, backend = kernels.manifest.order, kernels.backend
    made = _built(kernels.system(), order, backend, design=names)
    return replace(made, reference=kernels.reference)
