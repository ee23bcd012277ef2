"""Whether start and goal are states of the model: regular, in front of surfaces, not going in."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.base.tolerances import KEPT, ROUNDING, SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import is_positive, solved
from dmoc.mechanics.coefficients import check_coefficients
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contact_forces import unknown_in_impacts
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.model import Model
from dmoc.mechanics.phase_models import ENDS
from dmoc.motion.friction import rubbing_word, sticks, turned
from dmoc.problem.derived import once
from dmoc.problem.design import by_design, moves_by_design
from dmoc.problem.ranges import fixed_velocity
from dmoc.problem.reach import gap_sizes, rate_sizes

# An input without a bound, where the sign of friction is looked at.
FAR = 1e6
# Forces at the end of a phase are known to h^2 from this order on: below, its last impulse is the
# force half a step before.
LEAST_ORDER_OF_PAIRS = 4

if TYPE_CHECKING:
    from dmoc.mechanics.contact_mode import Mode
    from dmoc.problem.problem import Problem
    from dmoc.problem.ranges import Boundary


# What helps where a design is impossible at an end of its range.
AWAY = "keep the range of the design away from there"


@np.errstate(all="ignore")  # what overflows is no number, and is judged as none
def check_ends(problem: Problem) -> None:
    """Refuse ends of which nothing could come."""
    designs = {"": problem, **problem.design_ends}
    for where, at in designs.items():
        for i, model in enumerate(at.models.different):
            own = f" in phase {i}" if at.models.change else ""
            _check_kinks(model)
            _check_mass_matrix(model, at.start_position, where, own)
    _check_admissible(problem, "start", problem.start_bounds)
    _check_admissible(problem, "goal", problem.goal_bounds)
    _check_contacts(problem)


def _check_mass_matrix(model: Model, start: Array, where: str, own: str) -> None:
    """Refuse a start at which the equations of motion are not finite or their mass matrix is none;
    ``where`` says for which design, ``own`` in which phase."""
    mass, force = model.equations(start)
    values = model.values
    suspects = [
        f"{n}={values[n]:g}" for n in model.kernels.manifest.mass_parameters if values[n] <= 0
    ]
    cause = where or own + (f" ({', '.join(suspects)})" if suspects else "")
    if not (np.isfinite(mass).all() and np.isfinite(force).all()):
        raise ProblemError(
            f"the equations of motion are not finite at the start{cause}: "
            f"{AWAY if where else 'check the parameters and the start'}."
        )
    if not is_positive(mass):
        remedy = (
            "expected positive masses and lengths"
            if suspects
            else "check the parameters and the start"
        )
        remedy = AWAY if where else remedy
        raise ProblemError(
            f"the mass matrix is not positive definite at the start{cause}: {remedy}."
        )


def _check_kinks(model: Model) -> None:
    """Refuse parameters for which the functions in the place of kinks are others."""
    values = model.values
    for name, sign in model.kernels.manifest.kink_signs.items():
        if sign * values[name] < 0:
            expected = "positive" if sign > 0 else "negative"
            raise ProblemError(
                f"parameter {name} = {values[name]:g}: expected 0 or a {expected} number, the sign "
                "that its symbol is made with and on which the smooth form of abs, Max or Min in "
                "the model depends."
            )


def _check_admissible(problem: Problem, end: str, boundary: Boundary) -> None:
    """Check the gaps at a fixed position; a gap that contains a coordinate left free is the
    solver's business."""
    fixed = boundary.position[:, 0] == boundary.position[:, 1]
    _check_path(problem, end, boundary)
    if not problem.kernels.surfaces or not fixed.any():
        return
    at = np.where(fixed, boundary.position[:, 0], 0.0)
    model = problem.model
    gaps = model.barriers(at, 0.0, model.within_rounding(at))
    both = once(problem, _sizes_at_ends)
    sizes = both if np.isfinite(both).all() else gap_sizes(problem, at)
    chosen = by_design(problem, model.barrier_kernel)  # where they are is up to the solver
    for j, surface in enumerate(problem.kernels.surfaces):
        moves = end == "goal" and j in problem.model.moving
        if moves or chosen[j] or surface in problem.ignored or problem.touch.contacts.pull[j]:
            continue
        closed = j in problem.touch.modes[0 if end == "start" else -1].closed
        involved = sorted({*model.surface_coordinates[j], *model.ends.get(j, ())})
        state = ", ".join(f"{problem.kernels.coordinates[i]}={at[i]:g}" for i in involved)
        if fixed[involved].all() and not np.isfinite(sizes[j]):
            raise ProblemError(
                f"the gap to surface {surface!r} has no slope at the {end} ({state}): expected one "
                f"with a derivative there; move the {end}, or smooth the gap."
            )
        near = (SAME if closed else ROUNDING) * sizes[j]
        if fixed[involved].all() and not gaps[j] <= near:
            raise ProblemError(
                f"the {end} ({state}) lies behind surface {surface!r}, {gaps[j]:g} outside the "
                f"admissible set g <= 0: move the {end} or the surface."
            )
        if end == "start" and fixed.all() and gaps[j] >= -near and not closed:
            _check_leaving(problem, at, j, state)


