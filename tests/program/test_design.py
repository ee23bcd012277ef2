"""What fixed values settle of a program depends on the design, and on no value that it begins
with."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor, block_system, unit_mass

import dmoc
from dmoc.base.errors import ModelError, ProblemError
from dmoc.guess.automatic import initial_guesses
from dmoc.program.blocks import NOWHERE
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription

X, Y, U = dynamicsymbols("x y u")
W = sp.Symbol("w")


def solved(problem: dmoc.Problem) -> dmoc.Solution:
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.solved, solution.message
    return solution


def between_ends(name: str, **fields: Any) -> dmoc.Problem:
    """A unit mass from rest at 0.4 to rest at 0.2 with a parameter w that costs."""
    system = unit_mass(name, parameters={W: 1.0}, cost=U**2 / 2, terminal_cost=40 * W, **fields)
    return dmoc.Problem(
        system, start={"x": 0.4, "x_dot": 0}, goal={"x": 0.2, "x_dot": 0}, steps=20,
        final_time=1.0, design={"w": (0.0, 2.0)},
    )  # fmt: skip


@pytest.mark.slow
def test_sizes_are_those_of_the_design_of_a_motion() -> None:
    """Momenta of twice the mass are twice as large."""
    plain = dmoc.Problem(
        block_system(), start={"x": 0.0}, goal={"x": 0.5, "x_dot": 0}, steps=10, final_time=1.0
    )
    x = initial_guesses(plain)[0].x
    chosen = plain.but(design={"m": (0.5, 4.0)})
    scale = scale_of(chosen, np.append(x, 2.0))
    np.testing.assert_allclose(scale.p, scale_of(plain.but(parameters={"m": 2.0}), x).p)
    assert scale.design.tolist() == [2.0]
    heavy = Transcription(plain.but(parameters={"m": 2.0}))
    momenta = Transcription(chosen).momenta(np.append(x, 2.0))
    np.testing.assert_allclose(momenta, heavy.momenta(x))


def test_a_gap_at_a_fixed_end_is_a_constraint() -> None:
    """A wall that costs comes as near as the start allows."""
    s = solved(between_ends("near_wall", surfaces={"wall": X <= W}))
    assert s.design["w"] == pytest.approx(0.4, abs=1e-7)


def test_a_path_constraint_at_a_fixed_end_is_one() -> None:
    s = solved(between_ends("near_limit", path_constraints={"room": X <= W - 0.1}))
    assert s.design["w"] == pytest.approx(0.5, abs=1e-7)


@pytest.mark.slow
def test_a_contact_at_a_fixed_start_is_an_equation() -> None:
    """The floor is where the block stands, though it would rather be higher."""
    h = sp.Symbol("h")
    system = dmoc.MechanicalSystem(
        "chosen_floor", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2 - 9.81 * Y, {h: 0.3}, [U],
        {X: U}, surfaces={"floor": h <= Y}, cost=U**2 / 2, terminal_cost=-h,
    )  # fmt: skip
    problem = dmoc.Problem(
        system, start={"x": 0, "y": 0.3}, goal={"x": 1, "x_dot": 0}, contacts=["floor"], steps=20,
        final_time=1.0, design={"h": (0.0, 1.0)},
    )  # fmt: skip
    assert Transcription(problem).laws.contact.closed.index[0, 0] != NOWHERE
    assert Transcription(problem.but(design={})).laws.contact.closed.index[0, 0] == NOWHERE
    assert solved(problem).design["h"] == pytest.approx(0.3, abs=1e-8)


def test_a_constraint_at_a_fixed_start_is_an_equation() -> None:
    """The rod is as long as the start says, though it would rather be longer."""
    l = sp.Symbol("l")
    system = dmoc.MechanicalSystem(
        "started_rod", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2 - 9.81 * Y, {l: 1.0},
        constraints={"rod": X**2 + Y**2 - l**2}, terminal_cost=-l,
    )  # fmt: skip
    problem = dmoc.Problem(
        system, start={"x": math.sin(1), "y": -math.cos(1)}, goal={"x": 0.0, "y": (None, 0)},
        steps=20, final_time=(0.1, 2.0), design={"l": (0.5, 2)},
    )  # fmt: skip
    assert Transcription(problem).laws.joint.place.index[0, 0] != NOWHERE
    assert solved(problem).design["l"] == pytest.approx(1.0, abs=1e-8)


def test_a_bound_at_a_contact_that_moves_with_the_design_holds() -> None:
    """J = 24 w^2 - 80 w falls until w = 5/3; the block goes no further than 1."""
    system = block_system("bounded_wall")
    wall = next(s for s in system.parameters if s.name == "wall")
    problem = dmoc.Problem(
        replace(system, terminal_cost=-80 * wall), start={"x": 0}, goal={"x": 0, "x_dot": 0},
        sequence=["wall"], steps=20, final_time=1.0, bounds={"x": (-1, 1)},
        design={"wall": (0.5, 2)},
    )  # fmt: skip
    assert solved(problem).design["wall"] == pytest.approx(1.0, abs=1e-6)


def test_a_quantity_at_a_fixed_start_chooses() -> None:
    c = sp.Symbol("c")
    system = unit_mass("pulled", parameters={c: 1.0}, quantities={"pull": c * X}, cost=U**2 / 2)
    problem = dmoc.Problem(
        system, start={"x": 0.5, "x_dot": 0, "pull": 1.0}, goal={"x": 0.0}, steps=8,
        final_time=1.0, design={"c": (0, 5)},
    )  # fmt: skip
    assert solved(problem).design["c"] == pytest.approx(2.0, rel=1e-9)


@pytest.mark.slow
def test_a_velocity_at_the_start_is_none_of_a_mass_to_begin_with() -> None:
    """A quarter of the period 2 pi sqrt(m) in a second: m = 4 / pi^2; the speed is 1 at first."""
    m = sp.Symbol("m")
    system = dmoc.MechanicalSystem("chosen_mass", [X], m * X.diff() ** 2 / 2 - X**2 / 2, {m: 1.0})
    problem = dmoc.Problem(
        dmoc.build(system, order=4), start={"x": 0, "x_dot": 1.0}, goal={"x_dot": 0.0}, steps=20,
        final_time=1.0, design={"m": (0.3, 1)},
    )  # fmt: skip
    s = solved(problem)
    assert s.design["m"] == pytest.approx(4 / math.pi**2, rel=1e-5)
    assert s.phases[0].v[0, 0] == pytest.approx(1.0, rel=1e-9)


def test_a_momentum_at_the_start_leaves_the_velocity_to_the_mass() -> None:
    """A kilogram metre a second that begins with 2 m/s, or with 2 m/s at most, where that is the
    limit at the start alone, of a mass that would rather be less than half a kilogram."""
    m = sp.Symbol("m")
    system = dmoc.MechanicalSystem(
        "thrown_mass", [X], m * X.diff() ** 2 / 2, {m: 1.0}, quantities={"speed": X.diff()},
        path_constraints={"slow": X.diff() <= 2 + 10 * X}, terminal_cost=m,
    )  # fmt: skip
    problem = dmoc.Problem(
        system, start={"x": 0, "p_x": 1.0}, steps=5, final_time=1.0, design={"m": (0.1, 5)}
    )
    for stated in (problem.but(start={"x": 0, "p_x": 1.0, "speed": 2.0}), problem):
        assert solved(stated).design["m"] == pytest.approx(0.5, rel=1e-6)


@pytest.mark.slow
def test_what_cannot_be_chosen_is_named() -> None:
    """A parameter of the drawing alone, one of the tangential restitution, one without a value in a
    range without a middle, and kernels that do not know their system."""
    system = block_system("drawn_wall")
    seen, e_t = sp.symbols("seen e_t")
    drawn = replace(
        system, parameters={**system.parameters, seen: 1.0},
        drawing=[dmoc.Disc((X, 0), seen)],
    )  # fmt: skip
    problem = dmoc.Problem(drawn, start={"x": 0}, steps=5, final_time=1.0)
    with pytest.raises(ModelError, match="seen: nothing of the motion or its cost depends on it"):
        problem.but(design={"seen": (0, 1)})
    puck = block_on_floor("spinning", 1.0, 9.81, 0.2)
    puck = replace(
        puck, parameters={**puck.parameters, e_t: 0.5}, tangential_restitution={"floor": e_t}
    )
    with pytest.raises(ModelError, match="e_t is in the tangential restitution of 'floor'"):
        dmoc.Problem(puck, start={"x": 0, "y": 1}, steps=5, design={"e_t": (0, 1)})
    nameless = replace(system, parameters=dict.fromkeys(system.parameters))
    stated = {"start": {"x": 0}, "steps": 5, "parameters": {"m": 1.0}}
    with pytest.raises(ProblemError, match="no value of it to begin with, and its range no middle"):
        dmoc.Problem(nameless, design={"wall": (0.5, None)}, **stated)
    assert dmoc.Problem(nameless, design={"wall": (0.5, 2)}, **stated).design_values == [1.25]
    bare = replace(problem.kernels, system=None)
    with pytest.raises(ProblemError, match="have no derivatives by m and do not know their system"):
        problem.but(kernels=bare, design={"m": (0.5, 2)})


def test_a_shipped_model_is_built_on_demand() -> None:
    kernels = dmoc.load("bouncing_pendulum")
    problem = dmoc.Problem(kernels, start={"theta": 0.5}, steps=5, design={"l": (0.5, 2)})
    assert problem.kernels.design == ["l"]
    assert problem.but(design={"l": (0.7, 1)}).kernels is problem.kernels
    assert problem.but(design={}).kernels is problem.kernels
    assert problem.kernels.manifest.fingerprint == kernels.manifest.fingerprint
