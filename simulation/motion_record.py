"""What a simulation through lasting contacts records on its way."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import Index
from dmoc.mechanics.contact_mode import FREE, Mode, names_of
from dmoc.mechanics.model import Model
from dmoc.mechanics.phase_models import PhaseModels
from dmoc.motion.trajectory import Collision
from dmoc.simulation.impact_orders import Undecided


@dataclass(frozen=True)
class Stretch:
    """A time in which a surface stays closed (``friction`` None), or in which a tangent sticks (0)
    or slides in one direction (1 or -1)."""

    name: str
    begin: float
    end: float
    friction: int | None = None


@record(frozen=True, eq=False)
class ContactState:
    """A state after a step: time, row (q | v), and its contact and friction forces."""

    t: float
    y: Array
    normal: Array
    tangential: Array

    @property
    def rows(self) -> Rows:
        """It alone, as rows of states one after the other."""
        return self.y[None], self.normal[None], self.tangential[None]


# States (n, 2 nq) after steps in their order, with contact (n, nc) and friction forces (n, nt).
Rows = tuple[Array, Array, Array]


@dataclass(frozen=True)
class ModeChange:
    """A moment with impacts or another mode after it, or at which a switch ends a phase: the states
    on both sides, with the forces there, the mode that begins, and the switch."""

    before: ContactState
    after: ContactState
    mode: Mode
    switch: str = ""


@dataclass(eq=False)
class MotionRecord:
    """What happens on the way: collisions, moments between two modes, those at which the order of
    impacts decides, the stretches of contact and friction, of which some go on, and the times of
    events behind which parameters are others; ``last`` is the state that was reached."""

    collisions: list[Collision] = field(default_factory=list)
    stretches: list[Stretch] = field(default_factory=list)
    going: dict[tuple[str, int | None], float] = field(default_factory=dict)
    marks: list[ModeChange] = field(default_factory=list)
    undecided: list[Undecided] = field(default_factory=list)
    changes: list[float] = field(default_factory=list)
    last: ContactState | None = None

    def copied(self) -> MotionRecord:
        """A record that begins as this one, and goes on by itself."""
        own = {name: copy(value) for name, value in vars(self).items()}
        return MotionRecord(**own)

    def enter(
        self, event: tuple[float, str], before: ContactState, after: ContactState, mode: Mode
    ) -> None:
        """A phase begins behind an event, by its time and its switch, with other parameters: the
        states before and after the change, and the mode."""
        time, switch = event
        self.changes.append(time)
        self.last = after
        if switch:
            self.marks.append(ModeChange(before, after, mode, switch))

    def model_at(self, models: PhaseModels, t: Array, after: bool = True) -> Model:
        """The model with rows of parameters at times (n,), before or after what happens there."""
        phases = phases_at(np.array(self.changes), t, after)
        return models.along(np.minimum(phases, len(models.par) - 1))

    def note(self, model: Model, mode: Mode | None, t: float) -> bool:
        """A mode begins, or, without one, the simulation ends; return whether it is another
        one."""
        closed, rubbing = names_of(model.contacts, mode or FREE)
        rubs = model.contacts.said(rubbing).items()
        now: set[tuple[str, int | None]] = {*((name, None) for name in closed), *rubs}
        ended = [key for key in self.going if key not in now]
        changed = bool(ended) or not now <= set(self.going)
        for name, friction in ended:
            begin = self.going.pop((name, friction))
            if t > begin:
                self.stretches.append(Stretch(name, begin, t, friction))
        for key in now:
            self.going.setdefault(key, t)
        return changed


def phases_at(changes: Array, t: ArrayLike, after: bool) -> Index:
    """How many changes there were at times, shape (...), before or after what happens there."""
    return np.searchsorted(changes, t, "right" if after else "left")
