"""Loaded kernels: one object for the compiled and for the NumPy backend.  Needs neither SymPy
nor a compiler."""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dmoc.base.errors import BuildError
from dmoc.base.records import value_class
from dmoc.base.table import Shown, Table
from dmoc.codegen.border import Library
from dmoc.codegen.manifest import FunctionFacts, Manifest, OutputFacts

Array = NDArray[np.float64]
COMPILED = "compiled"
NUMPY = "numpy"


@value_class(frozen=True)
class Kernels(Shown):
    """The kernels of one model.

    Attributes
    ----------
    manifest : Manifest
        Names, sizes, parameters and sparsity patterns of the model.
    module : Library or module
        The shared library of the compiled kernels, or a module of functions on NumPy.
    seconds : float
        Time spent on derivation, generation and compilation when the kernels were made; 0 if they
        were found ready.
    reference : str
        How the user named the model, where he did: by it the model is found again.
    system : callable, optional
        Makes the system that they are the kernels of.
    """

    manifest: Manifest
    module: Library | types.ModuleType
    seconds: float = 0.0
    reference: str = field(default="", compare=False)
    system: Callable[[], Any] | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        return f"<Kernels of {self.name}: order {self.manifest.order}, {self.backend}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        m = self.manifest
        stored = sum(sum(counts) for counts in self._counts.values())
        rows = [
            ("model", m.title),
            ("discretisation", f"order {m.order}"),
            ("coordinates", _listed(self.coordinates, m.units)),
            ("inputs", _listed(self.inputs, m.units)),
            ("surfaces", ", ".join(self.surfaces) or "none"),
        ]
        if self.tangents:
            rows.append(("tangents", ", ".join(self.tangents)))
        if m.switches:
            rows.append(("switches", ", ".join(m.switches)))
        if self.joints:
            rows.append(("constraints", ", ".join(self.joints)))
        if m.path_constraints:
            rows.append(("path constraints", ", ".join(m.path_constraints)))
        if self.quantities:
            rows.append(("quantities", _listed(self.quantities, m.units)))
        if self.hit_quantities:
            rows.append(("quantities of hits", _listed(self.hit_quantities, m.units)))
        values = (
            f"{name} = {'to be given' if value is None else format(value, 'g')}"
            for name, value in self.parameters.items()
        )
        rows.append(("parameters", ", ".join(values) or "none"))
        rows.append(("kernels", f"{len(m.kernels)}, {stored} results, {self.backend}"))
        if self.seconds:
            rows.append(("built", f"in {self.seconds:.2f} s"))
        return Table(tuple(rows), title=f"kernels of {self.name}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Kernels travel between processes as their sources; see
        :func:`dmoc.codegen.build.arrived`."""
        from dmoc.codegen.build import arrived, sources

        return (
            arrived,
            (self.manifest, self.backend, sources(self)),
            {"reference": self.reference},
        )

    @property
    def compiled(self) -> bool:
        """Whether the kernels are C, and not NumPy."""
        return isinstance(self.module, Library)

    @property
    def backend(self) -> str:
        """Name of the backend that runs the kernels, "compiled" or "numpy"."""
        return COMPILED if self.compiled else NUMPY

    @property
    def identity(self) -> tuple[str, str | None, str]:
        """Everything that the results of kernels follow from beside their arguments."""
        return self.manifest.fingerprint, self.manifest.code, self.backend

    @property
    def name(self) -> str:
        return self.manifest.name

    @property
    def coordinates(self) -> list[str]:
        return list(self.manifest.coordinates)

    @property
    def inputs(self) -> list[str]:
        return list(self.manifest.inputs)

    @property
    def surfaces(self) -> list[str]:
        return list(self.manifest.surfaces)

    @property
    def tangents(self) -> list[str]:
        return list(self.manifest.tangents)

    @property
    def quantity_rows(self) -> list[FunctionFacts]:
        """Facts about the parts of a state that each quantity depends on."""
        return list(self.manifest.quantities)

    @property
    def quantities(self) -> list[str]:
        return [row["name"] for row in self.quantity_rows]

    @property
    def hit_quantities(self) -> list[str]:
        """Quantities that there are at hits alone."""
        return list(self.manifest.hit_quantities)

    @property
    def has_forces(self) -> bool:
        """Whether quantities contain forces of contacts or constraints."""
        return any(row.get("forces") for row in self.quantity_rows)

    @property
    def integrals(self) -> list[str]:
        return [n for n in self.manifest.totals if n != "final_time"]

    @property
    def joints(self) -> list[str]:
        """Names of the constraints, which hold in every phase."""
        return list(self.manifest.joints)

    @property
    def parameters(self) -> dict[str, float | None]:
        return dict(self.manifest.parameters)

    @property
    def design(self) -> list[str]:
        """Parameters that derivatives are by, beside the arguments."""
        return list(self.manifest.design)

    def has(self, kernel: str) -> bool:
        return kernel in self.manifest.kernels

    def call(self, kernel: str, *inputs: ArrayLike) -> tuple[Array, ...]:
        """Evaluate a kernel on rows of inputs.

        Parameters
        ----------
        kernel : str
            Name of the kernel.
        inputs : arrays of shape (n, size) or (1, size)
            In the order of the manifest; a single row serves all n.  A vector or a number is one
            row, a vector n rows of an input of one value.

        Returns
        -------
        tuple of arrays of shape (n, size)
            The outputs in the order of the manifest; a matrix as its stored entries.
        """
        return self._evaluations[kernel](inputs)

    @cached_property
    def _evaluations(self) -> dict[str, Callable[[tuple[ArrayLike, ...]], tuple[Array, ...]]]:
        """Each kernel as a function of its inputs."""
        if isinstance(self.module, Library):
            return {name: function.rows for name, function in self.module.functions().items()}
        return {name: partial(self._on_numpy, name) for name in self.manifest.kernels}

    def _on_numpy(self, kernel: str, inputs: tuple[ArrayLike, ...]) -> tuple[Array, ...]:
        counts = [count for _, count in self.manifest.kernels[kernel]["inputs"]]
        arrays = [np.ascontiguousarray(a, dtype=float) for a in inputs]
        rows = [
            a.reshape(-1, count) if count else a if a.ndim > 1 else a[None]
            for a, count in zip(arrays, counts, strict=True)
        ]
        n = max(map(len, rows))
        results = tuple([np.empty((n, count)) for count in self._counts[kernel]])
        self.functions[kernel](*rows, *results)
        return results

    @cached_property
    def functions(self) -> Mapping[str, Callable[..., None]]:
        """Each kernel as a function of its inputs and then its outputs, C-contiguous float64
        arrays of shape (n, count)."""
        if isinstance(self.module, Library):
            return self.module.functions()
        return {name: getattr(self.module, name) for name in self.manifest.kernels}

    @cached_property
    def _counts(self) -> dict[str, list[int]]:
        """Sizes of the outputs of each kernel."""
        return {
            name: [_size(o) for o in facts["outputs"]]
            for name, facts in self.manifest.kernels.items()
        }

    def depends(self, kernel: str, names: Sequence[str]) -> NDArray[np.bool_]:
        """Mask of the results of a kernel that depend on some of the parameters by which
        derivatives are taken, shape (results,); empty for a kernel that there is not."""
        if not self.has(kernel):
            return np.zeros(0, dtype=bool)
        ((count,),) = (o["shape"] for o in self.manifest.kernels[kernel]["outputs"])
        which, by_design = np.zeros(count, dtype=bool), f"{kernel}_design_jac"
        if self.has(by_design):
            (matrix,) = self.manifest.kernels[by_design]["outputs"]
            first = matrix["shape"][1] - len(self.design)
            columns = [first + i for i, name in enumerate(self.design) if name in names]
            rows, column = self.pattern(by_design, matrix["name"])
            which[rows[np.isin(column, columns)]] = True
        return which

    def outputs(self, kernel: str) -> list[str]:
        """Names of the outputs of a kernel, in order."""
        return [o["name"] for o in self.manifest.kernels[kernel]["outputs"]]

    def pattern(self, kernel: str, output: str) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return rows and columns of the stored entries of a matrix output, shape (entries,)
        each."""
        if (kernel, output) not in self._patterns:
            raise BuildError(f"kernel {kernel!r} of model {self.name!r} has no output {output!r}.")
        return self._patterns[kernel, output]

    def shape(self, kernel: str, output: str) -> tuple[int, ...]:
        """The shape of an output; of a matrix it counts the entries that are not stored too."""
        return self._shapes[kernel, output]

    @cached_property
    def _shapes(self) -> dict[tuple[str, str], tuple[int, ...]]:
        return {
            (kernel, o["name"]): tuple(o["shape"])
            for kernel, facts in self.manifest.kernels.items()
            for o in facts["outputs"]
        }

    @cached_property
    def _patterns(self) -> dict[tuple[str, str], tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Rows and columns of every matrix output; read-only, because all share them."""
        slots = {}
        for kernel, facts in self.manifest.kernels.items():
            for o in facts["outputs"]:
                if "rows" in o:
                    places = np.array([o["rows"], o["columns"]], dtype=np.intp)
                    places.flags.writeable = False
                    slots[kernel, o["name"]] = (places[0], places[1])
        return slots


def kernels_of_library(path: Path, manifest: Manifest) -> Kernels | None:
    """The kernels of a library, if it was compiled from the sources that a manifest describes:
    sizes of other sources reach beyond its arrays."""
    library = Library(path, manifest.name)
    return Kernels(manifest, library) if library.code == manifest.code else None


def _listed(names: list[str], units: Mapping[str, str]) -> str:
    """Names with their units."""
    labels = (f"{name} [{units[name]}]" if name in units else name for name in names)
    return ", ".join(labels) or "none"


def _size(output: OutputFacts) -> int:
    return len(output["rows"]) if "rows" in output else output["shape"][0]
