"""The nonlinear program: order of unknowns, derivatives, and agreement with the forward
integrator."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import driven_system, landing_system, rod_system, slippery_rod_system

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.mechanics.touch import Open
from dmoc.problem.relaxed import relaxed
from dmoc.program.blocks import GOAL, LAW
from dmoc.program.extraction import trajectory
from dmoc.program.layout import Layout
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription


def small(kernels: Kernels, controls: str | None = "constant") -> dmoc.Problem:
    """Few steps, every kind of constraint."""
    return dmoc.Problem(
        kernels, start={"alpha": (0.4, 0.5), "alpha_dot": (-1, 1), "x": 0.0},
        goal={"alpha": pi / 2, "p_alpha": 0.0, "p_x": 0.0, "x_dot": (-1, 1)},
        sequence=["left", "right"], steps=[3, 4, 3], final_time=(0.1, 1.0),
        bounds={"F": (-200, 200), "x": (-10, 10)}, controls=controls,
    )  # fmt: skip


def puck_problem(kernels: Kernels) -> dmoc.Problem:
    return dmoc.Problem(
        kernels, start={"x": 0.0, "y": 0.5}, goal={"x": 0.0, "y": -1.0}, sequence=["post", "rim"],
        steps=[2, 3, 2], final_time=(None, 2.0), bounds={"f_x": (-20, 20), "f_y": (-20, 20)},
    )  # fmt: skip


def point(nlp: Transcription, rng: np.random.Generator) -> np.ndarray:
    x = rng.normal(size=nlp.n) * 0.3
    lay = nlp.layout
    x[lay.index_h] = rng.uniform(0.05, 0.08, lay.stepped)
    x[lay.impact.lam] = rng.uniform(1, 2, lay.phases - 1)
    x[lay.index_q[:, 0]] = np.linspace(0.45, 1.2, lay.total + 1)
    x[lay.index_design] = rng.uniform(0.4, 1.0, len(lay.index_design))
    return x


def differences(f: object, x: np.ndarray, step: float = 1e-6) -> np.ndarray:
    return np.array([(f(x + step * d) - f(x - step * d)) / (2 * step) for d in np.eye(len(x))]).T  # type: ignore[operator]


def driven_problem(order: int, controls: str | None = None) -> dmoc.Problem:
    """Explicit time, moving surfaces, restitution, dissipation, a terminal cost and a periodic
    velocity."""
    return dmoc.Problem(
        dmoc.build(driven_system(), order=order), start={"a": 0.2, "z_dot": (-1, 1)},
        sequence=["floor", "side"], steps=[3, 2, 3], final_time=(None, 2.0),
        bounds={"u": (-20, 20)}, restitution={"floor": 0.6, "side": 0.0}, periodic=["a_dot", "z"],
        controls=controls,
    )  # fmt: skip


def rod_problem(
    periodic: bool, order: int = 2, system: dmoc.MechanicalSystem | None = None
) -> dmoc.Problem:
    """Contacts that land, stay, leave, stick, slide and turn, a hit beside them, several at once; a
    start that is known and one that is not."""
    sequence = [
        "+right:slip- -left",
        "wall rail:slip- right:stick",
        "+left:slip+",
        "-right rail:stick",
    ]
    start = {"x": 0.0, "y": 1.0, "a": (0.1, 1.0), "s": 0.0, "x_dot": None, "a_dot": None}
    if periodic:
        sequence = ["right:stick rail:slip+", "-right", "+right +left:slip-"]
        start = {"s": 0.1, "x": 0.0, "a": None}
    return dmoc.Problem(
        dmoc.build(system or rod_system(), order=order), start=start,
        contacts=["right:slip+"] if periodic else ["left", "rail:slip+"], sequence=sequence,
        goal={} if periodic else {"x": 0.2, "s_dot": 0.0},
        via=None if periodic else [{"y": (0.0, 2.0)}, None, {"x": 0.1}, None],
        ignored=["left"] if periodic else [],
        periodic={"y": "y", "x": ("x", (0.1, 0.4)), "y_dot": "y_dot"} if periodic else (),
        steps=[3, 2, 4, 2, 3][: len(sequence) + 1], final_time=(0.5, 2.0), restitution=0.5,
    )  # fmt: skip


def joint_problem(periodic: bool, order: int = 2) -> dmoc.Problem:
    """A moving guide and a rod beside hits, landings and what sticks; a start that is known and one
    that is not."""
    rod = rod_system()
    x, y, a, s = rod.coordinates
    guides = {"guide": x - s - sp.sin(2 * dynamicsymbols._t) / 3, "bend": y - 2 + x**2 + a / 2}
    start = {"x": 0.0, "y": 2.0, "a": 0.0, "s": 0.0, "x_dot": 2 / 3}
    return dmoc.Problem(
        dmoc.build(replace(rod, name="guided_rod", constraints=guides), order=order),
        start={"x": 0.0, "y": None, "a": None, "s": None, "x_dot": None} if periodic else start,
        contacts=["rail:slip+"],
        sequence=["+right:slip-", "wall", "-right rail:stick", "left:slip+:stick"],
        goal={} if periodic else {"x": 0.2, "s_dot": 0.0}, steps=[3, 2, 3, 2, 2],
        periodic=["y", "y_dot"] if periodic else (), final_time=(0.5, 2.0), restitution=0.5,
    )  # fmt: skip


def force_problem(
    order: int, controls: str, system: dmoc.MechanicalSystem | None = None
) -> dmoc.Problem:
    """Bounds, peaks, ends and periods of quantities that contain forces of what slides, sticks,
    lands and is held by a constraint."""
    rod = system or rod_system()
    x, _, a, s = rod.coordinates
    load = dmoc.normal("left") + 2 * dmoc.normal("right")
    grip = dmoc.traction("rail") * dmoc.normal("right") / 7 + dmoc.traction("left") * s.diff()
    system = replace(
        rod, name="pushed_rod", constraints={"guide": x - s - sp.sin(2 * dynamicsymbols._t) / 3},
        quantities={"load": load, "grip": grip, "pull": dmoc.reaction("guide") * sp.cos(a)},
        objective=dmoc.largest("grip") + dmoc.peak("load") ** 2,
    )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system, order=order),
        start={"x": 0.0, "y": 2.0, "a": 0.0, "s": 0.0, "x_dot": 2 / 3, "grip": (-3, 3)},
        contacts=["rail:slip+"],
        sequence=["+right:slip-", "wall rail:stick", "+left -right rail:slip-"],
        goal={"x": 0.2, "load": 4.0}, steps=[3, 2, 3, 2], bounds={"pull": (-9, 9)},
        periodic={"load": "load", "y_dot": "y_dot"}, final_time=(0.5, 2.0), restitution=0.5,
        controls=controls if controls in ("constant", "linear") else None,
    )  # fmt: skip


def slowed_problem(order: int) -> dmoc.Problem:
    """Friction of the sliding speed, of a contact, of one on a belt and of a rail, that slide in
    either way and stick, and a bound of their forces."""
    rod = slippery_rod_system()
    mu, s = dmoc.sliding_speed, rod.coordinates[3]
    slows = 1 + sp.exp(-2 * mu) + mu**2 / 5
    friction = {name: e * slows for name, e in rod.friction.items()}
    if order != 2:
        friction["right"] = 2 * rod.friction["right"], rod.friction["right"] / (1 + mu)
    grip = dmoc.traction("rail") + dmoc.traction("left") * s.diff() + dmoc.traction("right")
    system = replace(rod, name="slowed_rod", friction=friction, quantities={"grip": grip})
    return dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0.0, "y": 1.0, "a": (0.1, 1.0), "s": 0.0},
        contacts=["left:slip+" if order == 2 else "right:slip-", "rail:slip+"],
        sequence=["rail:stick", *(["left:stick rail:slip-"] if order == 2 else ["right:stick"])],
        steps=[3, 3, 4], bounds={"grip": (-9, 9)}, final_time=(0.5, 2.0),
    )  # fmt: skip


def hit_problem(order: int, system: dmoc.MechanicalSystem | None = None) -> dmoc.Problem:
    """Hits with friction in all ways, and landings that turn and stop, of a rod with a rail, also
    while its other end holds; of a puck without anything that lasts."""
    if order != 2:
        return dmoc.Problem(
            dmoc.build(landing_system(), order=order), start={"x": 0.0, "y": 1.0, "x_dot": None},
            sequence=["floor:slip+", "floor:slip-:stick:late", "floor:stick"], steps=[2, 3, 2, 2],
            final_time=(0.5, 2.0), restitution=0.5,
        )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system or rod_system()),
        start={"x": 0.0, "y": 1.0, "a": (0.1, 1.0), "s": 0.0, "x_dot": None},
        sequence=[
            "left:slip+:stick rail:slip+", "right:slip-:slip+:late", "left:slip-",
            "+right:slip-:slip+", "-right", "+left:slip+:stick", "right:slip+:stick",
            "right:slip-:slip+:late",
        ],
        steps=2, final_time=(0.5, 2.0), restitution={"left": 0.5, "right": 0.2},
    )  # fmt: skip


def tangential_problem(slippery: bool = False) -> dmoc.Problem:
    """Hits with tangential restitution that stick, with friction or without, and slide."""
    system = landing_system()
    x, y, *_ = system.coordinates
    if slippery:
        system = replace(system, friction={"floor": system.friction["floor"] * (2 + sp.sin(x))})
    system = replace(
        system,
        surfaces={**system.surfaces, "wall": x <= 2},
        tangents={**system.tangents, "wall": y},
        restitution={"wall": dmoc.approach_speed},
        tangential_restitution={"floor": 0.4, "wall": 0.7},
    )
    return dmoc.Problem(
        system, start={"x": 0.0, "y": 1.0, "x_dot": None},
        sequence=["floor:slip+", "wall", "floor:slip-", "floor:stick"], steps=[2, 3, 2, 2, 3],
        final_time=(0.5, 2.0), restitution={"floor": 0.5},
    )  # fmt: skip


def rebound_problem() -> dmoc.Problem:
    """Quantities, integrals, an objective and a law of impact of parameters that are chosen; the
    restitution of the wall is one of them."""
    x, u = dynamicsymbols("x u")
    m, wall, e, c = sp.symbols("m wall e c")
    system = dmoc.MechanicalSystem(
        "rebound", [x], m * x.diff() ** 2 / 2, {m: 1.0, wall: 1.0, e: 0.5, c: 2.0}, [u],
        {x: u - c * x}, surfaces={"wall": x <= wall},
        restitution={"wall": e / (1 + dmoc.approach_speed**2)},
        quantities={"pull": c * x + m * x.diff()}, integrals={"work": c * u * x.diff()},
        objective=dmoc.total("work") ** 2 * c + dmoc.peak("pull") + e * dmoc.at_end(x * wall),
        path_constraints={"near": x**2 <= 4 * wall},
    )  # fmt: skip
    return dmoc.Problem(
        system, start={"x": 0.0}, goal={"pull": 0.3}, sequence=["wall"], steps=3,
        bounds={"pull": (-9, 9)}, final_time=1.0,
        design=dict.fromkeys(("m", "wall", "e", "c"), (0.2, 3)),
    )  # fmt: skip


def kinked_problem(order: int, controls: str | None, design: bool) -> dmoc.Problem:
    """Kinks in the cost, also of the time, and in integrals: one is bounded, one is priced, one is
    to be large, and nothing holds the last one."""
    x, u, t = *dynamicsymbols("x u"), dynamicsymbols._t
    m, c = sp.symbols("m c", positive=True)
    v = x.diff()
    system = dmoc.MechanicalSystem(
        "kinked", [x], m * v**2 / 2, {m: 1.0, c: 2.0}, [u], {x: u - c * x},
        surfaces={"wall": x <= 1}, restitution={"wall": 0.5},
        cost=u**2 + sp.Abs(u * v) * c + sp.Max(u - t, 0) ** 2,
        integrals={"fuel": sp.Max(c * u, v, x), "back": sp.Min(m * v, u), "work": sp.Abs(u * v),
                   "idle": sp.Abs(u) * x**2},
        objective=dmoc.total("work") ** 2 - c * dmoc.total("back"),
    )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0.0}, goal={"x": 0.2, "fuel": (None, 3.0)},
        sequence=["wall"], steps=3, final_time=1.0, controls=controls,
        design=dict.fromkeys(("m", "c"), (0.2, 3)) if design else {},
    )  # fmt: skip


def ending(problem: dmoc.Problem) -> dmoc.Problem:
    """The same motion until its last impact, with which it ends."""
    count = int(np.flatnonzero(problem.touch.impacts)[-1]) + 1
    return problem.but(
        sequence=problem.sequence[:count], durations=[None] * count + [0],
        steps=[*problem.phase_steps[:count], 0],
        via=problem.via[:count] if problem.via is not None else None,
    )  # fmt: skip


@pytest.fixture(
    scope="module",
    params=[
        *("constant", "linear", "puck", "driven", "driven, by rates", "driven, order 4"),
        *("driven, linear", "driven, scaled"),
        *("pendulum, order 4", "contacts", "contacts, periodic"),
        *(
            "hits with friction",
            "hits with friction, order 4",
            "tangential",
            "joints",
            "joints, periodic",
        ),
        *("relaxed", "relaxed, periodic", "relaxed, moving"),
        *("contacts, order 4", "contacts, periodic, order 6"),
        *("joints, order 6", "joints, periodic, order 4"),
        *("driven, design", "driven, design, order 4", "driven, design, scaled"),
        *("contacts, design", "contacts, design, order 4", "joints, periodic, design"),
        *("relaxed, moving, design", "relaxed, design", "rebound, design"),
        *("hits with friction, design", "hits with friction, design, order 4"),
        *(f"slippery contacts, order {order}" for order in (2, 4, 6)),
        *("slippery hits", "slippery tangential", "slippery relaxed"),
        *("forces, constant", "forces, linear", "forces, order 4", "forces, order 6"),
        *("forces, linear, design", "forces, design, order 4"),
        *("forces, linear, slippery", "forces, slippery, order 4"),
        *(f"slowed, order {order}" for order in (2, 4, 6)),
        *("slowed, design, order 2", "slowed, design, order 4"),
        *("kinked", "kinked, linear", "kinked, order 4", "kinked, order 6", "kinked, design"),
        *("kinked, constant, design, order 4", "ending kinked, order 4", "ending kinked, linear"),
        *("ending constant", "ending driven, linear", "ending driven, scaled"),
        *("ending contacts", "ending contacts, periodic, order 4", "ending joints, order 6"),
        *("ending joints, periodic", "ending hits with friction", "ending tangential"),
        *("ending forces, linear", "ending forces, order 4", "ending rebound, design"),
        *("ending slippery contacts, order 4", "ending forces, constant"),
    ],
)
def nlp(request: pytest.FixtureRequest, pendulum: Kernels, puck: Kernels) -> Transcription:
    form = request.param.removeprefix("ending ")
    stated = program_of(form, pendulum, puck)
    return Transcription(ending(stated.problem)) if form != request.param else stated


def program_of(form: str, pendulum: Kernels, puck: Kernels) -> Transcription:
    """The programs of the fixture by the words of their forms."""
    ways = {"driven": ("m", "l", "amplitude"), "relaxed": ("l", "amplitude")}
    ways["relaxed"] = ways["relaxed"] if "moving" in form else ("l", "mu", "rub")
    names = ways.get(form.split(",")[0], ("l", "rise", "k", "mu", "rub"))
    design = dict.fromkeys(names, (0.3, 2.0)) if "design" in form else {}
    if form.startswith("rebound"):
        return Transcription(rebound_problem())
    if form.startswith("kinked"):
        controls = next((own for own in ("linear", "constant") if own in form), None)
        order = int(form[-1]) if "order" in form else 2
        return Transcription(kinked_problem(order, controls, "design" in form))
    if form.startswith("driven"):
        controls = "linear" if "linear" in form else None
        problem = driven_problem(4 if "4" in form else 2, controls).but(design=design)
        if "scaled" in form:
            return Transcription(problem, scale_of(problem, initial_guesses(problem)[0].x))
        return Transcription(problem.in_rates() if "rates" in form else problem)
    if form.startswith("relaxed, moving"):
        moving = driven_problem(2).but(design=design)
        return Transcription(relaxed(moving, Open((0, 1)), ["side"], 3, 0.5))
    static = 2 if form.endswith(("4", "6")) else 1
    slippery = slippery_rod_system(static) if "slippery" in form else None
    if "relaxed" in form:
        rod = rod_problem("periodic" in form, system=slippery).but(design=design)
        return Transcription(relaxed(rod, Open((0, 1), (0, 1, 2), (1,)), ["wall"], 3, 0.5))
    order = int(form[-1]) if "order" in form else 2
    if "slowed" in form:
        return Transcription(slowed_problem(order).but(design=design))
    if "contacts" in form:
        rod = rod_problem("periodic" in form, order, slippery)
        return Transcription(rod.but(design=design))
    if form.startswith("joints"):
        return Transcription(joint_problem("periodic" in form, order).but(design=design))
    if form.startswith("forces"):
        forced = force_problem(order, form.split(", ")[1], slippery)
        return Transcription(forced.but(design=design))
    if "tangential" in form:
        return Transcription(tangential_problem(bool(slippery)))
    if "hits" in form:
        hits = hit_problem(4 if "4" in form else 2, slippery)
        return Transcription(hits.but(design={"mu": (0.1, 1)} if design else {}))
    if "4" in form:
        return Transcription(small(dmoc.load("cart_pendulum", order=4), None))
    return Transcription(puck_problem(puck) if form == "puck" else small(pendulum, form))


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
        "totals",
        "peaks",
        "design",
    ]
    parts = lay, lay.impact, lay.contact, lay.hit, lay.joint, lay.held, lay.relaxed, lay.force
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
            kind = "event" if set(surface) & set("+-: ") else "collision"
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
        "force", "force at ends",
    } & set(prices)  # fmt: skip
    assert {name for name, price in prices.items() if price == GOAL} == {
        "goal", "periodic", "quantity fixed", "quantity within",
    } & set(prices)  # fmt: skip
    units = {"kg m/s", "kg m2/s", "m", "rad", "m/s", "rad/s", "s", ""}
    for block in blocks:
        for place in block.places.tolist():
            assert block.missed.unit(*place) in units
            assert block.missed.words is None or block.missed.words(*place)
        assert block.counted is None or len(block.counted.places) == len(block.index)


def test_first_derivatives_equal_differences(nlp: Transcription) -> None:
    """Entries outside the pattern are zero in the dense matrix, so that every numeric nonzero
    must be covered."""
    x = point(nlp, np.random.default_rng(0))
    for value, slope in (
        (nlp.equality, nlp.equality_jacobian(x).toarray()),
        (nlp.inequality, nlp.inequality_jacobian(x).toarray()),
        (nlp.cost, nlp.cost_gradient(x)),
    ):
        reference = differences(value, x)
        np.testing.assert_allclose(
            slope, reference, rtol=0, atol=1e-7 * max(1.0, np.abs(reference).max())
        )


def test_gradient_of_the_lagrangian_is_the_sum_of_its_parts(nlp: Transcription) -> None:
    rng = np.random.default_rng(2)
    x, y, w = point(nlp, rng), rng.normal(size=nlp.n_eq), rng.normal(size=nlp.n_in)
    parts = [
        nlp.cost_gradient(x),
        nlp.equality_jacobian(x).toarray().T @ y,
        -nlp.inequality_jacobian(x).toarray().T @ w,
    ]
    size = np.abs(parts).max()
    found = nlp.lagrangian_gradient(x, y, w)
    np.testing.assert_allclose(found, sum(parts), rtol=0, atol=1e-13 * size)


def test_hessian_of_the_lagrangian_equals_differences(nlp: Transcription) -> None:
    rng = np.random.default_rng(1)
    x = point(nlp, rng)
    y, w = rng.normal(size=nlp.n_eq), rng.normal(size=nlp.n_in)
    upper = nlp.lagrangian_hessian(x, y, w, sigma=0.7).toarray()
    assert not np.tril(upper, -1).any()
    hessian = upper + np.triu(upper, 1).T

    def slope(x: np.ndarray) -> np.ndarray:
        return (
            0.7 * nlp.cost_gradient(x)
            + nlp.equality_jacobian(x).T @ y
            - nlp.inequality_jacobian(x).T @ w
        )

    reference = differences(slope, x)
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
        parameters={"m_c": 2.0}, steps=[7, 9], bounds={"F": (-50, 60)}, sequence=["right"]
    )
    assert other.kernels is pendulum
    assert Transcription(other).layout.total == 16
    assert other.parameter_values[0, 1] == 2.0
