"""Simulation forward in time: of a model from a state, and of a solution once more with its
inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from dmoc.base.arguments import shown
from dmoc.base.errors import SimulationError
from dmoc.base.signatures import public
from dmoc.base.table import Shown, Table
from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Kernels
from dmoc.control.controller import Steers, controlled
from dmoc.control.disturbance import Disturbance
from dmoc.motion.friction import friction_word
from dmoc.motion.scene import Scene
from dmoc.motion.trajectory import Array, Collision, Trajectory
from dmoc.results.motion_result import MotionResult
from dmoc.results.result_file import Saved
from dmoc.results.solution import Solution
from dmoc.results.solution_model import check_same_model, kernels_for
from dmoc.simulation import forward
from dmoc.simulation.motion_record import Stretch
from dmoc.simulation.recording import motion_of
from dmoc.simulation.replay import replay

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem

MOST_EVENTS = 12  # collisions and stretches of contact that a table lists


@public(SimulationError)
@dataclass(frozen=True, eq=False)
class Simulation(Shown, MotionResult, Saved):
    """Result of :func:`dmoc.simulate`.

    Attributes
    ----------
    t : array of shape (n,)
        Times of the recorded nodes in seconds.
    q, p, v : arrays of shape (n, nq)
        Coordinates, momenta and velocities.
    energy : array of shape (n,)
        E = v . p - L at the recorded nodes.
    collisions : tuple of Collision
        In the order in which they happened.
    contacts, rubbing : tuples of Stretch
        When surfaces stayed closed, and when tangents stuck or slid, in the order in which that
        ended.
    normal, tangential : arrays of shape (n, nc), (n, nt)
        Contact forces N and friction forces T at the recorded nodes, in newton, with the inputs of
        the step that ends there: -N grad g and T grad tau act on the coordinates.
    trajectory : Trajectory
        The motion as phases between its events, like that of a solution, with the scene of a model
        that has a drawing.
    notes : tuple of str
        What the laws of contact do not determine, in sentences: contact forces of which others
        hold the same motion, hits at one moment of which the order decides.

    Examples
    --------
    >>> import dmoc
    >>> motion = dmoc.simulate(
    ...     dmoc.load("puck_table"), {"x": 0.3, "y": 0.2}, {"x": 1.5}, step_size=0.1, steps=10
    ... )
    >>> motion.q.shape, len(motion.collisions)
    ((11, 2), 1)
    """

    file_module = "dmoc.results.simulation_file"

    t: Array
    q: Array
    p: Array
    v: Array
    energy: Array
    collisions: tuple[Collision, ...]
    contacts: tuple[Stretch, ...]
    rubbing: tuple[Stretch, ...]
    normal: Array
    tangential: Array
    trajectory: Trajectory
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        hits = f"{len(self.collisions)} collisions, {len(self.t)} nodes"
        return f"<Simulation of {self.trajectory.model}: {self.final_time:.6g} s, {hits}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        title = f"simulation of {self.trajectory.model}"
        return Table(tuple(_rows(self)), notes=self.notes, title=title)

    @property
    def scene(self) -> Scene | None:
        """The drawing of the model along the motion; None where the model has none, and where
        there are more than 1000 events."""
        return self.trajectory.scene


def _rows(s: Simulation) -> Iterator[tuple[str, str]]:
    """What was simulated and what happened."""
    yield "final time", f"{s.final_time:.6g} s in {len(s.t) - 1} recorded steps"
    for c in s.collisions[:MOST_EVENTS]:
        impulse = f", impulse {c.impulse:.6g}" if c.impulse else ""
        if any(c.tractions.values()):
            least = SAME * c.impulse
            values = (T if abs(T) > least else 0 for T in c.tractions.values())
            along = " and ".join(f"{T:.6g}" for T in values)
            impulse += f", along it {along}"
        what = f"event {c.switch}" if c.switch else f"collision {c.surface}"
        yield what, f"at {c.time:.6g} s{impulse}"
    more = len(s.collisions) - MOST_EVENTS
    if more > 0:
        yield "", f"and {more} more collisions"
    stretches = sorted((*s.contacts, *s.rubbing), key=lambda x: (x.begin, x.end))
    for stretch in stretches[:MOST_EVENTS]:
        state = "closed" if stretch.friction is None else friction_word(stretch.friction)
        yield f"{stretch.name} {state}", f"from {stretch.begin:.6g} to {stretch.end:.6g} s"
    if len(stretches) > MOST_EVENTS:
        yield "", f"and {len(stretches) - MOST_EVENTS} more stretches of contact"
    low, high = float(s.energy.min()), float(s.energy.max())
    yield "energy", f"between {low:.6g} and {high:.6g}, {s.energy[-1]:.6g} at the end"


@public(SimulationError)
def simulate(
    kernels: Kernels | MechanicalSystem | Solution,
    position: Mapping[str, float] | ArrayLike | None = None,
    velocity: Mapping[str, float] | ArrayLike | None = None,
    *,
    step_size: float | None = None,
    steps: int | None = None,
    inputs: ArrayLike | Callable[[float], ArrayLike] | None = None,
    parameters: Mapping[str, float] | None = None,
    restitution: float | Mapping[str, float] | None = None,
    grips: Mapping[str, Any] | None = None,
    every: int = 1,
    model: Kernels | None = None,
    feedback: Steers | None = None,
    disturb: Disturbance | Mapping[str, Any] | None = None,
) -> Simulation:
    """Simulate a system through its collisions, lasting contacts and friction; or a solution, open
    loop, from its start and with its inputs.

    Each step solves r_minus(q_k, q_{k+1}) + p_k = 0.  A step that crosses a surface is split at the
    collision: first (q_tau, tau) from the momentum equation and g(q_tau) = 0, then (q_{k+1}, lam)
    from the balance of energy and the conservation of tangential momentum.  Several collisions in
    one step are handled one after the other; impacts on several surfaces at the same moment too,
    see ``dmoc.simulation.simultaneous_impacts.simultaneous``.  Ctrl-C ends a run, which leaves the
    interpreter to other threads.

    Where the motion stays on a surface, or bounces that accumulate come to rest on it, and in
    models with friction from the start on, it goes on by the continuous equations of one mode of
    contact and friction after the other, see ``dmoc.simulation.contact_motion``.  One hit with
    friction obeys Poisson's law of impact.

    The motion of a solution is found anew: its collisions are those that its inputs lead to.  The
    steps of the simulation take the means of the inputs over them, so that their impulses are
    kept.

    Parameters
    ----------
    kernels : Kernels, MechanicalSystem or Solution
    position, velocity : arrays of shape (nq,) or mappings by name
        Initial state; velocities default to rest, and are named as in ``start`` of a problem,
        ``{"x_dot": 1.0}``, or by their coordinates.  A solution has its own unless they are given,
        as for inputs, parameters and coefficients of restitution, which are 0 of surfaces that it
        lands on and never hits.
    step_size : float
        h in seconds.  A solution is simulated for its final time, with a quarter of its smallest
        step, in at most 32 times as many steps as it has, or with one of ``step_size`` and
        ``steps`` where it is given.
    steps : int
    inputs : array of shape (steps, nu) or (nu,), or function of the time, optional
        Inputs of each step; zero by default.  A function returns nu numbers and is evaluated in the
        middle of each step.
    parameters : mapping, optional
        Values that replace the model's, or the solution's.
    restitution : float or mapping, optional
        Coefficient e in [0, 1] of all surfaces, or by surface (others are elastic).
    grips : mapping, optional
        Pairs of times in seconds from and to which grips are closed, by name, None for the end:
        ``{"hand": [(0.4, 1.2)]}``.  A grip with one place closes where this vanishes, from then on;
        one with several, or with a rate alone, closes at that time, and moves what is within a
        hundredth of their sizes there.  A solution has its own times.
    every : int, optional
        Record every so many steps.
    model : Kernels, optional
        For a solution from a file whose model is not shipped.
    feedback : Feedback or Planner, optional
        That of a solution, from :func:`dmoc.feedback` or :class:`dmoc.Planner`: it measures the
        state at each sample, feels hits and contacts, and decides on the inputs until the next
        sample, within their bounds.
    disturb : Disturbance or mapping, optional
        Other starts, noise, pushes, a delay, and the sampling: what disturbs a solution, with a
        feedback or open loop, see :class:`~dmoc.control.disturbance.Disturbance`.  With one of
        these two the simulation has a step for each sample, of 1 ms unless it says otherwise, and
        goes by the continuous equations from the start on.

    Returns
    -------
    Simulation

    Raises
    ------
    SimulationError
        If an argument does not fit, a step has no solution, the mass matrix becomes singular,
        collisions accumulate without coming to rest (Zeno), or no state of contact, or no impact,
        obeys the law of Coulomb.

    Examples
    --------
    A pendulum without inputs that bounces off a wall keeps its energy:

    >>> import dmoc
    >>> motion = dmoc.simulate(
    ...     dmoc.load("bouncing_pendulum"), {"theta": 1.0}, step_size=0.01, steps=300
    ... )
    >>> [collision.surface for collision in motion.collisions]
    ['wall', 'wall', 'wall']
    >>> bool(abs(motion.energy - motion.energy[0]).max() < 1e-3)
    True
    """
    keywords = locals()
    names = "position", "velocity", "inputs", "parameters", "restitution", "grips"
    changes = {name: keywords[name] for name in names if keywords[name] is not None}
    mesh = {"step_size": step_size, "steps": steps}
    alone = feedback is None and disturb is None
    if isinstance(kernels, Solution):
        motion, system = kernels.trajectory, kernels_for(kernels, model, SimulationError)
        check_same_model(kernels, system)
        if alone:
            stated = replay(motion, system, changes, step_size, steps)
        else:
            stated = controlled(motion, system, changes, mesh, feedback, disturb)
    else:
        system, stated = _built(kernels, model, alone), {"position": None, **mesh, **changes}
    run = forward.simulate(system, **stated, every=every)
    motion = motion_of(run)
    crossed = (c for c in motion.collisions if c.switch)
    collisions = tuple(sorted((*run.collisions, *crossed), key=lambda c: c.time))
    return Simulation(
        run.t, run.q, run.p, run.v, run.energy, collisions, run.contacts, run.rubbing,
        run.normal, run.tangential, motion, run.notes,
    )  # fmt: skip


def _built(system: Any, model: Any, alone: bool) -> Any:
    """The kernels of a system; what is none, as it is."""
    if not alone:
        raise SimulationError(
            f"feedback and disturb go with a solution, not with {shown(system)}: expected one "
            "from dmoc.solve(problem)."
        )
    if model is not None:
        raise SimulationError(
            f"model = {shown(model)}: expected none beside kernels; it goes with a solution."
        )
    if isinstance(system, Kernels):
        return system
    from dmoc.codegen.system_kernels import build
    from dmoc.symbolic.system import MechanicalSystem

    return build(system) if isinstance(system, MechanicalSystem) else system
