"""What takes too long for every change, a part after the other, with what each said last.

Run:  .venv/bin/python tools/night.py [PART ...]

Without names all parts run, some hours in all.  What a part says goes into a file of its name in
``benchmarks/results/night``, headed by the day, the commit and how it ended; other files stay.  The
exit status is 1 if a part fails.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results" / "night"


@dataclass(frozen=True)
class Part:
    """A command of Python, and what its lines begin with that are kept beside the last one; all of
    them are kept where nothing is named."""

    command: tuple[str, ...]
    kept: tuple[str, ...] = ()


PARTS = {
    # the examples with the starts, the flags of the compiler and the pictures that users have
    "defaults": Part(
        ("-m", "pytest", "--as-users", "-n", "0", "tests/whole/test_examples.py"),
        ("FAILED", "ERROR"),
    ),
    "changes": Part(("tools/mutations.py",), ("!",)),
    "ladder": Part(("benchmarks/run.py", "--only", "ladder")),
    "campaign": Part(("benchmarks/campaign.py",)),
    "contacts": Part(("benchmarks/campaign.py", "--contacts")),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run parts and write what they say."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    names = parser.parse_args(arguments).parts or list(PARTS)
    if unknown := [name for name in names if name not in PARTS]:
        parser.error(f"{unknown[0]}: expected some of {', '.join(PARTS)}")
    commit = _commit()  # what the parts write is no change of it
    failed = [name for name in names if not _passes(name, PARTS[name], commit)]
    return int(bool(failed))


def _passes(name: str, part: Part, commit: str) -> bool:
    """Run a part, write its file, and say whether it succeeded."""
    begun = time.monotonic()
    ended = subprocess.run(
        (sys.executable, *part.command), cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False
    )
    minutes = (time.monotonic() - begun) / 60
    verdict = "passed" if ended.returncode == 0 else f"failed with {ended.returncode}"
    head = f"{time.strftime('%Y-%m-%d')}, commit {commit}, {minutes:.0f} min: {verdict}"
    RESULTS.mkdir(exist_ok=True)
    text = "\n".join([head, "", *kept(ended.stdout.splitlines(), part.kept)]) + "\n"
    (RESULTS / f"{name}.txt").write_text(text, encoding="utf-8")
    print(f"{name}: {head}", flush=True)
    return ended.returncode == 0


def kept(lines: Sequence[str], beginnings: tuple[str, ...]) -> list[str]:
    """The lines that begin with something, and the last; all where nothing is named."""
    if not beginnings:
        return list(lines)
    return [*(line for line in lines[:-1] if line.startswith(beginnings)), *lines[-1:]]


def _commit() -> str:
    words = ("git", "describe", "--always", "--dirty")
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
