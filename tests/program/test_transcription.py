"""The nonlinear program: order of unknowns, derivatives, and agreement with the forward
integrator."""

from __future__ import annotations

import numpy as np
import pytest
from every_constraint import differences, driven_problem, ending, point, program_of, small
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.program.blocks import GOAL, LAW, Numbering
from dmoc.program.extraction import multiplier_vectors, named_multipliers, trajectory
from dmoc.program.layout import Layout
from dmoc.program.transcription import Transcription

# Forms that take longer to build, or differ from others in their last event.
MORE = (
    *("contacts, order 4", "contacts, periodic, order 6"),
    *("lift-off, order 4", "lift-off, design, order 4"),
    *("joints, order 6", "joints, periodic, order 4"),
    *("driven, design", "driven, design, order 4", "driven, design, scaled"),
    *("contacts, design", "joints, periodic, design", "joints by rate, order 2"),
    *("joints by rate, order 4", "joints by rate, periodic, order 6"),
    *("joints by rate, design, order 4", "ending joints by rate, order 2"),
    *("relaxed, moving, design", "relaxed, design", "rebound, design"),
    *("hits with friction, design", "hits with friction, design, order 4"),
    *("slippery contacts, order 2", "slippery contacts, order 4"),
    *("slippery hits", "slippery tangential", "slippery relaxed"),
    *("forces, constant", "forces, linear", "forces, order 4", "forces, order 6"),
    *("forces, design, order 4", "slowed, order 2", "slowed, design, order 4"),
    *("slowed, order 6", "kinked", "kinked, linear", "kinked, order 4", "kinked, order 6"),
    *("kinked, constant, design, order 4", "ending kinked, order 4", "ending kinked, linear"),
    *("ending constant", "ending driven, linear", "ending driven, scaled"),
    *("ending contacts", "ending contacts, periodic, order 4", "ending joints, order 6"),
    *("ending joints, periodic", "ending hits with friction", "ending tangential"),
    *("ending forces, linear", "ending forces, order 4", "ending rebound, design"),
    *("rolling, order 2", "rolling, design, order 4"),
    *("balls, order 2", "balls, design, order 4", "ending balls, design, order 2"),
    *("ending slippery contacts, order 4", "ending forces, constant"),
)


@pytest.fixture(
    scope="module",
    params=[
        *("constant", "linear", "puck", "driven", "driven, by rates", "driven, order 4"),
        *("driven, linear", "driven, scaled"),
        *("pendulum, order 4", "contacts", "contacts, periodic"),
        *("hits with friction", "hits with friction, order 4", "tangential", "joints"),
        *("lift-off", "joints, periodic", "relaxed", "relaxed, periodic", "relaxed, moving"),
        *(pytest.param(form, marks=pytest.mark.slow) for form in MORE),
    ],
)
def nlp(request: pytest.FixtureRequest, pendulum: Kernels, puck: Kernels) -> Transcription:
    form = request.param.removeprefix("ending ")
    stated = program_of(form, pendulum, puck)
    return Transcription(ending(stated.problem)) if form != request.param else stated


def test_velocities_beside_collisions_enter_their_rows_with_the_documented_signs(
    pendulum: Kernels,
) -> None:
    """arrival: r_plus - dL/dv(q_c, v_a) = 0, departure: r_minus + dL/dv(q_c, v_c) = 0."""
    nlp = Transcription(small(pendulum))
    x = point(nlp, np.random.default_rng(5))
    jacobian = nlp.equality_jacobian(x).toarray()
    lay, par = nlp.layout, nlp.par
    for i, node in enumerate(lay.collision_nodes):
        q = x[lay.index_q[[node]]]
        zero = np.zeros((1, 2))
        mass = pendulum.call("dynamics", q, zero, np.zeros((1, 1)), np.zeros((1, 1)), par)[
            0
        ].reshape(2, 2)
        for name, unknowns, sign in (
            ("arrival", lay.impact.v_a[i], -1.0),
            ("departure", lay.impact.v_c[i], 1.0),
        ):
            rows = getattr(nlp.laws.impact, name).index[i]
            np.testing.assert_allclose(jacobian[np.ix_(rows, unknowns)], sign * mass, rtol=1e-12)


