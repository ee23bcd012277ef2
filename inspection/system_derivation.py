"""The derivation of a system with what becomes of it: unknowns, sparsity, kernels, and a check of
their numbers, on a page."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dmoc.base.arguments import check_known, flag, names, place
from dmoc.base.arguments import path as path_of
from dmoc.base.errors import ModelError, OutputError, ProblemError
from dmoc.base.files import write_whole
from dmoc.base.html import page, paragraph, section, sparsity
from dmoc.base.names import name_of
from dmoc.base.signatures import public
from dmoc.base.table import Table, html_of
from dmoc.codegen.kernels import Kernels
from dmoc.codegen.operation_counts import count_of
from dmoc.codegen.system_kernels import kernels_of
from dmoc.inspection.kernel_check import kernel_errors
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Block
from dmoc.program.transcription import Transcription
from dmoc.symbolic.derivation import sections
from dmoc.symbolic.derivation.document import Derivation, Section
from dmoc.symbolic.derivation.notebook import section_html, system_html
from dmoc.symbolic.families import model_spec
from dmoc.symbolic.kernel_family import DESIGN
from dmoc.symbolic.system import MechanicalSystem

STEPS = 3  # of each phase of the problem whose unknowns are shown
# Kernels that agree with the independent evaluation up to rounding errors.
AGREES = 1e-9
ENDINGS = (".html", ".tex", ".txt")


@public(OutputError)
@dataclass(frozen=True, repr=False)
class SystemDerivation(Derivation):
    """Result of :func:`dmoc.derive`: the steps from the Lagrangian to the derivatives of the
    discrete equations, with their system.

    It prints as text, shows itself in notebooks, gives a LaTeX document by ``latex()`` and a page
    that needs no network by ``html()``.

    Attributes
    ----------
    system : MechanicalSystem
    order : int
        Order of the discretisation.
    design : tuple of str
        Parameters that derivatives are by, too.
    """

    system: MechanicalSystem
    order: int
    design: tuple[str, ...] = ()

    def html(self) -> str:
        """Return one page: system, derivation, unknowns and sparsity of a small problem, the work
        of every kernel, and the kernels beside an independent evaluation.

        Raises
        ------
        GenerationError, BuildError
            If the kernels cannot be generated or compiled.
        """
        return derivation_page(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the page (.html), the LaTeX document (.tex) or the text (.txt).

        Raises
        ------
        OutputError
            If the ending is another one, or the file cannot be written.
        """
        target = path_of(path)
        if target.suffix not in ENDINGS:
            raise OutputError(
                f"{place(target)}: end it in {', '.join(ENDINGS)} to say what to write."
            )
        made = {".html": self.html, ".tex": self.latex, ".txt": self.__str__}[target.suffix]
        return write_whole(target, made().encode())


@public(ModelError)
def derive(
    system: MechanicalSystem, order: int = 2, *, expanded: bool = False, design: Sequence[str] = ()
) -> SystemDerivation:
    """Derive a system from its Lagrangian to the derivatives of its discrete equations, in the
    discretisation of the given order.

    The result prints as text, gives a LaTeX document by ``latex()``, and displays itself in
    notebooks.  A quantity of the derivation whose usual name the model uses itself is marked:
    ``h~``.

    Parameters
    ----------
    system : MechanicalSystem
    order : {2, 4, 6}
        Order of the discretisation.
    expanded : bool
        Write out what is shown by its structure otherwise: large systems and those with
        definitions, whose momenta, masses and forces are made of names for what they share.  Takes
        minutes where the system is large.
    design : sequence of str
        Parameters that a solver chooses: which kernels have derivatives by them.

    Returns
    -------
    SystemDerivation

    Raises
    ------
    ModelError
        If there is no system, the order is another one, ``expanded`` is not True or False, or
        ``design`` has something that is no parameter or cannot be chosen.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> derivation = dmoc.derive(find("puck_table").system())
    >>> [section.title for section in derivation.sections][:3]
    ['Lagrangian', 'Momenta', 'Mass matrix']
    >>> for equation in derivation.sections[1].equations:
    ...     print(equation.name, "=", equation.right)
    p_x = m*x_dot
    p_y = m*y_dot

    Notes
    -----
    The sections follow equations :eq:`hamilton` to :eq:`law` of the theory.
    """
    stated = sections.derive(system, order, flag(expanded, "expanded", ModelError))
    chosen = _chosen(system, names(design, "design", "parameters", ModelError))
    sections_of = (*stated.sections, *_by_design(system, order, chosen))
    return SystemDerivation(stated.title, sections_of, system, order, chosen)


def _chosen(system: MechanicalSystem, design: Sequence[str]) -> tuple[str, ...]:
    """Names of parameters in the order of the system."""
    names = [name_of(s) for s in system.parameters]
    for name in design:
        check_known(name, names, "parameter", "in design", ModelError)
    return tuple(name for name in names if name in design)


def _by_design(system: MechanicalSystem, order: int, design: tuple[str, ...]) -> list[Section]:
    """Section on the kernels that have derivatives by design parameters; none without these."""
    if not design:
        return []
    end = f"{DESIGN}_jac"
    kernels = [k.name for k in model_spec(system, order, design).kernels]
    own = [name.removesuffix(end) for name in kernels if name.endswith(end)]
    text = (
        f"A solver chooses {', '.join(design)}. First and second derivatives of these kernels are "
        f"by that, too: {', '.join(own)}."
    )
    return [Section("Design parameters", text, ())]


