"""What the file of a simulation holds, field by field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dmoc.motion.states import PARTS
from dmoc.motion.trajectory import Phase
from dmoc.results.result_file import ResultFile
from dmoc.results.schema import (
    Context,
    Either,
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
from dmoc.results.simulation import Simulation
from dmoc.results.solution_file import COLLISION, SIGN, TRAJECTORY
from dmoc.simulation.motion_record import Stretch

ROWS = ("t", "q", "p", "v", "u")
# Forces, and the names whose columns they have.
FORCES = {"normal": "closed", "tangential": "rubbing", "reaction": "joints"}


@dataclass(frozen=True)
class Together:
    """Phases whose rows are kept in one array for each field: a simulation may have thousands."""

    def write(self, value: Any, where: str, put: Put) -> Any:
        together = {name: np.concatenate([getattr(p, name) for p in value]) for name in ROWS}
        together |= {
            name: np.concatenate([np.ravel(getattr(p, name)) for p in value]) for name in FORCES
        }
        for name in ("quantities", "coefficients"):
            together[name] = np.concatenate([getattr(p, name).ravel() for p in value])
        modes = {name: [getattr(p, name) for p in value] for name in FORCES.values()}
        return PHASES.write(together | modes | {"nodes": [len(p.t) for p in value]}, where, put)

    def read(self, data: Any, where: str, context: Context) -> tuple[Phase, ...]:
        table = PHASES.read(data, where, context)
        nodes = table["nodes"].astype(int)
        ends = np.cumsum(nodes)[:-1]
        rows = {name: np.split(table[name], ends) for name in ("t", "q", "p", "v")}
        rows["u"] = np.split(table["u"], np.cumsum(nodes - 1)[:-1])
        for name, modes in FORCES.items():
            widths = np.array([len(mode) for mode in table[modes]], dtype=int)
            parts = np.split(table[name], np.cumsum(nodes * widths)[:-1])
            rows[name] = [a.reshape(n, w) for a, n, w in zip(parts, nodes, widths, strict=True)]
        own = PARTS * (nodes - 1) * (len(table["quantities"]) // (PARTS * int((nodes - 1).sum())))
        parts = np.split(table["quantities"], np.cumsum(own)[:-1])
        rows["quantities"] = [
            a.reshape(PARTS * (n - 1), -1) for a, n in zip(parts, nodes, strict=True)
        ]
        rows["coefficients"] = [np.zeros((0, 0))] * len(nodes)
        if table["coefficients"].size:
            widths = np.array([len(mode) for mode in table["rubbing"]], dtype=int)
            parts = np.split(table["coefficients"], np.cumsum(nodes * widths)[:-1])
            shapes = zip(parts, nodes, widths, strict=True)
            rows["coefficients"] = [a.reshape(n, w) for a, n, w in shapes]
        names = (*ROWS, *FORCES.values(), *FORCES, "quantities", "coefficients")
        columns = (rows.get(name, table.get(name)) for name in names)
        return tuple(
            Phase(**dict(zip(names, fields, strict=True))) for fields in zip(*columns, strict=True)
        )


def _wrong_phases(rows: dict[str, Any]) -> str | None:
    """A sentence about rows of phases that do not fit together."""
    nodes = rows["nodes"]
    if not len(nodes) or {len(rows[modes]) for modes in FORCES.values()} != {len(nodes)}:
        return "its phases have no modes"
    if nodes.sum() != len(rows["t"]) or nodes.sum() - len(nodes) != len(rows["u"]):
        return "its phases have other numbers of rows than declared"
    if len(rows["quantities"]) % (PARTS * int((nodes - 1).sum())):
        return "its phases have other numbers of quantities than declared"
    for name, modes in FORCES.items():
        widths = map(len, rows[modes])
        if sum(n * width for n, width in zip(nodes, widths, strict=True)) != len(rows[name]):
            return f"its phases have other {name} forces than declared"
    if len(rows["coefficients"]) not in (0, len(rows["tangential"])):
        return "its phases have other coefficients of friction than declared"
    return None


def _wrong(simulation: Simulation) -> str | None:
    """A sentence about parts of a simulation that do not fit together."""
    motion = simulation.trajectory
    columns = (simulation.normal.shape[1], simulation.tangential.shape[1])
    if columns != (len(motion.restitution), len(motion.friction)):
        return "its forces are those of other contacts"
    return None


PHASES = Record(
    dict,
    {
        "nodes": ShortArray(kind=Whole(2)),
        "t": Stored("N"),
        "q": Stored("N", "nq"),
        "p": Stored("N", "nq"),
        "v": Stored("N", "nq"),
        "u": Stored(None, "nu"),
        "closed": Listed(Listed(Name())),
        "rubbing": Listed(Mapped(SIGN, names=Name())),
        "normal": Stored(None),
        "tangential": Stored(None),
        "joints": Listed(Listed(Name())),
        "reaction": Stored(None),
        "quantities": Stored(None),
        "coefficients": Stored(None),
    },
    _wrong_phases,
)
_COMMON = {name: kind for name, kind in TRAJECTORY.fields.items() if name != "cost"}
MOTION = Record(TRAJECTORY.make, {**_COMMON, "phases": Together()}, TRAJECTORY.wrong)
STRETCH = Record(
    Stretch,
    {
        "name": Name(),
        "begin": Number(),
        "end": Number(),
        "friction": Either(Nothing(), SIGN),
    },
)
# One line for each field; n recorded nodes.
SIMULATION = Record(
    Simulation,
    {
        "t": Stored("n"),
        "q": Stored("n", "nq"),
        "p": Stored("n", "nq"),
        "v": Stored("n", "nq"),
        "energy": Stored("n"),
        "collisions": Listed(COLLISION),
        "contacts": Listed(STRETCH),
        "rubbing": Listed(STRETCH),
        "normal": Stored("n", None),
        "tangential": Stored("n", None),
        "trajectory": MOTION,
        "notes": Listed(Text()),
    },
    _wrong,
)
FORMAT = 9  # of the files that are written and read
FILE = ResultFile(
    "simulation",
    SIMULATION,
    "simulation_format",
    FORMAT,
    "file of a simulation",
    "simulate again",
    "Simulation.save",
    foreign={
        "solution": "the file of a solution: read it with dmoc.Solution.load, or give one that "
        "Simulation.save has written"
    },
    excess=lambda simulation, _: (
        f"the simulation has {len(simulation.collisions)} collisions, more than a file holds: "
        "write it with to_csv."
    ),
)
