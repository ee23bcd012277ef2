"""Small problems that together have every kind of constraint, in every discretisation."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import sympy as sp
from balls import rolled, thrown
from liftoff_problems import everything
from sympy.physics.mechanics import dynamicsymbols
from systems import driven_system, landing_system, rod_system, slippery_rod_system

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.codegen.system_kernels import kernels_of
from dmoc.guess.automatic import initial_guesses
from dmoc.mechanics.touch import Open
from dmoc.problem.derived import relaxed
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription


def small(kernels: Kernels, controls: str | None = "constant") -> dmoc.Problem:
    """Few steps, every kind of constraint."""
    return dmoc.Problem(
        kernels, start={"alpha": (0.4, 0.5), "alpha_dot": (-1, 1), "x": 0.0},
        goal={"alpha": pi / 2, "p_alpha": 0.0, "p_x": 0.0, "x_dot": (-1, 1)},
        sequence=["lower", "upper"], steps=[3, 4, 3], final_time=(0.1, 1.0),
        bounds={"F": (-200, 200), "x": (-10, 10)}, controls=controls,
    )  # fmt: skip


def puck_problem(kernels: Kernels) -> dmoc.Problem:
    return dmoc.Problem(
        kernels, start={"x": 0.0, "y": 0.5}, goal={"x": 0.0, "y": -1.0}, sequence=["post", "rim"],
        steps=[2, 3, 2], final_time=(None, 2.0), bounds={"f_x": (-20, 20), "f_y": (-20, 20)},
    )  # fmt: skip


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


def joint_problem(periodic: bool, order: int = 2, by_rate: bool = False) -> dmoc.Problem:
    """A moving guide and a rod, or a guide of rates and a blade, beside hits, landings and what
    sticks; a start that is known and one that is not."""
    rod, t = rod_system(), dynamicsymbols._t
    x, y, a, s = rod.coordinates
    guides = {"guide": x - s - sp.sin(2 * t) / 3, "bend": y - 2 + x**2 + a / 2}
    name = "guided_by_rate" if by_rate else "guided_rod"
    if by_rate:
        blade = y.diff() * sp.cos(a + t) + 2 * x * x.diff() + a.diff() / 2
        guides = {"guide": guides["guide"].diff(t), "blade": blade}
    start = {"x": 0.0, "y": 2.0, "a": 0.0, "s": 0.0, "x_dot": 2 / 3}
    return dmoc.Problem(
        dmoc.build(replace(rod, name=name, constraints=guides), order=order),
        start={"x": 0.0, "y": None, "a": None, "s": None, "x_dot": None} if periodic else start,
        contacts=["rail:slip+"],
        sequence=["+right:slip-", "wall", "-right rail:stick", "left:slip+:stick"],
        goal={} if periodic else {"x": 0.2, "s_dot": 0.0}, steps=[3, 2, 3, 2, 2],
        periodic=["y", "y_dot"] if periodic else (), final_time=(0.5, 2.0), restitution=0.5,
    )  # fmt: skip


def force_problem(order: int, controls: str) -> dmoc.Problem:
    """Bounds, peaks, ends and periods of quantities that contain forces of what slides, sticks,
    lands and is held by a constraint."""
    rod = rod_system()
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


def slowed_problem(order: int, design: dict[str, tuple[float, float]]) -> dmoc.Problem:
    """Friction of the sliding speed, of a contact, of one on a belt and of a rail, that slide in
    either way and stick, and a bound of their forces, but at order 6."""
    rod = slippery_rod_system() if order == 2 else rod_system()
    mu, s = dmoc.sliding_speed, rod.coordinates[3]
    slows = 1 + sp.exp(-2 * mu) + mu**2 / 5
    friction = {name: e * slows for name, e in rod.friction.items()}
    if order != 2:
        friction["right"] = 2 * rod.friction["right"], rod.friction["right"] / (1 + mu)
    grip = dmoc.traction("rail") + dmoc.traction("left") * s.diff() + dmoc.traction("right")
    quantities, bounds = ({"grip": grip}, {"grip": (-9, 9)}) if order != 6 else ({}, {})
    system = replace(rod, name="slowed_rod", friction=friction, quantities=quantities)
    return dmoc.Problem(
        kernels_of(system, order, tuple(design)), design=design,
        start={"x": 0.0, "y": 1.0, "a": (0.1, 1.0), "s": 0.0},
        contacts=["left:slip+" if order == 2 else "right:slip-", "rail:slip+"],
        sequence=["rail:stick", *(["left:stick rail:slip-"] if order == 2 else ["right:stick"])],
        steps=[3, 3, 4], bounds=bounds, final_time=(0.5, 2.0),
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
    to be large, and nothing holds the last one; a switch of the velocity before the hit, and
    quantities of this one that are bounded and priced."""
    x, u, t = *dynamicsymbols("x u"), dynamicsymbols._t
    m, c = sp.symbols("m c", positive=True)
    v = x.diff()
    system = dmoc.MechanicalSystem(
        "kinked", [x], m * v**2 / 2, {m: 1.0, c: 2.0}, [u], {x: u - c * x},
        surfaces={"wall": x <= 1}, restitution={"wall": 0.5},
        cost=u**2 + sp.Abs(u * v) * c + sp.Max(u - t, 0) ** 2,
        integrals={"fuel": sp.Max(c * u, v, x), "back": sp.Min(m * v, u), "work": sp.Abs(u * v),
                   "idle": sp.Abs(u) * x**2},
        objective=dmoc.total("work") ** 2 - c * dmoc.total("back") + dmoc.largest("blow") ** 2,
        quantities={"lost": c * dmoc.loss("wall"), "blow": x * dmoc.impulse("wall") - t},
        switches={"rest": v, "fast": c * v**2 + sp.sin(m * x) * t - 1},
    )  # fmt: skip
    chosen = dict.fromkeys(("m", "c") if design else (), (0.2, 3))
    return dmoc.Problem(
        kernels_of(system, order, tuple(chosen)), start={"x": 0.0},
        goal={"x": 0.2, "fuel": (None, 3.0)}, sequence=["fast", "wall"], steps=3, final_time=1.0,
        bounds={"lost": (-1, 4)}, controls=controls, design=chosen,
    )  # fmt: skip


