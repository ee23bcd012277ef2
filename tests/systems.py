"""Systems that several tests use."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels


def block_system(name: str = "block") -> dmoc.MechanicalSystem:
    """A mass on a line with a wall: the unfolded wall gives closed forms."""
    x, u = dynamicsymbols("x u")
    m, wall = sp.symbols("m wall")
    rate = x.diff(dynamicsymbols._t)
    return dmoc.MechanicalSystem(
        name, coordinates=[x], inputs=[u], lagrangian=m * rate**2 / 2, forces={x: u},
        surfaces={"wall": x <= wall}, parameters={m: 1.0, wall: 1.0}, cost=u**2 / 2,
    )  # fmt: skip


def unit_mass(name: str, **fields: Any) -> dmoc.MechanicalSystem:
    """A unit mass x on a line with the force u."""
    x, u = dynamicsymbols("x u")
    return dmoc.MechanicalSystem(
        name, [x], x.diff() ** 2 / 2, fields.pop("parameters", {}), [u], {x: u}, **fields
    )


def dropped_ball() -> dmoc.MechanicalSystem:
    """A mass over a floor."""
    q, (m, g) = dynamicsymbols("q"), sp.symbols("m g")
    return dmoc.MechanicalSystem(
        "ball",
        [q],
        m * q.diff() ** 2 / 2 - m * g * q,
        {m: 1.0, g: 9.81},
        surfaces={"floor": q >= 0},
    )


def block_on_floor(name: str, m: float, g: float, mu: float, **more: Any) -> dmoc.MechanicalSystem:
    """A block on a floor with friction, pushed along it; more is part of the system too."""
    x, y, u = dynamicsymbols("x y u")
    M, G, MU = sp.symbols("m g mu")
    fields: dict[str, Any] = {"cost": u**2 / 2, "surfaces": {"floor": y >= 0}} | more
    return dmoc.MechanicalSystem(
        name, [x, y], M * (x.diff() ** 2 + y.diff() ** 2) / 2 - M * G * y, {M: m, G: g, MU: mu},
        [u], {x: u}, tangents={"floor": x}, friction={"floor": MU}, **fields,
    )  # fmt: skip


def there_and_back(kernels: Kernels, **fields: Any) -> dmoc.Problem:
    """The block from rest to the wall and back within a second, unless fields say otherwise."""
    stated = {
        "start": {"x": 0.0},
        "goal": {"x": 0.0, "x_dot": 0.0},
        "sequence": ["wall"],
        "final_time": 1.0,
    }
    return dmoc.Problem(kernels, **(stated | fields))


def puck_system() -> dmoc.MechanicalSystem:
    """A puck on a table with a round rim and a round post: gaps that bend and normals that turn."""
    x, y, f_x, f_y = dynamicsymbols("x y f_x f_y")
    m, rim, post = sp.symbols("m rim post")
    t = dynamicsymbols._t
    return dmoc.MechanicalSystem(
        "puck", coordinates=[x, y], inputs=[f_x, f_y],
        lagrangian=m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2, forces={x: f_x, y: f_y},
        surfaces={"rim": x**2 + y**2 <= rim**2, "post": (x - 1) ** 2 + y**2 >= post**2},
        parameters={m: 1.0, rim: 3.0, post: 0.2}, cost=(f_x**2 + f_y**2) / 2,
        path_constraints={"speed": x.diff(t) ** 2 + y.diff(t) ** 2 <= 100},
    )  # fmt: skip


def driven_system() -> dmoc.MechanicalSystem:
    """Everything that may depend on the time does: a pendulum on a driven pivot over a floor
    that moves, damped, with a terminal cost."""
    a, z, u = dynamicsymbols("a z u")
    m, length, amplitude, damping = sp.symbols("m l amplitude damping")
    t = dynamicsymbols._t
    height = z - length * sp.cos(a)
    speed = (
        z.diff(t) ** 2 + 2 * length * sp.sin(a) * a.diff(t) * z.diff(t) + length**2 * a.diff(t) ** 2
    )
    return dmoc.MechanicalSystem(
        "driven",
        coordinates=[a, z],
        inputs=[u],
        lagrangian=(m * speed + z.diff(t) ** 2) / 2
        - m * height * (1 + t / 5)
        + amplitude * sp.sin(3 * t) * z.diff(t),
        forces={a: u * (1 + sp.cos(a) / 3), z: sp.cos(2 * t)},
        dissipation=damping * (a.diff(t) ** 2 + z.diff(t) ** 2) / 2,
        surfaces={"floor": height >= amplitude * sp.sin(t) - 2, "side": a <= 1.5},
        parameters={m: 1.3, length: 0.8, amplitude: 0.3, damping: 0.1},
        cost=u**2 / 2 * (1 + t),
        terminal_cost=z**2 + a.diff(t) ** 2 * t,
        path_constraints={"push": u * a.diff(t) <= 3 + t},
    )


def double_integrator(steps: int = 40, order: int = 2) -> dmoc.Problem:
    """From 0 to 1 in 1 s, rest to rest, with the least int u^2: 12."""
    system = replace(block_system("double_integrator"), cost=dynamicsymbols("u") ** 2)
    kernels = dmoc.build(system, order=order)
    return dmoc.Problem(
        kernels, start={"x": 0}, goal={"x": 1, "x_dot": 0}, steps=steps, final_time=1.0,
        parameters={"wall": 2.0},
    )  # fmt: skip


def bryson_denham(steps: int = 40, order: int = 2) -> dmoc.Problem:
    """Turn round in 1 s without passing x = l = 1/9, with the least int u^2 / 2: 4 / (9 l)."""
    kernels = dmoc.build(block_system(), order=order)
    return dmoc.Problem(
        kernels, start={"x": 0, "x_dot": 1}, goal={"x": 0, "x_dot": -1}, steps=steps,
        final_time=1.0, bounds={"x": (None, 1 / 9)},
    )  # fmt: skip


def bouncer_problem(
    e: float, steps: int = 40, order: int = 2, period: float = 0.5
) -> tuple[dmoc.Problem, float]:
    """A driven ball that bounces for ever, and its least cost: one flight from 0 to 0 whose speeds
    at both ends belong to one impact.

    With the speed v at take-off and -v / e at landing the flight costs 6 d^2/T^3 - 6 d w/T^2 + 2
    w^2/T with d = -v T + g T^2/2, w = -v/e - v + g T.
    """
    y, u = dynamicsymbols("y u")
    g = sp.Symbol("g")
    system = dmoc.MechanicalSystem(
        "bouncer", coordinates=[y], inputs=[u],
        lagrangian=y.diff(dynamicsymbols._t) ** 2 / 2 - g * y, forces={y: u},
        surfaces={"floor": y >= 0}, parameters={g: 9.81}, cost=u**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order),
        start={"y": 0.2},
        sequence=["floor"],
        steps=steps,
        final_time=period,
        restitution=e,
        periodic=["y", "y_dot"],
        durations=[(0.2, None), (None, None)],  # it begins on its way up, not down
    )
    v, T = sp.Symbol("v"), sp.Float(period, 30)
    d, w = (
        -v * T + sp.Float("9.81", 30) * T**2 / 2,
        -v / sp.Float(e, 30) - v + sp.Float("9.81", 30) * T,
    )
    cost = 6 * d**2 / T**3 - 6 * d * w / T**2 + 2 * w**2 / T
    return problem, float(cost.subs(v, sp.solve(cost.diff(v), v)[0]))


def rod_system() -> dmoc.MechanicalSystem:
    """A rod with two ends on a rising floor, a wall, and a carriage on a rail that a spring ties to
    it: contacts with and without friction, dry friction, and a tangent that moves with the time."""
    x, y, a, s, u, w = dynamicsymbols("x y a s u w")
    m, l, g, k, mu, rub, belt, rise = sp.symbols("m l g k mu rub belt rise")
    t = dynamicsymbols._t
    ends = {
        "left": (x - l * sp.cos(a), y - l * sp.sin(a)),
        "right": (x + l * sp.cos(a), y + l * sp.sin(a)),
    }
    speeds = x.diff(t) ** 2 + y.diff(t) ** 2 + (l * a.diff(t)) ** 2 / 3
    return dmoc.MechanicalSystem(
        "rod",
        coordinates=[x, y, a, s],
        inputs=[u, w],
        lagrangian=m * speeds / 2 + m * s.diff(t) ** 2 / 2 - m * g * y - k * (s - x) ** 2 / 2,
        forces={x: u, a: w, s: -u},
        surfaces={name: end[1] >= rise * end[0] ** 2 for name, end in ends.items()}
        | {"wall": s <= 2},
        tangents={"left": ends["left"][0], "right": ends["right"][0] - belt * t, "rail": s},
        friction={"left": mu, "right": 2 * mu, "rail": rub},
        parameters={m: 1.0, l: 0.5, g: 9.81, k: 3.0, mu: 0.4, rub: 0.7, belt: 0.3, rise: 0.1},
        cost=u**2 + w**2 + x**2,
    )


def slippery_rod_system(static: int = 1) -> dmoc.MechanicalSystem:
    """The rod on a floor that is slippery in places, and at times, with a brake on its rail; static
    friction may be so many times the kinetic one."""
    rod = rod_system()
    x, y, _, s = rod.coordinates
    brake, mu = dynamicsymbols("brake"), rod.friction["left"]
    place = 1 + sp.sin(3 * x + y) / 4 + sp.cos(2 * dynamicsymbols._t) / 3
    rail = rod.friction["rail"] * (1 + brake**2 * sp.cos(s))
    friction = rod.friction | {
        "left": (static * mu * place, mu * place), "rail": (static * rail, rail)
    }  # fmt: skip
    return replace(rod, name="slippery_rod", inputs=[*rod.inputs, brake], friction=friction)


def landing_system() -> dmoc.MechanicalSystem:
    """A puck over a floor with friction, pushed along it."""
    return block_on_floor("landing", 1.0, 10.0, 0.1)


def landing_problem(steps: int = 8) -> dmoc.Problem:
    """It falls for 0.2 s, lands with 2 N s, slides under 10 N and 1 N of friction, and sticks."""
    return dmoc.Problem(
        dmoc.build(landing_system()), start={"x": 0, "y": 0.2, "x_dot": 1.0},
        goal={"x": 0.5, "x_dot": 0}, sequence=["+floor:slip+", "floor:stick"], steps=steps,
        final_time=1.5,
    )  # fmt: skip


def chain_system(links: int, relative: bool = False) -> dmoc.MechanicalSystem:
    """A chain of point masses with a torque in every joint; angles are those of the links, or
    those of the joints between them."""
    angles, torques = (dynamicsymbols(f"{name}1:{links + 1}") for name in ("theta", "tau"))
    m, l, g = sp.symbols("m l g")
    vx = vy = y = kinetic = potential = angle = sp.S.Zero
    for theta in angles:
        angle = theta + angle if relative else theta
        rate = angle.diff()
        vx, vy = vx + l * sp.cos(angle) * rate, vy + l * sp.sin(angle) * rate
        y -= l * sp.cos(angle)
        kinetic += m * (vx**2 + vy**2) / 2
        potential += m * g * y
    return dmoc.MechanicalSystem(
        f"chain_{links}", angles, kinetic - potential, {m: 0.5, l: 0.4, g: 9.81}, inputs=torques,
        forces=dict(zip(angles, torques, strict=True)), cost=sum(u**2 for u in torques) / 2,
    )  # fmt: skip


def double_pendulum(named: bool, relative: bool = False, **fields: Any) -> dmoc.MechanicalSystem:
    """Two point masses on rods; every field contains their places, by name or written out."""
    T = dynamicsymbols._t
    a, b, u = dynamicsymbols("a b u")
    m, l, g, d = sp.symbols("m l g d")
    definitions: dict[Any, Any] = {}
    X = Y = angle = kinetic = potential = damping = sp.S.Zero
    for i, coordinate in enumerate((a, b), 1):
        angle = coordinate + angle if relative else coordinate
        place = (X + l * sp.sin(angle), Y - l * sp.cos(angle))
        names = tuple(dynamicsymbols(f"x{i} y{i}"))
        definitions |= dict(zip(names, place, strict=True))
        X, Y = names if named else place
        kinetic += m * (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2
        potential += m * g * Y
        damping += d * X.diff(T) ** 2 / 2
    stated = {
        "coordinates": [a, b], "inputs": [u], "lagrangian": kinetic - potential,
        "forces": {b: u + sp.sin(X)}, "dissipation": damping,
        "parameters": {m: 0.5, l: 0.4, g: 9.81, d: 0.1},
        "cost": u**2 / 2 + X**2 + sp.Abs(Y.diff(T)), "terminal_cost": X**2 + X.diff(T) ** 2,
        "surfaces": {"floor": -l - l * sp.sin(T) / 2 <= Y, "wall": l >= X},
        "tangents": {"floor": X}, "friction": {"floor": 0.3},
        "constraints": {"curve": sp.Eq(X, Y**2)},
        "path_constraints": {"speed": X.diff(T) <= 3, "room": sp.Abs(X) <= 2 * l},
        "drawing": [dmoc.Link((0, 0), (X, Y)), dmoc.Contact("floor", (X, Y))],
        "definitions": definitions if named else {},
    } | fields  # fmt: skip
    return dmoc.MechanicalSystem("double_pendulum", **stated)


def satellite_system(inertia: float = 0.4547, cost: Any = None) -> dmoc.MechanicalSystem:
    """A sphere that torques in its axes turn, by default at half the sum of their squares."""
    torque = dynamicsymbols("T_x T_y T_z")
    world = dmoc.spatial.World()
    world.ball("q", inertia=(inertia,) * 3, torque=torque)
    effort = sum(T**2 for T in torque) / 2
    return world.system("satellite", inputs=torque, cost=effort if cost is None else cost)
