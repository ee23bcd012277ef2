"""What holds a motion back: inequalities and bounds that are active, as data that read as text."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import NOWHERE, Block
from dmoc.program.transcription import Transcription

# A multiplier this small holds nothing back, and an impulse this small is none.
NO_FORCE = 1e-7
NO_IMPULSE = 1e-6


class BoundKind(Enum):
    """What is held; the values are the texts, in which ``s`` is that of a plural."""

    GAP = "gap to {name} at {places} node{s}"
    INSIDE = "gap to {name} inside {places} step{s}"
    PATH = "path constraint {name} in {places} step{s}"
    CONE = "friction cone of {name} at {places} node{s}"
    DIRECTION = "sliding of {name} in {places} step{s}"
    DURATION = "duration of phase {name} {side} {value} s"
    INPUT = "{name} {side} {value} in {places} step{s}"
    COORDINATE = "{name} {side} {value} in {places} node{s}"
    IMPULSE = "impulse of collision {name} >= 0"
    OTHER = "{name}"

    @property
    def pattern(self) -> str:
        """The regular expression of its texts."""
        fields = {"side": ">=|<=", "value": r"\S+", "places": r"\d+", "s": "s?"}

        def group(match: re.Match[str]) -> str:
            return f"(?P<{match[1]}>{fields.get(match[1], '.*')})"

        return re.sub(r"\\{(\w+)\\}", group, re.escape(self.value))


# Those that hold inputs or the motion along the way, and not only the times.
ALONG_THE_WAY = (
    BoundKind.GAP,
    BoundKind.INSIDE,
    BoundKind.PATH,
    BoundKind.INPUT,
    BoundKind.COORDINATE,
)


@dataclass(frozen=True, eq=False, repr=False)
class ActiveBound(str):
    """A bound or an inequality that holds a motion back; it is the text that says so.

    Attributes
    ----------
    kind : BoundKind
    name : str
        The input, coordinate, surface or path constraint, the number of the phase, number and
        surface of the collision; of others the whole text.
    side : str
        ">=" or "<=" of a bound.
    value : float or None
        Where the bound is.
    places : int
        Steps or nodes in which it holds.
    """

    kind: BoundKind
    name: str
    side: str = ""
    value: float | None = None
    places: int = 0

    def __new__(
        cls, kind: BoundKind, name: str, side: str = "", value: float | None = None, places: int = 0
    ) -> ActiveBound:
        said = "" if value is None else f"{value:g}"
        plural = "s" * (places > 1)
        text = kind.value.format(name=name, side=side, value=said, places=places, s=plural)
        return super().__new__(cls, text)

    def __getnewargs__(self) -> tuple[BoundKind, str, str, float | None, int]:  # type: ignore[override]
        return self.kind, self.name, self.side, self.value, self.places

    @classmethod
    def read(cls, text: str) -> ActiveBound:
        """The bound that a text says; its value has the digits of the text."""
        for kind in BoundKind:
            match = re.fullmatch(kind.pattern, text, re.DOTALL)
            groups = {} if match is None else match.groupdict()
            try:
                value = float(groups["value"]) if "value" in groups else None
                places = int(groups.get("places", 0))
            except ValueError:
                continue
            bound = cls(kind, groups.get("name", ""), groups.get("side", ""), value, places)
            if bound == text:
                return bound
        return cls(BoundKind.OTHER, text)


def active_bounds(nlp: Transcription, x: Array, w: Array, z: Array) -> tuple[ActiveBound, ...]:
    """Name the inequalities and bounds that hold x back: those with a multiplier above the
    distance; many of a kind are counted."""
    return (*_inequalities(nlp, x, w), *_bounds(nlp, x, z), *_impulses(nlp, x))


def _inequalities(nlp: Transcription, x: Array, w: Array) -> Iterator[ActiveBound]:
    kinds, d, nodes = _counted(nlp), nlp.inequality(x), dict[tuple[BoundKind, str], set[int]]()
    for block in nlp.inequalities:
        if not block.count:
            continue
        rows = block.numbers - nlp.n_eq
        held = np.flatnonzero(w[rows] > np.maximum(d[rows], NO_FORCE))
        if block not in kinds or block.nodes is None:
            nodes |= {(BoundKind.OTHER, block.name_of(int(i))): set() for i in held}
            continue
        kind, names = kinds[block]
        for row, column, *_ in block.places[held]:
            name = names[column % len(names)]
            if name:  # else it is that of a hidden unknown
                nodes.setdefault((kind, name), set()).add(int(block.nodes[row]))
    for (kind, name), where in nodes.items():
        yield ActiveBound(kind, name, places=len(where))


def _counted(nlp: Transcription) -> dict[Block, tuple[BoundKind, Sequence[str]]]:
    """Rows of which there are some for every node or step, and the names along their second axis,
    once for each quadrature point."""
    manifest, laws = nlp.problem.kernels.manifest, nlp.laws
    surfaces = nlp.problem.kernels.surfaces
    paths = [row["name"] or "" for row in manifest["path_rows"]]
    return {
        laws.step.gap: (BoundKind.GAP, surfaces),
        laws.step.gap_inside: (BoundKind.INSIDE, surfaces),
        **dict.fromkeys(laws.path.blocks, (BoundKind.PATH, paths)),
        laws.contact.cone: (BoundKind.CONE, nlp.layout.touch.contacts.tangents),
        laws.contact.direction: (BoundKind.DIRECTION, nlp.layout.touch.contacts.tangents),
    }


def _bounds(nlp: Transcription, x: Array, z: Array) -> Iterator[ActiveBound]:
    lay, kernels = nlp.layout, nlp.problem.kernels
    with np.errstate(invalid="ignore"):
        free = nlp.lower < nlp.upper
        below = free & (z > np.maximum(x - nlp.lower, NO_FORCE))
        above = free & (-z > np.maximum(nlp.upper - x, NO_FORCE))
    ends = ((">=", nlp.limits[0], below), ("<=", nlp.limits[1], above))
    for i, k in enumerate(lay.index_h):
        for side, limit, active in ends:
            if active[k]:
                yield ActiveBound(BoundKind.DURATION, str(i), side, float(limit[k] * lay.steps[i]))
    inputs, coordinates = (kernels.inputs, lay.index_u), (kernels.coordinates, lay.index_q)
    for kind, (names, index), at in (
        (BoundKind.INPUT, inputs, lay.step_of_input),
        (BoundKind.COORDINATE, coordinates, np.arange(lay.total + 1)),
    ):
        for j, name in enumerate(names):
            for side, limit, active in ends:
                held = np.flatnonzero(active[index[:, j]])
                places = {(float(limit[index[k, j]]), int(at[k])) for k in held}
                for value, count in sorted(Counter(value for value, _ in places).items()):
                    yield ActiveBound(kind, name, side, value, count)


def _impulses(nlp: Transcription, x: Array) -> Iterator[ActiveBound]:
    for i, (k, event) in enumerate(zip(nlp.layout.impact.lam, nlp.problem.events, strict=True)):
        if event.hit != NOWHERE and x[k] <= NO_IMPULSE:
            yield ActiveBound(BoundKind.IMPULSE, f"{i + 1} ({nlp.problem.sequence[i]})")
