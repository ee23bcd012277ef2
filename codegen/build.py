"""Write, compile and load: generated text becomes a library, kept in a cache by the content it was
made from.

A cache entry is a folder ``<model>-<key>`` with the sources, their shared library and
``build.json``, which holds the key and the digest of every other file.  An entry is made in a
folder of its own and renamed into place under a lock, so that processes building at once do not see
half an entry; an entry that is not whole is made again.  The digests find damage; against others
stand the rights of the folder, the entries and the files: what others could have written is not
loaded.  The library holds the digest of its sources, as their manifest does, so that a library and
a manifest of different sources never meet.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import json
import os
import tempfile
import time
import types
from collections.abc import Callable, Mapping
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

from dmoc.base.errors import BuildError, warn
from dmoc.base.names import check_name
from dmoc.codegen.compiler import HEADER, HEADERS, compile_library, compiler
from dmoc.codegen.kernels import NUMPY, Kernels, kernels_of_library
from dmoc.codegen.manifest import Manifest
from dmoc.codegen.private_files import is_private, make_folder, remove, safe_folder, write_whole

BUILD_RECORD = "build.json"
SOURCES = ("__init__.py", "kernels.c", "kernels.h", "manifest.json")
# Setuptools names the libraries of the shipped models so: by the machine and its C library.
LIBRARY = f"kernels{EXTENSION_SUFFIXES[0]}"
NUMPY_TEXT = "numpy.py"


def cache_directory() -> Path:
    """Return the folder of built kernels: $DMOC_CACHE if set, else the user's cache folder."""
    chosen = os.environ.get("DMOC_CACHE")
    if chosen:
        return Path(chosen)
    import platformdirs

    return Path(platformdirs.user_cache_dir("dmoc", appauthor=False))


def build_cached(
    name: str,
    key: str,
    texts: Callable[[], Mapping[str, str]],
    fallback: Callable[[], Kernels] | None = None,
    force: bool = False,
    compiling: Callable[[], None] = lambda: None,
) -> Kernels:
    """Return compiled kernels from the cache, building them first if they are missing, stale or
    damaged.

    Parameters
    ----------
    name : str
        Model name.
    key : str
        Digest of what the model was made from.
    texts : callable
        Makes the sources; called only when they are needed.
    fallback : callable, optional
        Makes NumPy kernels, used with a warning on a machine without a C compiler.
    force : bool, optional
        Build even if the cache holds the kernels.
    compiling : callable, optional
        Called before the compiler is.

    Raises
    ------
    BuildError
        If there is no compiler and no fallback, the compiler fails, or the cache cannot be written.
    """
    cache, digest = cache_directory(), _entry_key(key)
    if not force:
        kernels = _cached_kernels(cache, name, digest)
        if kernels is not None:
            return kernels
    start = time.perf_counter()
    try:
        command = compiler()
    except BuildError as error:
        if fallback is None:
            raise
        warn(f"{str(error).rstrip('.')}; until then NumPy kernels are used, which are much slower.")
        return fallback()
    import filelock  # here, because installed kernels need no lock

    try:
        make_folder(cache)
        entry = _entry(safe_folder(cache), name, digest)
        lock = filelock.FileLock(entry.parent / f"{entry.name}.lock")
        with lock:
            kernels = None if force else _load_entry(entry, digest)
            if kernels is None:
                files = texts()
                compiling()
                _make_entry(entry, digest, files, command)
                kernels = _load_entry(entry, digest)
    except OSError as error:
        raise BuildError(
            f"the kernel cache {cache} cannot be written ({error.strerror}): set DMOC_CACHE to a "
            "writable folder."
        ) from None
    if kernels is None:
        raise BuildError(
            f"the kernels in {entry} were built and cannot be loaded, or are not those of their "
            "manifest: remove that folder and try again."
        )
    return Kernels(kernels.manifest, kernels.module, time.perf_counter() - start)


def load_installed(package: str) -> Kernels | None:
    """Return the kernels of an installed package of generated code, or None if they were not
    compiled.

    Raises
    ------
    BuildError
        If they cannot be loaded, or were compiled from other sources than those beside them.
    """
    folder = _folder(package)
    if folder is None or not (folder / LIBRARY).exists():
        return None
    facts = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    wrong = "were made from other sources than those installed"
    try:
        kernels = kernels_of_library(folder / LIBRARY, Manifest.read(facts))
    except (OSError, ValueError) as error:
        kernels, wrong = None, f"cannot be loaded ({error})"
    if kernels is None:
        raise BuildError(
            f"the compiled kernels of model {facts['name']!r} {wrong}: install dmoc again (in a "
            "checkout: pip install -e .)."
        )
    return kernels


def _folder(package: str) -> Path | None:
    """The folder of an installed package."""
    spec = importlib.util.find_spec(package)
    places = spec.submodule_search_locations if spec else None
    return Path(places[0]) if places else None


def sources(kernels: Kernels) -> dict[str, str]:
    """Return the generated text that kernels were made from."""
    if kernels.backend == NUMPY:
        return {NUMPY_TEXT: kernels.module.__dict__["TEXT"]}
    folder = Path(kernels.module.path).parent
    return {name: (folder / name).read_text(encoding="utf-8") for name in SOURCES}


