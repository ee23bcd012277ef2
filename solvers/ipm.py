"""The compiled interior-point method on the sparse program (interior_point.h)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.transcription import Transcription
from dmoc.solvers.compiled import interior_point, interior_points
from dmoc.solvers.judge import INFEASIBLE
from dmoc.solvers.kkt import LEAST_COST
from dmoc.solvers.kkt_layout import KKTLayout, kkt_layout
from dmoc.solvers.outcome import Duals, Ending, Iteration, Options, Status

if TYPE_CHECKING:
    from concurrent.futures import Executor

Report: TypeAlias = Callable[[int, float, float, float, bool], None]
STATUSES = (
    Status.SOLVED,
    Status.INFEASIBLE,
    Status.ITERATION_LIMIT,
    Status.TIME_LIMIT,
    Status.STALLED,
    Status.INTERRUPTED,
)
# First barrier parameter, relative to the cost: of a start without multipliers, and of a
# neighbouring solution.
COLD, WARM, LEAST = 1e-4, 1e-6, 1e-6
# The barrier leaves every cost too high by mu for each bound: costs shall agree with other methods
# to more digits than anyone asks for. A point this sharp that gets no sharper has met rounding
# errors, whatever is asked for.
BARRIER_END = 1e-9
# Largest ratio of a step size in two iterates: on 200 random pendulums, 1.25 took 23 iterations on
# average and 1.1 took 25; 2 took 33, and without a limit 6 failed and the others took 77.
STRETCH = 1.25


def solve_ipm(
    nlp: Transcription, x: Array, options: Options, duals: Duals | None = None, least: float = LEAST
) -> Ending:
    """Minimise from x, shape (n,), with compiled kernels; with ``duals`` x is a neighbouring
    solution. The first barrier parameter is at least ``least``."""
    return _run(nlp, x, options, duals, least=least)


def solve_starts(
    pool: Executor,
    programs: Sequence[Transcription],
    points: Sequence[Array],
    options: Options,
    hurried: Sequence[bool] = (),
) -> list[Ending]:
    """Minimise from scaled points, shape (n,) each, in as many threads of a pool as there are
    programs, which are equal. Returns the endings in their order, as many as there is time for,
    whatever the number of threads. Those that are ``hurried`` end at a limit of iterations, before
    that of the options, where they come no nearer to a motion."""
    nlp, count = programs[0], len(points)
    x = np.clip(np.reshape(points, (count, nlp.n)), nlp.lower, nlp.upper)
    y, z_lower, z_upper = np.zeros((count, nlp.n_eq + nlp.n_in)), np.zeros_like(x), np.zeros_like(x)
    status, iterations = np.full(count, -1, np.intc), np.zeros(count, np.intc)
    turn, stop = np.zeros(1, np.intc), np.zeros(1, np.intc)
    costs = np.array([nlp.program.values(at)[0] for at in x])
    size, mu = sizes(nlp, x), np.maximum(COLD * np.abs(costs), LEAST)
    in_a_hurry = np.array(hurried or [False] * count, np.intc)
    numbers, ends = (size, stretches(nlp), mu, in_a_hurry), (x, y, z_lower, z_upper)
    arrays = (*numbers, *ends, status, iterations, turn, stop)

    def each(own: Transcription) -> None:
        with np.errstate(all="ignore"):  # each thread has its own
            program, layout = own.program, kkt_layout(own)
        interior_points(
            program, layout, *arrays, **demands(options), most=options.iterations,
            seconds=options.deadline.left,
        )  # fmt: skip

    try:
        list(pool.map(each, programs))
    finally:
        stop[0] = 1
    return [
        Ending(STATUSES[s], "", at, Duals.of_rows(nlp.n_eq, rows, low - high), int(used))
        for s, at, rows, low, high, used in zip(
            status, x, y, z_lower, z_upper, iterations, strict=True
        )
        if s >= 0
    ]


def least_violation(nlp: Transcription, x: Array, options: Options, price: Array) -> Ending:
    """Minimise the sum of violations, weighted by ``price`` of shape (n_eq + n_in,), from x; solved
    where nothing is violated.

    The multipliers are those of the weighted sum: those of bounds and constraints that hold it up
    are not zero.
    """
    return _run(nlp, x, options, None, price)


def profile(nlp: Transcription, x: Array, options: Options, prepared: KKTLayout) -> dict[str, Any]:
    """Minimise from x; return counts and seconds: iterations, factorisations, seconds_kernels,
    seconds_linear, seconds."""
    x = np.clip(x, nlp.lower, nlp.upper)
    y, z_lower, z_upper = np.zeros(nlp.n_eq + nlp.n_in), np.zeros(nlp.n), np.zeros(nlp.n)
    return _minimise(
        nlp, prepared, x, y, z_lower, z_upper, options, False, None, LEAST, _listener(options)[0]
    )


def _run(
    nlp: Transcription,
    x: Array,
    options: Options,
    duals: Duals | None,
    price: Array | None = None,
    least: float = LEAST,
) -> Ending:
    x = np.clip(x, nlp.lower, nlp.upper)
    start = duals or Duals.none(nlp.n_eq, nlp.n_in, nlp.n)
    y = start.rows
    z_lower, z_upper = np.maximum(start.z, 0.0), np.maximum(-start.z, 0.0)
    report, count = _listener(options)
    try:
        prepared = kkt_layout(nlp)
        result = _minimise(
            nlp, prepared, x, y, z_lower, z_upper, options, duals is not None, price, least, report
        )
        status, iterations = STATUSES[result["status"]], result["iterations"]
    except KeyboardInterrupt:
        status, iterations = Status.INTERRUPTED, count()
    return Ending(status, "", x, Duals.of_rows(nlp.n_eq, y, z_lower - z_upper), iterations)


def _listener(options: Options) -> tuple[Report, Callable[[], int]]:
    """Return a function that hears of iterations and one that tells the last number heard."""
    last = 0

    def report(number: int, cost: float, violation: float, mu: float, restoring: bool) -> None:
        nonlocal last
        last = number
        if options.progress is not None:
            options.progress(Iteration(number, cost, violation))

    return report, lambda: last


def _minimise(
    nlp: Transcription,
    prepared: KKTLayout,
    x: Array,
    y: Array,
    z_lower: Array,
    z_upper: Array,
    options: Options,
    warm: bool,
    price: Array | None,
    least: float,
    report: Report,
) -> dict[str, Any]:
    """Call the compiled method, which works on x and the multipliers in place."""
    return interior_point(
        nlp.program,
        prepared,
        sizes(nlp, x),
        stretches(nlp),
        x,
        y,
        z_lower,
        z_upper,
        price=price,
        least_violation=price is not None,
        **demands(options),
        mu=_first_barrier(nlp, x, WARM if warm else COLD, least),
        warm=warm,
        iterations=options.iterations,
        seconds=options.deadline.left,
        report=report,
        every=options.progress is not None,
    )


def demands(options: Options) -> dict[str, Any]:
    """Tolerances of the method at an end."""
    return {
        "optimality": min(options.optimality, BARRIER_END),
        "demanded": max(options.optimality, BARRIER_END),
        "violation": options.violation,
        "least_cost": LEAST_COST,
        "infeasible": INFEASIBLE,
    }


def _first_barrier(nlp: Transcription, x: Array, share: float, least: float) -> float:
    return max(share * abs(nlp.cost(x)), least)


def sizes(nlp: Transcription, x: Array) -> Array:
    """Typical changes of unknowns (..., n), of this shape: step sizes count in their own size, all
    others in their units."""
    size, h = np.ones(x.shape), nlp.layout.index_h
    size[..., h] = x[..., h]
    return size


def stretches(nlp: Transcription) -> Array:
    """Largest ratio of an unknown in two iterates."""
    stretch = np.full(nlp.n, np.inf)
    stretch[nlp.layout.index_h] = STRETCH
    return stretch
