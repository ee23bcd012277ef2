"""The check of motions that are free between hits without friction, by compiled code: what passes
needs no words."""

from __future__ import annotations

from functools import partial
from typing import Any, TypeAlias

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.errors import SimulationError
from dmoc.base.names import velocity_name
from dmoc.check.checked_motion import check_shapes, out_of_time
from dmoc.check.free_motion import FreeMotion as FreeMotion
from dmoc.check.limit_functions import bounds_of
from dmoc.check.verdict import PASSING, TERMINAL, Verification
from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.contacts import Contacts
from dmoc.mechanics.model_values import parameter_rows, restitution_row
from dmoc.motion.trajectory import Collision, Trajectory
from dmoc.simulation.flow import SurfaceContact

# Coordinates, surfaces, inputs, and path constraints and bounds that compiled code has room for: of
# a state, of gaps along a step, and of functions of a state.
MOST_COORDINATES, MOST_SURFACES, MOST_INPUTS, MOST_LIMITS = 30, 50, 60, 60
# Of each state that is looked at it keeps some values of each function, some ten states a step and
# function: at most so many steps times squares of the number of functions.
MOST_SQUARES = 300_000
# What was measured of a motion: errors, those of the segments, the amplification, contacts of the
# open-loop run.
Measured: TypeAlias = tuple[tuple[float, ...], Array, float, list[tuple[int, float, float]]]
# Errors in the order in which they are measured, by the names of PASSING.
ERRORS = (
    "step error",
    "energy error",
    "error of the law of impact",
    "error of the law of impact relative to its own rates",
    "error of the cost",
    "phase error",
    "excess of a path constraint",
    "segment error",
    "penetration",
    "excess of a limit",
    "error of the end",
)
# Those with which a motion passes.
MOST = np.array([{**PASSING, "error of the end": TERMINAL}[name] for name in ERRORS])


def passing(trajectory: Trajectory, kernels: Kernels, deadline: Deadline) -> Verification | None:
    """What the check finds of a motion that passes; None where it does not, or where another look
    is needed."""
    if not (is_free(kernels) and _goes_freely(trajectory, kernels)):
        return None
    check_shapes(trajectory)
    try:
        restitution = restitution_row(kernels, trajectory.restitution, SimulationError)
    except SimulationError:
        return None
    if not (restitution > 0).all():  # rests, or goes by a law
        return None
    stated = kernels, trajectory.parameters, len(trajectory.phases), SimulationError
    par = parameter_rows(*stated)
    if len(par) > 1:
        return None
    check = FreeMotion(kernels, DISCRETISATIONS[trajectory.order])
    arrays = arrays_of(trajectory, kernels, restitution)
    found = check.measured(par, arrays, trajectory.cost, partial(out_of_time, deadline))
    return None if found is None else verification_of(found, kernels)


def verification_of(found: Measured, kernels: Kernels) -> Verification | None:
    """What was measured of a motion, if it passes."""
    errors, segments, amplification, contacts = found
    if not (np.array(errors) <= MOST).all():
        return None
    measured, surfaces = dict(zip(ERRORS, errors, strict=True)), kernels.surfaces
    return Verification(
        True,
        "",
        measured["error of the end"],
        amplification,
        measured["step error"],
        segments,
        measured["energy error"],
        measured["error of the law of impact"],
        (),
        (),
        measured["penetration"],
        measured["excess of a limit"],
        tuple(SurfaceContact(surfaces[j], time, jump) for j, time, jump in contacts),
        path_excess=measured["excess of a path constraint"],
        phase_error=measured["phase error"],
        cost_error=measured["error of the cost"],
    )


def is_free(kernels: Kernels) -> bool:
    """Whether nothing of a model but surfaces without ends, friction and laws holds a motion."""
    facts = kernels.manifest
    small = len(kernels.coordinates) <= MOST_COORDINATES and len(kernels.surfaces) <= MOST_SURFACES
    small = small and len(kernels.inputs) <= MOST_INPUTS
    return (
        kernels.compiled
        and small
        and not (kernels.joints or kernels.tangents or kernels.integrals or kernels.hit_quantities)
        and not (facts.within or facts.grips or facts.crossings)
        and not any(map(kernels.has, ("objective", "rebound")))
    )


