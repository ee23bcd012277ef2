"""Lift-offs that no input decides, and the unknown accelerations and forces y = (a | N | T | R)
before them (:mod:`dmoc.program.force_unknowns`).

A contact leaves where its normal force vanishes, if no input changes that force there
(equation :eq:`lift-off`).  Where one does, the cost says when the contact leaves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.base.records import record, value_class
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contact_forces import accelerations_and_forces
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.redundancy import places_held
from dmoc.mechanics.touch import Touch
from dmoc.problem.problem import Problem
from dmoc.problem.reach import latest_time
from dmoc.program.blocks import Bools, Index, Numbering
from dmoc.program.force_unknowns import labels_of_forces, sizes, there_are_forces

# Draws of velocities and inputs at each place, and shares of a force that are rounding errors.
DRAWS, UNCHANGED = 3, 1e-9


@value_class(frozen=True)
class Liftoff:
    """Surfaces that leave at an event where their normal forces vanish."""

    event: int
    surfaces: tuple[int, ...]


def liftoffs_of(problem: Problem) -> tuple[Liftoff, ...]:
    """Lift-offs of a problem: at events without an impact, whose time the problem does not fix, and
    whose forces the motion determines."""
    found = list[Liftoff]()
    if not problem.model.has_force_equations:  # inputs push all that touches
        return ()
    for i, event in enumerate(problem.touch.events if problem.touch.open is None else ()):
        low, high = problem.duration_bounds[i]
        if event.impact or not event.leaves or low == high:
            continue
        follows = problem.redundant[i]
        if not (follows.pressing or follows.rubbing):
            says = _say_when(problem, i) & ~problem.touch.contacts.pull
            under_load = event.off  # of an end, not where their forces vanish
            leaving = (j for j in event.leaves if says[j] and j not in under_load)
            found.append(Liftoff(i, tuple(leaving)))
    return tuple(one for one in found if one.surfaces)


def _say_when(problem: Problem, phase: int) -> Bools:
    """Surfaces whose normal forces in a phase change with no input, shape (nc,); not those that
    never press."""
    model, mode, latest = problem.models[phase], problem.touch.modes[phase], latest_time(problem)
    reach, count = problem.reach, model.nu + 1
    closed = conditions_of(model, Mode(mode.closed))
    held = places_held(model, closed, problem.start_position, reach, latest)
    q, t, _ = (np.repeat(part, DRAWS, axis=0) for part in zip(*held, strict=True))
    fast, rng = reach / latest, np.random.default_rng(0)
    v = fast * rng.standard_normal(q.shape)
    u, other = np.clip(rng.standard_normal((2, len(q), 1, model.nu)), *problem.input_bounds.T)
    # Of each draw, all inputs as they are and each of them as another one.
    u = np.where(np.eye(count, model.nu, -1, dtype=bool), other, u)
    u = u.reshape(len(q) * count, model.nu)
    state = *(np.repeat(part, count, axis=0) for part in (q, v)), u, np.repeat(t, count)
    forces = accelerations_and_forces(model, mode, state)[:, model.nq :][:, : model.nc]
    N = forces.reshape(len(q), count, model.nc)
    size = np.abs(N).max(axis=1, keepdims=True)
    pushed = np.abs(N - N[:, :1]) > UNCHANGED * size
    pressed = size > UNCHANGED * np.abs(model.mass(q, t) @ fast).max() / latest
    return np.asarray(pressed.any(axis=(0, 1)) & ~pushed.any(axis=(0, 1)))


@record(frozen=True, eq=False)
class LiftoffUnknowns:
    """The unknowns y before each event, shape (events, ny); without columns where there are no
    such lift-offs."""

    of: tuple[Liftoff, ...]
    y_lift_off: Index

    @classmethod
    def numbered(
        cls, block: Numbering, of: tuple[Liftoff, ...], names: tuple[Sequence[str], Sequence[str]],
        touch: Touch,
    ) -> LiftoffUnknowns:  # fmt: skip
        """``names`` are those of coordinates and constraints."""
        labels = labels_of_forces(*names, touch) if of else []
        there = np.zeros((len(touch.events), len(labels)), dtype=bool)
        for one in of:
            there[one.event] = there_are_forces(*names, touch)[one.event]
        y = block(
            "y_lift_off",
            there,
            lambda i, j: f"{labels[j]} before event {i + 1}",
            lambda s: sizes(s)[: len(labels)],
        )
        return cls(of, y.index)
