"""Coefficients of a model that its laws of contact do not have: they create energy, or leave no
state of contact."""

from __future__ import annotations

from dmoc.base.arguments import ErrorKind
from dmoc.mechanics.model import Model

PARAMETERS = "check the parameters"


def check_coefficients(
    model: Model, error: ErrorKind, where: str = "", remedy: str = PARAMETERS
) -> None:
    """Refuse constant friction below zero, static below kinetic, tangential restitution that
    creates energy, and grips without strength; ``where`` says for which values of the model."""
    for k, name in enumerate(model.kernels.tangents):
        if k in model.varying_friction:
            continue
        for value in (model.friction[k], model.static_friction[k]):
            if not value >= 0:
                raise error(
                    f"the friction of {name!r} is {value:g}{where}: expected 0 or a positive "
                    f"number; {remedy}."
                )
        check_pair(name, model.static_friction[k], model.friction[k], error, where, remedy)
    for k in model.rubs_in_hits.values():
        e_t = float(model.tangential_restitution[k])
        if not -1 <= e_t <= 1:
            raise error(
                f"the tangential restitution of {model.kernels.tangents[k]!r} is {e_t:g}{where}: "
                f"expected -1 (smooth) to 1 (a superball), more creates energy; {remedy}."
            )
    for name, F in zip(model.contacts.strong, model.strength[0].tolist(), strict=True):
        if not F > 0:
            raise error(
                f"the strength of grip {name!r} is {F:g}{where}: expected a positive force; "
                f"{remedy}."
            )


def check_pair(
    name: str, static: float, kinetic: float, error: ErrorKind, where: str, remedy: str
) -> None:
    """Refuse static friction below kinetic, with which a contact that breaks away would stop at
    once."""
    if static < kinetic:
        raise error(
            f"the static friction of {name!r} is {static:g}{where}, below the kinetic one, "
            f"{kinetic:g}: expected the larger one first; {remedy}."
        )
