"""One thread for BLAS while methods run that call it: the matrices are small, and several threads
would wait for each other."""

from __future__ import annotations

from collections.abc import Iterable
from threading import Lock, local
from typing import Any, TypeAlias

from threadpoolctl import OpenBLASController, ThreadpoolController

Library: TypeAlias = Any  # threadpoolctl ships no type information

# The name of threads that only wait, beside which a solve has standard output to itself.
WAITS = "dmoc-waits"


class OneThread:
    """A context that limits linear algebra to one thread, also when contexts of several threads
    overlap.

    Most libraries have one limit for the process: the first one to enter sets it, the last one to
    leave restores what was before.  OpenMP has one for each thread, which sets and restores its
    own.  A limit that somebody else has set meanwhile stays.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._users = 0
        self._before: list[tuple[Library, int]] = []
        self._own = local()

    def __enter__(self) -> None:
        # Looked for each time, because every package may bring a library of its own.
        libraries = ThreadpoolController().lib_controllers
        own = _limited(c for c in libraries if _is_of_a_thread(c))
        self._own.before = [*getattr(self._own, "before", []), own]
        with self._lock:
            if self._users == 0:
                self._before = _limited(c for c in libraries if not _is_of_a_thread(c))
            self._users += 1

    def __exit__(self, *_: object) -> None:
        _restore(self._own.before.pop())
        with self._lock:
            self._users -= 1
            if self._users == 0:
                _give_up_control()
                _restore(self._before)
                _give_up_control()


def _is_of_a_thread(library: Library) -> bool:
    """Whether each thread has a limit of its own."""
    return "openmp" in (library.internal_api, getattr(library, "threading_layer", ""))


def _limited(libraries: Iterable[Library]) -> list[tuple[Library, int]]:
    """Give libraries one thread; return what they had."""
    before = [(library, library.num_threads) for library in libraries]
    for library, _ in before:
        library.set_num_threads(1)
    return before


def _restore(before: Iterable[tuple[Library, int]]) -> None:
    for library, number in before:
        if library.num_threads == 1:
            library.set_num_threads(number)


def _give_up_control() -> None:
    """Since threadpoolctl 3.8 OpenBLAS obeys only the thread that has set a limit first, and the
    last to leave may be another one."""
    give_up = getattr(OpenBLASController, "clear_controlling_thread", None)
    if give_up is not None:
        give_up(force=True)


# One for the process, because most limits are the process's.
ONE_THREAD = OneThread()
