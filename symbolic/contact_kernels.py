"""Kernels of surfaces, tangents and constraints: what touches, slides and holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from dmoc.symbolic.continuous import (
    Continuous,
    constraint_rates,
    dot,
    gap_rates,
    impact_work,
    keeps_rate,
    mass_matrix,
    own_rates,
    sum_of,
)
from dmoc.symbolic.discrete import StepElement
from dmoc.symbolic.end_kernels import barriers
from dmoc.symbolic.expressions import sliding_speed
from dmoc.symbolic.graph import RELATION, GraphNode, gradient
from dmoc.symbolic.kernel_family import family, parameters, state_inputs
from dmoc.symbolic.spec import Input, KernelSpec, Output


def surface_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the gaps g(q, t), of the normal impulse lam . grad g and of the work of an
    impact."""
    if not f.g:
        return []
    q, v, _, t, par = state_inputs(f)
    lam = Input.vector(f.L.graph, "lam", len(f.g))
    normal = gradient(dot(lam.symbols, f.g), f.q)
    moving, rate = impact_work(f, lam.symbols)
    return [
        *family("surface", "Gaps g <= 0.", (q, t), {"g": f.g}, par),
        *family("gap_rate", "Rates gamma of the gaps.", (q, v, t), {"gamma": gap_rates(f)}, par),
        *family(
            "normal", "Normal impulse n = sum_j lam_j grad g_j.", (q, lam, t), {"n": normal}, par
        ),
        *family(
            "moving_work",
            "Work of moving surfaces, W_t = sum_j lam_j dg_j/dt, in an impact.",
            (q, lam, t),
            {"W_t": [moving]},
            par,
        ),
        *family(
            "rate_work",
            "Impulses times rates after an impact, W_gamma = sum_j lam_j gamma_j.",
            (q, v, lam, t),
            {"W_gamma": [rate]},
            par,
        ),
        *family(
            "gap_work",
            "Normal impulses times gaps of the surfaces, lam_j g_j.",
            (q, lam, t),
            {"W_g": [a * b for a, b in zip(lam.symbols, barriers(f), strict=True)]},
            par,
        ),
    ]


def tangent_kernels(f: Continuous, degree: int) -> list[KernelSpec]:
    """Kernels of the tangential positions tau(q, t), of the tangential impulse T . grad tau, and
    of the coefficients of friction, with steps of a degree.  Sliding velocities in the place of tau
    are taken as constraints of velocities are (:func:`joint_kernels`)."""
    if not f.tau:
        return []
    q, v, _, t, par = state_inputs(f)
    T = Input.vector(f.L.graph, "T", len(f.tau))
    places, linear = _places_and_rates(f, f.tau)
    along = _pushed(f, T.symbols, places, linear)
    slides = own_rates(f, f.tau)
    ends = _ends_of_step(f)
    before, after = ([_at(f, tau, end) for tau in places] for end in ends)
    slipped = zip(T.symbols, before, after, strict=True)
    return [
        *_with_rate_slopes(
            f,
            family("tangent", "Tangential positions tau.", (q, t), {"tau": places}, par),
            places,
            linear,
        ),
        *family("slide_rate", "Sliding velocities sigma.", (q, v, t), {"sigma": slides}, par),
        *family(
            "traction", "Tangential impulse s = sum_j T_j grad tau_j.", (q, T, t), {"s": along}, par
        ),
        *family(
            "slip_work",
            "Tangential impulses times how far their tangents slide in a step, "
            "T_j (tau_j(q_kp1) - tau_j(q_k)).",
            (ends[0][0], ends[1][0], T, ends[0][1], ends[1][1]),
            {"W_tau": [a * (late - early) for a, early, late in slipped]},
            par,
        ),
        *_friction_kernels(f, degree),
    ]


