"""Every public object is documented, and its examples run."""

from __future__ import annotations

import doctest
import inspect
from dataclasses import FrozenInstanceError, fields, is_dataclass
from importlib import import_module
from pathlib import Path

import pytest
from pages import DOCS, write_shared

import dmoc
from dmoc.base import errors

PUBLIC = sorted(dmoc.__all__)
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.mark.parametrize("name", PUBLIC)
def test_public_name_has_the_sections_of_numpydoc(name: str) -> None:
    thing = getattr(dmoc, name)
    text = inspect.getdoc(thing) or ""
    assert text.partition("\n\n")[0].endswith("."), text
    assert "Examples\n--------\n" in text
    if inspect.isfunction(thing):
        documented = text.partition("Examples\n--------\n")[0]
        assert all(p in documented for p in inspect.signature(thing).parameters)
        assert "Returns\n-------\n" in text and "Raises\n------\n" in text


def test_the_reference_lists_every_public_name_and_every_error() -> None:
    listed = set((DOCS / "reference" / "index.rst").read_text().split())
    kinds = [f"dmoc.base.errors.{n}" for n, e in vars(errors).items() if isinstance(e, type)]
    missing = {f"dmoc.{name}" for name in PUBLIC} - listed
    assert not missing and set(kinds) - listed == {"dmoc.base.errors.DmocError"}


def test_records_of_the_reference_are_frozen() -> None:
    """What users get does not change under them, at run time either."""
    listed, seen = (DOCS / "reference" / "index.rst").read_text().split(), 0
    for name in listed:
        module, _, attribute = name.rpartition(".")
        if module.startswith("dmoc."):
            thing = getattr(import_module(module), attribute)
            if isinstance(thing, type) and is_dataclass(thing):
                base = str if issubclass(thing, str) else object
                one, name = base.__new__(thing), fields(thing)[0].name
                vars(one)[name] = None
                with pytest.raises(FrozenInstanceError):
                    setattr(one, name, None)
                seen += 1
    assert seen > 20


@pytest.mark.slow
@pytest.mark.usefixtures("without_library")
@pytest.mark.parametrize("name", PUBLIC)
def test_examples_of_a_public_name_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_shared(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    runner, output = doctest.DocTestRunner(optionflags=FLAGS), []
    examples = doctest.DocTestFinder().find(getattr(dmoc, name), name, module=False, globs={})
    for example in examples:
        runner.run(example, out=output.append)
    assert runner.summarize(verbose=False).attempted and not runner.failures, "".join(output)
