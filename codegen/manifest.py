"""What the numerical layers know of a model: the facts beside its generated sources."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NotRequired, TypedDict


class OutputFacts(TypedDict):
    """An output of a kernel; of a matrix that is stored by its entries, rows and columns of
    these."""

    name: str
    shape: Sequence[int]
    rows: NotRequired[Sequence[int]]
    columns: NotRequired[Sequence[int]]


class KernelFacts(TypedDict):
    """A kernel: names and sizes of its inputs, and its outputs."""

    inputs: Sequence[tuple[str, int]]
    outputs: Sequence[OutputFacts]


class FunctionFacts(TypedDict):
    """What a function of states depends on: numbers of coordinates, whether on velocities, inputs,
    the time and forces; of a path constraint with kinks the number of its smooth branches."""

    name: str
    coordinates: Sequence[int]
    velocities: bool
    inputs: bool
    time: bool
    forces: NotRequired[bool]
    terms: NotRequired[int]


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Names, sizes, parameters and sparsity patterns of a model, as
    :func:`dmoc.codegen.text.manifest` writes them; ``code`` is the digest of C sources.  What has a
    default is written where a model has it."""

    name: str
    fingerprint: str
    format: int
    key: str
    order: int
    explicit_time: bool
    title: str
    coordinates: Sequence[str]
    inputs: Sequence[str]
    units: Mapping[str, str]
    surfaces: Sequence[str]
    surface_coordinates: Mapping[str, list[int]]
    moving_surfaces: Sequence[str]
    path_constraints: Sequence[str]
    path_rows: Sequence[FunctionFacts]  # smooth ones, several of a constraint with kinks
    path_limits: Sequence[FunctionFacts]  # one of each constraint
    kink_signs: Mapping[str, int]
    hidden: Sequence[str]
    tangents: Sequence[str]
    tangent_coordinates: Mapping[str, list[int]]
    joints: Sequence[str]
    bent_joints: Sequence[str]
    drawing: Sequence[Any]
    parameters: Mapping[str, float | None]
    mass_parameters: Sequence[str]
    inputs_enter_linearly: bool
    terminal_velocity: bool
    kernels: Mapping[str, KernelFacts]
    code: str | None = None
    design: Sequence[str] = ()
    restitution: Mapping[str, str] = field(default_factory=dict)
    tangential_restitution: Mapping[str, str] = field(default_factory=dict)
    impact_laws: Mapping[str, str] = field(default_factory=dict)
    without_friction: Sequence[str] = ()
    grips: Mapping[str, Sequence[str]] = field(default_factory=dict)  # names of their places
    by_rate: Sequence[str] = ()  # those of them that are stated by their rates
    strength: Sequence[str] = ()  # grips that have one
    quantities: Sequence[FunctionFacts] = ()
    within: Mapping[str, list[int]] = field(default_factory=dict)  # coordinates of the ends
    static_friction: Sequence[str] = ()
    varying_friction: Sequence[FunctionFacts] = ()
    rate_constraints: Sequence[str] = ()
    rate_tangents: Sequence[str] = ()
    totals: Sequence[str] = ()
    hit_sums: Sequence[tuple[int, int, int]] = ()  # integral, surface, number of the hit or 0
    hit_quantities: Mapping[str, Sequence[int]] = field(default_factory=dict)  # as in hit_sums
    hit_peaks: Sequence[tuple[int, bool]] = ()
    switches: Sequence[str] = ()
    crossings: Sequence[FunctionFacts] = ()  # functions whose zeros are events, switches first
    priced: Sequence[str] = ()
    peaks: Sequence[tuple[int, bool]] = ()
    objective: bool = False
    objective_velocities: Sequence[bool] = (False, False)
    hidden_limits: Sequence[int] = ()
    hidden_of: Sequence[str] = ()
    senses: Mapping[str, int] = field(default_factory=dict)
    attitudes: Mapping[str, list[int]] = field(default_factory=dict)  # four coordinates each
    pitches: Sequence[int] = ()  # coordinates of Euler angles

    @classmethod
    def read(cls, facts: Mapping[str, Any]) -> Manifest:
        """The manifest of a text's JSON; ValueError where that has other facts."""
        try:
            return cls(**facts)
        except TypeError as error:
            raise ValueError(f"a manifest has other facts: {error}") from None