def _sizes_at_ends(problem: Problem) -> Array:
    """The larger sizes of the gaps at both ends, where what is not fixed there is zero, (nc,)."""
    boxes = problem.start_bounds.position, problem.goal_bounds.position
    at = (np.where(box[:, 0] == box[:, 1], box[:, 0], 0.0) for box in boxes)
    return np.maximum(*(gap_sizes(problem, q) for q in at))


def _check_path(problem: Problem, end: str, boundary: Boundary) -> None:
    """Refuse fixed values of an end that path constraints do not allow; those on inputs are up to
    the solver, and a measured start is what it is."""
    rows = problem.kernels.manifest.path_limits
    if problem.measured or not rows:
        return
    smooth = zip(problem.kernels.manifest.path_rows, by_design(problem, "path_point"), strict=True)
    chosen = {row["name"] for row, depends in smooth if depends}
    fixed = boundary.position[:, 0] == boundary.position[:, 1]
    q = np.where(fixed, boundary.position[:, 0], 0.0)
    moves = not fixed.all() or moves_by_design(problem, boundary)
    v = None if moves else fixed_velocity(boundary, problem, q)
    t = 0.0 if end == "start" else _fixed_end_time(problem)
    at = q, np.zeros(problem.nq) if v is None else v, np.zeros(problem.nu), t or 0.0
    model = problem.models[ENDS[end]]
    kept, sizes = model.path_at(*at), model.path_terms(*at)
    for row, value, size in zip(rows, kept, sizes, strict=True):
        unknown = row["inputs"] or (row["velocities"] and v is None) or row["name"] in chosen
        unknown |= row["time"] and t is None
        if not unknown and fixed[row["coordinates"]].all() and value < -KEPT * size:
            raise ProblemError(
                f"path constraint {row['name']!r} is violated by {-value:g} at the {end}, which is "
                f"fixed: change the {end} or the constraint."
            )


def _fixed_end_time(problem: Problem) -> float | None:
    """The time at the goal, where it is fixed."""
    low, high = problem.final_time_bounds
    return float(low) if low == high else None


def _check_leaving(problem: Problem, q: Array, j: int, state: str) -> None:
    """Refuse a start on a surface with a fixed velocity that moves into it."""
    v = fixed_velocity(problem.start_bounds, problem, q)
    if v is None:
        return
    rate, slope = float(problem.model.gap_rates(q, v)[j]), problem.model.gap_slopes(q)[j]
    if rate > SAME * float(np.abs(slope) @ np.append(np.abs(v), 1.0)):
        raise ProblemError(
            f"the start ({state}) lies on surface {problem.kernels.surfaces[j]!r} and moves into "
            f"it (the gap changes by {rate:g} per second): give a velocity that leaves it, or "
            "leave the velocity free."
        )


def _check_contacts(problem: Problem) -> None:
    """Refuse what contacts that last cannot be: redundant, with a negative friction, or closed at a
    start that is off them."""
    for i, model in enumerate(problem.models.different):
        check_coefficients(model, ProblemError, f" in phase {i}" if problem.models.change else "")
    for where, at in problem.design_ends.items():
        check_coefficients(at.model, ProblemError, where.rstrip(","), AWAY)
    _check_varying_friction(problem)
    if not problem.held:
        return
    for i, mode in enumerate(problem.touch.modes):
        _check_consistent(problem, i, mode)
    _check_joined(problem, "start", problem.start_bounds)
    if not problem.explicit_time:
        _check_joined(problem, "goal", problem.goal_bounds)
    _check_start_in_contact(problem)
    for i, mode in enumerate(problem.touch.modes):
        _check_independent(problem, i, mode)


