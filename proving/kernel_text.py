"""Kernels of a model as text that runs on other numbers than those of NumPy."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import lru_cache
from types import ModuleType
from typing import Any

from dmoc.base.errors import ProblemError
from dmoc.codegen.build import numpy_kernels, sources
from dmoc.codegen.kernels import NUMPY, Kernels
from dmoc.codegen.manifest import Manifest

# Systems whose text is kept.
KEPT_TEXTS = 8


def kernels_over(kernels: Kernels, functions: Any, only: Collection[str] = ()) -> ModuleType:
    """The text of the NumPy kernels with other functions in the place of NumPy's; ``only`` some of
    them where it takes a derivation to have any."""
    if kernels.backend == NUMPY:
        module = numpy_kernels(kernels.manifest, sources(kernels)["numpy.py"]).module
    else:
        module = _derived(kernels, only)
    assert isinstance(module, ModuleType)
    module.__dict__["np"] = functions
    return module


def _derived(kernels: Kernels, only: Collection[str]) -> Any:
    if kernels.system is None:
        raise ProblemError(
            f"the kernels of {kernels.name!r} do not know their system, which a proof needs: state "
            "the problem with the MechanicalSystem."
        )
    text = _text(kernels.system, kernels.manifest.order, tuple(kernels.design), tuple(only))
    return numpy_kernels(*text).module


@lru_cache(maxsize=KEPT_TEXTS)
def _text(
    system: Callable[[], Any], order: int, design: tuple[str, ...], only: tuple[str, ...]
) -> tuple[Manifest, str]:
    """The kernels of a system as text, which nodes of a search have in common."""
    from dmoc.codegen.text import manifest, numpy_text
    from dmoc.symbolic.families import model_spec

    model = model_spec(system(), order, design)
    if only:
        model = replace(model, kernels=tuple(k for k in model.kernels if k.name in only))
    return Manifest.read(manifest(model)), numpy_text(model)
