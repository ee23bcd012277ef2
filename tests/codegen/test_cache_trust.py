"""Nothing is loaded from the cache that others could have written, and compiled kernels are
those of their manifest."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import printed
from systems import block_system

import dmoc
from dmoc.base.errors import BuildError, DmocError
from dmoc.codegen.build import LIBRARY, arrived, load_installed, sources, write_files
from dmoc.codegen.compiler import compiler
from dmoc.codegen.kernels import Kernels
from dmoc.codegen.text import c_files
from dmoc.symbolic.families import model_key, model_spec

SYSTEM = block_system("trusted")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache with the kernels of SYSTEM, made by a user whose files are open to all unless they
    are closed."""
    folder = tmp_path_factory.mktemp("trust") / "above" / "cache"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DMOC_CACHE", str(folder))
        mask = os.umask(0)
        try:
            dmoc.build(SYSTEM)
        finally:
            os.umask(mask)
    yield folder


@pytest.fixture
def own_cache(built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that cache, in use; what is not found in it is not built."""
    folder = tmp_path / "above" / "cache"
    shutil.copytree(built.parent, folder.parent)

    def refuse(*_: Any) -> None:
        raise BuildError("built again.")

    monkeypatch.setenv("DMOC_CACHE", str(folder))
    monkeypatch.setattr("dmoc.codegen.build.compile_library", refuse)
    return folder


def entry(cache: Path) -> Path:
    (folder,) = (p for p in cache.iterdir() if p.is_dir())
    return folder


def mass(kernels: Kernels) -> float:
    one = np.ones((1, 1))
    return float(kernels.call("dynamics", one, one, one, one, np.array([[3.0, 1.0]]))[0][0, 0])


@pytest.mark.slow
def test_the_own_cache_is_used_and_is_the_users_alone(own_cache: Path) -> None:
    assert dmoc.build(SYSTEM).seconds == 0
    made = [own_cache, own_cache.parent, *entry(own_cache).rglob("*"), entry(own_cache)]
    assert all(p.stat().st_mode & 0o077 == 0 for p in made)


@pytest.mark.parametrize(
    ("place", "mode"),
    [("cache", 0o770), ("cache", 0o707), ("cache", 0o1777), ("above", 0o777), ("above", 0o770)],
)
def test_a_folder_that_others_may_write_to_is_not_used_and_said_once(
    own_cache: Path, place: str, mode: int
) -> None:
    folder = own_cache if place == "cache" else own_cache.parent
    folder.chmod(mode)
    with (
        pytest.warns(RuntimeWarning, match=f"other users may write to {folder}, .* set DMOC_CACHE"),
        pytest.raises(BuildError, match="again"),
    ):
        dmoc.build(SYSTEM)
    with pytest.raises(BuildError, match="built again"):  # a second warning would be an error
        dmoc.build(SYSTEM)
    assert len(list(own_cache.iterdir())) == 2


def test_a_sticky_folder_above_is_no_objection(own_cache: Path) -> None:
    own_cache.parent.chmod(0o1777)
    assert dmoc.build(SYSTEM).seconds == 0


def test_a_folder_of_another_user_is_not_used(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    me = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: me + 1)
    with (
        pytest.warns(RuntimeWarning, match="belongs to another user"),
        pytest.raises(BuildError, match="set TMPDIR or DMOC_CACHE"),
    ):
        dmoc.build(SYSTEM)


def _linked(path: Path) -> None:
    elsewhere = path.rename(path.parents[1] / f"elsewhere-{path.name}")
    path.symlink_to(elsewhere)


def _changed(folder: Path, **facts: Any) -> None:
    """Put other facts into the manifest, such as the digest of the sources, or none."""
    manifest = json.loads((folder / "manifest.json").read_text()) | facts
    kept = {name: fact for name, fact in manifest.items() if fact is not None}
    (folder / "manifest.json").write_text(json.dumps(kept))


def _without_table(folder: Path) -> None:
    """Make the library one that holds no table of the model."""
    (folder / "empty.c").touch()
    (folder / LIBRARY).unlink()
    printed(*compiler(), "-shared", "empty.c", "-o", LIBRARY, cwd=folder)


def _without_library(folder: Path) -> None:
    (folder / LIBRARY).unlink()
    (folder / LIBRARY).write_text("no library")


def _of_older_form(entry: Path) -> None:
    """Before kernels were plain libraries, each had a module of Python."""
    record = (entry / "build.json").read_text()
    (entry / "build.json").write_text(record.replace("kernels.cpy", "wrapper.cpy"))
    (entry / LIBRARY).rename(entry / LIBRARY.replace("kernels", "wrapper"))


def _recorded(change: Callable[[Path], None]) -> Callable[[Path], None]:
    """A change of an entry after which its record agrees."""

    def changed(entry: Path) -> None:
        change(entry)
        record = json.loads((entry / "build.json").read_text())
        for name in record["files"]:
            digest = hashlib.sha256((entry / name).read_bytes()).hexdigest()
            record["files"][name] = digest
        (entry / "build.json").write_text(json.dumps(record))

    return changed


def _of_another_key(entry: Path) -> None:
    record = json.loads((entry / "build.json").read_text())
    (entry / "build.json").write_text(json.dumps({**record, "key": "0" * 64}))


DAMAGE: dict[str, Callable[[Path], Any]] = {
    "open folder": lambda e: e.chmod(0o770),
    "open module": lambda e: next(e.glob("*.so")).chmod(0o620),
    "open manifest": lambda e: (e / "manifest.json").chmod(0o602),
    "linked folder": _linked,
    "linked module": lambda e: _linked(next(e.glob("*.so"))),
    "linked record": lambda e: _linked(e / "build.json"),
    "record of nothing": lambda e: (e / "build.json").write_text("{}"),
    "record of no files": lambda e: (e / "build.json").write_text('{"files": {}}'),
    "record that is deeper than JSON is read": lambda e: (e / "build.json").write_text("[" * 10**5),
    "record that is a list": lambda e: (e / "build.json").write_text("[]"),
    "another key": _of_another_key,
    "manifest of other sources": _recorded(lambda e: _changed(e, code="0" * 64)),
    "manifest without a digest": _recorded(lambda e: _changed(e, code=None)),
    "manifest without a fact": _recorded(lambda e: _changed(e, order=None)),
    "manifest with another fact": _recorded(lambda e: _changed(e, tides=1)),
    "library that is none": _recorded(_without_library),
    "library without a table": _recorded(_without_table),
    "older form": _of_older_form,
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_an_entry_that_others_could_have_made_is_not_loaded(own_cache: Path, damage: str) -> None:
    DAMAGE[damage](entry(own_cache))
    with pytest.raises(BuildError, match="built again"):
        dmoc.build(SYSTEM)


# What is wrong with installed kernels, and what is said of it.
INSTALLED: dict[str, tuple[Callable[[Path], Any], str]] = {
    "fresh": (lambda p: None, ""),
    "not compiled": (lambda p: (p / LIBRARY).unlink(), ""),
    "stale": (lambda p: _changed(p, code="0" * 64), "were made from other sources"),
    "oldest": (lambda p: _changed(p, code=None), "were made from other sources"),
    "without a fact": (lambda p: _changed(p, order=None), "cannot be loaded .*'order'"),
    "with another fact": (lambda p: _changed(p, tides=1), "cannot be loaded .*'tides'"),
    "damaged": (_without_library, "cannot be loaded"),
    "of another name": (_without_table, "cannot be loaded"),
}


def test_installed_kernels_of_other_sources_are_refused(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages = {name: tmp_path / f"{name}_kernels" for name in INSTALLED}
    for name, folder in packages.items():
        shutil.copytree(entry(built), folder)
        INSTALLED[name][0](folder)
    monkeypatch.syspath_prepend(tmp_path)
    for name, folder in packages.items():
        text = INSTALLED[name][1]
        if text:
            with pytest.raises(BuildError, match=f"of model 'trusted' {text}.*install dmoc again"):
                load_installed(folder.name)
        else:
            assert (load_installed(folder.name) is None) == (name == "not compiled")
    assert load_installed("no_such_kernels") is None


def test_the_compiled_module_knows_its_sources(own_cache: Path) -> None:
    kernels = dmoc.build(SYSTEM)
    assert kernels.manifest.code == kernels.module.code
    other = c_files(model_spec(replace(SYSTEM, lagrangian=2 * SYSTEM.lagrangian)))
    assert json.loads(other["manifest.json"])["code"] != kernels.module.code


@pytest.mark.slow
def test_what_arrives_is_built_under_the_name_of_its_texts(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kernels of another model, which claim to be the user's, work and are not taken for them."""
    own = dmoc.build(SYSTEM)
    files = c_files(model_spec(replace(SYSTEM, lagrangian=2 * SYSTEM.lagrangian)))
    claimed = json.loads(files["manifest.json"]) | {"fingerprint": own.manifest.fingerprint}
    files["manifest.json"] = json.dumps(claimed)
    monkeypatch.undo()
    monkeypatch.setenv("DMOC_CACHE", str(own_cache))
    assert mass(arrived(claimed, "compiled", files)) == 6.0
    assert mass(dmoc.build(SYSTEM)) == 3.0
    assert len([p for p in own_cache.iterdir() if p.is_dir()]) == 2


def test_what_arrives_with_the_manifest_of_the_users_kernels_is_the_users(own_cache: Path) -> None:
    own = dmoc.build(SYSTEM)
    files = sources(own)
    files["kernels.c"] += "other\n"
    loaded = arrived(own.manifest, "compiled", files)
    assert loaded.module.path == own.module.path
    assert sources(loaded)["kernels.c"] != files["kernels.c"]


@pytest.mark.parametrize("change", ["../name", "extra", "missing"])
def test_what_arrives_in_another_form_is_refused(own_cache: Path, change: str) -> None:
    own = dmoc.build(SYSTEM)
    files = sources(own)
    if change == "extra":
        files["../beside.c"] = ""
    elif change == "missing":
        del files["kernels.h"]
    else:
        described = json.loads(files["manifest.json"])
        files["manifest.json"] = json.dumps(described | {"name": "../trusted"})
    with pytest.raises(DmocError, match=r"is not a C identifier|expected __init__\.py, kernels\.c"):
        arrived(own.manifest, "compiled", files)
    assert not (own_cache.parent / "beside.c").exists()


def test_files_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    write_files(tmp_path, {"a.c": "before"})
    with pytest.raises(UnicodeEncodeError):
        write_files(tmp_path, {"a.c": "after" * 100_000 + "\ud800"})
    assert [p.name for p in tmp_path.iterdir()] == ["a.c"]
    assert (tmp_path / "a.c").read_text() == "before"


def test_a_changed_title_shows_and_is_the_same_model(own_cache: Path) -> None:
    titled = replace(SYSTEM, title="a block")
    with pytest.raises(BuildError, match="built again"):
        dmoc.build(titled)
    assert model_key(titled) != model_key(SYSTEM)
    first, second = (json.loads(c_files(model_spec(s))["manifest.json"]) for s in (SYSTEM, titled))
    assert (first["title"], second["title"]) == ("trusted", "a block")
    assert first["fingerprint"] == second["fingerprint"]


@pytest.mark.parametrize("command", ["'", '"gcc', "gcc '"])
def test_a_command_without_an_end_is_told_by_its_variable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.setenv("CC", command)
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path))
    with pytest.raises(BuildError, match=r"CC = .* is no command"):
        dmoc.build(SYSTEM, backend="compiled")