def ending(problem: dmoc.Problem) -> dmoc.Problem:
    """The same motion until its last impact, with which it ends."""
    count = int(np.flatnonzero(problem.touch.impacts)[-1]) + 1
    return problem.but(
        sequence=problem.sequence[:count], durations=[None] * count + [0],
        steps=[*problem.phase_steps[:count], 0],
        via=problem.via[:count] if problem.via is not None else None,
    )  # fmt: skip


def program_of(form: str, pendulum: Kernels, puck: Kernels) -> Transcription:
    """The programs of the fixture by the words of their forms."""
    ways = {"driven": ("m", "l", "amplitude"), "relaxed": ("l", "amplitude")}
    ways["lift-off"] = ("l", "mu", "amplitude")
    ways["relaxed"] = ways["relaxed"] if "moving" in form else ("l", "mu", "rub")
    names = ways.get(form.split(",")[0], ("l", "rise", "k", "mu", "rub"))
    design = dict.fromkeys(names, (0.3, 2.0)) if "design" in form else {}
    if form.startswith("rebound"):
        return Transcription(rebound_problem())
    if form.startswith("rolling"):
        return Transcription(rolled(int(form[-1]), design=("mu",) if "design" in form else ()))
    if form.startswith("balls"):
        return Transcription(thrown(int(form[-1]), design=("r", "mu") if "design" in form else ()))
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
    if form.startswith("lift-off"):
        return Transcription(everything(order).but(design=design))
    if "slowed" in form:
        return Transcription(slowed_problem(order, design))
    if "contacts" in form:
        rod = rod_problem("periodic" in form, order, slippery)
        return Transcription(rod.but(design=design))
    if form.startswith("joints"):
        by_rate = "rate" in form
        return Transcription(joint_problem("periodic" in form, order, by_rate).but(design=design))
    if form.startswith("forces"):
        return Transcription(force_problem(order, form.split(", ")[1]).but(design=design))
    if "tangential" in form:
        return Transcription(tangential_problem(bool(slippery)))
    if "hits" in form:
        hits = hit_problem(4 if "4" in form else 2, slippery)
        return Transcription(hits.but(design={"mu": (0.1, 1)} if design else {}))
    if "4" in form:
        return Transcription(small(dmoc.load("cart_pendulum", order=4), None))
    return Transcription(puck_problem(puck) if form == "puck" else small(pendulum, form))


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
