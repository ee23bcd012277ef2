"""What the shell proposes: models, methods, and names of a shipped model."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from dmoc.solving.methods import METHODS

if TYPE_CHECKING:
    import typer

APART = ","  # between the words of a sequence


def models(incomplete: str) -> list[tuple[str, str]]:
    """Shipped models and problems; where none fits, the shell proposes files."""
    from dmoc.models import catalogue

    entries = catalogue.ENTRIES.items()
    return [(name, entry.title) for name, entry in entries if name.startswith(incomplete)]


def methods(incomplete: str) -> list[tuple[str, str]]:
    """Methods and what they are."""
    return [(m.name, m.what) for m in METHODS.values() if m.name.startswith(incomplete)]


def surfaces(context: typer.Context, incomplete: str) -> list[str]:
    """Surfaces, one after the other with commas between them."""
    before, comma, last = incomplete.rpartition(APART)
    surfaces = _manifest(context).get("surfaces", [])
    return [f"{before}{comma}{name}" for name in surfaces if name.startswith(last)]


def parameters(context: typer.Context, incomplete: str) -> list[str]:
    """Parameters as NAME=."""
    return _assigned(_manifest(context).get("parameters", []), incomplete)


def bounded(context: typer.Context, incomplete: str) -> list[str]:
    """Inputs, coordinates and velocities as NAME=."""
    manifest = _manifest(context)
    inputs, coordinates = manifest.get("inputs", []), manifest.get("coordinates", [])
    velocities = [f"{name}_dot" for name in coordinates]
    return _assigned([*inputs, *coordinates, *velocities], incomplete)


def states(context: typer.Context, incomplete: str) -> list[str]:
    """Coordinates, velocities and momenta as NAME=."""
    coordinates = _manifest(context).get("coordinates", [])
    forms = ("{}", "{}_dot", "p_{}")
    return _assigned([form.format(name) for form in forms for name in coordinates], incomplete)


def _assigned(names: Any, incomplete: str) -> list[str]:
    return [f"{name}=" for name in names if name.startswith(incomplete)]


def _manifest(context: typer.Context) -> dict[str, Any]:
    """The facts of the shipped model on the command line; none of another model, which would have
    to be run."""
    from importlib import resources

    from dmoc.models import catalogue

    # What follows an option that has no value yet is not read into the parameters.
    words = [context.params.get("model"), *context.args]
    entry = next((catalogue.ENTRIES[word] for word in words if word in catalogue.ENTRIES), None)
    if entry is None:
        return {}
    place = resources.files("dmoc.generated").joinpath(entry.model, "manifest.json")
    facts: dict[str, Any] = json.loads(place.read_text(encoding="utf-8"))
    return facts
