"""IPOPT and Uno on the same program, for comparison: through ipyopt and unopy, which are extras."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.transcription import Transcription
from dmoc.solvers.blas import WAITS
from dmoc.solvers.kkt import violation
from dmoc.solvers.outcome import Duals, Ending, Iteration, Options, Status

# IPOPT measures optimality after scaling the cost by its steepest slope, which is that of a step
# size, 1e4 times the others.
IPOPT_TOLERANCE = 1e-10
# Costs shall agree with those of other methods to more digits than anyone asks for.
UNO_TOLERANCE = 1e-8
# Uno's subproblem solver keeps global state: one solve at a time.
UNO = threading.Lock()
IPOPT_STATUSES = {
    0: Status.SOLVED,
    1: Status.SOLVED,
    2: Status.INFEASIBLE,
    -1: Status.ITERATION_LIMIT,
    -4: Status.TIME_LIMIT,
    -5: Status.TIME_LIMIT,
    5: Status.TIME_LIMIT,  # our callback asked it to stop
}


class _Callbacks:
    """The program as functions of the solvers' kind at x, shape (n,) or longer; what the user
    raises in a callback is kept and raised afterwards."""

    def __init__(self, nlp: Transcription, options: Options) -> None:
        self.nlp, self.options, self.m = nlp, options, nlp.n_eq + nlp.n_in
        jac, hess = nlp.assembled.jacobian, nlp.assembled.hessian
        self.jacobian = (np.repeat(np.arange(jac.shape[0]), np.diff(jac.indptr)), jac.indices)
        self.hessian = (np.repeat(np.arange(nlp.n), np.diff(hess.indptr)), hess.indices)
        self.raised: BaseException | None = None
        self.count = 0

    # Uno hands over longer vectors while it looks for a feasible point; the program's come first.

    def f(self, x: Array) -> float:
        """Cost at x, shape (n,) or longer."""
        return self.nlp.cost(x[: self.nlp.n])

    def gradient(self, x: Array, out: Array) -> None:
        """Put the gradient of the cost into ``out``, shape (n,) or longer as x."""
        out[: self.nlp.n] = self.nlp.cost_gradient(x[: self.nlp.n])

    def g(self, x: Array, out: Array) -> None:
        """Put (c | d) into ``out``, shape (n_eq + n_in,) or longer."""
        out[: self.m] = self.nlp.values(x[: self.nlp.n])[1:]

    def slopes(self, x: Array, out: Array) -> None:
        """Put the entries of d(c | d)/dx by rows into ``out``, shape (entries,) or longer."""
        out[: self.nlp.assembled.jacobian.size] = self.nlp.slopes(x[: self.nlp.n])[self.nlp.n :]

    def curvatures(self, x: Array, y: Array, sigma: float, out: Array) -> None:
        """Put the entries of the Hessian of sigma f + y . (c | d) into ``out``, shape (entries,) or
        longer; y has the shape (n_eq + n_in,) or is longer."""
        x, y = np.ascontiguousarray(x[: self.nlp.n]), np.ascontiguousarray(y[: self.m])
        out[: self.nlp.assembled.hessian.size] = self.nlp.program.curvatures(x, y, sigma)

    def report(self, x: Array | None, cost: float, infeasibility: float) -> bool:
        """Tell of an iteration at x, shape (n,), which some solvers do not give; whether to go
        on."""
        self.count += 1
        try:
            if self.options.progress is not None:
                self.options.progress(
                    Iteration(
                        self.count, cost, infeasibility if x is None else violation(self.nlp, x)
                    )
                )
        except BaseException as error:  # the solver in between would lose it
            self.raised = error
        return self.raised is None and not self.options.deadline.passed


def solve_ipopt(
    nlp: Transcription, x: Array, options: Options, duals: Duals | None = None
) -> Ending:
    """Minimise with IPOPT (Waechter & Biegler 2006) and the exact Hessian."""
    ipyopt: Any = import_module("ipyopt")
    functions = _Callbacks(nlp, options)
    m = functions.m

    def hessian(x: Array, y: Array, sigma: float, out: Array) -> None:
        functions.curvatures(x, y, sigma, out)

    def report(mode: int, number: int, cost: float, violation: float, *rest: float) -> bool:
        return functions.report(None, cost, violation)

    problem = ipyopt.Problem(
        nlp.n,
        nlp.lower,
        nlp.upper,
        m,
        np.zeros(m),
        np.concatenate([np.zeros(nlp.n_eq), np.full(nlp.n_in, np.inf)]),
        functions.jacobian,
        functions.hessian,
        functions.f,
        functions.gradient,
        functions.g,
        functions.slopes,
        hessian,
        report,
        ipopt_options=_ipopt_settings(options, warm=duals is not None),
    )
    y, z_lower, z_upper = np.zeros(m), np.zeros(nlp.n), np.zeros(nlp.n)
    if duals is not None:
        y[:] = duals.rows
        z_lower[:], z_upper[:] = np.maximum(duals.z, 0.0), np.maximum(-duals.z, 0.0)
    x, _, code = problem.solve(
        np.clip(x, nlp.lower, nlp.upper), mult_g=y, mult_x_L=z_lower, mult_x_U=z_upper
    )
    last_duals = Duals.of_rows(nlp.n_eq, y, z_lower - z_upper)
    status = IPOPT_STATUSES.get(int(code), Status.STALLED)
    return _ended(
        functions,
        x,
        last_duals,
        status,
        f"IPOPT ended with code {int(code)}",
        max(functions.count - 1, 0),
    )


def _ipopt_settings(options: Options, warm: bool) -> dict[str, Any]:
    settings: dict[str, Any] = {
        "print_level": 0,
        "sb": "yes",
        "tol": min(options.optimality, IPOPT_TOLERANCE),
        "constr_viol_tol": options.violation,
        "max_iter": options.iterations,
        "bound_relax_factor": 0.0,
        "acceptable_iter": 0,
    }
    if warm:
        settings |= {
            "warm_start_init_point": "yes",
            "mu_init": 1e-4,
            "warm_start_bound_push": 1e-6,
            "warm_start_mult_bound_push": 1e-6,
        }
    return settings


def solve_uno(nlp: Transcription, x: Array, options: Options, duals: Duals | None = None) -> Ending:
    """Minimise with Uno's filter SQP and the exact Hessian."""
    unopy: Any = import_module("unopy")
    functions = _Callbacks(nlp, options)
    m = functions.m
    model = unopy.Model(
        unopy.PROBLEM_NONLINEAR, nlp.n, nlp.lower, nlp.upper, unopy.ZERO_BASED_INDEXING
    )
    model.set_objective(unopy.MINIMIZE, functions.f, functions.gradient)
    upper = np.concatenate([np.zeros(nlp.n_eq), np.full(nlp.n_in, np.inf)])
    rows, columns = functions.jacobian
    model.set_constraints(
        m, functions.g, np.zeros(m), upper, len(rows), rows, columns, functions.slopes
    )
    rows, columns = functions.hessian

    def hessian(x: Array, sigma: float, y: Array, out: Array) -> None:
        functions.curvatures(x, y, sigma, out)

    model.set_lagrangian_hessian(len(rows), unopy.UPPER_TRIANGLE, rows, columns, hessian)
    model.set_lagrangian_sign_convention(unopy.MULTIPLIER_POSITIVE)
    model.set_initial_primal_iterate(np.clip(x, nlp.lower, nlp.upper))
    if duals is not None:
        model.set_initial_dual_iterate(duals.rows)
    output = _Silence()
    solver = unopy.UnoSolver()
    solver.set_preset("filtersqp")
    for name, value in (
        ("logger", "SILENT"),
        ("max_iterations", options.iterations),
        ("primal_tolerance", options.violation),
        ("dual_tolerance", min(options.optimality, UNO_TOLERANCE)),
        ("time_limit", options.deadline.seconds or 1e20),
    ):
        solver.set_option(name, value)

    def stop(x: Array, *rest: Any) -> bool:
        point = np.array(x[: nlp.n])
        with output.restored():
            return not functions.report(point, functions.f(point), 0.0)

    solver.set_termination_callback(stop)
    with UNO, output:
        result = solver.optimize(model)
    y = np.array(result.constraint_dual_solution)
    z = np.array(result.lower_bound_dual_solution) + np.array(result.upper_bound_dual_solution)
    last_duals = Duals.of_rows(nlp.n_eq, y, -z)
    detail = (
        f"Uno ended with {result.optimization_status.name.lower()}, "
        f"{result.solution_status.name.lower()}"
    )
    return _ended(
        functions,
        np.array(result.primal_solution)[: nlp.n],
        last_duals,
        _uno_status(unopy, result),
        detail,
        int(result.number_iterations),
    )


