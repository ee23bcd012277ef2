"""Run the tests that are not slow against the wheels of ``make release``, each under its own
interpreter, installed, and not from the sources.

Run:  make test-wheels
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from release import ROOT, interpreters, run, version_of

# Of the checkout: what tests a build of the sources and not what is installed.
LEFT_OUT = ("--deselect", "tests/codegen/test_generated.py", "--ignore", "tests/whole")


def main() -> None:
    """Test every wheel in ``dist``."""
    for python in interpreters():
        tag = f"cp{version_of(python).replace('.', '')}"
        for wheel in sorted((ROOT / "dist").glob(f"*-{tag}-*.whl")):
            with tempfile.TemporaryDirectory() as folder:
                tested(wheel, python, Path(folder))


def tested(wheel: Path, python: str, folder: Path) -> None:
    """Install a wheel with what its tests need, and run them."""
    run(python, "-m", "venv", folder / "env")
    commands = folder / "env" / "bin"
    run(commands / "pip", "install", "--quiet", f"{wheel}[test]")
    words = ("-n", "auto", "--dist", "worksteal", "-m", "not slow", *LEFT_OUT)
    cache = os.environ.get("DMOC_CACHE", str(folder / "cache"))
    run(commands / "python", "-m", "pytest", *words, cwd=ROOT, DMOC_CACHE=cache)


if __name__ == "__main__":
    main()