def _friction_kernels(f: Continuous, degree: int) -> list[KernelSpec]:
    """Kernels of the coefficients of friction: of all that are constant along a motion, and, where
    some are not, of what they bear at a state.

    ``c`` is the place between two inputs, in [0, 1]; sigma the sliding speed of each tangent; N
    what it is pressed with.
    """
    q, _, _, t, par = state_inputs(f)
    graph, stated = f.L.graph, {"mu": f.mu} | ({"mu_s": f.mu_s} if f.mu_s != f.mu else {})
    moving = [varies(f, mu) or varies(f, mu_s) for mu, mu_s in zip(f.mu, f.mu_s, strict=True)]
    constant = {
        name: [graph.zero if moves else mu for mu, moves in zip(values, moving, strict=True)]
        for name, values in stated.items()
    }
    kernels = [
        KernelSpec(
            "friction",
            "Coefficients of friction of surfaces, largest forces of rails; 0 where they vary.",
            (par,),
            tuple(Output.vector(name, values) for name, values in constant.items()),
        )
    ]
    if not any(moving):
        return kernels
    (c,) = (place := Input.vector(graph, "c", 1)).symbols
    sides = [Input.vector(graph, f"u_{k}", len(f.u)) for k in ("k", "kp1")]
    between = {
        s: (1 - c) * a + c * b
        for s, a, b in zip(f.u, *(side.symbols for side in sides), strict=True)
    }
    sigma, N = (Input.vector(graph, name, len(f.tau)) for name in ("sigma", "N"))
    state, ends = (q, sigma, *sides, place, N, t), _ends_of_step(f)

    def borne(values: Sequence[Any], speeds: Sequence[Any]) -> list[Any]:
        rows = zip(N.symbols, at_speeds(f, values, speeds), moving, strict=True)
        return [load * mu.subs(between) if moves else graph.zero for load, mu, moves in rows]

    bears = {name: borne(values, sigma.symbols) for name, values in stated.items()}
    text = "What friction holds whose coefficients vary, mu_j N_j"
    kernels += family("bearing", f"{text}.", state, {"bears": bears["mu"]}, par)
    if "mu_s" in bears:
        kernels += family("holding", f"{text}, that sticks.", state, {"holds": bears["mu_s"]}, par)
    if any(sliding(f) in mu.free_symbols for mu in f.mu):
        ways = Input.vector(graph, "ways", len(f.tau))
        speeds = [s * rate for s, rate in zip(ways.symbols, own_rates(f, f.tau), strict=True)]
        kernels += _dragging(f, degree, (ways, *sides, place), N, borne(f.mu, speeds))
    places, _ = _places_and_rates(f, f.tau)
    moved = [_at(f, tau, ends[1]) - _at(f, tau, ends[0]) for tau in places]
    step = (ends[0][0], ends[1][0], ends[0][1], ends[1][1])
    return [
        *kernels,
        *family(
            "bearing_work",
            "The same times how far their tangents slide in a step.",
            (*state, *step),
            {"W_mu": [a * b for a, b in zip(bears["mu"], moved, strict=True)]},
            par,
        ),
    ]


def _dragging(
    f: Continuous, degree: int, more: tuple[Input, ...], N: Input, drags: list[Any]
) -> list[KernelSpec]:
    """The kernel of what friction holds at a place whose velocity is sum_a d_a q_a / h, of the
    coordinates q_a of other places; it slides with the signs s."""
    graph, n, places = f.L.graph, len(f.q), max(degree, 2) + 1
    around, slopes = (
        Input.vector(graph, name, count) for name, count in (("around", places * n), ("d", places))
    )
    (h,) = (length := Input("h", (graph.symbol("h"),))).symbols
    q, _, _, t, par = state_inputs(f)
    inputs = (q, around, slopes, length, *more, N, t)
    rates = tuple((v, dot(slopes.symbols, around.symbols[i::n]) / h) for i, v in enumerate(f.v))

    def chain(partial: Callable[[Sequence[GraphNode]], list[GraphNode]]) -> list[GraphNode]:
        own = [s for i in inputs for s in i.symbols]
        by = dict(zip(own, (every := partial([*own, *f.v])), strict=False))
        pulls = [slope / h for slope in every[len(own) :]]
        by[h] = by[h] - dot(f.v, pulls)
        for a, d in enumerate(slopes.symbols):
            place = around.symbols[a * n : (a + 1) * n]
            by[d] = by[d] + dot(place, pulls)
            by |= {s: by[s] + d * pull for s, pull in zip(place, pulls, strict=True)}
        return [by[s] for s in own]

    text = "What friction holds of what slides, mu_j N_j, at the rates of a step."
    return family("dragging", text, inputs, {"drags": drags}, par, chain, definitions=rates)


