"""One thread for linear algebra while solves run: the matrices are small, and several threads
would wait for each other."""

from __future__ import annotations

from threading import Lock
from typing import Any

from threadpoolctl import OpenBLASController, ThreadpoolController


class OneThread:
    """A context that limits the process's linear algebra to one thread, also when contexts of
    several threads overlap.

    The limit belongs to the process: the first one to enter sets it, the last one to leave restores
    what was before.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._users = 0
        self._controller: ThreadpoolController | None = None
        self._limit: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if self._users == 0:
                # Looking for the libraries takes longer than a solve of the compiled method, so it
                # is done once.
                self._controller = self._controller or ThreadpoolController()
                self._limit = self._controller.limit(limits=1)
            self._users += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._users -= 1
            if self._users == 0:
                _give_up_control()
                self._limit.restore_original_limits()
                _give_up_control()


def _give_up_control() -> None:
    """Since threadpoolctl 3.8 OpenBLAS obeys only the thread that has set a limit first, and the
    last to leave may be another one."""
    give_up = getattr(OpenBLASController, "clear_controlling_thread", None)
    if give_up is not None:
        give_up(force=True)


# One for the process, because the limit is the process's.
ONE_THREAD = OneThread()
