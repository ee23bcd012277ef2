"""What goes wrong where a motion is run: another start, noise, pushes, delay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dmoc.base.arguments import check_known, listed, number, positive, shown, whole
from dmoc.base.errors import SimulationError
from dmoc.base.records import record
from dmoc.base.signatures import public
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model_values import by_name

SAMPLING = 1e-3
MOST_SAMPLES = 1_000_000  # minutes
WHOLE = 1e-6  # of a sample, by which a delay may be off whole ones


@public(SimulationError)
@dataclass(frozen=True)
class Disturbance:
    """What disturbs a motion in :func:`dmoc.simulate`, beside its ``parameters`` and
    ``restitution``, which replace those of the solution: masses, and places of walls that are
    parameters.

    Attributes
    ----------
    start : mapping of str to float
        By how much states differ at the start, such as ``{"x": 0.01, "x_dot": -0.1}``; what closed
        contacts and constraints do not allow of it is projected away.
    noise : mapping of str to float
        Standard deviations of the states that a feedback measures, independent in each sample.
    pushes : sequence of (float, mapping)
        Times in seconds, and impulses along coordinates by their names, in N s or N m s.
    delay : float
        Seconds between what a feedback measures and the inputs that follow, whole samples.
    sampling : float
        Seconds between samples; inputs are constant in between.
    seed : int
        Of the random numbers of the noise.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> solution = dmoc.solve(problem.but(sequence=["east"]), "ipm", starts=1)
    >>> pushed = dmoc.Disturbance(start={"x": -0.01}, pushes=[(0.2, {"y": 0.1})])
    >>> alone = dmoc.simulate(solution, disturb=pushed)
    >>> hold = dmoc.feedback(solution, Q=100)
    >>> held = dmoc.simulate(solution, disturb=pushed, feedback=hold)
    >>> [f"{abs(run.q[-1] - solution.phases[-1].q[-1]).max():.3f} m" for run in (alone, held)]
    ['0.180 m', '0.001 m']
    """

    start: Mapping[Any, float] = field(default_factory=dict)
    noise: Mapping[Any, float] = field(default_factory=dict)
    pushes: Sequence[tuple[float, Mapping[Any, float]]] = ()
    delay: float = 0.0
    sampling: float = SAMPLING
    seed: int = 0


@record(frozen=True, eq=False)
class Disturbed:
    """A disturbance in the order of states: offsets and standard deviations (2 nq,), times and
    impulses (nq,) of pushes, whole samples of delay, sampling, seed."""

    start: Array
    noise: Array
    pushes: tuple[tuple[float, Array], ...]
    delay: int
    sampling: float
    seed: int


def read_disturbance(value: Any, states: Sequence[str], end: float) -> Disturbed:
    """Read a disturbance, or a mapping of its fields, of a motion until a time."""
    if value is None:
        value = Disturbance()
    if isinstance(value, Mapping):
        fields = Disturbance.__dataclass_fields__
        for name in value:
            check_known(str(name), fields, "field", "in disturb", SimulationError)
        value = Disturbance(**{str(name): x for name, x in value.items()})
    if not isinstance(value, Disturbance):
        raise SimulationError(
            f"disturb = {shown(value)}: expected a dmoc.Disturbance or a mapping of its fields."
        )
    sampling = positive(
        value.sampling, "sampling", "expected a positive number of seconds", SimulationError
    )
    if not end / MOST_SAMPLES <= sampling < end:
        raise SimulationError(
            f"sampling = {sampling:g}: expected seconds below the final time of {end:g} s, and at "
            f"most {MOST_SAMPLES} samples."
        )
    noise = _entries(value.noise, "noise", states)
    if (noise < 0).any():
        k = int(np.argmin(noise))
        raise SimulationError(
            f"noise[{states[k]!r}] = {noise[k]:g}: expected a standard deviation that is not "
            "negative."
        )
    seconds = number(value.delay, "delay", SimulationError)
    samples = seconds / sampling
    if not 0 <= samples <= MOST_SAMPLES or abs(samples - round(samples)) > WHOLE:
        raise SimulationError(
            f"delay = {seconds:g}: expected a whole number of samples of {sampling:g} s."
        )
    start = _entries(value.start, "start", states)
    pushes = tuple(
        _push(push, states, end)
        for push in listed(value.pushes, "pushes", "pairs", SimulationError)
    )
    seed = whole(value.seed, "seed", 0, 2**63 - 1, SimulationError)
    return Disturbed(start, noise, pushes, round(samples), sampling, seed)


def _entries(values: Any, what: str, names: Sequence[str]) -> Array:
    entries = by_name(values, what, SimulationError)
    for name in entries:
        check_known(name, names, "state", f"in {what}", SimulationError)
    return np.array(
        [number(entries.get(name, 0.0), f"{what}[{name!r}]", SimulationError) for name in names]
    )


def _push(push: Any, states: Sequence[str], end: float) -> tuple[float, Array]:
    if not isinstance(push, (tuple, list)) or len(push) != 2:
        raise SimulationError(
            f"pushes has the entry {shown(push)}: expected a pair of a time and impulses by name, "
            'as (0.5, {"x": 0.1}).'
        )
    time = number(push[0], "the time of a push", SimulationError)
    if not 0 <= time < end:
        raise SimulationError(
            f"a push at {time:g} s: expected a time from 0 to the final time of {end:g} s."
        )
    return time, _entries(push[1], "pushes", states[: len(states) // 2])
