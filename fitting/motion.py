"""A fitted motion as a solution: phases between its events, checked like any other."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.fitting.course import Arc, Course
from dmoc.fitting.data import LINEAR
from dmoc.fitting.experiment import Experiment
from dmoc.mechanics.contact_mode import names_of
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.model_trajectory import motion_along
from dmoc.mechanics.phase_models import PhaseModels
from dmoc.motion.trajectory import Collision, Phase, Trajectory
from dmoc.results.solution import Solution
from dmoc.simulation.contact_modes import borne
from dmoc.solvers.outcome import Status
from dmoc.solving.checked_solution import checked

METHOD = "fit"
# Share of a phase that is no step any more: what an event leaves of the one in which it happens.
SHORTEST = 1e-9


def solution_of(e: Experiment, course: Course) -> Solution:
    """The motion of an experiment, checked."""
    kernels = e.problem.kernels
    solution = Solution(
        status=Status.SOLVED, cause="fitted to what was measured", method=METHOD,
        trajectory=trajectory_of(e, course), multipliers={}, active_bounds=(), max_violation=0.0,
        optimality=0.0, iterations=0, seconds={}, unknowns=np.zeros(0),
        reference=kernels.reference or kernels.name, kernels=kernels,
    )  # fmt: skip
    return checked(solution)


def trajectory_of(e: Experiment, course: Course) -> Trajectory:
    """The motion of an experiment from its begin, which is at the time zero."""
    model, laws = course.laws.model, course.laws
    phases = [_phase(e, course, arc) for arc in course.arcs]
    events = [_event(e, course, i, pair) for i, pair in enumerate(pairwise(phases))]
    made = motion_along(
        PhaseModels(model.kernels, model.par), phases, events, laws.restitution,
        ignored=e.problem.ignored,
        controls="linear" if e.run.form == LINEAR else "constant",
    )  # fmt: skip
    return replace(made, order=2)


def _phase(e: Experiment, course: Course, arc: Arc) -> Phase:
    keep = np.append(arc.t[-1] - arc.t[:-1] > SHORTEST * (arc.t[-1] - arc.t[0]), True)
    arc = Arc(arc.mode, arc.t[keep], arc.y[keep], arc.held)
    model, t = course.laws.model, arc.t
    q, v = (np.ascontiguousarray(part) for part in np.split(arc.y, 2, axis=1))
    middle = (t[:-1] + t[1:]) / 2
    u = course.mesh.inputs(t if e.run.form == LINEAR else middle)
    at_nodes = course.mesh.inputs(t)
    normal, tangential, joint = _forces(course, arc, at_nodes)
    closed, rubbing = names_of(model.contacts, arc.mode)
    return Phase(
        t - (0.0 if model.kernels.manifest.explicit_time else e.run.begin), q,
        model.momentum(q, v, t), v, u, closed, rubbing,
        np.ascontiguousarray(normal[:, list(arc.mode.closed)]),
        np.ascontiguousarray(tangential[:, list(arc.mode.rubbing)]),
        joints=tuple(model.kernels.joints), reaction=joint,
    )  # fmt: skip


def _forces(course: Course, arc: Arc, u: Array) -> tuple[Array, Array, Array]:
    """Forces of contacts (n, nc), friction (n, nt) and joints (n, nj) at the nodes of a phase."""
    model, n = course.laws.model, len(arc.t)
    if arc.mode.free and not model.nj:
        return np.zeros((n, model.nc)), np.zeros((n, model.nt)), np.zeros((0, 0))
    q, v = (np.ascontiguousarray(part) for part in np.split(arc.y, 2, axis=1))
    reaction = course.laws.integrator.reaction(arc.mode, arc.y.copy(), u, arc.t)
    there = model.with_friction_at(q, v, u, arc.t)
    made = borne(there, arc.mode, reaction, q, arc.t)
    return made.normal, made.tangential, made.joint if model.nj else np.zeros((0, 0))


def _event(e: Experiment, course: Course, i: int, sides: tuple[Phase, Phase]) -> Collision:
    """The event between two phases."""
    (before, after), model, event = sides, course.laws.model, course.laws.touch.events[i]
    kernels, t = model.kernels, course.arcs[i].t[-1:]
    outcome = course.laws.impacts[i].after(before.q[-1:], before.v[-1:], t)
    impulses = dict(zip(kernels.surfaces, outcome.normal[0].tolist(), strict=True))
    tractions = dict(zip(kernels.tangents, outcome.tangential[0].tolist(), strict=True))
    surface, rates = "", (0.0, 0.0)
    if event.impact:
        surface = kernels.surfaces[event.surface]
        velocities = np.vstack([before.v[-1:], after.v[:1]])
        both = model.gap_rates(np.repeat(before.q[-1:], 2, 0), velocities, np.repeat(t, 2))
        rates = float(both[0, event.surface]), float(both[1, event.surface])
    changed = {n: s for n, s in after.rubbing.items() if before.rubbing.get(n) != s}
    return Collision(
        surface, float(before.t[-1]), before.q[-1], impulses.get(surface, 0.0), before.p[-1],
        after.p[0], *rates, lands=model.contacts.named(event.lands),
        leaves=model.contacts.named(event.leaves), off=model.contacts.named(event.off),
        friction=model.contacts.said(changed),
        impulses={name: value for name, value in impulses.items() if value},
        tractions={name: value for name, value in tractions.items() if value},
        switch="" if event.switch == NOWHERE else model.contacts.switches[event.switch],
        course=outcome.course if event.course is not None else "",
    )  # fmt: skip