def sliding(f: Continuous) -> Any:
    """The symbol of the sliding speed."""
    return f.L.graph.symbol(sliding_speed.name)


def at_speeds(f: Continuous, values: Sequence[Any], speeds: Sequence[Any]) -> list[Any]:
    """Coefficients of friction at the sliding speeds of their tangents.  A negative one, as on the
    way of a solver, has the tangent of the coefficient at rest: the coefficient itself may grow
    without bounds there."""
    pairs = zip(values, speeds, strict=True)
    return [_at_speed(sliding(f), mu, speed) for mu, speed in pairs]


def _at_speed(symbol: Any, mu: Any, speed: Any) -> Any:
    if symbol not in mu.free_symbols:
        return mu
    graph = mu.graph
    rest, slope = (a.subs({symbol: graph.zero}) for a in (mu, mu.diff(symbol)))
    forth = graph.make(RELATION, ">=", (speed, graph.zero))
    return graph.choice([mu.subs({symbol: speed}), forth, rest + slope * speed])


def varying(f: Continuous, tangents: Sequence[str]) -> tuple[list[str], list[Any]]:
    """The tangents whose friction varies, and what has the symbols of both coefficients."""
    mu = at_speeds(f, f.mu, own_rates(f, f.tau))
    both = [(name, a * a + b * b) for name, a, b in zip(tangents, mu, f.mu_s, strict=True)]
    pairs = [(name, mu) for name, mu in both if varies(f, mu)]
    return [name for name, _ in pairs], [mu for _, mu in pairs]


def varies(f: Continuous, mu: Any) -> bool:
    """Whether a coefficient of friction varies along a motion, or with what a solver chooses."""
    return bool(mu.free_symbols & {*f.q, *f.v, *f.u, f.t, sliding(f), *f.design})


def joint_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the constraints phi(q, t) = 0 and c(q, v, t) = 0, of their rates and of their
    impulse, which is R . grad phi or R . dc/dv.  In the place of phi a constraint of velocities has
    zero, and the slopes of its rate where those of phi would be."""
    if not f.phi:
        return []
    q, v, _, t, par = state_inputs(f)
    own = constraint_rates(f)
    R = Input.vector(f.L.graph, "R", len(f.phi))
    (q_k, t_k), (q_kp1, t_kp1) = _ends_of_step(f)
    places, linear = _places_and_rates(f, f.phi)
    along = _pushed(f, R.symbols, places, linear)
    values = family("joint", "Constraints phi = 0.", (q, t), {"phi": places}, par)
    return [
        *_with_rate_slopes(f, values, places, linear),
        *family("joint_rate", "Their rates.", (q, v, t), {"phi_dot": own}, par),
        *family("reaction", "Impulse s = sum_j R_j grad phi_j.", (q, R, t), {"s": along}, par),
        *family(
            "joint_turn",
            "Products of the gradients at both ends of a step, each over the masses.",
            (q_k, q_kp1, t_k, t_kp1),
            {"turn": _turns(f, (q_k, t_k), (q_kp1, t_kp1))},
            par,
        ),
    ]


def _linear(f: Continuous, c: Any) -> Any:
    """A constraint that is linear in the velocities, whatever its form, as S v + s."""
    rest = dict.fromkeys(f.v, f.L.graph.zero)
    return dot([slope.subs(rest) for slope in gradient(c, f.v)], f.v) + c.subs(rest)


def _places_and_rates(f: Continuous, functions: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Functions that are places, zero where they are rates, and these, linear in the velocities,
    zero where they are places."""
    zero = f.L.graph.zero
    of_rates = [keeps_rate(f, e) for e in functions]
    places = [zero if rate else e for rate, e in zip(of_rates, functions, strict=True)]
    return places, [
        _linear(f, e) if rate else zero for rate, e in zip(of_rates, functions, strict=True)
    ]