def _uno_status(unopy: Any, result: Any) -> Status:
    ended = {
        unopy.OptimizationStatus.ITERATION_LIMIT: Status.ITERATION_LIMIT,
        unopy.OptimizationStatus.TIME_LIMIT: Status.TIME_LIMIT,
        unopy.OptimizationStatus.USER_TERMINATION: Status.TIME_LIMIT,
    }
    if result.solution_status in (
        unopy.SolutionStatus.INFEASIBLE_STATIONARY_POINT,
        unopy.SolutionStatus.INFEASIBLE_SMALL_STEP,
    ):
        return Status.INFEASIBLE
    return ended.get(result.optimization_status, Status.STALLED)


class _Silence:
    """Keep what Uno's subproblem solver prints, which no option stops, away from standard
    output.

    Standard output is the whole process's: where other threads live, which may write to it, it is
    left alone, and shows what the subproblem solver prints."""

    def __enter__(self) -> None:
        others = [t for t in threading.enumerate() if t.name != WAITS]
        self.alone = others == [threading.current_thread()]
        if not self.alone:
            return
        sys.stdout.flush()
        self.kept, self.nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
        os.dup2(self.nowhere, 1)

    def __exit__(self, *error: object) -> None:
        if self.alone:
            os.dup2(self.kept, 1)
            os.close(self.kept)
            os.close(self.nowhere)

    @contextmanager
    def restored(self) -> Iterator[None]:
        """Standard output as the caller knows it."""
        if not self.alone:
            yield
            return
        os.dup2(self.kept, 1)
        try:
            yield
            sys.stdout.flush()
        finally:
            os.dup2(self.nowhere, 1)


def _ended(
    functions: _Callbacks, x: Array, duals: Duals, status: Status, detail: str, iterations: int
) -> Ending:
    """The ending of a solver; what was raised in a callback is raised."""
    if isinstance(functions.raised, KeyboardInterrupt):
        status = Status.INTERRUPTED
    elif functions.raised is not None:
        raise functions.raised
    return Ending(status, detail, x, duals, iterations)
