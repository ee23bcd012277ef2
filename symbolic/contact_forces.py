"""Forces of contacts and constraints in quantities, and the equations that determine them.

Along a phase, accelerations a and forces y = (a | N | T | R) obey at each state, :eq:`reaction`::

    M a - F + sum N grad g - sum T grad tau - sum R grad phi = 0
    g'' = 0, tau'' = 0, phi'' = 0    of what is closed, of what sticks, and of constraints; of one
                                     of velocities c, which pushes with R dc/dv, c' = 0
    T + mu N = 0, T - mu N = 0       of what slides forth and back; of rails with 1 for N
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from dmoc.symbolic.contact_kernels import at_speeds
from dmoc.symbolic.continuous import (
    Continuous,
    constraint_rates,
    dot,
    keeps_rate,
    mass_matrix,
    own_rates,
    rates,
)
from dmoc.symbolic.graph import gradient
from dmoc.symbolic.kernel_family import contracted, family, state_inputs
from dmoc.symbolic.spec import Input, KernelSpec


def forces_input(points: Sequence[Continuous]) -> tuple[Input, ...]:
    """The input y of a kernel at some places, if there is one."""
    own = tuple(s for f in points for s in f.y)
    return (Input("y", own),) if own else ()


def residual(f: Continuous, a: Sequence[Any]) -> list[Any]:
    """dL/dq - d(dL/dv)/dt + Q at accelerations a; d/dt is the derivative along (v, a, 1)."""
    g = f.L.graph
    places = [*f.q, *f.v, f.t]
    along = Input.vector(g, "along", len(places)).symbols
    moved = gradient(contracted(dot(along, gradient(f.L, places))), f.v)
    values = dict(zip(along, (*f.v, *a, g.one), strict=True))
    return [
        slope - rate.subs(values) + force
        for slope, rate, force in zip(gradient(f.L, f.q), moved, f.Q, strict=True)
    ]


def equations_of_forces(f: Continuous, supports: Sequence[int | None]) -> list[Any]:
    """The left sides of the equations above at a state, in the order of y, and behind them those of
    all tangents that slide forth and of all that slide back; ``supports`` are the surfaces of the
    tangents, None of rails."""
    n, kept = len(f.q), (*rates(f, f.g), *own_rates(f, f.tau), *constraint_rates(f))
    a, forces = f.y[:n], f.y[n:]
    signs = [-1] * len(f.g) + [1] * (len(f.tau) + len(f.phi))
    rows = zip(signs, forces, (*f.g, *f.tau, *f.phi), strict=True)
    terms = [(s * force * p, keeps_rate(f, p)) for s, force, p in rows]
    pushed = gradient(f.L.graph.sum((term, 1.0) for term, by_rate in terms if not by_rate), f.q)
    if any(by_rate for _, by_rate in terms):
        more = gradient(f.L.graph.sum((term, 1.0) for term, by_rate in terms if by_rate), f.v)
        pushed = [p + c for p, c in zip(pushed, more, strict=True)]
    bent = [dot(gradient(r, f.q), f.v) + dot(gradient(r, f.v), a) + r.diff(f.t) for r in kept]
    T, one = forces[len(f.g) : len(f.g) + len(f.tau)], f.L.graph.one
    presses = [one if j is None else forces[j] for j in supports]
    slides = [
        a + s * mu * N
        for s in (1, -1)
        for a, mu, N in zip(
            T, at_speeds(f, f.mu, [s * r for r in own_rates(f, f.tau)]), presses, strict=True
        )
    ]
    return [*(r + p for r, p in zip(residual(f, a), pushed, strict=True)), *bent, *slides]


def _unpushed(f: Continuous) -> bool:
    """Whether there is a surface whose gap has no coordinate in common, by masses and by what
    touches and holds, with what inputs act on."""
    n, inputs = len(f.q), {*f.u}
    masses = mass_matrix(f)
    together = [{i, j} for i in range(n) for j in range(i) if masses[i][j] is not f.L.graph.zero]
    together += [_coordinates(f, e) for e in (*f.g, *f.tau, *f.phi)]
    pushed = {i for i, force in enumerate(f.Q) if force.free_symbols & inputs}
    for mu, tau in zip((*f.mu, *f.mu_s), (*f.tau, *f.tau), strict=True):
        pushed |= _coordinates(f, tau) if mu.free_symbols & inputs else set()
    for _ in range(n):
        for group in together:
            pushed |= group if group & pushed else set()
    return any(not _coordinates(f, gap) & pushed for gap in f.g)


def _coordinates(f: Continuous, e: Any) -> set[int]:
    """Coordinates that an expression contains, also by their velocities."""
    return {i for i, (q, v) in enumerate(zip(f.q, f.v, strict=True)) if {q, v} & e.free_symbols}


def forces_at_events(f: Continuous, supports: Sequence[int | None]) -> list[KernelSpec]:
    """The kernel of these equations at a state, of a model that has a surface whose normal force no
    input may change, and whose quantities contain no forces: the law of lift-offs has them too."""
    if f.y or not _unpushed(f):
        return []
    count = len(f.q) + len(f.g) + len(f.tau) + len(f.phi)
    y = Input.vector(f.L.graph, "y", count)
    equations = equations_of_forces(replace(f, y=tuple(y.symbols)), supports)
    *state, par = state_inputs(f)
    text = "Equations of the accelerations and forces e = 0 at a state."
    return family("forces_point", text, (*state, y), {"e": equations}, par)
