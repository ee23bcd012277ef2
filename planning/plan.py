"""A plan, and the one before it as the next one takes it: its motion from a state on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dmoc.base.arguments import number
from dmoc.base.errors import MotionError
from dmoc.codegen.kernels import Array
from dmoc.guess.transfer import Piece
from dmoc.motion.states import State, state_at
from dmoc.motion.trajectory import Collision, Trajectory
from dmoc.solvers.outcome import Duals, Status


@dataclass(frozen=True, eq=False)
class Plan:
    """What is to be done from a time on.

    Attributes
    ----------
    time : float
        When it was made, in seconds from the beginning of the motion.
    phase : int
        Number of the phase that it begins in, of those of the whole motion.
    status : Status
        What became of the solve: ``solved``; ``time_limit`` and ``iteration_limit``, whose best
        motion is taken where it is feasible; or why there is none.
    message : str
    trajectory : Trajectory
        The rest of the motion, whose times begin at ``origin``.
    origin : float
        When the plan that is followed was made: ``time``, or before it where this is the last one.
    cost : float
        Of the rest of the motion.
    seconds : float
        How long planning took.
    iterations : int
    new : bool
        Whether it is a motion from the state that was measured, not the last plan going on.
    """

    time: float
    phase: int
    status: Status
    message: str
    trajectory: Trajectory
    origin: float
    cost: float
    seconds: float
    iterations: int
    new: bool

    @property
    def final_time(self) -> float:
        """When the motion ends, in seconds from its beginning."""
        return self.origin + self.trajectory.final_time

    def at(self, time: float) -> State:
        """State and inputs at a time from the beginning of the motion; at the ends, those there."""
        motion, passed = self.trajectory, number(time, "time", MotionError) - self.origin
        return state_at(motion, min(max(passed, 0.0), motion.final_time))

    def input(self, time: float) -> Array:
        """The inputs at a time from the beginning of the motion, shape (nu,)."""
        return np.asarray(self.at(time).u)

    def __repr__(self) -> str:
        goes_on = "" if self.new else f", that of {self.origin:.6g} s goes on"
        return f"<Plan of phase {self.phase} at {self.time:.6g} s: {self.message}{goes_on}>"


@dataclass
class LastPlan:
    """Where the next plan starts from: the motion of the last one and its multipliers."""

    phase: int
    motion: Trajectory
    origin: float
    begun: float  # when its first phase began
    duals: Duals | None


def next_event(last: LastPlan) -> Collision | None:
    """The next event of the last plan."""
    return next(iter(last.motion.collisions), None)


def time_left(last: LastPlan, now: float) -> float:
    """Seconds that are left of the motion."""
    return max(last.motion.final_time - (now - last.origin), 0.0)


def place_at(last: LastPlan, now: float) -> Array:
    """The planned position that is nearest in time, shape (nq,)."""
    t, q = (np.concatenate([getattr(p, name) for p in last.motion.phases]) for name in "tq")
    return np.asarray(q[int(np.argmin(np.abs(t + last.origin - now)))])


def from_phase(last: LastPlan, phase: int, now: float) -> LastPlan:
    """The last plan from one of its later phases on, which has begun by now."""
    over = phase - last.phase
    motion = last.motion
    rest = replace(motion, phases=motion.phases[over:], collisions=motion.collisions[over:])
    return LastPlan(phase, rest, last.origin, now, None)


def from_state(
    piece: Piece, begin: float, state: tuple[Array, Array], least: float, late: float
) -> Piece:
    """A piece from a time on, beginning with a state; one of which less than ``least`` is left goes
    on as the state moves for as long as it is ``late``."""
    q, v = state
    if piece.t[0] > begin:  # its event came early
        piece = _moved(piece, begin - piece.t[0])
    kept = piece.t > begin + least
    if kept.any():
        t, q, v = (
            np.concatenate([[a], b[kept]])
            for a, b in ((begin, piece.t), (q, piece.q), (v, piece.v))
        )
        return replace(piece, t=t, q=q, v=v)
    t = np.array([begin, begin + late])
    return replace(piece, t=t, q=np.array([q, q + late * v]), v=np.array([v, v]))


def _moved(piece: Piece, by: float) -> Piece:
    """A piece at other times."""
    forces = {kind: (t + by, rows) for kind, (t, rows) in piece.forces.items()}
    return replace(piece, t=piece.t + by, t_u=piece.t_u + by, forces=forces)
