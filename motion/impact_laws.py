"""The laws of a hit with a tangential impulse, by their names, and what is said of each.

Their equations are in ``program/laws``, and once more, by other means, in
``simulation/impact_laws``: a file each.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ImpactLaw:
    """A law of impact in words.

    Attributes
    ----------
    name : str
        As sentences have it: what hits obey.
    whole : bool
        A hit sticks or slides as a whole: no word says that its sliding stops on the way.
    alone : bool
        It is a law of one contact: nothing else may touch.
    constant : bool
        Its coefficient of restitution is a number of a program.
    """

    name: str
    whole: bool = False
    alone: bool = False
    constant: bool = False


POISSON, STRONGE, RETURNING = "poisson", "stronge", "tangential restitution"
IMPACT_LAWS = {
    POISSON: ImpactLaw("Poisson's law"),
    STRONGE: ImpactLaw("Stronge's law", alone=True, constant=True),
    RETURNING: ImpactLaw("tangential restitution", whole=True, alone=True),
}
