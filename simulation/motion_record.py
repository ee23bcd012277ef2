"""What a simulation through lasting contacts records on its way."""

from __future__ import annotations

from dataclasses import dataclass, field

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import FREE, Mode, names_of
from dmoc.mechanics.model import Model
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


@dataclass(frozen=True)
class ModeChange:
    """A moment with impacts or another mode after it: the states on both sides, with the forces
    there, and the mode that begins."""

    before: ContactState
    after: ContactState
    mode: Mode


@dataclass(eq=False)
class MotionRecord:
    """What happens on the way: collisions, moments between two modes, those at which the order of
    impacts decides, and the stretches of contact and friction, of which some go on; ``last`` is the
    state that was reached."""

    collisions: list[Collision] = field(default_factory=list)
    stretches: list[Stretch] = field(default_factory=list)
    going: dict[tuple[str, int | None], float] = field(default_factory=dict)
    marks: list[ModeChange] = field(default_factory=list)
    undecided: list[Undecided] = field(default_factory=list)
    last: ContactState | None = None

    def note(self, model: Model, mode: Mode | None, t: float) -> bool:
        """A mode begins, or, without one, the simulation ends; return whether it is another
        one."""
        closed, rubbing = names_of(model.contacts, mode or FREE)
        now: set[tuple[str, int | None]] = {*((name, None) for name in closed), *rubbing.items()}
        ended = [key for key in self.going if key not in now]
        changed = bool(ended) or not now <= set(self.going)
        for name, friction in ended:
            begin = self.going.pop((name, friction))
            if t > begin:
                self.stretches.append(Stretch(name, begin, t, friction))
        for key in now:
            self.going.setdefault(key, t)
        return changed
