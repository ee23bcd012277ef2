"""Inputs at the end of a motion, by how they vary in a step."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.motion.trajectory import FORMS, last_inputs


@pytest.mark.parametrize("controls", FORMS)
def test_the_last_inputs_are_those_of_the_last_step(controls: str) -> None:
    """A phase without steps has none of its own."""
    form, t = FORMS[controls], np.linspace(0.0, 1.0, 5)
    u = np.arange(2.0 * len(form.times(t))).reshape(-1, 2)
    phases: Any = [SimpleNamespace(steps=4, u=-u), SimpleNamespace(steps=4, u=u)]
    rest: Any = SimpleNamespace(steps=0, u=u[:0])
    for motion in (phases, [*phases, rest]):
        np.testing.assert_array_equal(last_inputs(motion, form), u[-1])