def has_room(kernels: Kernels, bounds: int, steps: int) -> bool:
    """Whether there is room for the values of all limits along so many steps: path constraints, and
    bounds of velocities."""
    limits = len(kernels.manifest.path_constraints) + bounds
    return limits <= MOST_LIMITS and steps * limits**2 <= MOST_SQUARES


def _goes_freely(trajectory: Trajectory, kernels: Kernels) -> bool:
    """Whether a motion consists of free phases and hits, within few limits of velocities."""
    free = all(phase.free and phase.steps for phase in trajectory.phases)
    known = all(c.surface in kernels.surfaces for c in trajectory.collisions)
    steps = sum(phase.steps for phase in trajectory.phases)
    few = has_room(kernels, len(bounds_of(trajectory, kernels)), steps)
    few = few and set(trajectory.limits) <= set(map(velocity_name, kernels.coordinates))
    return free and known and few and all(map(_is_hit, trajectory.collisions))


def _is_hit(c: Collision) -> bool:
    """Whether an event is one hit with an impulse, recorded once."""
    if not c.surface or c.grazes or c.lands or c.leaves or c.friction or c.tractions or c.course:
        return False
    return not c.impulses or dict(c.impulses) == {c.surface: c.impulse}


def arrays_of(trajectory: Trajectory, kernels: Kernels, restitution: Array) -> tuple[Any, ...]:
    """The arrays of R motions of one form that a compiled check takes, here of one: q, v and p (R,
    n, nq) at the nodes of all phases, their times (R, n), the first nodes of the phases and n;
    inputs at both ends of the steps (R, N, nu), positions inside (R, N places, nq); of each event
    the surface, its time and impulse (R, events, 2), the position and the momenta before and after
    it (R, events, 3, nq); bounds of coordinates and inputs (R, ..., 2), coefficients of
    restitution, the surfaces that are watched, bounds of velocities (bounds, 3) as the coordinate,
    the sign and the value, and whether inputs are constant in a step."""
    phases, events, nq = trajectory.phases, trajectory.collisions, len(trajectory.coordinates)
    q, v, p, t = (np.concatenate([getattr(phase, name) for phase in phases]) for name in "qvpt")
    begins = np.cumsum([0, *(len(phase.t) for phase in phases)])
    ends = zip(*map(trajectory.input_ends, phases), strict=True)
    u0, u1 = (np.concatenate(u, dtype=float) for u in ends)
    inside = np.concatenate([phase.q_inside.reshape(-1, nq) for phase in phases])
    surfaces = kernels.surfaces
    places = Contacts(tuple(surfaces), tuple(kernels.tangents)).surface_numbers
    hit = np.array([places[c.surface] for c in events], dtype=np.intp)
    numbers = np.array([(c.time, c.impulse) for c in events], dtype=float).reshape(-1, 2)
    states = [(c.position, c.momentum_before, c.momentum_after) for c in events]
    recorded = np.array(states, dtype=float).reshape(-1, 3, nq)
    watched = np.array([name not in trajectory.ignored for name in surfaces], dtype=np.uint8)
    stated = trajectory.coordinate_bounds, trajectory.input_bounds
    boxes, input_boxes = (np.array(box, dtype=float).reshape(-1, 2) for box in stated)
    bounds = [(b.place, b.sign, b.value) for b in bounds_of(trajectory, kernels)]
    rates, constant = np.array(bounds, dtype=float).reshape(-1, 3), not trajectory.input_form.width
    return (
        q[None], v[None], p[None], t[None], begins, u0[None], u1[None], inside[None], hit,
        numbers[None], recorded[None], boxes[None], input_boxes[None], restitution, watched, rates,
        constant,
    )  # fmt: skip
