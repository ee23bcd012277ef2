"""Derivatives of the optimal cost with respect to what a problem is given, from the multipliers.

At a regular minimum the derivative of the optimal cost with respect to a quantity theta is the
partial derivative of the Lagrangian L = f + y . c - w . d - z . (x - bounds) with respect to theta
at fixed x, y, w, z (the envelope theorem; A. V. Fiacco, "Introduction to Sensitivity and Stability
Analysis in Nonlinear Programming", 1983).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TypedDict

import numpy as np

from dmoc.base.arguments import interval
from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.records import record
from dmoc.base.tolerances import TINY
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model_values import ParameterValue
from dmoc.motion.impact_laws import IMPACT_LAWS
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.extraction import multiplier_vectors, stated_as
from dmoc.program.transcription import Transcription

# Relative change of a parameter for differences of order 4: the error of the formula (1e-12) and
# that of rounding (1e-13 / 1e-3) are both small.
CHANGE = 1e-3
# Places and weights of the differences.
DIFFERENCE = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))
# The same in shares of a coefficient from 0 to 1, exact for what is quadratic in it, and for a
# coefficient 0 and what is linear in it.
BACKWARD, ONE_SIDED = ((1.0, 6.0), (0.75, -8.0), (0.5, 2.0)), ((1.0, 2.0), (0.5, -2.0))


class Sensitivities(TypedDict):
    """dJ/d(theta) by kind and name.

    Attributes
    ----------
    parameters : by parameter; a list for one that has a value for each phase
    restitution : by surface that is hit, with respect to its coefficient e, where that is a number
    surfaces : by surface, with respect to moving it outwards by one unit of its gap
    final_time : with respect to the final time or its active bound; 0 where it is free
    start, goal : by state, quantity or integral, with respect to the value or the active bound;
        its other states as given
    bounds : by input, coordinate, velocity, quantity or design parameter and side, with respect to
        the bound, as "F <="
    """

    parameters: dict[str, float | list[float]]
    restitution: dict[str, float]
    surfaces: dict[str, float]
    final_time: float
    start: dict[str, float]
    goal: dict[str, float]
    bounds: dict[str, float]


def sensitivities(problem: Problem, x: Array, multipliers: Mapping[str, Array]) -> Sensitivities:
    """Return the derivatives of the optimal cost at a minimum x, shape (n,), with its multipliers
    by kind, shape (count,) each (of the program without minimal times)."""
    problem = stated_as(problem, multipliers)
    nlp = Transcription(problem)
    y, w, z = multiplier_vectors(nlp, multipliers)
    # Solvers leave out fixed unknowns: their multipliers make the Lagrangian stationary.
    slope = nlp.lagrangian_gradient(x, y, w)
    z = np.where(nlp.lower == nlp.upper, slope, z)
    named = {**multipliers, "bounds": z}
    problem = nlp.layout.problem_at(problem, x)
    values = problem.models.values
    at = _AtMinimum(problem, nlp, x, named)
    contacts = problem.model.contacts
    stated = contacts.named(np.flatnonzero(~np.isnan(problem.restitution_values)))
    hit = [event.hit for event in problem.touch.events if event.hit != NOWHERE]
    hits = [contacts.surfaces[j] for j in hit]
    ends, force = nlp.laws.ends, np.concatenate([-y, w])
    time = sum(force[ends.final_time.numbers]) + sum(force[ends.earliest.numbers])
    return {
        "parameters": {
            name: at.parameter(values, name) for name in values if name not in problem.design
        },
        "restitution": {s: at.coefficient(stated, s) for s in dict.fromkeys(hits) if s in stated},
        "surfaces": _surfaces(nlp, y, w),
        "final_time": float(time - sum(force[ends.latest.numbers])),
        "start": _ends(nlp, x, z, 0) | at.end("start"),
        "goal": _ends(nlp, x, z, -1) | at.end("goal"),
        "bounds": _bounds(nlp, z) | dict(at.limits()),
    }


@record(frozen=True, eq=False)
class _AtMinimum:
    """Derivatives of the Lagrangian at a minimum x of a program, with its multipliers by kind, by
    numbers of the problem."""

    problem: Problem
    nlp: Transcription
    x: Array
    multipliers: Mapping[str, Array]

    def lagrangian(self, problem: Problem, **multipliers: Array) -> float:
        """The Lagrangian of a changed problem at x, with some other multipliers by kind, shape
        (count,) each."""
        return _lagrangian(problem, {**self.multipliers, **multipliers}, self.x)

    def parameter(self, values: Mapping[str, ParameterValue], name: str) -> float | list[float]:
        """Derivative by a parameter, or by its value in each phase; ``values`` are those of all
        parameters."""
        value = np.array(values[name], dtype=float)
        slopes = []
        for own in np.eye(value.size).reshape(value.size, *value.shape):
            step = CHANGE * (abs(float((own * value).sum())) or 1.0)
            changed = ({**values, name: value + k * step * own} for k, _ in DIFFERENCE)
            parts = [self.lagrangian(self.problem.unchecked(parameters=p)) for p in changed]
            slopes.append(float(np.dot(parts, [c for _, c in DIFFERENCE]) / step))
        return slopes if value.ndim else slopes[0]

    def coefficient(self, stated: Sequence[str], surface: str) -> float:
        """Derivative by a coefficient of restitution: L is linear in e > 0, or quadratic; the law
        of plastic impacts is -lam w / 2 = 0 there. Not a number where e = 0 and the law has another
        row."""
        impact = self.nlp.laws.impact
        lam = np.maximum(self.x[self.nlp.layout.impact.lam[impact.impact]], TINY)
        plain = (impact.plain & ~impact.by_rates)[impact.impact]
        law = np.asarray(self.multipliers.get("energy", np.zeros(0)))
        law = law * np.where(plain, -2 / lam, 1.0)
        contacts = self.problem.model.contacts
        values = dict(zip(contacts.surfaces, self.problem.restitution_values, strict=True))
        e, own = values[surface], {name: float(values[name]) for name in stated}
        if e == 0 and IMPACT_LAWS[self.problem.touch.contacts.impact_law(surface)].constant:
            return float("nan")
        parts = [
            weight
            * self.lagrangian(
                self.problem.unchecked(restitution={**own, surface: (e or 1.0) * share}), energy=law
            )
            for share, weight in (BACKWARD if e else ONE_SIDED)
        ]
        return float(sum(parts) / (e or 1.0))

    def moved(self, field: str, name: str, ways: tuple[float, float]) -> float:
        """Derivative by a move of both ends of a range, each by its ``ways``: L is linear in
        them."""
        stated = getattr(self.problem, field)
        low, high = interval(stated[name], name)
        parts = []
        for sign in (1.0, -1.0):
            ends = low + sign * ways[0], high + sign * ways[1]
            changed = self.problem.unchecked(**{field: {**stated, name: ends}})
            parts.append(self.lagrangian(changed))
        return (parts[0] - parts[1]) / (2 * max(ways))

    def limits(self) -> Iterator[tuple[str, float]]:
        """Derivatives by the bounds of velocities and quantities."""
        for name, ends in self.problem.limits.items():
            for sign, bound, ways in zip(("<=", ">="), ends[::-1], ((0, 1), (1, 0)), strict=True):
                if np.isfinite(bound):
                    step = CHANGE * (abs(bound) or 1.0)
                    yield (
                        f"{name} {sign}",
                        self.moved("bounds", name, (step * ways[0], step * ways[1])),
                    )

    def end(self, end: str) -> dict[str, float]:
        """Derivatives by the values of quantities and integrals at an end."""
        names = [*self.problem.kernels.quantities, *self.problem.kernels.integrals]
        fixed = [n for n in names if getattr(self.problem, end).get(n) is not None]
        return {name: self.moved(end, name, (CHANGE, CHANGE)) for name in fixed}


def _lagrangian(problem: Problem, multipliers: Mapping[str, Array], x: Array) -> float:
    nlp = Transcription(problem)
    y, w, z = multiplier_vectors(nlp, multipliers)
    r = nlp.values(x)
    bound = np.where(z > 0, nlp.lower, nlp.upper)
    active = z != 0
    return float(r[0] + r[1:] @ np.concatenate([y, -w]) - z[active] @ (x - bound)[active])


def _surfaces(nlp: Transcription, y: Array, w: Array) -> dict[str, float]:
    """g becomes g - delta: contacts c = g and gaps d = -g follow."""
    names, force = nlp.kernels.surfaces, np.concatenate([y, w])
    law, on = nlp.laws, nlp.layout.touch.surfaces
    rows = [(law.impact.contact.numbers, on[on != NOWHERE])]
    for block in (law.contact.closed, law.contact.lands, law.step.gap, law.step.gap_inside):
        rows.append((block.numbers, block.places[:, 1]))
    slopes = np.zeros(len(names))
    for numbers, surfaces in rows:
        np.subtract.at(slopes, surfaces, force[numbers])
    return dict(zip(names, slopes.tolist(), strict=True))


def _ends(nlp: Transcription, x: Array, z: Array, node: int) -> dict[str, float]:
    """Multipliers of the bounds of the states at one end, where there are bounds.

    Where momenta stand for velocities that were given, p = dL/dv(q, v, t), those of q and v follow
    from them by the chain rule.
    """
    lay, names = nlp.layout, nlp.kernels.coordinates
    at_start = node == 0
    boundary = nlp.problem.start_bounds if at_start else nlp.problem.goal_bounds
    q, p = lay.index_q[node], lay.index_p_B if at_start else lay.index_p_E
    v = lay.index_v_B if at_start else lay.index_v_E
    states: list[tuple[Callable[[str], str], Index, Array]] = [
        (str, q, z[q]),
        (momentum_name, p, z[p]),
    ]
    if boundary.by_velocity:
        at = nlp.iterate(x)
        model, t = at.problem.models[node], at.t[node]
        slopes = model.momentum_slopes(x[q], model.velocity(x[q], x[p], t), t)
        by_q, by_v = z[p] @ slopes[:, : lay.nq], z[p] @ slopes[:, lay.nq : 2 * lay.nq]
        states = [(str, q, z[q] + by_q), (velocity_name, p, by_v)]
    slopes_of = {}
    for naming, index, forces in states:
        for i, name, force in zip(index, names, forces, strict=False):
            if nlp.lower[i] > -np.inf or nlp.upper[i] < np.inf:
                slopes_of[naming(name)] = float(force)
    for name, force, bounds in zip(names, z[v], boundary.velocity, strict=False):
        if np.isfinite(bounds).any():  # others have bounds on the way
            slopes_of[velocity_name(name)] = float(force)
    return slopes_of


def _bounds(nlp: Transcription, z: Array) -> dict[str, float]:
    lay, kernels, problem = nlp.layout, nlp.problem.kernels, nlp.problem
    slopes = {}
    inner = np.vstack([lay.index_q[1:-1], lay.index_q_i.reshape(-1, lay.nq)])
    for names, index, box in (
        (kernels.inputs, lay.index_u, problem.input_bounds),
        (kernels.coordinates, inner, problem.coordinate_bounds),
        (list(problem.design), lay.index_design[None], problem.design_bounds),
    ):
        for j, name in enumerate(names):
            forces = z[index[:, j]]
            for sign, limit, value in (
                ("<=", box[j, 1], forces[forces < 0].sum()),
                (">=", box[j, 0], forces[forces > 0].sum()),
            ):
                if np.isfinite(limit):
                    slopes[f"{name} {sign}"] = float(value)
    return slopes
