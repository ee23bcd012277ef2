"""Problems of a few forms with neighbours, and rows of batches that are to be the same."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.models.registry import find

WORDS = ("status", "message", "collisions", "check")
NUMBERS = ("cost", "final_time", "collision_times", "impulses", "iterations")
MASSES = (0.5, 1.0, 2.0)


def same(a: dmoc.Batch, b: dmoc.Batch) -> None:
    for name in WORDS:
        assert getattr(a, name) == getattr(b, name), name
    assert a.design.keys() == b.design.keys()
    for name, values in a.design.items():
        np.testing.assert_allclose(values, b.design[name], rtol=1e-12, err_msg=name)
    for name in NUMBERS:
        np.testing.assert_allclose(
            getattr(a, name), getattr(b, name), rtol=1e-12, atol=1e-13, err_msg=name
        )


def moved(value: Any, by: Callable[[], float]) -> Any:
    """A number, or a range, of a neighbour."""
    if isinstance(value, tuple):
        return tuple(moved(end, by) for end in value)
    return value if value is None else value * by()


def neighbours(base: dmoc.Problem, count: int, size: float) -> list[dmoc.Problem]:
    """Problems whose numbers differ by a share at random: of each field in some of them."""
    rng = np.random.default_rng(2026)

    def by() -> float:
        return float(1 + size * rng.uniform(-1, 1))

    def field(stated: Mapping[str, Any]) -> dict[str, Any]:
        return {name: moved(value, by) for name, value in stated.items()}

    every = zip(base.kernels.parameters, base.parameter_values[0].tolist(), strict=True)
    parameters = {name: value for name, value in every if name not in base.design}
    problems = []
    for _ in range(count):
        fields = {
            "start": field(base.start), "goal": field(base.goal), "bounds": field(base.bounds),
            "final_time": moved(base.final_time, by), "parameters": field(parameters),
        }  # fmt: skip
        kept = [name for name in fields if rng.random() < 0.6]
        problems.append(base.but(**{name: fields[name] for name in kept}))
    return problems


def pendulum(order: int, **fields: Any) -> dmoc.Problem:
    reference = find("cart_pendulum")
    base = dmoc.Problem(reference.kernels(order), **reference.defaults)
    return base.but(**{"steps": (7, 8), **fields})


def puck(*hits: str) -> dmoc.Problem:
    reference = find("puck_table")
    base = dmoc.Problem(reference.kernels(), **reference.defaults)
    return base.but(sequence=hits, steps=10)


def limited() -> dmoc.Problem:
    """A mass whose power is limited."""
    x, u = dynamicsymbols("x u")
    system = unit_mass(
        "limited",
        path_constraints={"power": 1e3 * u * x.diff(dynamicsymbols._t) <= 1e3},
        cost=u**2 / 2,
    )
    return dmoc.Problem(
        dmoc.build(system), start={"x": 0.0}, goal={"x": 0.6, "x_dot": 0.0}, final_time=1.0,
        steps=12,
    )  # fmt: skip


def watched() -> dmoc.Problem:
    """A mass whose power is a quantity of which nothing is said."""
    x, u = dynamicsymbols("x u")
    quantities = {"power": u * x.diff(dynamicsymbols._t)}
    system = unit_mass("watched", quantities=quantities, cost=u**2 / 2)
    return dmoc.Problem(
        dmoc.build(system), start={"x": 0.0}, goal={"x": 0.6, "x_dot": 0.0}, final_time=1.0,
        steps=12,
    )  # fmt: skip


def periodic() -> dmoc.Problem:
    """A puck that is as fast at the end as at the start."""
    base = puck("east")
    return base.but(
        start={**base.start, "x_dot": None}, goal={"x": 0.4, "y": 0.7},
        periodic={"x_dot": ("x_dot", 0.1), "y_dot": ("y_dot", (-2.0, -0.6))},
    )  # fmt: skip


def masses(block: dmoc.Problem, *values: float) -> list[dmoc.Problem]:
    return [block.but(parameters={"m": m}) for m in values]
