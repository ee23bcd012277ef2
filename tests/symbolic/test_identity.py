"""Kernels and solutions are those of one system: whatever is changed of it, it is another one."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.symbolic.families import model_fingerprint, model_key

X, Y, Z, U, W = dynamicsymbols("x y z u w")
M, C, K = sp.symbols("m c k")
SYSTEM = dmoc.MechanicalSystem(
    "whole", [X, Y, Z], M * (X.diff() ** 2 + Y.diff() ** 2 + Z.diff() ** 2) / 2 - K * X**2 / 2,
    {M: 1.0, C: 0.5, K: 2.0}, [U, W], {X: U, Y: W}, surfaces={"floor": Y >= 0, "wall": X <= 1},
    cost=U**2, path_constraints={"fast": X.diff() <= 3}, units={X: "m"},
    dissipation=C * X.diff() ** 2 / 2, terminal_cost=X**2, tangents={"floor": X, "wall": Y},
    friction={"floor": C, "wall": C}, restitution={"wall": C}, constraints={"rod": X + Z - 2},
    quantities={"power": U * X.diff()}, tangential_restitution={"wall": 0.2},
    integrals={"work": U * X.diff()}, impact_laws={"floor": "poisson"},
)  # fmt: skip
CHANGES: dict[str, Any] = {
    "name": "other", "coordinates": [Y, X, Z], "lagrangian": SYSTEM.lagrangian + K * Z,
    "parameters": {M: 1.0, C: 0.5, K: 2.5}, "inputs": [W, U], "forces": {X: U, Y: 2 * W},
    "surfaces": {"floor": Y >= 0, "wall": X <= 2}, "cost": U**2 + W**2,
    "path_constraints": {"fast": X.diff() <= 4}, "units": {X: "cm"},
    "dissipation": C * X.diff() ** 2, "terminal_cost": X**4,
    "tangents": {"floor": X, "wall": Y + Z}, "friction": {"floor": C, "wall": 2 * C},
    "restitution": {"wall": C / 2}, "constraints": {"rod": X + Z - 3},
    "definitions": {dynamicsymbols("d"): X * Y}, "quantities": {"power": W * X.diff()},
    "tangential_restitution": {"wall": 0.3}, "integrals": {"work": W * X.diff()},
    "objective": dmoc.total("work"), "impact_laws": {}, "switches": {"gate": X - 2},
    "within": {"wall": Y >= 0}, "grips": {"hand": Z - X},
    "strength": {"hand": 3}
}  # fmt: skip
# Of angles, attitudes say which one is a pitch; quaternions are constraints and quantities too.
SHOWN: dict[str, Any] = {
    "title": "Another", "drawing": [dmoc.Disc((X, Y), 0.1)], "attitudes": {"turn": (X, Y, Z)},
}  # fmt: skip


def test_every_field_has_its_change() -> None:
    assert {f.name for f in fields(SYSTEM) if f.init} == {*CHANGES, *SHOWN}


@pytest.mark.parametrize("name", CHANGES)
def test_a_system_with_another_field_has_other_kernels_and_other_solutions(name: str) -> None:
    base = replace(SYSTEM, grips=CHANGES["grips"]) if name == "strength" else SYSTEM
    other = replace(base, **{name: CHANGES[name]})
    assert model_key(other) != model_key(base)
    assert model_fingerprint(other, 2) != model_fingerprint(base, 2)


@pytest.mark.parametrize("name", SHOWN)
def test_what_is_only_shown_changes_kernels_and_no_solution(name: str) -> None:
    other = replace(SYSTEM, **{name: SHOWN[name]})
    assert model_key(other) != model_key(SYSTEM)
    assert model_fingerprint(other, 2) == model_fingerprint(SYSTEM, 2)


def test_orders_and_designs_have_kernels_of_their_own() -> None:
    keys = [model_key(SYSTEM, order) for order in (2, 4, 6)]
    keys += [model_key(SYSTEM, 2, design) for design in (["m"], ["c"], ["m", "c"])]
    assert len(set(keys)) == 6
    assert len({model_fingerprint(SYSTEM, order) for order in (2, 4, 6)}) == 3
    assert model_key(SYSTEM) == model_key(replace(SYSTEM)) == keys[0]