def derivation_page(derivation: SystemDerivation) -> str:
    """The page of a derivation."""
    kernels = kernels_of(derivation.system, derivation.order, derivation.design)
    parts = [
        section("System", system_html(derivation.system)),
        section("Derivation", "".join(section_html(s) for s in derivation.sections)),
        section("A small problem", _small(kernels)),
        section("Kernels", _work(derivation)),
        section("Check of the numbers", _check(derivation.system, kernels)),
    ]
    return page(f"{derivation.title}, order {derivation.order}", "".join(parts))


def _small(kernels: Kernels) -> str:
    """Unknowns, constraints and sparsity of a problem of few steps."""
    problem = small_problem(kernels)
    if problem is None:
        return paragraph(
            "No problem with free ends can be stated with the default parameters: the layout of "
            "unknowns is not shown."
        )
    nlp = Transcription(problem)
    sequence = ", ".join(problem.sequence) or "no collision"
    text = (
        f"Free at both ends, sequence: {sequence}; {STEPS} steps in each of {problem.phases} "
        f"phases: {nlp.n} unknowns, {nlp.n_eq} equations, {nlp.n_in} inequalities."
    )
    tables = "".join(
        html_of(Table(tuple(_listed(blocks)), (what, "from", "number", "first")))
        for what, blocks in (
            ("unknowns", nlp.layout.unknowns),
            ("constraints", (*nlp.equalities, *nlp.inequalities)),
        )
    )
    return paragraph(text) + f'<div class="row">{tables}</div>{_patterns(nlp)}'


def small_problem(kernels: Kernels) -> Problem | None:
    """A problem of few steps that leaves both ends free, through one collision where there is a
    surface; None where the model cannot have one."""
    missing = {name: 1.0 for name, value in kernels.parameters.items() if value is None}
    for sequence in [(s,) for s in kernels.surfaces] + [()]:
        try:
            return Problem(
                kernels,
                start=dict.fromkeys(kernels.coordinates),
                sequence=sequence,
                steps=STEPS,
                parameters=missing,
            )
        except ProblemError:
            continue
    return None


def _listed(blocks: Iterable[Block]) -> Iterator[tuple[str, str, str, str]]:
    """Name, place, number and first member of each block that has members."""
    first = 0
    for block in blocks:
        if block.count:
            name = block.name.replace("_", " ")
            yield name, str(first), str(block.count), block.name_of(0)
        first += block.count


def _patterns(nlp: Transcription) -> str:
    """Pictures of the entries at which the derivatives of the program are not identically zero."""
    jacobian, hessian = nlp.assembled.jacobian, nlp.assembled.hessian
    first = jacobian.matrix(np.ones(int(jacobian.indptr[-1])), 0).tocoo()
    second = hessian.matrix(np.ones(int(hessian.indptr[-1]))).tocoo()
    pictures = []
    for what, m, symmetric in (
        ("Jacobian of the constraints", first, False),
        ("Hessian of the Lagrangian", second, True),
    ):
        places = [(int(i), int(j)) for i, j in zip(m.row, m.col, strict=True)]
        if symmetric:
            places += [(j, i) for i, j in places if i != j]
        rows, columns = m.shape
        share = len(places) / max(rows * columns, 1)
        caption = f"{what}: {rows} x {columns}, {len(places)} entries, {100 * share:.1f} %"
        pictures.append(sparsity(rows, columns, places, caption))
    return f'<div class="row">{"".join(pictures)}</div>'


def _work(derivation: SystemDerivation) -> str:
    """Table of the operations of each kernel."""
    spec = model_spec(derivation.system, derivation.order, derivation.design)
    counts = [count_of(kernel) for kernel in spec.kernels]
    rows = tuple(
        (c.kernel, str(c.results), str(c.shared), str(c.operations), str(c.calls)) for c in counts
    )
    total = sum(c.operations for c in counts)
    text = (
        "Operations of one call in the generated C, after common subexpressions are shared; small "
        f"powers count as functions. {total} operations in {len(counts)} kernels."
    )
    head = ("kernel", "results", "shared values", "operations", "functions")
    return paragraph(text) + html_of(Table(rows, head))


def _check(system: MechanicalSystem, kernels: Kernels) -> str:
    """The kernels beside an independent evaluation."""
    errors = kernel_errors(system, kernels)
    if not errors:
        return paragraph(
            "The functions of the system are not real at any of the random points: the kernels "
            "were not compared."
        )
    worst = max(errors, key=lambda c: c.error)
    left_out = sorted(set(kernels.manifest.kernels) - {c.kernel for c in errors})
    text = (
        "Each kernel at a random point beside the definitions, evaluated from the system's "
        "functions in 90 digits with differences for all derivatives and a quadrature of its own; "
        "matrices along random directions. Largest relative error: "
        f"{worst.error:.1e} ({worst.kernel})."
    )
    text += f" Not compared: {', '.join(left_out)}." if left_out else ""
    rows = tuple(
        (c.kernel, ((f"{c.error:.1e}", "good" if c.error < AGREES else "bad"),)) for c in errors
    )
    return paragraph(text) + html_of(Table(rows, ("kernel", "largest relative error")))