def _check_varying_friction(problem: Problem) -> None:
    """Refuse pairs of coefficients at order 2, friction that inputs within their bounds make
    negative, and impacts in which it would depend on them."""
    model, touch = problem.model, problem.touch
    names, bounds = problem.kernels.inputs, problem.input_bounds
    if model.paired.any() and problem.order < LEAST_ORDER_OF_PAIRS:
        name = problem.kernels.tangents[int(np.argmax(model.paired))]
        raise ProblemError(
            f"the friction of {name!r} is a pair (static, kinetic): the moment at which it breaks "
            f"away asks for order {LEAST_ORDER_OF_PAIRS} or more; take the kernels of "
            f"dmoc.build(system, order={LEAST_ORDER_OF_PAIRS})."
        )
    for k, row in model.varying_friction.items():
        for j, side in np.ndindex(bounds.shape) if row["inputs"] else ():
            u = np.clip(np.zeros(model.nu), *bounds.T)
            u[j] = np.clip(bounds[j, side], -FAR, FAR)
            there = model.with_friction_at(problem.start_position, u=u)
            value = float(min(there.friction[k], there.static_friction[k]))
            if value < 0:
                raise ProblemError(
                    f"the friction of {row['name']!r} is {value:g} where the input {names[j]} is "
                    f"{u[j]:g}, which its bounds allow: expected 0 or a positive number; give "
                    f"{names[j]} bounds where it is, as bounds={{{names[j]!r}: (0, 10)}}."
                )
    for i in np.flatnonzero(touch.impacts):
        rubbing = np.flatnonzero(touch.rubs_in_impact[i] | touch.passes[i])
        if unknown := unknown_in_impacts(model, rubbing.tolist()):
            raise ProblemError(
                f"{unknown}: event {i + 1} ({problem.words[i]}) is one; give it friction "
                "without them, or leave the impact out."
            )


def _check_joined(problem: Problem, end: str, boundary: Boundary) -> None:
    """Refuse a fixed state at the start or at the end that the constraints do not allow."""
    model, position = problem.model, boundary.position
    if not model.nj or not (position[:, 0] == position[:, 1]).all():
        return
    q = position[:, 0]
    off, sizes = model.joints(q), model.joint_sizes(q)
    chosen = by_design(problem, "joint")
    for name, miss, size, free in zip(problem.kernels.joints, off, sizes, chosen, strict=True):
        if not free and not abs(miss) <= KEPT * size:
            raise ProblemError(
                f"constraint {name!r} does not hold at the {end}, where it is {miss:.3g} instead "
                f"of 0: give a {end} that fits it."
            )
    v = fixed_velocity(boundary, problem, q)
    if v is None:
        return
    rates, slopes = model.joint_rates(q, v), model.joint_slopes(q)
    chosen = by_design(problem, "joint_rate")
    for name, rate, slope, free in zip(problem.kernels.joints, rates, slopes, chosen, strict=True):
        if not free and abs(rate) > _kept(problem, slope, q, v):
            raise ProblemError(
                f"constraint {name!r} does not allow the velocity at the {end}, which changes it "
                f"by {rate:.3g} per second: give velocities along it."
            )


def _check_start_in_contact(problem: Problem) -> None:
    """Refuse a fixed start off the contacts that are closed there."""
    model, mode, q = problem.model, problem.touch.modes[0], problem.start_position
    position = problem.start_bounds.position
    fixed = position[:, 0] == position[:, 1]
    v = fixed_velocity(problem.start_bounds, problem, q) if fixed.all() else None
    gaps, sizes, chosen = model.gaps(q), gap_sizes(problem, q), by_design(problem, "surface")
    within, reach = model.within(q), np.abs(model.within_slopes(q)[:, :-1]) @ problem.reach
    for j in mode.closed:
        name = problem.kernels.surfaces[j]
        if chosen[j] or not fixed[model.surface_coordinates[j]].all():
            continue
        if fixed[model.ends.get(j, [])].all() and not within[j] >= -KEPT * reach[j]:
            on = [f"{problem.kernels.coordinates[i]}={q[i]:g}" for i in model.ends[j]]
            raise ProblemError(
                f"contact {name!r} is closed at the start ({', '.join(on)}), which is beyond "
                "its end: move the start onto it."
            )
        contacts = problem.touch.contacts
        kind = "grip" if (grip := contacts.pull[j]) else "contact"
        if j not in contacts.floating and abs(gaps[j]) > SAME * sizes[j]:
            raise ProblemError(
                f"{kind} {name!r} is closed at the start, which is {-gaps[j]:g} off "
                f"{'its place' if grip else 'it'}: move the start onto it, or leave a coordinate "
                "free."
            )
        if v is not None:
            rate, slope = float(model.gap_rates(q, v)[j]), model.gap_slopes(q)[j]
            moves = "moves it off its place" if grip else "leaves or enters it"
            _check_rate(name, moves, rate, _kept(problem, slope, q, v), kind)
    if v is None:
        return
    rates = model.slide_rates(q, v)
    forward = conditions_of(model, mode).forward(rates)
    for k, state in mode.rubbing.items():
        name = problem.kernels.tangents[k]
        word, kept = rubbing_word(name, state), _kept(problem, model.tangent_slopes(q)[k], q, v)
        if sticks(state):
            _check_rate(name, "slides", float(rates[k]), kept)
        elif abs(rates[k]) <= kept:
            _check_breaking(problem, q, k, word)
        elif forward[k] < 0:
            other = rubbing_word(name, turned(state))
            raise ProblemError(
                f"contact {word!r} begins with a sliding velocity of {rates[k]:g} per second, "
                f"against its direction: say {other!r}, or give another velocity."
            )


