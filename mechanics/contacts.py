"""What can touch in a model, by names and by numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import value_class
from dmoc.codegen.kernels import Array
from dmoc.codegen.manifest import Manifest
from dmoc.motion.impact_laws import BALL, IMPACT_LAWS, POISSON, ImpactLaw, second_of
from dmoc.motion.trajectory import by_grip

# The number of what there is not, and the surface of a tangent that belongs to none.
NOWHERE = -1
RAIL = NOWHERE


@value_class(frozen=True)
class Contacts:
    """What can touch in a model: its surfaces, and its tangents, of which those that are named like
    a surface belong to it and the others are rails; surfaces without restitution, those whose
    tangent has friction, surfaces with the laws of their hits, Poisson's where none is told, and
    tangents without friction, which take part in hits alone; switches; surfaces that have ends;
    surfaces whose tangent has two directions, with the second; tangents that are sliding
    velocities, of no place.

    Behind the surfaces come the places of ``grips``: conditions that a sequence closes and opens,
    whose forces have both signs, and which hold nothing back while they are open.  Those that are
    stated ``by_rate`` close wherever they are; ``strong`` are grips with a strength."""

    surfaces: tuple[str, ...]
    tangents: tuple[str, ...]
    plastic: tuple[str, ...] = ()
    rough: tuple[str, ...] = ()
    impact_laws: tuple[tuple[str, str], ...] = ()
    frictionless: tuple[str, ...] = ()
    switches: tuple[str, ...] = ()
    ended: tuple[str, ...] = ()
    pairs: tuple[tuple[str, str], ...] = ()
    skids: tuple[str, ...] = ()
    grips: tuple[tuple[str, tuple[str, ...]], ...] = ()
    by_rate: tuple[str, ...] = ()
    strong: tuple[str, ...] = ()

    @cached_property
    def of_grips(self) -> tuple[int, ...]:
        """Numbers of the places of grips among the surfaces."""
        return tuple(self.surface_numbers[name] for _, names in self.grips for name in names)

    @cached_property
    def pull(self) -> NDArray[np.bool_]:
        """Surfaces whose forces have both signs, the places of grips, shape (nc,)."""
        pull = np.zeros(len(self.surfaces), dtype=bool)
        pull[list(self.of_grips)] = True
        return pull

    @cached_property
    def floating(self) -> tuple[int, ...]:
        """Numbers of those that close wherever they are."""
        return tuple(self.surface_numbers[name] for name in self.by_rate)

    @cached_property
    def of_strong(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the places of each grip with a strength."""
        return tuple(tuple(map(self.surface_numbers.__getitem__, self.places(name)))
                     for name in self.strong)  # fmt: skip

    @property
    def grip_names(self) -> tuple[str, ...]:
        return tuple(name for name, _ in self.grips)

    def places(self, name: str) -> tuple[str, ...]:
        """The places of a grip; of a surface itself."""
        return dict(self.grips).get(name, (name,))

    def grasped(self, names: Iterable[str]) -> tuple[str, ...]:
        """Names of surfaces, with those of grips for all their places."""
        return by_grip(tuple(names), dict(self.grips))

    @cached_property
    def surface_numbers(self) -> dict[str, int]:
        """The place of each surface in the model."""
        return {name: j for j, name in enumerate(self.surfaces)}

    @cached_property
    def tangent_numbers(self) -> dict[str, int]:
        """The place of each tangent in the model."""
        return {name: k for k, name in enumerate(self.tangents)}

    @cached_property
    def supports(self) -> tuple[int, ...]:
        """The surface that each tangent belongs to, or RAIL."""
        first = {second: name for name, second in self.pairs}
        owners = (first.get(name, name) for name in self.tangents)
        return tuple(self.surface_numbers.get(name, RAIL) for name in owners)

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Tangents that rub where a contact lasts."""
        return tuple(t for t in self.tangents if t not in self.frictionless)

    @cached_property
    def rolling(self) -> tuple[tuple[int, int], ...]:
        """Numbers of both directions of the tangents that have two."""
        numbers = self.tangent_numbers
        return tuple((numbers[name], numbers[second]) for name, second in self.pairs)

    def needed(self, tangential: Array) -> Array:
        """How much friction forces (..., nt) need, shape (..., nt): of both directions of a tangent
        what they need together."""
        needs = np.abs(tangential)
        for pair in self.rolling:
            needs[..., pair] = np.hypot.reduce(tangential[..., pair], axis=-1, keepdims=True)
        return needs

    @cached_property
    def in_place(self) -> NDArray[np.bool_]:
        """Tangents that are positions, and no sliding velocities, shape (nt,)."""
        return np.array([name not in self.skids for name in self.tangents], dtype=bool)

    @cached_property
    def in_space(self) -> tuple[int, ...]:
        """Numbers of the surfaces whose tangent has two directions."""
        return tuple(self.surface_numbers[name] for name, _ in self.pairs)

    def directions(self, tangent: int) -> list[int]:
        """A tangent with its second direction, where it has one."""
        second = dict(self.pairs).get(self.tangents[tangent])
        return [tangent] if second is None else [tangent, self.tangent_numbers[second]]

    def tangents_of(self, surface: int) -> tuple[int, ...]:
        """The directions of the tangent of a surface."""
        return tuple(self.directions(self.supports.index(surface)))

    @cached_property
    def lines(self) -> tuple[int, ...]:
        """Numbers of the tangents that are no second directions."""
        seconds = [second for _, second in self.pairs]
        return tuple(k for k, name in enumerate(self.tangents) if name not in seconds)

    def said(self, rubbing: Mapping[str, int]) -> dict[str, int]:
        """Friction of tangents by name as words say it: once for both directions of one."""
        return {n: s for n, s in rubbing.items() if self.tangent_numbers[n] in self.lines}

    def rubs_on(self, surface: int) -> list[int]:
        """The directions of the tangent that rubs where a contact with a surface lasts; none
        without one."""
        name = self.surfaces[surface]
        return self.directions(self.tangent_numbers[name]) if name in self.rubbing else []

    @property
    def rails(self) -> tuple[str, ...]:
        return tuple(t for t, j in zip(self.tangents, self.supports, strict=True) if j == RAIL)

    def impact_law(self, surface: str) -> str:
        """The law of hits of a surface that have a tangential impulse."""
        return dict(self.impact_laws).get(surface, POISSON)

    def said_of(self, surface: str) -> ImpactLaw:
        """Facts about the impact law of a surface."""
        return IMPACT_LAWS[self.impact_law(surface)]

    def named(self, surfaces: Iterable[int]) -> tuple[str, ...]:
        """Names of surfaces."""
        return tuple(self.surfaces[j] for j in surfaces)


def contacts_of(facts: Manifest) -> Contacts:
    """What can touch in the model of a manifest."""
    return Contacts(
        tuple(facts.surfaces), tuple(facts.tangents), frictionless=tuple(facts.without_friction),
        switches=tuple(facts.switches), ended=tuple(facts.within),
        grips=tuple((grip, tuple(places)) for grip, places in facts.grips.items()),
        by_rate=tuple(facts.by_rate), strong=tuple(facts.strength),
        pairs=tuple((n, second_of(n)) for n in facts.tangents if facts.impact_laws.get(n) == BALL),
        skids=tuple(facts.rate_tangents),
    )  # fmt: skip
