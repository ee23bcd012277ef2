"""What the drawings of the shipped models show is what their equations say."""

from __future__ import annotations

import pytest
import sympy as sp

from dmoc.models.catalogue import ENTRIES
from dmoc.models.registry import find
from dmoc.symbolic.drawing import Contact


@pytest.mark.parametrize("model", sorted({entry.model for entry in ENTRIES.values()}))
def test_a_surface_pushes_where_its_gap_opens(model: str) -> None:
    """A unit force along the normal of a contact does the work of a force that opens the gap, in
    each coordinate with the same factor."""
    system = find(model).system()
    contacts = [shape for shape in system.drawing if isinstance(shape, Contact)]
    assert {c.surface for c in contacts} == set(system.surfaces)
    for contact in contacts:
        surface = sp.sympify(system.surfaces[contact.surface])
        opening = surface.gts - surface.lts
        place, normal = sp.Matrix(contact.at), sp.Matrix(contact.normal)
        assert sp.simplify(normal.dot(normal)) == 1
        pushed = [sp.simplify(place.diff(c).dot(normal)) for c in system.coordinates]
        opened = [sp.simplify(opening.diff(c)) for c in system.coordinates]
        factors = {sp.simplify(p / o) for p, o in zip(pushed, opened, strict=True) if o != 0}
        at = {**system.parameters, **dict.fromkeys(system.coordinates, 0.3)}
        assert len(factors) == 1 and factors.pop().subs(at) > 0, contact.surface
