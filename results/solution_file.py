"""What a solution file holds, field by field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dmoc.base.arguments import is_row
from dmoc.base.discretisation import DISCRETISATIONS, FORMS, ORDERS
from dmoc.base.tolerances import SAME
from dmoc.check.verdict import Verification
from dmoc.mechanics.contact_mode import COURSES
from dmoc.motion.friction import IN_SPACE
from dmoc.motion.scene import COLUMNS, Scene, Shape, wrong_scene
from dmoc.motion.states import PARTS
from dmoc.motion.trajectory import FORCES, Collision, Phase, Trajectory
from dmoc.program.active_constraints import ActiveBound
from dmoc.program.bound_kinds import BoundKind
from dmoc.results.certificate import Certificate, wrong
from dmoc.results.notes import Note, Topic
from dmoc.results.proposal import CONTACT_STATES, Proposal, Stay
from dmoc.results.result_file import REMEDY, ResultFile
from dmoc.results.schema import (
    Choice,
    Context,
    Either,
    Flag,
    Listed,
    Mapped,
    Name,
    Nothing,
    Number,
    Put,
    Record,
    ShortArray,
    Stored,
    Text,
    Whole,
)
from dmoc.results.solution import Mesh, Minimum, Solution
from dmoc.simulation.flow import SurfaceContact
from dmoc.solvers.outcome import UNREFINED, Status

FORMAT = 25  # of the files that are written and read
INSIDE = ("q", "p", "normal", "tangential", "reaction")  # what phases have inside steps


@np.errstate(all="ignore")
def _wrong_motion(motion: Trajectory) -> str | None:
    """A sentence about parts of a motion that do not fit together."""
    if not motion.coordinates:
        return "the motion has no coordinate"
    if len(motion.collisions) != len(motion.phases) - 1:
        return f"the motion has {len(motion.phases)} phases and {len(motion.collisions)} collisions"
    for bounds in (motion.input_bounds, motion.coordinate_bounds):
        if not (bounds[:, 0] <= bounds[:, 1]).all():
            return "the motion has a lower bound above the upper one"
    if not all(low <= high for low, high in motion.limits.values()):
        return "the motion has a lower limit above the upper one"
    for i, phase in enumerate(motion.phases):
        last = 0 < i == len(motion.phases) - 1  # the motion may end with an event
        if len(phase.t) < 2 - last or not (np.diff(phase.t) > 0).all():
            return f"the times of phase {i} do not increase"
        rows = PARTS * phase.steps if phase.steps else 1
        if phase.quantities.size != rows * len(motion.quantities):
            return f"phase {i} has {len(phase.quantities)} rows of quantities"
        if len(phase.u) != len(motion.input_times(phase)):
            return f"phase {i} has {len(phase.u)} rows of inputs for {phase.steps} steps"
        nodes = (DISCRETISATIONS[motion.order].inside * phase.steps, len(motion.coordinates))
        for inside in (phase.q_inside, phase.p_inside):
            if inside.size and inside.shape != nodes:
                return f"phase {i} has {len(inside)} nodes inside {phase.steps} steps"
    for name, value in motion.parameters.items():
        if is_row(value) and len(value) != len(motion.phases):
            return f"parameter {name} has {len(value)} values for {len(motion.phases)} phases"
    if motion.scene is not None and len(motion.scene.times) != len(motion.phases):
        return f"the motion has {len(motion.phases)} phases, its scene {len(motion.scene.times)}"
    return _wrong_joints(motion)


def _wrong_joints(motion: Trajectory) -> str | None:
    """A sentence about phases and collisions of a motion that do not meet in time."""
    near = SAME * motion.final_time
    ends = [0.0, *(float(phase.t[-1]) for phase in motion.phases)]
    for i, (phase, end) in enumerate(zip(motion.phases, ends, strict=False)):
        if not abs(phase.t[0] - end) <= near:
            return f"phase {i} does not begin where the time before it ends"
    for collision, end in zip(motion.collisions, ends[1:], strict=False):
        if collision.surface and collision.surface not in motion.restitution:
            return f"surface {collision.surface!r} has no coefficient of restitution"
        if not abs(collision.time - end) <= near:
            return f"the event {collision.word!r} is not where its phase ends"
    return None


def _wrong_solution(solution: Solution) -> str | None:
    """A sentence about parts of a solution that do not fit together."""
    for name, value in solution.design.items():
        if solution.trajectory.parameters.get(name) != value:
            return f"the design {name} = {value:g} is not that of the motion"
    if solution.certificate and (
        sentence := wrong(solution.certificate, solution.cost, solution.scale)
    ):
        return sentence
    numbers = [solution.cost, solution.max_violation, solution.optimality]
    values = np.concatenate([numbers, *(a.ravel() for a in solution.multipliers.values())])
    if solution.converged and not np.isfinite(values).all():
        return (
            f"the status is '{solution.status}', and a cost, residual or multiplier is not finite"
        )
    return None


def _wrong_certificate(certificate: Certificate) -> str | None:
    """A sentence about a certificate that proves something and nothing."""
    if certificate.proved and (certificate.cost is None or certificate.radius == np.inf):
        return "the certificate has no condition that fails, and no cost or radius"
    return None


@dataclass(frozen=True)
class Kind:
    """What is limited by a bound, by its name."""

    def write(self, value: Any, where: str, put: Put) -> str:
        return str(value.name)

    def read(self, data: Any, where: str, context: Context) -> BoundKind:
        return BoundKind[NAMES_OF_KINDS.read(data, where, context)]


NAMES_OF_KINDS = Choice(tuple(kind.name for kind in BoundKind))
BOUND = Record(
    ActiveBound,
    {
        "kind": Kind(),
        "name": Text(),
        "side": Choice(("", ">=", "<=")),
        "value": Either(Nothing(), Number(special=True)),
        "places": Whole(),
    },
)
SIGN = Choice((-1, 0, 1))  # of friction


def _wrong_contacts(phase: Phase) -> str | None:
    """A sentence about contacts of a phase that do not fit together."""
    for kind, names in zip(FORCES, (phase.closed, phase.rubbing, phase.joints), strict=True):
        for rows, places in (
            (getattr(phase, kind), len(phase.t)), (phase.inside(kind), len(phase.q_inside)),
        ):  # fmt: skip
            none = {(0, 0)} if not (names and places) else set()
            if rows.shape not in {(places, len(names))} | none:
                return f"a phase has forces of shape {rows.shape} for {len(names)} contacts"
    if phase.coefficients.shape not in {(0, 0), (len(phase.t), len(phase.rubbing))}:
        return f"a phase has coefficients of friction of shape {phase.coefficients.shape}"
    return None


# One line for each field; N nodes, nq coordinates, nu inputs.
PHASE = Record(
    Phase,
    {
        "t": Stored("N"),
        "q": Stored("N", "nq"),
        "p": Stored("N", "nq"),
        "v": Stored("N", "nq"),
        "u": Stored(None, "nu"),
        "closed": Listed(Name()),
        "rubbing": Mapped(SIGN, names=Name()),
        "normal": Stored(None, None),
        "tangential": Stored(None, None),
        "joints": Listed(Name()),
        "reaction": Stored(None, None),
        **{f"{name}_inside": Stored(None, None) for name in INSIDE},
        "quantities": Stored(None, None),
        "coefficients": Stored(None, None),
    },
    _wrong_contacts,
)
COLLISION = Record(
    Collision,
    {
        "surface": Either(Choice(("",)), Name()),
        "time": Number(),
        "position": ShortArray("nq"),
        "impulse": Number(),
        "momentum_before": ShortArray("nq"),
        "momentum_after": ShortArray("nq"),
        "rate_before": Number(),
        "rate_after": Number(),
        "grazes": Flag(),
        "lands": Listed(Name()),
        "leaves": Listed(Name()),
        "friction": Mapped(SIGN, names=Name()),
        "impulses": Mapped(Number(), names=Name()),
        "tractions": Mapped(Number(), names=Name()),
        "course": Choice(tuple(dict.fromkeys((*COURSES, *IN_SPACE)))),
        "reactions": Mapped(Number(), names=Name()),
        "switch": Either(Choice(("",)), Name()),
        "off": Listed(Name()),
        "grips": Mapped(Listed(Name()), names=Name()),
    },
)
SHAPE = Record(
    Shape,
    {
        "kind": Choice(tuple(COLUMNS)),
        "name": Either(Choice(("",)), Name()),
        "start": Whole(),
        "size": Whole(2),
    },
)
SCENE = Record(
    Scene,
    {
        "shapes": Listed(SHAPE),
        "times": Listed(Stored(None)),
        "values": Listed(Stored(None, "columns")),
    },
    wrong_scene,
)
TRAJECTORY = Record(
    Trajectory,
    {
        "model": Name(),
        "fingerprint": Text(),
        "coordinates": Listed(Name(), "nq"),
        "inputs": Listed(Name(), "nu"),
        "parameters": Mapped(Either(Listed(Number()), Number()), names=Name()),
        "phases": Listed(PHASE),
        "collisions": Listed(COLLISION),
        "controls": Choice(tuple(FORMS)),
        "input_bounds": Stored("nu", 2, special=True),
        "coordinate_bounds": Stored("nq", 2, special=True),
        "restitution": Mapped(Either(Nothing(), Number(0.0, 1.0)), names=Name()),
        "order": Choice(ORDERS),
        "ignored": Listed(Name()),
        "friction": Mapped(Either(Nothing(), Number(0.0)), names=Name()),
        "tangential_restitution": Mapped(Number(-1.0, 1.0), names=Name()),
        "units": Mapped(Text(), names=Name()),
        "scene": Either(Nothing(), SCENE),
        "limits": Mapped(Listed(Number(special=True), 2), names=Name()),
        "quantities": Listed(Name()),
        "totals": Mapped(Number(special=True)),
        "cost": Number(special=True),
        "grips": Mapped(Listed(Name()), names=Name()),
    },
    _wrong_motion,
)
MESH = Record(
    Mesh,
    {
        "steps": Listed(Whole(0)),
        "cost": Number(),
        "iterations": Whole(),
        "estimate": Number(special=True),
        "simulated": Either(Nothing(), Number(special=True)),
        "difference": Either(Nothing(), Number(special=True)),
    },
)
MINIMUM = Record(
    Minimum,
    {
        "cost": Number(),
        "agreeing_starts": Whole(),
        "status": Choice((*Status, UNREFINED)),
        "steps": Listed(Whole(0)),
    },
)
CONTACT = Record(
    SurfaceContact, {"surface": Name(), "time": Number(), "jump": Number(special=True)}
)
PROPOSAL = Record(
    Proposal,
    {
        "stays": Listed(
            Record(
                Stay,
                {
                    "phase": Whole(),
                    "contact": Name(),
                    "begin": Number(),
                    "end": Number(),
                    "mode": Choice(CONTACT_STATES),
                    "cheaper": Choice(CONTACT_STATES),
                },
            )
        ),
        "sequence": Listed(Text()),
        "times": Listed(Number()),
        "contacts": Either(Nothing(), Listed(Text())),
    },
)
VERIFICATION = Record(
    Verification,
    {
        "passed": Flag(),
        "message": Text(),
        "terminal_error": Number(special=True),
        "amplification": Number(special=True),
        "max_defect": Number(special=True),
        "segment_defects": ShortArray(kind=Number(special=True)),
        "energy_error": Number(special=True),
        "impact_error": Number(special=True),
        "missed_contacts": Listed(Text()),
        "extra_contacts": Listed(Text()),
        "penetration": Number(special=True),
        "limit_excess": Number(special=True),
        "contacts": Listed(CONTACT),
        "force_error": Number(special=True),
        "path_excess": Number(special=True),
        "phase_error": Number(special=True),
        "cost_error": Number(special=True),
        "reaction_error": Number(special=True),
        "advice": Text(),
    },
)
CERTIFICATE = Record(
    Certificate,
    {
        "fails": Listed(Text()),
        "cost": Either(Nothing(), Listed(Number(), 2)),
        "radius": Number(special=True),
        "unknowns": Whole(),
        "active": Whole(),
        "slack": Number(special=True),
        "held": Listed(Text()),
        "left_out": Listed(Text()),
        "seconds": Number(),
    },
    _wrong_certificate,
)
SOLUTION = Record(
    Solution,
    {
        "status": Choice(tuple(Status)),
        "cause": Text(),
        "notes": Listed(
            Record(Note, {"topic": Choice(tuple(Topic)), "text": Text(), "after": Text()})
        ),
        "method": Name(),
        "trajectory": TRAJECTORY,
        "multipliers": Mapped(Stored(special=True)),
        "active_bounds": Listed(BOUND),
        "max_violation": Number(special=True),
        "optimality": Number(special=True),
        "iterations": Whole(),
        "seconds": Mapped(Number()),
        "unknowns": Stored(None),
        "conflicts": Listed(Text()),
        "verification": Either(Nothing(), VERIFICATION),
        "reference": Text(),
        "error_estimate": Either(Nothing(), Number(special=True)),
        "meshes": Listed(MESH),
        "duality_gap": Number(special=True),
        "scale": Mapped(Number()),
        "starts": Whole(),
        "agreeing_starts": Whole(),
        "first_start": Text(),
        "unseen_share": Either(Nothing(), Number(0.0, 1.0)),
        "others": Listed(MINIMUM),
        "proposal": Either(Nothing(), PROPOSAL),
        "design": Mapped(Number(), names=Name()),
        "periodic": Mapped(Mapped(Number(), names=Name()), names=Name()),
        "certificate": Either(Nothing(), CERTIFICATE),
    },
    _wrong_solution,
)
FILE = ResultFile(
    "solution",
    SOLUTION,
    "format",
    FORMAT,
    "solution file",
    "solve the problem again",
    "`dmoc solve --out`",
    foreign={
        "simulation_format": f"the file of a simulation: {REMEDY}",
        "batch_format": "the file of a batch, which has no motions: read it with dmoc.Batch.load, "
        "or solve with keep=True and save its solutions",
    },
)
