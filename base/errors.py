"""The errors that dmoc raises: each message says what is wrong, where, what was expected and the
remedy; and the warnings that it gives."""

from __future__ import annotations

import sys
import warnings


class DmocError(Exception):
    """Base of every error that dmoc raises on purpose.

    Examples
    --------
    >>> import dmoc
    >>> try:
    ...     dmoc.load("pendulum")
    ... except dmoc.DmocError as error:
    ...     print(type(error).__name__, "-", str(error)[:24])
    ModelError - unknown model 'pendulum'
    """

    def __init__(self, *args: object) -> None:
        super().__init__(*args)
        self.add_note(f"Help: {self.help}")

    @property
    def help(self) -> str:
        """The command that prints the entry of its kind; a traceback ends with it."""
        return f"dmoc explain {type(self).__name__}"


class ModelError(DmocError):
    """A mechanical system is described wrongly or incompletely."""


class GenerationError(DmocError):
    """An expression cannot be turned into code."""


class BuildError(DmocError):
    """Generated code cannot be compiled or loaded."""


class ProblemError(DmocError):
    """A problem (boundary states, bounds, sequence, steps, parameters) is stated wrongly."""


class SimulationError(DmocError):
    """A simulation cannot go on: too many impacts, friction that jams, or no solution of a step."""


class MotionError(DmocError):
    """A motion is asked for what it does not have: a time outside of it, a kind of file."""


class SearchError(DmocError):
    """A search over sequences is stated wrongly, or its journal cannot be used."""


class FitError(DmocError):
    """A fit is stated wrongly, or its data do not fit it."""


class SolutionFileError(DmocError):
    """A file cannot be read as a solution, or belongs to another model."""


class OutputError(DmocError):
    """A result cannot be written."""


class MissingExtraError(DmocError):
    """An optional dependency is needed and not installed."""


def warn(text: str) -> None:
    """Give a warning at the line that called dmoc, however deep inside it this is noticed."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and _is_ours(frame.f_globals.get("__name__", "")):
        frame, level = frame.f_back, level + 1
    warnings.warn(text, RuntimeWarning, stacklevel=level)


def _is_ours(module: str) -> bool:
    return module.partition(".")[0] == "dmoc"
