"""Drawings of models: what they may be, what of the model they change, and what their kernel
computes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system

import dmoc
from dmoc.base.errors import ModelError
from dmoc.codegen.system_kernels import build
from dmoc.mechanics.model import Model
from dmoc.symbolic.drawing import values_of
from dmoc.symbolic.families import model_fingerprint, model_key

T = dynamicsymbols._t
x, y, a, u = dynamicsymbols("x y a u")
l, r, speed, wall = sp.symbols("l r speed wall")


def drawn(*parts: Any, **fields: Any) -> dmoc.MechanicalSystem:
    """A mass in the plane with a turning arm over a moving floor."""
    statement: dict[str, Any] = {
        "surfaces": {"floor": y >= speed * T},
        "tangents": {"floor": x},
        "friction": {"floor": 0},
        "parameters": {l: 0.7, r: 0.2, speed: 0.1},
    }
    return dmoc.MechanicalSystem(
        "drawn", [x, y, a], sum(q.diff(T) ** 2 for q in (x, y, a)) / 2 - (r + l) * y,
        **(statement | fields), drawing=parts,
    )  # fmt: skip


PARTS = (
    dmoc.Link((x, y), sp.Matrix([x + l * sp.cos(a), y + l * sp.sin(a)]), (0, 1.5)),
    dmoc.Point([x, y]), dmoc.Disc((x, y), r, a), dmoc.Box((x, sp.Rational(1, 2)), 2 * r, l, -a),
    dmoc.Spring((0, 0), (x, y)), dmoc.Wall((-1, speed * T), (1, speed * T)),
    dmoc.Contact("floor", (x, speed * T), (3, 4)),
)  # fmt: skip


def by_hand(q: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The columns of PARTS with the default parameters."""
    x, y, a = q.T
    one, l, r, h = np.ones(len(t)), 0.7, 0.2, 0.1 * t
    link = (x, y, x + l * np.cos(a), y + l * np.sin(a), 0 * one, 1.5 * one)
    bodies = (x, y, x, y, r * one, a, x, one / 2, 2 * r * one, l * one, -a)
    rest = (0 * one, 0 * one, x, y, -one, h, one, h, x, h, 0.6 * one, 0.8 * one)
    return np.stack([*link, *bodies, *rest], axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
@pytest.mark.parametrize("order", [2, 4])
def test_the_kernel_computes_the_columns_of_every_shape(backend: str, order: int) -> None:
    kernels = build(drawn(*PARTS), backend=backend, order=order)
    par = np.array([list(kernels.parameters.values())], dtype=float)
    rng = np.random.default_rng(3)
    q, t = rng.normal(size=(20, 3)), rng.uniform(0, 5, 20)
    model = Model(kernels, par)
    np.testing.assert_allclose(model.drawing(q, t), by_hand(q, t), rtol=0, atol=1e-14)
    np.testing.assert_allclose(model.drawing(q[0], t[0]), by_hand(q[:1], t[:1])[0], atol=1e-14)


def test_the_manifest_lists_kinds_names_and_columns() -> None:
    manifest = build(drawn(*PARTS), backend="numpy").manifest
    assert manifest.drawing == [
        ["link", "", 0, 6],
        ["point", "", 6, 2],
        ["disc", "", 8, 4],
        ["box", "", 12, 5],
        ["spring", "", 17, 4],
        ["wall", "", 21, 4],
        ["contact", "floor", 25, 4],
    ]


def test_a_model_without_a_drawing_has_no_kernel_for_it() -> None:
    kernels = build(block_system(), backend="numpy")
    assert not kernels.has("drawing") and kernels.manifest.drawing == []
    model = Model(kernels, np.array([[1.0, 1.0]]))
    assert model.drawing(np.zeros((4, 1))).shape == (4, 0)


def test_a_drawing_changes_the_kernels_and_not_what_solutions_depend_on() -> None:
    plain, one, other = drawn(), drawn(PARTS[1]), drawn(dmoc.Disc((x, y), r))
    assert len({model_key(s) for s in (plain, one, other)}) == 3
    assert len({model_fingerprint(s, 2) for s in (plain, one, other)}) == 1
    assert plain.fingerprint() == other.fingerprint()


def test_the_name_of_a_contact_is_part_of_the_key() -> None:
    surfaces = {"surfaces": {"floor": y >= 0, "side": x >= 0}, "parameters": {r: 1.0, l: 1.0}}
    first, second = (drawn(dmoc.Contact(n, (x, y)), **surfaces) for n in ("floor", "side"))
    assert model_key(first) != model_key(second)


def test_a_parameter_may_serve_the_drawing_alone() -> None:
    system = drawn(dmoc.Disc((x, y), wall), parameters={l: 0.7, r: 0.2, speed: 0.1, wall: 1.0})
    with pytest.raises(ModelError, match="parameter wall is used nowhere"):
        replace(system, drawing=[])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: dmoc.Link((x, y)), "a Link has 1 points: expected two or more"),
        (lambda: dmoc.Link((x, y), (0, 0, 0)), "a point of a Link .* has 3 entries"),
        (lambda: dmoc.Link((x, y), x), "a point of a Link = x.*: expected two expressions"),
        (lambda: dmoc.Point("xy"), "the place of a Point = 'xy': expected two expressions"),
        (lambda: dmoc.Point((x, "y")), "the place of a Point is not a scalar .*: got 'y'"),
        (lambda: dmoc.Point((x, sp.oo)), "the place of a Point contains an infinite"),
        (lambda: dmoc.Disc((x, y), 0), "the radius of a Disc = 0: expected a positive length"),
        (lambda: dmoc.Box((x, y), -1, 1), "the width of a Box = -1: expected a positive"),
        (lambda: dmoc.Box((x, y), 1, 1, "flat"), "the angle of a Box is not a scalar"),
        (lambda: dmoc.Spring((x,), (0, 0)), "an end of a Spring .* has 1 entries"),
        (lambda: dmoc.Wall((0, 0), None), "an end of a Wall = None: expected two"),
        (lambda: dmoc.Contact("floor", (x, y), (0, 0)), "the normal .* 'floor' is zero"),
        (lambda: drawn(PARTS[1], (x, y)), "the drawing contains .*: expected shapes out of Link"),
        (lambda: replace(drawn(), drawing=PARTS[1]), "drawing = Point.*: expected a list"),
        (lambda: replace(drawn(), drawing="cart"), "drawing = 'cart': expected a list"),
        (lambda: drawn(dmoc.Contact("wall", (x, y))), "Contact of 'wall': expected a surface or"),
        (lambda: drawn(PARTS[-1], PARTS[-1]), "two Contacts of 'floor': give one"),
        (lambda: drawn(dmoc.Point((x, wall))), "a Point of the drawing contains the symbol wall"),
        (lambda: drawn(dmoc.Point((x, u))), "a Point of the drawing contains u.t., which is"),
        (lambda: drawn(dmoc.Point((x, y.diff(T)))), "a Point of the drawing contains"),
    ],
)
def test_what_is_no_drawing_is_refused_in_one_sentence(make: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        make()
    assert str(caught.value).endswith(".") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("relation", "at", "normal"),
    [
        (y >= 0, (x, y), (0, 1)),
        (y <= 2, (x, y), (0, -1)),
        (x <= 1, (x + r, y), (-1, 0)),
        (x >= 0, (x, 0), (1, 0)),
        (3 * x + 4 * y >= 0, (x, y), (0.6, 0.8)),
        (3 * x + 4 * y <= 5, (2 * x, 2 * y), (-0.6, -0.8)),
        (y >= x, (x, y), (-(0.5**0.5), 0.5**0.5)),
    ],
)
def test_a_contact_pushes_where_its_gap_says(relation: Any, at: Any, normal: Any) -> None:
    system = drawn(
        dmoc.Contact("side", at), surfaces={"side": relation}, parameters={r: 1.0, l: 1.0}
    )
    direction = values_of(system.shapes[0])[2:]
    assert [float(e) for e in direction] == pytest.approx(normal)


def test_the_friction_of_a_rail_is_drawn_along_its_tangent() -> None:
    system = drawn(
        dmoc.Contact("rail", (x, y)), surfaces={}, tangents={"rail": -y}, friction={"rail": r},
        parameters={r: 1.0, l: 1.0},
    )  # fmt: skip
    assert values_of(system.shapes[0])[2:] == (1, 0)  # turned clockwise: downwards


def test_a_contact_at_a_place_that_does_not_move_needs_its_normal() -> None:
    with pytest.raises(ModelError, match="at a place that its surface does not move"):
        drawn(dmoc.Contact("side", (0, 0)), surfaces={"side": y >= 0}, parameters={r: 1.0, l: 1.0})
