"""A film as one page that plays by itself: style, script and document in one file, and nothing that
it would have to fetch."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from dmoc.motion.scene import Array, Scene
from dmoc.report.curves import Panel
from dmoc.report.film import Film, Take
from dmoc.report.places import Room, room_of
from dmoc.report.style import DARK, LIGHT, SIGNS

FORMAT = 2
# In the order in which they need each other.
SCRIPTS = ("values", "elements", "clock", "picture", "curves", "tree", "player")
SPACE = ("meshes", "webgl", "space")  # of motions in space
PLANNER = ("answers", "handles", "planner")  # of a page that plans
WORKER = "worker"  # which runs beside it
# Around a motion, in shares of the larger side, and the least side in shares of the other one.
MARGIN, LEAST = 0.1, 0.3
# Digits that are kept of the largest number of an array: finer than a pixel, finer than what is
# read out.
DIGITS = 6
# Samples of a phase of a curve that are kept at most: it has no more pixels.
MOST = 400


def page_of(film: Film, plan: Mapping[str, Any] | None = None) -> str:
    """The text of a page that plays a film; with a plan, of one that plans its motion again
    (:mod:`dmoc.export.page`).

    Its policy lets a browser run the page's own script alone, and the solver that it carries, and
    fetch nothing.
    """
    space = SPACE if any(take.scene.in_space for take in film.takes) else ()
    scripts = (*SCRIPTS[:-1], *space, SCRIPTS[-1], *(PLANNER if plan else ()))
    script = "\n".join(_source(f"{name}.js") for name in scripts)
    styles = ("page", *(["space"] if space else []), *(["planner"] if plan else []))
    themes = f':root {{ {LIGHT.css} }}\n:root[data-theme="dark"] {{ {DARK.css} }}\n'
    shown = document(film)
    if plan:
        shown |= {"plan": {**plan, "worker": _source(f"{WORKER}.js")}}
    text = json.dumps(
        shown, ensure_ascii=False, separators=(",", ":"), allow_nan=False, default=rounded
    )
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    if plan:
        policy += " 'wasm-unsafe-eval'; worker-src blob:"
    filled = {
        "title": escape(film.title),
        "style": themes + "".join(_source(f"{name}.css") for name in styles),
        "script": script,
        "film": text.replace("<", "\\u003c"),  # no text ends the element that holds it
        "policy": policy,
    }
    # What is filled in is not read again: names of a model may look like places to fill.
    return re.sub(r"\{\{(\w+)\}\}", lambda place: filled[place[1]], _source("page.html"))


def _source(name: str) -> str:
    """A file of the player."""
    return (files("dmoc.report.animation") / "player" / name).read_text(encoding="utf-8")


def document(film: Film) -> dict[str, Any]:
    """A film as numbers, texts, lists and mappings, and arrays that :func:`rounded` makes lists."""
    return {
        "format": FORMAT,
        "title": film.title,
        "motions": [_motion(take) for take in film.takes],
        "verdicts": dict(SIGNS),
        "tree": [asdict(branch) for branch in film.tree],
        "statement": film.statement,
    }


def film_room(scenes: Sequence[Scene]) -> Room:
    """The part of the plane that a film shows."""
    return room_of(scenes, MARGIN, LEAST)


def _motion(take: Take) -> dict[str, Any]:
    motion, scene = take.trajectory, take.scene
    room = film_room([scene])
    # Columns that are the same all along are there once; one that does not change is one number.
    _, first, which = np.unique(
        np.vstack(scene.values), axis=1, return_index=True, return_inverse=True
    )
    columns = which.ravel().tolist()
    return {
        "name": take.name,
        "model": motion.model,
        "status": take.status,
        "message": take.message,
        "cost": take.cost,
        "duration": motion.final_time,
        "starts": [float(phase.t[0]) for phase in motion.phases],
        "modes": [phase.mode for phase in motion.phases],
        "lasting": motion.lasting,
        "unit": "m" if motion.scene else "",
        "shapes": [
            {"kind": s.kind, "name": s.name, "columns": columns[s.start : s.start + s.size]}
            for s in scene.shapes
        ],
        "parts": [
            {"times": t, "columns": [_column(v) for v in values.T[first]]}
            for t, values in zip(scene.times, scene.values, strict=True)
        ],
        "bounds": np.array(room.camera.bounds if room.camera else room[:4]),
        "ground": room.camera and room.camera.floor,
        "events": take.events,
        "panels": [_panel(panel) for panel in take.panels],
        "arrows": take.arrows,
        "largest": take.largest,
    }


def _column(values: Array) -> list[float] | float:
    numbers = rounded(values)
    return numbers[0] if len(set(numbers)) == 1 else numbers


def _panel(panel: Panel) -> dict[str, Any]:
    def thinned(values: Array | None) -> Array | None:
        """At most MOST of the values, evenly, with both ends; None if one is infinite."""
        if values is None or not np.isfinite(values).all():
            return None
        if len(values) <= MOST:
            return values
        kept: Array = values[np.linspace(0, len(values) - 1, MOST).round().astype(int)]
        return kept

    curves = []
    for curve in panel.curves:
        low, high = (bound if np.isfinite(bound) else None for bound in curve.bounds)
        label = {"head": curve.label.head, "tail": curve.label.tail}
        values, limits = (list(map(thinned, parts)) for parts in (curve.values, curve.limits))
        curves.append({"name": curve.name, "label": label, "number": curve.number, "low": low,
                       "high": high, "values": values, "limits": limits})  # fmt: skip
    times = list(map(thinned, panel.times))
    return {"title": panel.title, "unit": panel.unit, "times": times, "curves": curves}


def rounded(values: Array) -> list[float]:
    """The numbers of an array, shape (n,), to DIGITS digits of the largest."""
    largest = float(np.abs(values).max(initial=0.0))
    if not largest:
        return [0.0] * len(values)
    decimals = DIGITS - 1 - int(np.floor(np.log10(largest)))
    return [float(v) for v in np.round(values, decimals) + 0.0]