def header() -> dict[str, str]:
    """Return what generated sources need to be compiled elsewhere, as ``{file name: text}``."""
    return {HEADER: (HEADERS / HEADER).read_text(encoding="utf-8")}


def arrived(manifest: Manifest, backend: str, files: Mapping[str, str]) -> Kernels:
    """Return kernels that come from another process: those installed or in the cache here, or built
    once more from their sources.

    What is here serves if it has the same manifest, digest of its sources included.  What is built
    gets the key of its texts, whatever they say of themselves, so that it is never taken for a
    model of the user.

    Raises
    ------
    BuildError
        If the texts are not those of one model.
    """
    if backend == NUMPY:
        return numpy_kernels(manifest, files[NUMPY_TEXT])
    if sorted(files) != sorted(SOURCES):
        raise BuildError(
            f"the kernels that arrived hold the files {', '.join(sorted(files))}: expected "
            f"{', '.join(sorted(SOURCES))}."
        )
    described = Manifest.read(json.loads(files["manifest.json"]))
    name = check_name(described.name, "model")
    installed = f"dmoc.generated.{name}"
    folder = _folder(installed)
    if folder and (folder / "manifest.json").read_text(encoding="utf-8") == files["manifest.json"]:
        kernels = load_installed(installed)
    else:
        kernels = _cached_kernels(cache_directory(), name, _entry_key(described.key))
    if kernels is not None and kernels.manifest == described:
        return kernels
    text = json.dumps(dict(files), sort_keys=True)
    return build_cached(name, f"arrived {hashlib.sha256(text.encode()).hexdigest()}", lambda: files)


def numpy_kernels(manifest: Manifest, text: str) -> Kernels:
    """Return kernels that run on NumPy from the text of a NumPy module."""
    module = types.ModuleType(f"dmoc_numpy_{manifest.name}")
    module.__dict__["TEXT"] = text
    exec(compile(text, module.__name__, "exec"), module.__dict__)
    return Kernels(manifest, module)


def write_files(directory: Path, files: Mapping[str, str]) -> list[Path]:
    """Write generated files into ``directory``, each whole or not at all, and return their
    paths."""
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, text in sorted(files.items()):
        path = directory / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            write_whole(path, text)
        paths.append(path)
    return paths


def _entry_key(key: str) -> str:
    """Digest of the model, the generator, the compiler's command and the kind of machine."""
    compiler_and_machine = f"{os.environ.get('CC')} {LIBRARY}"
    return hashlib.sha256(key.encode() + _generator() + compiler_and_machine.encode()).hexdigest()


@functools.cache
def _generator() -> bytes:
    """Digest of the generator, which stays what it was when it was loaded."""
    digest = hashlib.sha256()
    for package in ("dmoc.symbolic", "dmoc.codegen"):
        for path in sorted(_sources(package)):
            digest.update(path.read_bytes())
    return digest.digest()


def _sources(package: str) -> list[Path]:
    root = _folder(package)
    if root is None:
        raise BuildError(f"the package {package} cannot be found: install dmoc again.")
    return [p for p in root.rglob("*") if p.suffix in (".py", ".jinja", ".h")]


def _entry(folder: Path, name: str, digest: str) -> Path:
    return folder / f"{name}-{digest[:24]}"


def _cached_kernels(cache: Path, name: str, digest: str) -> Kernels | None:
    """Return kernels from the cache folder, if it exists and holds them."""
    return (
        _load_entry(_entry(safe_folder(cache), name, digest), digest)
        if os.path.isdir(cache)
        else None
    )


def _make_entry(entry: Path, digest: str, files: Mapping[str, str], command: list[str]) -> None:
    with tempfile.TemporaryDirectory(prefix=f".{entry.name}-", dir=entry.parent) as work:
        folder = Path(work) / entry.name
        folder.mkdir(mode=0o700)
        write_files(folder, files)
        compile_library(folder, command, LIBRARY)
        digests = {p.name: _digest(p) for p in sorted(folder.iterdir())}
        write_whole(
            folder / BUILD_RECORD, json.dumps({"key": digest, "files": digests}, indent=1) + "\n"
        )
        for path in folder.iterdir():
            path.chmod(0o600)  # also where the user's files are open to a group
        remove(entry)
        folder.rename(entry)


def _load_entry(entry: Path, digest: str) -> Kernels | None:
    """Load an entry if it is complete, undamaged, of this key, and nobody else could have
    written it."""
    try:
        if not all(is_private(path) for path in (entry, *entry.iterdir())):
            return None
        record = json.loads((entry / BUILD_RECORD).read_text(encoding="utf-8"))
        digests = {name: _digest(entry / name) for name in (*SOURCES, LIBRARY)}
        if record != {"key": digest, "files": digests}:
            return None
        facts = json.loads((entry / "manifest.json").read_text(encoding="utf-8"))
        return kernels_of_library(entry / LIBRARY, Manifest.read(facts))
    except (OSError, ValueError, RecursionError):  # the last of JSON that is too deep
        return None


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
