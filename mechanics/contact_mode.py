"""The mode of a motion by numbers: what is closed, sticks and slides, each by its place in the
model.  In words it is a :class:`dmoc.mechanics.modes.PhaseMode`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from dmoc.mechanics.bound_kernels import RAIL, BoundKernels


@dataclass(frozen=True)
class Mode:
    """Closed surfaces, tangents that stick, and tangents that slide with their signs."""

    closed: tuple[int, ...] = ()
    sticking: tuple[int, ...] = ()
    sliding: tuple[tuple[int, int], ...] = ()

    @property
    def rubbing(self) -> dict[int, int]:
        """Friction of the tangents that rub: 0 sticks, 1 and -1 slide."""
        return dict.fromkeys(self.sticking, 0) | dict(self.sliding)


FREE = Mode()


def mode_by_names(model: BoundKernels, closed: Iterable[str], rubbing: Mapping[str, int]) -> Mode:
    """The mode of surfaces and tangents by their names; what rubs at an open surface has no part
    in it."""
    on = tuple(model.surface_numbers[name] for name in closed)
    states = [(model.tangent_numbers[name], s) for name, s in rubbing.items()]
    states = [(k, s) for k, s in states if model.supports[k] in (RAIL, *on)]
    return Mode(
        on, tuple(k for k, s in states if s == 0), tuple((k, s) for k, s in states if s != 0)
    )


def names_of(model: BoundKernels, mode: Mode) -> Iterator[tuple[str, int | None]]:
    """What is closed, with None, and what rubs, with 0 or its sign."""
    for j in mode.closed:
        yield model.kernels.surfaces[j], None
    for k, s in mode.rubbing.items():
        yield model.kernels.tangents[k], s


def without_rails(model: BoundKernels, mode: Mode) -> Mode:
    """A mode as it is during an impact, in which rails have no part."""
    return replace(
        mode,
        sticking=tuple(k for k in mode.sticking if model.supports[k] != RAIL),
        sliding=tuple((k, s) for k, s in mode.sliding if model.supports[k] != RAIL),
    )
