"""What a carried solver knows of the laws of its model, as C (dmoc_carried.h): what parameters must
be together, and which coefficients depend on the motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dmoc.export.constants import Constants, initial
from dmoc.mechanics.algebra import is_positive
from dmoc.program.blocks import NOWHERE
from dmoc.program.transcription import Transcription

# Kernels of coefficients that depend on the motion, and of what they depend on.
KERNELS = ("rebound", "bearing", "holding", "slide_rate")
OF_PARAMETERS = ("friction", "tangential")


def together_text(c: Constants, nlp: Transcription, entries: Mapping[str, str]) -> str:
    model, varies = nlp.problem.model, _varies(nlp)
    kinds = np.where(varies, 0, 1 + model.paired)
    mass = is_positive(model.mass(nlp.problem.start_position))
    friction, tangential = (entries.get(name, "NULL") for name in OF_PARAMETERS)
    return initial(int(mass), len(kinds), friction, c.array("int", kinds), tangential)


def laws_text(c: Constants, nlp: Transcription, entries: Mapping[str, str]) -> str:
    touch, model, varies = nlp.problem.touch, nlp.problem.model, _varies(nlp)
    hit = np.full(nlp.layout.phases, NOWHERE)
    for i, event in enumerate(touch.events):
        if event.hit != NOWHERE and np.isnan(nlp.problem.restitution_values[event.hit]):
            hit[i] = event.hit
    rubs = np.where(touch.rubs & varies, 1 + model.paired, 0)
    struck = np.zeros_like(rubs)
    struck[: len(touch.events)] = (touch.rubs_in_impact | touch.passes) & varies
    arrays = (c.array("int", a) for a in (hit, rubs, struck))
    return initial(*(entries.get(name, "NULL") for name in KERNELS), *arrays)


def _varies(nlp: Transcription) -> NDArray[np.bool_]:
    """The tangents whose friction depends on the motion, shape (nt,)."""
    rows = nlp.kernels.manifest.varying_friction
    return np.isin(nlp.kernels.tangents, [row["name"] for row in rows])
