"""What a driver in Python keeps of its iterations: their number, limits, the best one, whether they
get anywhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.transcription import Transcription
from dmoc.solvers.kkt import violation
from dmoc.solvers.outcome import Duals, Ending, Iteration, Options, Status

# Violation below which the cost decides which iterate is the better one, and from which Newton's
# method can be tried.
MET = 1e-6


class Stop(Exception):  # noqa: N818 - it is no error
    """Ends a run of SLSQP from its callback."""

    def __init__(self, status: Status) -> None:
        super().__init__(status.sentence)
        self.status = status


class Tally:
    """Counts iterations, keeps the limits and remembers the best iterate."""

    def __init__(self, nlp: Transcription, options: Options, x: Array) -> None:
        self.nlp, self.options = nlp, options
        self.count = 0
        self.best = x
        self._rank = self._ranked(nlp.cost(x), violation(nlp, x))

    def ending(self, descend: Callable[[], Ending], duals: Callable[[Array], Duals]) -> Ending:
        """The end of a descent; the best iterate, with its multipliers, where a limit, Ctrl-C or a
        singular system ends it. ``duals`` makes multipliers from x, shape (n,)."""
        detail = ""
        try:
            return descend()
        except Stop as stop:
            status = stop.status
        except KeyboardInterrupt:
            status = Status.INTERRUPTED
        except (np.linalg.LinAlgError, FloatingPointError, ZeroDivisionError) as error:
            status, detail = Status.STALLED, f"the equations become singular on the way: {error}"
        return Ending(status, detail, self.best, duals(self.best), self.count)

    def step(self, x: Array) -> None:
        """Count an iterate x, shape (n,), show it, and stop at a limit."""
        self.count += 1
        cost, worst = self.nlp.cost(x), violation(self.nlp, x)
        self.consider(x, cost, worst)
        if self.options.progress is not None:
            self.options.progress(Iteration(self.count, cost, worst))
        if self.count >= self.options.iterations:
            raise Stop(Status.ITERATION_LIMIT)
        self.check_time()

    def consider(self, x: Array, cost: float, worst: float) -> None:
        """Keep x if it is the best so far: of the least violation, and of the least cost where the
        violations are small."""
        rank = self._ranked(cost, worst)
        if rank <= self._rank:
            self._rank, self.best = rank, x

    @staticmethod
    def _ranked(cost: float, worst: float) -> tuple[float, float]:
        return max(worst, MET), cost

    def check_time(self) -> None:
        if self.options.deadline.passed:
            raise Stop(Status.TIME_LIMIT)


class Watch:
    """Tells whether the iterates still get somewhere: towards the constraints until these are met
    to a tolerance, or, once they nearly hold, to lower cost; ``patience`` of them in a row may get
    nowhere."""

    def __init__(self, patience: int, tolerance: float) -> None:
        self.patience, self.tolerance = patience, tolerance
        self.violation, self.cost, self.idle = np.inf, np.inf, 0

    def progressing(self, violation: float, cost: float) -> bool:
        met = violation <= MET
        nearer = violation < 0.9 * self.violation and self.violation > self.tolerance
        better = nearer or (met and cost < self.cost - 1e-7 * max(1.0, abs(cost)))
        self.violation = min(violation, self.violation)
        self.cost = min(cost, self.cost) if met else self.cost
        self.idle = 0 if better else self.idle + 1
        return self.idle < self.patience
