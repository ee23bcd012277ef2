"""C under the address and undefined-behaviour sanitizers, each file compiled once in a run."""

from __future__ import annotations

import hashlib
import os
import subprocess
from pathlib import Path

WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
C11 = ("-std=c11", "-ffp-contract=off")
SANITIZED = ("-g", "-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def object_of(source: Path, *flags: str, gcc: str = "gcc") -> str:
    """The object file of a source, of whichever process of the tests compiles it first: what the
    preprocessor makes of it, and the flags, are its name."""
    command = [gcc, *C11, *flags, str(source)]
    text = subprocess.run([*command, "-E", "-P"], capture_output=True, check=True).stdout
    included = [flag for flag in flags if not flag.startswith("-I")]
    name = hashlib.sha256(" ".join(included).encode() + text).hexdigest()
    target = Path(os.environ["DMOC_CACHE"]).with_name("objects") / f"{name}.o"
    if not target.exists():
        target.parent.mkdir(exist_ok=True)
        own = target.with_suffix(f".{os.getpid()}.o")
        done = subprocess.run([*command, "-c", "-o", own], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        own.rename(target)
    return str(target)