@pytest.mark.slow
def test_the_law_in_the_rates_is_newtons() -> None:
    """gamma+ = -e gamma- with the rates of moving gaps, and nothing of any energy."""
    problem = driven_problem(2).in_rates()
    nlp = Transcription(problem)
    x = np.random.default_rng(6).normal(size=nlp.n)
    lay, at = nlp.layout, nlp.layout.collision_nodes
    q, t = x[lay.index_q[at]], x[lay.index_t[at]]
    before, after = (
        problem.model.gap_rates(q, x[v], t)[[0, 1], lay.touch.surfaces]
        for v in (lay.impact.v_a, lay.impact.v_c)
    )
    rows = nlp.laws.impact.energy.numbers
    np.testing.assert_allclose(
        nlp.equality(x)[rows], after + np.array([0.6, 0.0]) * before, rtol=1e-12
    )
    assert not nlp.laws.impact.separation.count  # it follows from the approach


def test_every_unknown_has_one_place(nlp: Transcription) -> None:
    lay = nlp.layout
    assert np.array_equal(np.concatenate([b.numbers for b in lay.unknowns]), np.arange(nlp.n))
    assert lay.index_step.shape == (lay.total, (2 + lay.inside) * lay.nq + 2 * lay.nu + 2)
    again = Layout.of(nlp.problem)
    assert all(
        np.array_equal(a.index, b.index) for a, b in zip(again.unknowns, lay.unknowns, strict=True)
    )


def test_unknowns_have_the_order_of_files_and_those_of_laws_tables(nlp: Transcription) -> None:
    """Files keep the multipliers of bounds in this order."""
    lay, order = nlp.layout, "h q u lam p_B p_E v_B v_E v_a v_c t q_i s".split()
    of_laws = ["P", "T", "P_c", "T_c", "v_h", "P_h", "T_h", "R", "R_c", "P_b", "T_b", "R_b"]
    assert [b.name for b in lay.unknowns] == [
        *order,
        *of_laws,
        "P_r",
        "T_r",
        "w",
        "t_i",
        "y",
        "y_ends",
        "y_lift_off",
        "totals",
        "peaks",
        "design",
    ]
    parts = lay, lay.impact, lay.contact, lay.hit, lay.joint, lay.held, lay.relaxed, lay.force
    parts = (*parts, lay.liftoff)
    tables = {name: table for part in parts for name, table in vars(part).items()}
    for block in lay.unknowns:
        if block.name == "v_E" and lay.ends_with_event:
            assert not block.count and np.array_equal(lay.index_v_E, lay.impact.v_c[-1])
            continue
        held = [name for name in (block.name, f"index_{block.name}") if name in tables]
        assert [np.array_equal(tables[name], block.index) for name in held] == [True]
    assert not {"index_lam", "index_v_a", "index_v_c"} & set(vars(lay))


def test_unknowns_and_rows_are_found_under_their_names(nlp: Transcription) -> None:
    """An unknown is named by what the motion shows there, a row by what makes it move."""
    lay, coordinates = nlp.layout, nlp.kernels.coordinates
    names = lay.names()
    assert len(set(names)) == len(names) == nlp.n
    for node in (0, 1, lay.total):
        for j, q in enumerate(coordinates):
            assert names[lay.index_q[node, j]] == f"{q} at node {node}"
    for j, q in enumerate(coordinates):
        assert names[lay.index_p_B[j]] == f"p_{q} at the start"
        assert names[lay.index_p_E[j]] == f"p_{q} at the goal"
        for i, surface in enumerate(nlp.problem.sequence):
            switch = surface in nlp.problem.touch.contacts.switches
            kind = "event" if switch or set(surface) & set("+-: ") else "collision"
            at = f"{kind} {i + 1} ({surface})"
            assert names[lay.impact.v_a[i, j]] == f"{q}_dot before {at}"
            assert names[lay.impact.v_c[i, j]] == f"{q}_dot after {at}"
            assert names[lay.impact.lam[i]] == f"impulse of {at}"
    where = "inside" if lay.inside == 1 else "at inner node 0 of"
    for step, inner in enumerate(lay.index_q_i[:, : lay.nq]):
        assert [names[i] for i in inner] == [
            f"{q} {where} step {step}" for q in coordinates[: len(inner)]
        ]
    blocks = [*nlp.equalities, *nlp.inequalities]
    rows = [b.name_of(i) for b in blocks for i in range(b.count)]
    assert np.array_equal(
        np.concatenate([b.numbers for b in blocks]), np.arange(nlp.n_eq + nlp.n_in)
    )
    x = point(nlp, np.random.default_rng(7))
    moved, before = x.copy(), nlp.values(x)[1:]
    node = int(lay.collision_nodes[0])
    moved[lay.index_q[node, 0]] += 1e-3
    changed = {rows[i] for i in np.flatnonzero(nlp.values(moved)[1:] != before)}
    assert f"momentum of {coordinates[0]} at node {node}" in changed
    near = {f"node {k}" for k in (node - 1, node, node + 1)} | {
        f"step {k}" for k in (node - 1, node)
    }
    assert all(
        any(name.endswith(place) or f"{place} in phase" in name for place in near)
        or "collision 1" in name
        or "event 1" in name
        or "end of phase 0" in name
        or "start of phase 1" in name
        or name.startswith("total ")
        or (lay.ends_with_event and name.endswith("at the goal"))
        for name in changed
    )


