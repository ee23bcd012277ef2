"""The command ``dmoc``, also as ``python -m dmoc``."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import threading
from typing import Any

INTERRUPTED = 130
# Of NumPy's linear algebra, in this process and its workers: starting threads for it takes longer
# than all it is asked for.
THREADS = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
# New objects after which Python looks for cycles among them: what modules make stays, and looking
# through it after every 700 takes a tenth of a short command. At its end nothing is looked through.
NEW_OBJECTS = 100_000
# Seconds after which a Ctrl-C that came in a callback comes again.
AGAIN = 0.02


def main() -> None:
    """Run the command line; while its modules load and after its end, Ctrl-C leaves at once and
    without a traceback."""
    gc.set_threshold(NEW_OBJECTS)
    for name, number in THREADS.items():
        os.environ.setdefault(name, number)
    listening = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    try:
        if listening:
            signal.signal(signal.SIGINT, _leave)
        from dmoc import cli

        if listening:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            sys.unraisablehook = _lost
        cli.main()
    except KeyboardInterrupt:
        _leave()
    except SystemExit as end:
        # Threads of stopped workers may never end, and Python would wait for them.
        if threading.active_count() > 1:
            _flush()
            _release()
            os._exit(end.code if isinstance(end.code, int) else end.code is not None)
        raise
    finally:
        gc.freeze()
        if listening:
            signal.signal(signal.SIGINT, _leave)


def _lost(error: Any) -> None:
    """What is raised in a callback, or where an object ends, goes no further: Python tells it and
    goes on.  A Ctrl-C that came there comes again."""
    if isinstance(error.exc_value, KeyboardInterrupt):
        main_thread = threading.main_thread().ident
        threading.Timer(AGAIN, signal.pthread_kill, (main_thread, signal.SIGINT)).start()
    else:
        sys.__unraisablehook__(error)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()


def _release() -> None:
    """Give back the semaphores of workers, which are kept by name, as Python does at its end."""
    util = sys.modules.get("multiprocessing.util")
    if util is not None:
        util._run_finalizers(0)


def _leave(*_: object) -> None:
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    main()
