"""dmoc.fit: parameters of a model from measured motions, through hits; and beforehand, what these
can tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dmoc.base.arguments import choice, listed, names, shown
from dmoc.base.errors import FitError
from dmoc.base.signatures import public
from dmoc.base.table import Shown, Table
from dmoc.codegen.kernels import Array
from dmoc.fitting.data import HELD, LINEAR, Run, runs_of
from dmoc.fitting.estimation import estimated, pushed
from dmoc.fitting.experiment import Experiment
from dmoc.fitting.hits import experiment_of
from dmoc.fitting.identification import identified
from dmoc.fitting.noise import assumed_sigma
from dmoc.fitting.outcome import check_starts, fit_of
from dmoc.fitting.parameters import fixed_start, parameters_of
from dmoc.fitting.regression import LOSSES, Regression
from dmoc.fitting.result import Fit
from dmoc.fitting.words import best_words, by_laws, in_order, in_order_of_sight, touch_of_words
from dmoc.mechanics.phase_models import check_one_for_all
from dmoc.problem.problem import Problem

# Orders of events that are tried, one after the other.
MOST_ORDERS = 3


@public(FitError)
def fit(
    problem: Problem,
    runs: Any,
    parameters: Mapping[Any, Any],
    *,
    start: Mapping[Any, Any] | Sequence[Mapping[Any, Any] | None] | None = None,
    sigma: Mapping[str, float | str] | None = None,
    own: Sequence[str] = (),
    inputs: str = "held",
    loss: str = "linear",
    sequences: Sequence[Sequence[str]] | None = None,
) -> Fit:
    """Fit parameters to measured motions, through the hits of a word.

    Unknowns theta, and free starts, minimise

    .. math:: \\frac12 \\sum_i \\rho\\Bigl(\\frac{y_i - h(q(t_i), \\dot q(t_i), u(t_i);
       \\theta)}{\\sigma_i}\\Bigr)

    (:eq:`fit`) where the motion follows the continuous equations of one mode after the other, each
    until its event happens, and the laws of impact there: times of hits move with the parameters.
    A fit that does not get near begins anew from windows of the runs with a start each.

    Parameters
    ----------
    problem : Problem
        The model, the sequence of events, contacts at the start, and values of everything that is
        not fitted.  Its goal, bounds and steps do not matter.
    runs : path, frame, mapping, Simulation or Solution, or a sequence of these
        A table with a column ``t`` in seconds, in order, and columns of coordinates, velocities
        (``x_dot``), momenta (``p_x``), quantities, and inputs, by name; NaN or nothing where
        nothing was measured.  A column ``event`` has words of the sequence at the times at which
        they were seen.  The first row is where the motion begins.  A table of hits has columns
        such as ``x_dot before`` and ``x_dot after``, a row for each hit of the sequence's one word.
    parameters : mapping
        Ranges (lower, upper) by name, None for no bound: parameters of the model; "e", the
        coefficient of restitution of all surfaces, or "e:floor" of one; "bias:y", "gain:y" and
        "delay:y" of what measures y, which tells gain y(t - delay) + bias.  Fits begin with the
        problem's values.
    start : mapping, or a sequence of them, one for each run, optional
        States at the begin of each run: numbers are known, ranges bounded, None free.  What is left
        out is as in ``start`` of the problem, where velocities that are not given are zero.
    sigma : mapping, optional
        Standard deviations by column: a number, or the name of a column that has one in each row;
        "event" of times in seconds.  Those that are left out are estimated from the residuals.
    own : sequence of str, optional
        Parameters that each run has of its own.
    inputs : {"held", "linear"}
        What inputs are between their samples.  Those that are not measured are zero.
    loss : {"linear", "huber"}
        Least squares, or Huber's loss, for which outliers count little.
    sequences : sequence of sequences of str, optional
        The word of each run.  Without it all have the problem's; where that has none, the words
        that fit are looked for.

    Returns
    -------
    Fit

    Raises
    ------
    FitError
        If a column names nothing, times go back, a standard deviation is not positive, there are
        fewer values than unknowns, a run ends before its word, the data contradict a start that is
        given, or no motion can be followed from the first values.

    References
    ----------
    .. [1] H. G. Bock, *Randwertproblemmethoden zur Parameteridentifizierung in Systemen
       nichtlinearer Differentialgleichungen*, Bonner Mathematische Schriften 183 (1987).

    Examples
    --------
    Gravity and restitution of a ball from its heights, measured every 10 ms:

    >>> import dmoc, sympy as sp
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> y, (m, g) = dynamicsymbols("y"), sp.symbols("m g")
    >>> ball = dmoc.MechanicalSystem(
    ...     "ball", [y], m * y.diff() ** 2 / 2 - m * g * y, {m: 1, g: 9.5},
    ...     surfaces={"floor": y >= 0},
    ... )
    >>> problem = dmoc.Problem(ball, start={"y": 1.0}, sequence=["floor"])
    >>> seen = dmoc.simulate(
    ...     problem.kernels, {"y": 1.0}, parameters={"g": 9.81}, restitution=0.8,
    ...     step_size=0.01, steps=100,
    ... )
    >>> fit = dmoc.fit(problem, seen, {"g": (9, 10), "e": (0, 1)}, sigma={"y": 0.001})
    >>> round(fit["g"], 3), round(fit["e"], 3)
    (9.81, 0.8)
    """
    with np.errstate(all="ignore"):  # what overflows has no value, and is told as that
        regression = _stated(problem, runs, parameters, start, sigma, own, inputs, loss, sequences)
        check_starts(regression)
        regression, notes = _with_words(regression, sequences)
        made = estimated(regression)
        for _ in range(MOST_ORDERS):
            regression, told = in_order(made)
            if not told:
                break
            made, notes = estimated(regression), [*notes, *told]
        return fit_of(problem, made, notes)


@public(FitError)
def identifiable(
    problem: Problem,
    runs: Any,
    parameters: Mapping[Any, Any],
    *,
    start: Mapping[Any, Any] | Sequence[Mapping[Any, Any] | None] | None = None,
    sigma: Mapping[str, float | str] | None = None,
    own: Sequence[str] = (),
    inputs: str = "held",
    sequences: Sequence[Sequence[str]] | None = None,
) -> Identifiability:
    """What runs can tell of parameters, before anything is fitted: by the derivatives of what their
    sensors see at the values of the problem.

    What runs have measured does not matter, only what and when; :func:`dmoc.simulate` makes runs of
    a plan.  Without a sequence the hits are those that the laws say.  Sensors without a standard
    deviation are taken to be off by 1 % of their range, events by 1 % of the time of the run.

    Parameters
    ----------
    problem, runs, parameters, start, sigma, own, inputs, sequences
        As for :func:`dmoc.fit`.

    Returns
    -------
    Identifiability

    Raises
    ------
    FitError
        As :func:`dmoc.fit`.

    Examples
    --------
    >>> import dmoc
    >>> problem = dmoc.Problem(dmoc.load("bouncing_pendulum"), start={"theta": 0.5})
    >>> swing = dmoc.simulate(problem.kernels, {"theta": 0.5}, step_size=0.01, steps=30)
    >>> known = dmoc.identifiable(
    ...     problem, swing, {"g": (5, 15), "l": (0.5, 2)}, sigma={"theta": 0.01}
    ... )
    >>> known.undetermined
    ('only g/l is determined',)
    """
    with np.errstate(all="ignore"):  # what overflows has no value, and is told as that
        regression = _stated(
            problem, runs, parameters, start, sigma, own, inputs, "linear", sequences
        )
        if sequences is None and not problem.sequence and problem.kernels.surfaces:
            pairs = zip(regression.experiments, regression.own, strict=True)
            made = (e if e.run.before else by_laws(e, regression.first[own]) for e, own in pairs)
            regression = replace(regression, experiments=tuple(made))
        return _known_of(regression)


def _known_of(regression: Regression) -> Identifiability:
    """What experiments tell of unknowns at their first values."""
    x = regression.first
    predictions = regression.predict(x)
    if predictions is None:
        raise FitError(
            "the motion cannot be followed with the values of the problem: state others, or "
            "another start."
        )
    J = regression.accurate_slopes(x, predictions)[0] / assumed_sigma(regression)[:, None]
    known = identified(J, regression.parameters, x, pushed(regression))
    errors = np.sqrt(np.diag(known.covariance))
    return Identifiability(tuple(p.name for p in regression.parameters), x, errors, known.sentences)


@dataclass(frozen=True, eq=False)
class Identifiability(Shown):
    """What runs can tell of parameters; made by :func:`dmoc.identifiable`.

    Attributes
    ----------
    names : tuple of str
        The unknowns, free starts among them.
    values : array of shape (p,)
        At which that was found.
    errors : array of shape (p,)
        Standard errors to expect; infinite of what is not determined.
    undetermined : tuple of str
        What cannot be told, in sentences.
    """

    names: tuple[str, ...]
    values: Array
    errors: Array
    undetermined: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<Identifiability: {'; '.join(self.undetermined) or 'all is determined'}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        rows = [
            (name, f"{value:.6g}", f"{error:.2g}" if np.isfinite(error) else "not determined")
            for name, value, error in zip(self.names, self.values, self.errors, strict=True)
        ]
        return Table(tuple(rows), ("unknown", "at", "error to expect"), self.undetermined)


# What is stated -----------------------------------------------------------------------------------


def _stated(
    problem: Problem, runs: Any, parameters: Any, start: Any, sigma: Any, own: Any, inputs: str,
    loss: str, sequences: Any,
) -> Regression:  # fmt: skip
    """The runs and unknowns as a problem of least squares."""
    if not isinstance(problem, Problem):
        raise FitError(f"problem = {shown(problem)}: expected a dmoc.Problem.")
    check_one_for_all(problem.models, "a fit has one set of parameters", FitError)
    choice(inputs, "inputs", (HELD, LINEAR), FitError)
    choice(loss, "loss", LOSSES, FitError)
    measured = runs_of(runs, problem.kernels, sigma, inputs)
    unknowns = parameters_of(problem, measured, parameters, own, start)
    words = _words(problem, measured, sequences)
    experiments = tuple(
        experiment_of(
            problem, run, touch_of_words(problem, words[i]),
            tuple(p for p in unknowns if p.serves(i)), fixed_start(problem, measured, i, start),
        )
        for i, run in enumerate(measured)
    )  # fmt: skip
    return Regression(experiments, unknowns, loss)


def _words(problem: Problem, runs: Sequence[Run], sequences: Any) -> list[tuple[str, ...]]:
    if sequences is None:
        return [tuple(problem.sequence)] * len(runs)
    each = listed(sequences, "sequences", "sequences, one for each run", FitError)
    if len(each) != len(runs):
        raise FitError(
            f"sequences has {len(each)} entries: expected one for each of the {len(runs)} runs."
        )
    return [tuple(names(words, "sequences", "surfaces", FitError)) for words in each]


def _with_words(regression: Regression, sequences: Any) -> tuple[Regression, list[str]]:
    """The runs with their words: those that are given, else the ones that fit best."""
    given = sequences is not None or any(e.problem.sequence for e in regression.experiments)
    surfaces = regression.experiments[0].problem.kernels.surfaces
    if given or not surfaces:
        return _in_order_of_sight(regression)
    made, notes = list[Experiment](), list[str]()
    for i, e in enumerate(regression.experiments):
        if e.run.before:
            made.append(e)
            continue
        best, _ = best_words(regression, i)
        made.append(best)
        said = ", ".join(best.words) or "no event"
        notes.append(f"no sequence is given: {said} fits {e.run.name} best")
    return replace(regression, experiments=tuple(made)), notes


def _in_order_of_sight(regression: Regression) -> tuple[Regression, list[str]]:
    """Runs whose sensors show their hits in another order than their words, in that order."""
    made, notes = list[Experiment](), list[str]()
    for e, own in zip(regression.experiments, regression.own, strict=True):
        free = e.run.before or not all(event.impact for event in e.touch.events)
        made.append(e if free else in_order_of_sight(e, regression.first[own]))
        if made[-1].words != e.words:
            notes.append(f"{e.run.name} shows its hits as {', '.join(made[-1].words)}")
    return replace(regression, experiments=tuple(made)), notes