def test_rows_say_what_it_costs_to_miss_them_and_in_what_words(nlp: Transcription) -> None:
    """What holds in any motion costs most, what the user asked for least, limits in between."""
    blocks = [*nlp.equalities, *nlp.inequalities]
    prices = {b.name: b.missed.price for b in blocks}
    laws = {name for name, price in prices.items() if price == LAW}
    assert laws == {
        "momentum", "inside", "time", "passing", "time inside", "arrival", "departure", "energy",
        "start velocity",
        "goal velocity", "within", "restitution", "slips", "stops all", "returns", "total",
        "force", "force at ends", "force before lift-off", "stops as a ball",
        "slides as a ball",
    } & set(prices)  # fmt: skip
    assert {name for name, price in prices.items() if price == GOAL} == {
        "goal", "goal >=", "periodic", "quantity fixed", "quantity within",
    } & set(prices)  # fmt: skip
    units = {"kg m/s", "kg m2/s", "m", "rad", "m/s", "rad/s", "s", "N", ""}
    for block in blocks:
        for place in block.places.tolist():
            assert block.missed.unit(*place) in units
            assert block.missed.words is None or block.missed.words(*place)
        assert block.counted is None or len(block.counted.places) == len(block.index)


def test_unknowns_beside_limits_are_on_them(nlp: Transcription) -> None:
    """A product that rounding has left beside a limit is the limit; one further away is none."""
    lower, upper = nlp.limits
    beside = np.where(np.isfinite(upper), upper, np.where(np.isfinite(lower), lower, 1.0))
    y = nlp.physical(np.nextafter(beside / nlp.sizes, 0.0))
    np.testing.assert_array_equal(y, np.where(np.isfinite(upper) | np.isfinite(lower), beside, y))
    away = beside * (1 - 1e-12) / nlp.sizes
    np.testing.assert_array_equal(nlp.physical(away), away * nlp.sizes)


def test_multipliers_are_kept_by_the_names_of_their_rows(nlp: Transcription) -> None:
    """Also of a goal that is a number beside one that is a range."""
    x, y, rng = *dynamicsymbols("x y"), np.random.default_rng(3)
    system = dmoc.MechanicalSystem("two_goals", [x, y], x.diff() ** 2 + y.diff() ** 2)
    still = {"x": 0, "y": 0, "x_dot": None, "y_dot": None}
    goal = {"x_dot": 1.0, "y_dot": (0.0, 2.0)}
    both = Transcription(dmoc.Problem(dmoc.build(system), still, goal, steps=3, final_time=1.0))
    assert {"goal", "goal >="} <= {b.name for b in (*both.equalities, *both.inequalities)}
    for program in (nlp, both):
        duals = [rng.normal(size=n) for n in (program.n_eq, program.n_in, program.n)]
        again = multiplier_vectors(program, named_multipliers(program, *duals))
        for one, other in zip(duals, again, strict=True):
            np.testing.assert_allclose(other, one, rtol=1e-12)


