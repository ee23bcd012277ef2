"""The methods of :func:`dmoc.solve`, one entry for each; what solves is loaded when it is first
asked for."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from enum import StrEnum
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeAlias

from dmoc.base.errors import DmocError, MissingExtraError, ProblemError
from dmoc.base.records import record

if TYPE_CHECKING:
    from dmoc.codegen.kernels import Array
    from dmoc.program.transcription import Transcription
    from dmoc.solvers.outcome import Duals, Ending, Options, Outcome

Driver: TypeAlias = "Callable[[Transcription, Array, Options, Duals | None], Ending]"
Judged: TypeAlias = "Callable[[Transcription, Array, Options, Duals | None], Outcome]"


class ProgramForm(StrEnum):
    """The program that slsqp gets: coordinates eliminated by the equations of motion, or all there
    is."""

    CONDENSED = "condensed"
    FULL = "full"


FORMS = tuple(form.value for form in ProgramForm)


@record(frozen=True, eq=False)
class Method:
    """A way to solve a program."""

    name: str
    what: str  # where methods are listed
    driver: str  # the function that minimises, as "module:name"
    full: str | None = None  # the function for form="full", where that is another one
    package: str | None = None  # behind it, where it is an extra, which then has the method's name
    needs_compiled: bool = False  # kernels
    most_inputs: int | None = None  # of all steps together
    guided: bool = False  # estimates of minimal times keep it on the right track
    falls_back_on: str | None = None  # the method that takes over where it ends without a solution
    uses_blas: bool = True  # which then gets one thread

    def minimise(self, form: str = ProgramForm.CONDENSED) -> Judged:
        """The function that minimises a program from scaled unknowns, and judges where it ends."""
        from dmoc.solvers.judge import judged

        def minimise(
            nlp: Transcription, x: Array, options: Options, duals: Duals | None = None
        ) -> Outcome:
            driver = self.loaded(form)
            with self._limit():
                ending = driver(nlp, x, options, duals)
            return judged(nlp, ending, options)

        return minimise

    def loaded(self, form: str = ProgramForm.CONDENSED) -> Driver:
        """The function that minimises."""
        where = self.full if self.full and form == ProgramForm.FULL else self.driver
        module, name = where.split(":")
        driver: Driver = getattr(import_module(module), name)
        return driver

    def _limit(self) -> AbstractContextManager[None]:
        """One thread for linear algebra, where the method uses it."""
        if not self.uses_blas:
            return nullcontext()
        from dmoc.solvers.blas import ONE_THREAD

        return ONE_THREAD

    def require(self, backend: str, error: type[DmocError] = ProblemError) -> None:
        """Refuse kernels that the method cannot use, and import its package."""
        if self.needs_compiled and backend != "compiled":
            raise error(
                f"method {self.name} needs compiled kernels: install a C compiler and build the "
                "model again, or use slsqp."
            )
        if self.package is None:
            return
        # Uno's Fortran would keep its lines and print them when the program ends, where nothing
        # can keep them away any more.
        os.environ.setdefault("GFORTRAN_UNBUFFERED_PRECONNECTED", "1")
        try:
            import_module(self.package)
        except ImportError:
            raise MissingExtraError(
                f"method {self.name} needs {self.package}: install it with `pip install "
                f"'dmoc[{self.name}]'`."
            ) from None

    def takes(self, inputs: int) -> bool:
        """Whether so many inputs of all steps together are not too many."""
        return self.most_inputs is None or inputs <= self.most_inputs

    def check_size(self, steps: Any, inputs: int, error: type[DmocError] = ProblemError) -> None:
        """Raise an error if the inputs of all steps together are too many for the method."""
        if not self.takes(inputs):
            raise error(
                f"steps = {steps}: method {self.name} works with dense matrices and takes at most "
                f"{self.most_inputs} inputs in all steps, these are {inputs}; take fewer steps or "
                "collisions, or method ipm."
            )


METHODS = {
    method.name: method
    for method in (
        Method(
            "slsqp",
            "sequential quadratic programming",
            "dmoc.solvers.slsqp:solve_slsqp",
            full="dmoc.solvers.slsqp_full:solve_slsqp_full",
            most_inputs=2000,  # memory grows with the square of the inputs, time with the cube
            guided=True,
            falls_back_on="ipm",
        ),
        Method(
            "ipm",
            "compiled interior point",
            "dmoc.solvers.ipm:solve_ipm",
            needs_compiled=True,
            uses_blas=False,
        ),
        Method("ipopt", "IPOPT, an extra", "dmoc.solvers.external:solve_ipopt", package="ipyopt"),
        Method("uno", "filter SQP, an extra", "dmoc.solvers.external:solve_uno", package="unopy"),
    )
}
COMPILED_METHOD = METHODS["ipm"]
# Of a single solve, of a refinement, and of a search.
DEFAULT, REFINING, SEARCHING = "slsqp", COMPILED_METHOD.name, COMPILED_METHOD.name


def usual(preferred: str, compiled: bool) -> str:
    """The method where none is named: the preferred one, or without compiled kernels, if that needs
    them, the one of a single solve."""
    return preferred if compiled or not METHODS[preferred].needs_compiled else DEFAULT


def listed() -> str:
    """The methods in a line."""
    return ", ".join(f"{method.name} ({method.what})" for method in METHODS.values())
