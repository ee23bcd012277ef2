"""Kernels of a mechanical system: derived, generated, compiled and loaded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

from dmoc.base.arguments import choice, flag, shown
from dmoc.base.discretisation import known_order
from dmoc.base.errors import BuildError, ModelError, ProblemError
from dmoc.base.progress import Listener, listener
from dmoc.codegen.build import build_cached, numpy_kernels
from dmoc.codegen.kernels import Kernels

if TYPE_CHECKING:
    from dmoc.symbolic.spec import ModelSpec
    from dmoc.symbolic.system import MechanicalSystem

    GivenModel: TypeAlias = Kernels | MechanicalSystem  # what kernels_of takes

BACKENDS = ("auto", "compiled", "numpy")


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
    from dmoc.codegen.text import c_files, manifest, numpy_text
    from dmoc.symbolic.families import model_key, model_spec
    from dmoc.symbolic.system import MechanicalSystem

    if not isinstance(system, MechanicalSystem):
        raise ModelError(f"system = {shown(system)}: expected a MechanicalSystem.")
    order = known_order(order)
    choice(backend, "backend", BACKENDS, BuildError)
    flag(force, "force", BuildError)
    with listener(progress, f"{system.name}: looking for its kernels", BuildError) as tell:

        def deriving() -> ModelSpec:
            if tell is not None:
                tell(f"{system.name}: deriving equations and derivatives")
            return model_spec(system, order)

        def compiling() -> None:
            if tell is not None:
                tell(f"{system.name}: compiling")

        if backend == "numpy":
            model = deriving()
            return numpy_kernels(manifest(model), numpy_text(model))
        return build_cached(
            system.name,
            model_key(system, order),
            lambda: c_files(deriving()),
            (lambda: numpy_text(deriving())) if backend == "auto" else None,
            force,
            compiling,
        )


def kernels_of(model: Any, order: int) -> Kernels:
    """Kernels as they are, or those of a system of an order; what is neither is a ProblemError."""
    if isinstance(model, Kernels):
        return model
    from dmoc.symbolic.system import MechanicalSystem

    if isinstance(model, MechanicalSystem):
        return build(model, order=order)
    raise ProblemError(
        f"kernels = {shown(model)}: expected the kernels of a model (dmoc.build, dmoc.load), or a "
        "MechanicalSystem."
    )
