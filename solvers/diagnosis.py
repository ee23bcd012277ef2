"""Why a problem has no feasible point, in the user's words and units.

The motion of least violation is sought once more with the constraints priced as a user would: what the laws of motion say (momentum and
energy) costs most to violate, so that the violation moves to what the user asked for - goal, contacts, gaps, path constraints, times -
and the bounds that then carry multipliers are those that stand against it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.nlp.labels import goal_limits
from dmoc.nlp.layout import Index
from dmoc.nlp.motion import active_bounds
from dmoc.nlp.problem import Problem
from dmoc.nlp.scaling import Scale
from dmoc.nlp.transcription import Transcription
from dmoc.solvers.ipm import least_violation
from dmoc.solvers.outcome import INFEASIBLE, Options, Status

# Prices of a violation relative to that of missing the goal: of what limits the motion, and of the laws of motion.
LIMITS = 10.0
LAWS = 1000.0
# Share of the largest violation below which another is not worth a word.
NEGLIGIBLE = 1e-3
# Share of the largest multiplier below which a bound does not count as holding something up.
FAINT = 1e-5
# Share by which an estimated shortest time must exceed what is allowed to be mentioned.
CLEARLY = 1e-3
# Iterations that an explanation is worth.
ITERATIONS = 300
MOST_LINES = 4
# Units of momenta by the unit of the coordinate; of another coordinate, the unit of its momentum is not known.
MOMENTUM_UNITS = {"m": "kg m/s", "rad": "kg m2/s"}


@dataclass(frozen=True)
class Diagnosis:
    """Least violation of a problem.

    ``x`` are its unknowns, ``violation`` the largest violation relative to the size of the constraint, ``least`` whether the search for it
    ended at a minimum, ``missed`` what is not met and by how much, ``against`` the bounds and constraints that hold it there, ``times`` what the
    shortest collision times say.
    """

    x: Array
    violation: float
    least: bool
    missed: tuple[str, ...]
    against: tuple[str, ...]
    times: tuple[str, ...]

    @property
    def sentences(self) -> tuple[str, ...]:
        parts = (
            [] if self.least else ["the search for the least violation did not come to an end; the best motion that was found:"]
        )
        parts += [*self.missed[:MOST_LINES], *self.times]
        if self.against:
            parts.append("what stands against it: " + ", ".join(self.against[:MOST_LINES]))
        return tuple(parts)


def diagnose(problem: Problem, scale: Scale, x: Array, options: Options) -> Diagnosis:
    """Seek the motion of least violation from the unknowns x and say what it misses; needs compiled kernels.

    x is best an initial guess: where a solver has given up, the motion may have left what the user had in mind.
    """
    nlp = Transcription(problem, scale, minimal_times=False, goal_as_rows=True)
    limits = replace(options, iterations=min(options.iterations, ITERATIONS), progress=None)
    outcome = least_violation(nlp, nlp.scaled(x), limits, _prices(nlp))
    if outcome.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    missed = _missed(nlp, outcome.x)
    # What is violated does not hold anything up, and the barrier leaves small multipliers everywhere.
    w = np.where(nlp.inequality(outcome.x) < -INFEASIBLE, 0.0, outcome.duals.w)
    z = outcome.duals.z
    faint = FAINT * max(float(np.abs(z).max(initial=0.0)), float(w.max(initial=0.0)), 1e-300)
    w, z = (np.where(np.abs(d) > faint, d, 0.0) for d in (w, z))
    against = active_bounds(nlp, outcome.x, w, z) if outcome.status is Status.INFEASIBLE else ()
    amount = max((value for value, _ in missed), default=0.0)
    least = outcome.status in (Status.SOLVED, Status.INFEASIBLE)
    return Diagnosis(nlp.physical(outcome.x), amount, least, tuple(text for _, text in missed), against, _times(nlp, outcome.x))


def _prices(nlp: Transcription) -> Array:
    price = np.full(nlp.n_eq + nlp.n_in, LIMITS)
    for name in ("goal", "periodic"):
        price[nlp.equality_rows(name)] = 1.0
    price[nlp.n_eq + nlp.inequality_rows("goal")] = 1.0
    for name in ("momentum", "inside", "time", "arrival", "departure", "energy", "start velocity", "goal velocity"):
        price[nlp.equality_rows(name)] = LAWS
    return price


def _missed(nlp: Transcription, x: Array) -> list[tuple[float, str]]:
    """Amount and text of what is not met, the worst of each kind of constraint and coordinate or surface, largest first."""
    problem, kernels = nlp.problem, nlp.problem.kernels
    units = kernels.manifest["units"]
    c, d = nlp.equality(x), nlp.inequality(x)
    size = nlp.row_unit[1:]
    size_c, size_d = size[: nlp.n_eq], size[nlp.n_eq :]
    worst: dict[str, tuple[float, str]] = {}

    def note(kind: str, rows: Index, labels: Sequence[str], unit: str = "", inequality: bool = False) -> None:
        """Keep the most violated row of a kind; amounts are compared by size and told in units."""
        if not len(rows):
            return
        amounts = -d[rows] if inequality else np.abs(c[rows])
        k = int(np.argmax(amounts))
        if amounts[k] > max(INFEASIBLE, worst.get(kind, (0.0, ""))[0]):
            amount = amounts[k] * (size_d if inequality else size_c)[rows[k]]
            worst[kind] = (float(amounts[k]), f"{labels[k]} by {amount:.3g}{' ' + unit if unit else ''}")

    fixed = [g for g in nlp.goals if g.low == g.high]
    goals = [(row, g.name, False) for row, g in zip(nlp.equality_rows("goal"), fixed, strict=True)]
    goals += [(row, g.name, True) for row, (g, _, _) in zip(nlp.inequality_rows("goal"), goal_limits(nlp.goals), strict=True)]
    for row, name, one_sided in goals:
        note(f"goal {name}", np.array([row]), [f"the goal of {name} is missed"], _unit(name, units), one_sided)
    for i, (row, surface) in enumerate(zip(nlp.equality_rows("contact"), problem.sequence, strict=True)):
        involved = [kernels.coordinates[j] for j in kernels.manifest["surface_coordinates"][surface]]
        unit = _unit(involved[0], units) if len(involved) == 1 else ""
        note(f"contact {i}", np.array([row]), [f"collision {i + 1} misses {surface!r}"], unit)
    rows = nlp.equality_rows("momentum").reshape(-1, nlp.layout.nq)
    for j, q in enumerate(kernels.coordinates):
        labels = [f"the momentum of {q} jumps at node {k}" for k in range(len(rows))]
        note(f"momentum {q}", rows[:, j], labels, _unit(f"p_{q}", units))
    steps = nlp.equality_rows("inside").reshape(nlp.layout.total, -1)
    for j in range(steps.shape[1]):
        q = kernels.coordinates[j % nlp.layout.nq]
        note(f"inside {q}", steps[:, j], [f"the equation of motion of {q} is violated in step {k}" for k in range(len(steps))])
    for name, text in (
        ("time", "the time jumps"),
        ("arrival", "the velocity before a collision does not fit its momentum"),
        ("departure", "the velocity after a collision does not fit its momentum"),
        ("final time", "the final time is missed"),
    ):
        rows = nlp.equality_rows(name)
        note(name, rows, [text] * len(rows), "s" if name in ("time", "final time") else "")
    for row, name in zip(nlp.equality_rows("periodic"), problem.periodic, strict=True):
        note(f"periodic {name}", np.array([row]), [f"{name} at the end misses its value at the start"], _unit(name, units))
    for end in ("start", "goal"):
        for row, q in zip(nlp.equality_rows(f"{end} velocity"), kernels.coordinates, strict=False):
            text = f"the momentum of {q} at the {end} does not fit the velocity"
            note(f"{end} velocity", np.array([row]), [text], _unit(f"p_{q}", units))
    for i, row in enumerate(nlp.equality_rows("energy")):
        note(f"energy {i}", np.array([row]), [f"collision {i + 1} ({problem.sequence[i]}) violates its law of restitution"])
    for block in (b for b in nlp.inequalities if b.name != "goal"):
        if block.name == "gap":
            of = nlp.gap_constraints[1]
            for j, surface in enumerate(kernels.surfaces):
                at = np.flatnonzero(of == j)
                labels = [f"the motion passes {block.labels[i].removeprefix('gap to ')}" for i in at]
                note(f"gap {surface}", block.rows[at], labels, inequality=True)
        else:
            unit = "s" if block.name.startswith("final time") else ""
            note(block.name, block.rows, [f"{label} is violated" for label in block.labels], unit, True)
    found = sorted(worst.values(), reverse=True)
    return [(amount, text) for amount, text in found if amount > NEGLIGIBLE * found[0][0]]


def _unit(name: str, units: dict[str, str]) -> str:
    """Unit of a coordinate, velocity or momentum, "" where the model does not tell."""
    if name in units:
        return units[name]
    if name.startswith("p_"):
        return MOMENTUM_UNITS.get(units.get(name[2:], ""), "")
    return f"{units[name[:-4]]}/s" if name.endswith("_dot") and name[:-4] in units else ""


def _times(nlp: Transcription, x: Array) -> tuple[str, ...]:
    """Phases whose estimated shortest time at full input exceeds what the bounds allow."""
    problem, lay = nlp.problem, nlp.layout
    if not problem.nu or not np.isfinite(problem.input_bounds).all() or not problem.model.has_minimal_times:
        return ()
    low, high = problem.duration_bounds.T
    found = []
    for i, surface in enumerate(problem.sequence):
        allowed = min(high[i], problem.final_time_bounds[1] - (low.sum() - low[i]))
        at = x.copy()
        if i == 0:  # the start is known: a motion of least violation may have left it
            at[lay.index_q[0]] = np.clip(at[lay.index_q[0]], nlp.lower[lay.index_q[0]], nlp.upper[lay.index_q[0]])
        shortest = nlp.phase_minimal_time(at, i)
        if np.isfinite(shortest) and shortest > (1 + CLEARLY) * allowed:
            found.append(
                f"phase {i} -> {surface!r}: the shortest time at full input is about {shortest:.3g} s, the bounds allow {allowed:.3g} s"
            )
    return tuple(found)