def _pushed(
    f: Continuous, forces: Sequence[Any], places: list[Any], linear: list[Any]
) -> list[Any]:
    """What forces push the coordinates with: along the gradients of places, or along the slopes of
    rates."""
    along = gradient(dot(forces, places), f.q)
    if all(c is f.L.graph.zero for c in linear):
        return along
    more = gradient(dot(forces, linear), f.v)
    return [a + b for a, b in zip(along, more, strict=True)]


def _with_rate_slopes(
    f: Continuous, specs: list[KernelSpec], places: list[Any], by_rate: list[Any]
) -> list[KernelSpec]:
    """Kernels of places phi, those of their slopes (dphi/dq, dphi/dt) with (dc/dv, c at rest) of
    rates c in their place."""
    if all(c is f.L.graph.zero for c in by_rate):
        return specs
    rest = dict.fromkeys(f.v, f.L.graph.zero)
    rows = [
        [*(a + b for a, b in zip(gradient(phi, f.q), gradient(c, f.v), strict=True)),
         phi.diff(f.t) + c.subs(rest)]
        for phi, c in zip(places, by_rate, strict=True)
    ]  # fmt: skip
    return [
        replace(spec, outputs=(Output.matrix(spec.outputs[0].name, rows, len(f.q) + 1),))
        if spec.name.endswith("_jac")
        else spec
        for spec in specs
    ]


def joint_step_kernels(f: Continuous, e: StepElement, step: tuple[Input, ...]) -> list[KernelSpec]:
    """Kernels of the constraints of velocities at the quadrature points of a step, times h."""
    text = "Constraints of velocities at the points of a step, times its size; 0 of the others."
    return _rates_within("joint_step", text, "c_d", (f, e, step), [p.start.phi for p in e.points])


def slide_step_kernels(f: Continuous, e: StepElement, step: tuple[Input, ...]) -> list[KernelSpec]:
    """Kernels of the tangents that are sliding velocities, as those of constraints."""
    text = "Sliding velocities at the points of a step, times its size; 0 of positions."
    return _rates_within("slide_step", text, "s_d", (f, e, step), [p.start.tau for p in e.points])


def _rates_within(
    name: str, text: str, output: str, of: tuple[Continuous, StepElement, tuple[Input, ...]],
    functions: Sequence[Sequence[Any]],
) -> list[KernelSpec]:  # fmt: skip
    """Kernels of functions that are rates at the quadrature points of a step, times h."""
    f, e, step = of
    pairs = [(p.start, c) for p, own in zip(e.points, functions, strict=True) for c in own]
    if not any(keeps_rate(start, c) for start, c in pairs):
        return []
    moved = [e.h * c if keeps_rate(start, c) else f.L.graph.zero for start, c in pairs]
    ways = e.chain, e.spread, e.definitions
    return family(name, text, step, {output: moved}, parameters(f), *ways)


def _ends_of_step(f: Continuous) -> list[tuple[Input, Input]]:
    """Positions and times at the start and at the end of a step."""
    graph, nq = f.L.graph, len(f.q)
    return [
        (Input.vector(graph, f"q_{k}", nq), Input.vector(graph, f"t_{k}", 1)) for k in ("k", "kp1")
    ]


def _at(f: Continuous, expression: Any, place: tuple[Input, Input]) -> Any:
    """An expression at a position and a time."""
    q, t = place
    return expression.subs(dict(zip((*f.q, f.t), (*q.symbols, *t.symbols), strict=True)))


def _turns(f: Continuous, start: tuple[Input, Input], end: tuple[Input, Input]) -> list[Any]:
    """The sum_i d_i phi(start) d_i phi(end) / M_ii(start) of each constraint; coordinates of a
    quaternion are of one kind, which no masses have to compare."""
    zero, one = f.L.graph.zero, f.L.graph.one
    needed = len(f.spheres) < len(f.phi)
    matrix = mass_matrix(f) if needed else []
    masses = [_at(f, row[i], start) for i, row in enumerate(matrix)]
    slopes = [gradient(zero if keeps_rate(f, phi) else phi, f.q) for phi in f.phi]
    weights = [[one] * len(f.q) if j in f.spheres else masses for j in range(len(slopes))]
    return [
        sum_of(_at(f, s, start) * _at(f, s, end) / m for s, m in zip(row, own, strict=True))
        for row, own in zip(slopes, weights, strict=True)
    ]