def _check_breaking(problem: Problem, q: Array, k: int, word: str) -> None:
    """Refuse a start at rest that slides without having broken away from its static friction; what
    was measured may have just done so, and what constraints move does not stick at all."""
    there = problem.model.with_friction_at(q[None])
    static, kinetic = (np.ravel(mu[..., k])[0] for mu in (there.static_friction, there.friction))
    along = problem.model.tangent_slopes(q)[k, :-1]
    alone = float(along @ solved(problem.model.mass(q), along))
    sticks = float(along @ problem.model.responses(q, along)) > KEPT * alone
    if static > kinetic and sticks and not problem.measured:
        raise ProblemError(
            f"contact {word!r} begins at rest, where its static friction of {static:g} is above "
            f"the kinetic one of {kinetic:g} and has to give way first: let it stick at the start, "
            f"and begin the sequence with {word!r}."
        )


def _what(problem: Problem, mode: Mode) -> str:
    """Words for the conditions that hold a phase."""
    held = [problem.touch.contacts.pull[j] for j in mode.closed]
    touched, joints = bool(mode.rubbing) or not all(held), bool(problem.kernels.joints)
    kinds = ("contacts", touched), ("grips", any(held)), ("constraints", joints)
    return " and ".join(f"the {kind}" for kind, there in kinds if there)


def _kept(problem: Problem, slope: Array, q: Array, v: Array) -> float:
    """Largest rate that counts as none, of a function with a slope of shape (nq + 1,). Rounding is
    small beside what the velocities make, and beside what their energy could make, since momenta at
    rest have rounding errors too."""
    model, made = problem.model, float(rate_sizes(problem, slope[None], v)[0])
    squares = float(v @ model.mass(q) @ v) * float(slope[:-1] @ model.responses(q, slope[:-1]))
    return KEPT * made + SAME * sqrt(max(squares, 0.0))


def _check_rate(name: str, moves: str, rate: float, kept: float, kind: str = "contact") -> None:
    if abs(rate) > kept:
        keeps = "along the contact, or say how it slides" if kind == "contact" else "that keeps it"
        raise ProblemError(
            f"{kind} {name!r} is closed at the start, whose velocity {moves} ({rate:g} per "
            f"second): give a velocity {keeps}."
        )


def _names_held(problem: Problem, mode: Mode) -> list[str]:
    """Names of the contacts, rails and constraints that hold a phase."""
    contacts, tangents = problem.model.contacts, problem.kernels.tangents
    rails = [tangents[k] for k in mode.sticking if contacts.supports[k] == RAIL]
    return [*contacts.named(mode.closed), *rails, *problem.kernels.joints]


def _check_consistent(problem: Problem, phase: int, mode: Mode) -> None:
    """Refuse contacts and constraints that contradict each other, whatever the start is."""
    if wrong := problem.redundant[phase].contradictory:
        sticks = {*wrong} & {*problem.kernels.tangents}
        raise ProblemError(
            f"{_what(problem, mode)} {', '.join(_names_held(problem, mode))} of phase {phase} "
            f"contradict each other: {' and '.join(wrong)} cannot hold together with the others; "
            f"{'say how it slides, or leave one out' if sticks else 'leave one out'}."
        )


def _check_independent(problem: Problem, phase: int, mode: Mode) -> None:
    """Refuse forces of contacts that a motion depends on without determining them, and landings of
    what is closed."""
    model, follows = problem.model, problem.redundant[phase]
    names = _names_held(problem, mode)
    if follows.loose:
        raise ProblemError(
            f"the contacts {', '.join(names)} of phase {phase} press against each other with a "
            f"force that the motion does not determine, and the friction of "
            f"{' and '.join(follows.loose)} depends on it: let one of them leave, or stick."
        )
    landed = problem.touch.events[phase - 1].lands[:1] if phase else ()
    if landed and landed[0] in follows.closed:
        (name,), before = model.contacts.named(landed), problem.touch.modes[phase - 1].closed
        raise ProblemError(
            f"event {phase} ({problem.sequence[phase - 1]}): {name} touches wherever "
            f"{' and '.join(model.contacts.named(before))} do, so that it has nothing to land "
            "from: land them together, or leave it out."
        )