def test_two_blocks_of_one_name_are_refused() -> None:
    block = Numbering()
    block("goal", (2,), str, lambda s: 1.0)
    with pytest.raises(ValueError, match="two blocks are called 'goal'"):
        block("goal", (1,), str, lambda s: 1.0)


def test_first_derivatives_equal_differences(nlp: Transcription) -> None:
    """Entries outside the pattern are zero in the dense matrix, so that every numeric nonzero
    must be covered."""
    x = point(nlp, np.random.default_rng(0))
    slopes = (
        nlp.cost_gradient(x)[None],
        nlp.equality_jacobian(x).toarray(),
        nlp.inequality_jacobian(x).toarray(),
    )
    references = np.split(differences(nlp.values, x), [1, 1 + nlp.n_eq])
    for slope, reference in zip(slopes, references, strict=True):
        most = np.abs(reference).max(initial=1.0)
        np.testing.assert_allclose(slope, reference, rtol=0, atol=1e-7 * most)


def test_gradient_of_the_lagrangian_is_the_sum_of_its_parts(nlp: Transcription) -> None:
    rng = np.random.default_rng(2)
    x, y, w = point(nlp, rng), rng.normal(size=nlp.n_eq), rng.normal(size=nlp.n_in)
    parts = [
        nlp.cost_gradient(x),
        nlp.equality_jacobian(x).toarray().T @ y,
        -nlp.inequality_jacobian(x).toarray().T @ w,
    ]
    size = np.abs(parts).max()
    gradient = nlp.lagrangian_gradient(x, y, w)
    np.testing.assert_allclose(gradient, sum(parts), rtol=0, atol=1e-13 * size)


def test_hessian_of_the_lagrangian_equals_differences(nlp: Transcription) -> None:
    rng = np.random.default_rng(1)
    x = point(nlp, rng)
    y, w = rng.normal(size=nlp.n_eq), rng.normal(size=nlp.n_in)
    upper = nlp.lagrangian_hessian(x, y, w, sigma=0.7).toarray()
    assert not np.tril(upper, -1).any()
    hessian = upper + np.triu(upper, 1).T

    reference = differences(lambda x: 0.7 * nlp.lagrangian_gradient(x, y / 0.7, w / 0.7), x)
    np.testing.assert_allclose(hessian, reference, rtol=0, atol=1e-7 * np.abs(reference).max())


def test_constraints_are_named(nlp: Transcription) -> None:
    x = point(nlp, np.random.default_rng(0))
    assert sum(b.count for b in nlp.equalities) == nlp.n_eq == len(nlp.equality(x))
    assert sum(b.count for b in nlp.inequalities) == nlp.n_in == len(nlp.inequality(x))


def test_a_forward_simulation_satisfies_the_momentum_equations(pendulum: Kernels) -> None:
    """The integrator's nodes, put into the unknowns of a problem without collisions, leave no
    residual."""
    h, steps = 0.01, 40
    rng = np.random.default_rng(2)
    u = rng.normal(size=(steps, 1))
    run = dmoc.simulate(pendulum, [1.2, 0.0], [0.5, 0.3], step_size=h, steps=steps, inputs=u)
    assert not run.collisions
    nlp = Transcription(
        dmoc.Problem(
            pendulum, start={"alpha": 1.2, "x": 0.0, "p_alpha": None, "p_x": None}, steps=steps
        )
    )
    lay = nlp.layout
    x = np.zeros(nlp.n)
    x[lay.index_h], x[lay.index_q], x[lay.index_u] = h, run.q, u
    x[lay.index_p_B], x[lay.index_p_E] = run.p[0], run.p[-1]
    assert np.abs(nlp.equality(x)).max() < 1e-11
    np.testing.assert_allclose(trajectory(nlp, x).phases[0].p, run.p, atol=1e-11)


def test_parameters_bounds_and_steps_need_no_new_kernels(
    pendulum: Kernels, seed: dmoc.Problem
) -> None:
    other = seed.but(
        parameters={"m_c": 2.0}, steps=[7, 9], bounds={"F": (-50, 60)}, sequence=["upper"]
    )
    assert other.kernels is pendulum
    assert Transcription(other).layout.total == 16
    assert other.parameter_values[0, 1] == 2.0
