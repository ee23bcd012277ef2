"""The laws of a hit with a tangential impulse, by their names, and what is said of each.

Their equations are in ``program/laws``, and once more, by other means, in
``simulation/impact_laws``: a file each.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from dmoc.base.records import value_class


@value_class(frozen=True)
class ImpactLaw:
    """A law of impact in words.

    Attributes
    ----------
    name : str
        As sentences have it: what hits obey.
    says : str
        What it says, in a sentence after a colon.
    whole : bool
        A hit sticks or slides as a whole: no word says that its sliding stops on the way.
    alone : bool
        It is a law of one contact: nothing else may touch.
    constant : bool
        Its coefficient of restitution is a number of a program.
    in_space : bool
        The contact has two tangential directions: what slides has no sign.
    """

    name: str
    says: str
    whole: bool = False
    alone: bool = False
    constant: bool = False
    in_space: bool = False


POISSON, STRONGE, RETURNING = "poisson", "stronge", "tangential restitution"
BALL = "ball"
IMPACT_LAWS = {
    POISSON: ImpactLaw("Poisson's law", "restitution has e times the impulse of compression"),
    STRONGE: ImpactLaw(
        "Stronge's law", "restitution gives e^2 of the work of compression back", alone=True,
        constant=True,
    ),
    RETURNING: ImpactLaw(
        "tangential restitution",
        "T = (1 + e_t) T_0 with the T_0 that stops the sliding in the plastic hit, or slides where "
        "that is above mu P",
        whole=True, alone=True,
    ),
    BALL: ImpactLaw(
        "the law of a ball",
        "T is opposite to the sliding velocity before the hit, and leaves -e_t times that, or is "
        "mu P where that would be more",
        whole=True, alone=True, in_space=True,
    ),
}  # fmt: skip


def second_of(tangent: str) -> str:
    """The name of the second direction of a tangent that has two."""
    return f"{tangent}_2"


def law_of(surface: str, stated: Mapping[str, str], returning: Collection[str]) -> str:
    """The law of the hits of a surface that have a tangential impulse, from the laws that a model
    states and its surfaces with tangential restitution."""
    return stated.get(surface, RETURNING if surface in returning else POISSON)
