"""A motion of a model, with all that the model says of it, and its scene: the drawing of the model
along its phases."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import nan

import numpy as np

from dmoc.base.discretisation import FORMS, InputForm
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_forces import accelerations_and_forces
from dmoc.mechanics.contact_mode import mode_by_names
from dmoc.mechanics.model import Model
from dmoc.mechanics.phase_models import PhaseModels
from dmoc.motion.friction import sticks
from dmoc.motion.impact_laws import BALL, RETURNING
from dmoc.motion.scene import Scene, resampled, shapes_in
from dmoc.motion.states import PARTS, positions
from dmoc.motion.trajectory import Collision, Phase, Trajectory, last_inputs


def motion_along(
    models: PhaseModels,
    phases: Sequence[Phase],
    collisions: Sequence[Collision],
    restitution: Array,
    *,
    controls: str = "constant",
    bounds: tuple[Array, Array] | None = None,
    ignored: Sequence[str] = (),
    limits: Mapping[str, tuple[float, float]] | None = None,
    totals: Mapping[str, float] | None = None,
    cost: float = nan,
    drawn: bool = True,
) -> Trajectory:
    """The motion through phases and collisions, with coefficients of restitution, shape (nc,), not
    a number where the law of the model says it. ``bounds`` are those of inputs and coordinates,
    shapes (nu, 2) and (nq, 2), ``limits`` those of velocities by name; without them there are
    none."""
    model, kernels, form = models[0], models.kernels, FORMS[controls]
    if kernels.quantities:
        last = last_inputs(phases, form)
        phases = [
            replace(p, quantities=_quantities(models[i], p, form, last))
            for i, p in enumerate(phases)
        ]
    mu = np.array([m.friction for m in models.different])
    for k in model.contacts.lines:
        mu[:, model.contacts.directions(k)] = mu[:, [k]]
    if model.varying_friction or model.paired.any() or np.ptp(mu, axis=0).any():
        last = last_inputs(phases, form)
        phases = [
            replace(p, coefficients=_coefficients(models[i], p, form, last))
            for i, p in enumerate(phases)
        ]
    input_bounds, coordinate_bounds = bounds or (
        np.full((n, 2), (-np.inf, np.inf)) for n in (model.nu, model.nq)
    )
    return Trajectory(
        model=kernels.name,
        fingerprint=kernels.manifest.fingerprint,
        coordinates=tuple(kernels.coordinates),
        inputs=tuple(kernels.inputs),
        parameters=models.values,
        phases=tuple(phases),
        collisions=tuple(collisions),
        controls=controls,
        input_bounds=input_bounds,
        coordinate_bounds=coordinate_bounds,
        restitution={
            name: None if np.isnan(e) else float(e)
            for name, e in zip(kernels.surfaces, restitution, strict=True)
        },
        order=kernels.manifest.order,
        ignored=tuple(ignored),
        friction={
            name: None if np.isnan(of).any() or np.ptp(of) else float(of[0])
            for name, of in zip(kernels.tangents, mu.T, strict=True)
        },
        tangential_restitution={
            kernels.surfaces[j]: float(model.tangential_restitution[k])
            for j, k in model.rubs_in_hits.items()
            if model.impact_laws[j] in (RETURNING, BALL)
        },
        units=dict(kernels.manifest.units),
        scene=scene_of(models, [(p.t, p.q, p.v) for p in phases]) if drawn else None,
        limits=dict(limits or {}),
        quantities=tuple(kernels.quantities),
        totals=dict(totals or {}),
        cost=cost,
        grips=dict(kernels.manifest.grips),
    )


def _quantities(model: Model, phase: Phase, form: InputForm, last: Array) -> Array:
    """Quantities at the start, in the middle and at the end of each step of a phase, or at its
    node, with the ``last`` inputs."""
    if not phase.steps:
        mode = mode_by_names(model.contacts, phase.closed, phase.rubbing)
        node = phase.q, phase.v, last[None], phase.t
        return model.quantities(
            *node, accelerations_and_forces(model, mode, node) if model.ny else None
        )
    k, h, at = np.arange(phase.steps), np.diff(phase.t), form.starts(phase.steps)
    mode = mode_by_names(model.contacts, phase.closed, phase.rubbing)
    first, last = phase.u[at], phase.u[at + form.width]
    parts = []
    for share in np.linspace(0, 1, PARTS):
        q, v = positions(phase, k, np.full(phase.steps, share), h)
        u = first + share * (last - first)
        state = q, v, u, phase.t[:-1] + share * h
        y = accelerations_and_forces(model, mode, state) if model.ny else None
        parts.append(model.quantities(*state, y))
    return np.stack(parts, axis=1).reshape(PARTS * phase.steps, -1)


def _coefficients(model: Model, phase: Phase, form: InputForm, last: Array) -> Array:
    """Coefficients of friction of the tangents that rub at the nodes of a phase, shape (N + 1,
    rubbing): the mean of both sides where inputs jump. Where it has no steps, the ``last`` inputs
    count."""
    at = form.starts(phase.steps)
    before, after = phase.u[at + form.width], phase.u[at]
    u = (
        np.vstack([after[:1], (before[:-1] + after[1:]) / 2, before[-1:]])
        if len(at)
        else last[None]
    )
    there, shape = model.with_friction_at(phase.q, phase.v, u, phase.t), (len(phase.t), model.nt)
    kinds = [np.broadcast_to(mu, shape) for mu in (there.static_friction, there.friction)]
    columns = [
        kinds[not sticks(s)][:, model.tangent_numbers[name]] for name, s in phase.rubbing.items()
    ]
    return np.array(columns).reshape(len(columns), len(phase.t)).T.copy()


def scene_of(models: PhaseModels, phases: Iterable[tuple[Array, Array, Array]]) -> Scene | None:
    """The scene of phases, each given as times, positions and velocities at its nodes.

    None where the model has no drawing, or the drawing is nowhere: velocities at a singular mass
    matrix are not numbers, nor is the root of a negative length.
    """
    shapes = shapes_in(models.kernels.manifest.drawing)
    if not shapes:
        return None
    with np.errstate(all="ignore"):
        ways = [resampled(*phase) for phase in phases]
        values = tuple([models[i].drawing(q, t) for i, (t, q) in enumerate(ways)])
    if not all(np.isfinite(part).all() for part in values):
        return None
    return Scene(shapes, tuple([t for t, _ in ways]), values)
