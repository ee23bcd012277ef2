"""dmoc.generate_solver: a problem with its solver as a folder of C sources."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from dmoc.base.arguments import shown, whole
from dmoc.base.errors import OutputError, ProblemError
from dmoc.base.files import write_folder
from dmoc.base.messages import path as path_of
from dmoc.base.messages import place
from dmoc.base.signatures import public
from dmoc.base.tolerances import ITERATIONS
from dmoc.codegen.build import header, sources
from dmoc.codegen.kernels import Array
from dmoc.control.feedback import Feedback
from dmoc.export.feedback_text import checked_feedback, feedback_facts
from dmoc.export.motion_text import derived_tables, momenta_of, work_of
from dmoc.export.numbers import moved_arrays, numbers_of
from dmoc.export.program_text import (
    CarriedProgram,
    count_of,
    elements_moved,
    program_text,
    shape_of,
    tables_of,
)
from dmoc.export.rests_text import carried_rests, planner_doubles, rests_facts
from dmoc.planning.planner import Planner
from dmoc.problem.problem import Problem
from dmoc.program.arrays import ElementData
from dmoc.program.assembly import strided
from dmoc.program.transcription import Transcription
from dmoc.results.solution import Solution
from dmoc.solvers.compiled import interior_memory
from dmoc.solvers.ipm import solve_ipm
from dmoc.solvers.judge import judged
from dmoc.solvers.kkt_layout import kkt_layout
from dmoc.solvers.outcome import Duals, Options, Outcome, Status
from dmoc.solving.methods import COMPILED_METHOD
from dmoc.solving.programs import at_solution
from dmoc.solving.request import check_problem
from dmoc.solving.sensitivity import as_solved
from dmoc.solving.solve import solve
from dmoc.solving.starts import InitialGuess, starts_of

# The sources that every solver has, by the package that they are those of.
PARTS = {
    "dmoc.program": ("passes.c", "passes.h"),
    "dmoc.solvers": (
        "interior_evaluation.c", "interior_optimality.c", "interior_point.c", "interior_point.h",
        "interior_restoration.c", "interior_search.c", "interior_solver.h", "interior_start.c",
        "interior_status.h", "interior_system.c", "ldl.c", "ldl.h", "ldl_dense.c", "ldl_dense.h",
    ),
    "dmoc.export": (
        "dmoc_carried.h", "dmoc_events.c", "dmoc_inside.h", "dmoc_judge.c", "dmoc_laws.c",
        "dmoc_motion.c", "dmoc_numbers.c", "dmoc_solver.c", "dmoc_solver.h", "dmoc_starts.c",
    ),
}  # fmt: skip
PLANNER = ("dmoc_planner.c", "dmoc_planner.h")
KERNELS = ("kernels.c", "kernels.h")
# Doubles that hold a solver, without what it works with, and an element (passes.h); rows that an
# element works on at a time (passes.c).
OF_SOLVER, OF_ELEMENT, ROWS = 160, 82, 64
# Names that sources of the solver, headers of C or targets of make have.
TAKEN = re.compile(
    "dmoc.*|interior_.*|ldl.*|passes|kernels|program|main|test.*|all|clean|build|"
    "assert|complex|ctype|errno|fenv|float|inttypes|iso646|limits|locale|math|setjmp|signal|"
    "stdalign|stdarg|stdatomic|stdbool|stddef|stdint|stdio|stdlib|stdnoreturn|string|strings|"
    "tgmath|threads|time|uchar|unistd|wchar|wctype"
)


@public(ProblemError)
def generate_solver(
    problem: Problem | Planner,
    folder: str | os.PathLike[str],
    *,
    guess: InitialGuess = None,
    feedback: Feedback | None = None,
    most_bytes: int | None = None,
) -> list[Path]:
    """Write a solver of a problem in C, which needs neither Python nor a heap.

    The folder holds the model's kernels, the program and the order of its pivots as constants, the
    sources of the interior-point method, a header with the numbers and tables of the problem,
    ``main.c``, ``test.c``, ``Makefile``, ``CMakeLists.txt`` and ``README.md``.  Steps and sequence
    are fixed; start, goal, final time, bounds and parameters are set at run time.  The solver
    starts from the answer of the day of export, from its first motion, or from given unknowns.

    Parameters
    ----------
    problem : Problem or Planner
        With a Planner the folder has the programs of the rest of its motion from each phase on, and
        a planner in C; its first program is that of the whole motion.
    folder : path
        A new or empty folder; its name is that of the problem in C.
    guess : optional
        Where the solve that gives the answer starts, as :func:`dmoc.solve` takes it; a solution of
        the problem is taken as it is.  None with a Planner, which has its solution.
    feedback : Feedback, optional
        Of :func:`dmoc.feedback` along the solution that is given as ``guess``: its tables are
        written too, in C with a function that gives the inputs, and as comma-separated values.
    most_bytes : int, optional
        Bytes of memory and constants that the machine has; a larger solver is refused.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ProblemError
        If the problem has no solution, its kernels are not compiled, the solver is too large, the
        feedback is that of another motion, or a rest of the motion has no program of its own.
    OutputError
        If the folder is not empty, its name is none in C, or it cannot be written.

    Examples
    --------
    A swing-up with its answer and gains along it, for a machine of 2 MB:

    >>> import tempfile
    >>> from pathlib import Path
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("cart_pendulum")
    >>> problem = dmoc.Problem(reference.kernels(2), **reference.defaults).but(steps=50)
    >>> solution = dmoc.solve(problem, starts=1)
    >>> files = dmoc.generate_solver(
    ...     problem,
    ...     Path(tempfile.mkdtemp()) / "swing_up",
    ...     guess=solution,
    ...     feedback=dmoc.feedback(solution),
    ...     most_bytes=2_000_000,
    ... )
    >>> [file.name for file in files if file.name.startswith("swing_up")]
    ['swing_up.h', 'swing_up_feedback.c', 'swing_up_feedback.csv', 'swing_up_feedback.h']
    """
    if not isinstance(problem, Planner):
        check_problem(problem)
    name, target = _new_folder(folder)
    most = None if most_bytes is None else whole(most_bytes, "most_bytes", 1, 2**62)
    if isinstance(problem, Planner):
        texts = _planner_files(name, problem, guess, most, feedback)
    else:
        texts = solver_files(name, problem, guess, most, feedback)[-1]
    return write_folder(target, {file: text.encode() for file, text in texts.items()})


def solver_files(
    name: str,
    problem: Problem,
    guess: InitialGuess,
    most: int | None,
    feedback: Feedback | None = None,
) -> tuple[CarriedProgram, Solution, dict[str, str]]:
    """The program that a solver carries, its solution, and the texts of the solver's files."""
    if not problem.kernels.compiled:
        raise ProblemError(
            f"the kernels of {problem.kernels.name!r} run on NumPy, and a solver in C needs "
            "compiled ones: install a C compiler and build the model again."
        )
    method = COMPILED_METHOD.name
    solution = guess if isinstance(guess, Solution) else solve(problem, method, guess=guess)
    carried, iterations = carried_by(name, problem, solution)
    along = None if feedback is None else checked_feedback(feedback, solution.trajectory)
    return carried, solution, _texts(carried, iterations, most, along)


def _planner_files(
    name: str, planner: Planner, guess: InitialGuess, most: int | None, feedback: Feedback | None
) -> dict[str, str]:
    """The texts of the files of a planner."""
    if guess is not None:
        raise ProblemError("a guess beside a Planner: expected none, a Planner has its solution.")
    _check_verified(planner.solution)
    rests, begins = carried_rests(name, planner)
    along = (
        None if feedback is None else checked_feedback(feedback, planner.begin().plan.trajectory)
    )
    solvers = [memory_of(carried) for carried in rests]
    facts = rests_facts(rests, begins, planner) | {"memory": planner_doubles(rests, solvers)}
    first = rests[0]
    counts = (
        _solved(first.nlp, first.first, None).iterations,
        _solved(first.nlp, first.x, first.duals).iterations,
    )
    return _texts(first, counts, most, along, rests[1:], facts)


def _new_folder(folder: Any) -> tuple[str, Path]:
    """The name of a solver and its folder, which has to be new or empty."""
    target = path_of(folder)
    name = target.resolve().name
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,40}", name) or TAKEN.fullmatch(name):
        raise OutputError(
            f"{place(target)} names the solver {shown(name)}, which is no free name in C: "
            "expected letters, digits and underscores, such as swing_up, and no name of C or make."
        )
    if target.exists() and not (target.is_dir() and not any(target.iterdir())):
        raise OutputError(
            f"{place(target)} exists and is not an empty folder: name a new one, nothing is "
            "overwritten."
        )
    return name, target


def carried_by(
    name: str, problem: Problem, solution: Solution
) -> tuple[CarriedProgram, tuple[int, int]]:
    """The program that a solver carries, and the iterations that it takes from the first motion and
    from the answer."""
    _check_verified(solution)
    if not solution.minimum:
        raise ProblemError(
            f"the problem has no solution to begin with ({solution.message}): a solver carries the "
            "answer of the day of export, so give a guess that leads to one."
        )
    problem = as_solved(problem, solution)
    nlp, duals = at_solution(problem, solution)
    outcome = _solved(nlp, nlp.scaled(solution.unknowns), duals)
    if outcome.status is not Status.SOLVED:
        raise ProblemError(
            f"the solution is no minimum of this problem ({outcome.status.sentence}, "
            f"{outcome.detail}): give the problem that was solved."
        )
    nlp = Transcription(nlp.problem, nlp.scale)
    first = nlp.scaled(starts_of(nlp.problem, None).points[0])
    counts = _solved(nlp, first, None).iterations, _solved(nlp, outcome.x, outcome.duals).iterations
    x = np.clip(outcome.x, nlp.lower, nlp.upper)
    layout = kkt_layout(nlp)
    numbers = numbers_of(nlp)
    return CarriedProgram(
        name, nlp, layout, numbers, x, outcome.duals, first, problem.reach
    ), counts


def _check_verified(solution: Solution) -> None:
    if solution.status is Status.NOT_VERIFIED:
        raise ProblemError(
            f"the solution is not verified ({solution.message}): a solver has its mesh, so take "
            "more steps."
        )


def _solved(nlp: Transcription, x: Array, duals: Duals | None) -> Outcome:
    options = Options()
    with np.errstate(all="ignore"):
        return judged(nlp, solve_ipm(nlp, x, options, duals), options)


def _texts(
    carried: CarriedProgram,
    counts: tuple[int, int],
    most: int | None,
    feedback: Feedback | None,
    others: Sequence[CarriedProgram] = (),
    rests: Mapping[str, Any] | None = None,
) -> dict[str, str]:
    """Texts of all files of a folder, by name; a planner has ``others``, rests of the motion, and
    the facts ``rests`` about them."""
    kernels = sources(carried.nlp.kernels)
    texts = dict(header()) | {name: kernels[name] for name in KERNELS}
    for package, names in PARTS.items():
        folder = resources.files(package)
        texts |= {name: folder.joinpath(name).read_text(encoding="utf-8") for name in names}
    lines, constants = program_text(carried)
    doubles = memory_of(carried)
    if rests is not None:
        texts |= {name: resources.files(__package__).joinpath(name).read_text() for name in PLANNER}
        doubles = rests["memory"]
    for i, other in enumerate(others, 1):
        own, size = program_text(other)
        texts[f"program_{i}.c"] = _template("program.c").render(name=carried.name, lines=own)
        constants += size
    along = None if feedback is None else feedback_facts(feedback)
    constants += 0 if along is None else along["table_bytes"]
    if most is not None and 8 * doubles + constants > most:
        raise ProblemError(
            f"the solver takes {8 * doubles} bytes of memory and {constants} bytes of constants, "
            f"and most_bytes = {most}: take fewer steps, or a machine with more."
        )
    files = {"header.h": f"{carried.name}.h"}
    for name in ("program.c", "main.c", "test.c", "Makefile", "CMakeLists.txt", "README.md"):
        files[name] = name
    facts = _facts(carried, lines, counts) | {"feedback": along, "rests": rests}
    if rests is not None:
        files["rests.c"] = "rests.c"
    if feedback is not None:
        files |= {f"feedback.{kind}": f"{carried.name}_feedback.{kind}" for kind in ("c", "h")}
        texts[f"{carried.name}_feedback.csv"] = feedback.csv()
    written = [name for name in (*texts, *files.values()) if name.endswith(".c")]
    facts |= {
        "memory": memory_of(carried), "bytes": 8 * memory_of(carried), "constants": constants,
        "sources": sorted(set(written) - {"main.c", "test.c"}),
        "code": sum(len(text) for name, text in texts.items() if name.endswith(".c")),
    }  # fmt: skip
    return texts | {file: _template(name).render(facts) for name, file in files.items()}


def memory_of(carried: CarriedProgram) -> int:
    """Doubles that a solver takes where pointers have eight bytes: dmoc_solver.c shares them out
    so, with one more behind each part."""
    nlp, layout, data = carried.nlp, carried.layout, carried.nlp.assembled.data
    n, m, lay = data.n, data.m, carried.nlp.layout
    ldl = layout.factorisation.analysis()
    parts = [
        *(len(a) for a in moved_arrays(data, carried.numbers.results)),
        OF_ELEMENT * elements_moved(data, carried.numbers),
        len(carried.numbers.taken), len(data.pool),
        *[n] * 7, m, m + 1, 2 * n + m, len(data.slopes.constant), lay.total + 1,
        sum(t.rows * t.columns for t in derived_tables(nlp)) + 1, work_of(nlp), _scratch(nlp),
        ldl["panel_size"], ldl["work_size"], 3 * (ldl["pivots"] + 2),
        ldl["n"] - ldl["chain"] + 1, -(-interior_memory(nlp.program, layout) // 8),
    ]  # fmt: skip
    return OF_SOLVER + int(sum(parts)) + len(parts)


def _scratch(nlp: Transcription) -> int:
    """The most doubles that an element works on at a time."""
    data, kernels = nlp.assembled.data, nlp.kernels.manifest.kernels

    def of(element: ElementData) -> int:
        gathered = sum(int(a.shape[1]) for a in element.arguments if strided(a) is None)
        return gathered + sum(count_of(o) for o in kernels[element.kernel]["outputs"])

    passes = data.values, data.slopes, data.curvatures, momenta_of(nlp)
    every = (e for p in passes for e in p.elements)
    return ROWS * max(map(of, every), default=0)


def _facts(carried: CarriedProgram, lines: list[str], counts: tuple[int, int]) -> dict[str, Any]:
    """Facts about a problem for the templates of its files."""
    nlp, name, upper = carried.nlp, carried.name, carried.name.upper()
    blocks, taken, derived = tables_of(nlp), carried.numbers.taken, derived_tables(nlp)
    words = _words([*(b.name for b in blocks), *(t.name for t in derived)])
    tables = [
        {
            "word": f"{upper}_TABLE_{word}", "rows": shape_of(b)[0],
            "columns": shape_of(b)[1], "what": b.name_of(0) + (", ..." if b.count > 1 else ""),
        }
        for b, word in zip(blocks, words, strict=False)
    ]  # fmt: skip
    tables += [
        {"word": f"{upper}_TABLE_{word}", "rows": t.rows, "columns": t.columns, "what": t.what}
        for t, word in zip(derived, words[len(blocks) :], strict=True)
    ]
    numbers = [
        {"word": f"{upper}_{word}", "value": f"{n.value:.17g}"}
        for n, word in zip(taken, _words([n.name for n in taken]), strict=True)
    ]
    return {
        "name": name, "upper": upper, "version": version("dmoc"), "lines": lines,
        "statement": [line.rstrip() for line in str(nlp.problem).splitlines()],
        "numbers": numbers, "tables": tables, "taken": [n.name for n in carried.numbers.taken],
        "kept": list(carried.numbers.kept), "size": nlp.n, "rows": nlp.n_eq + nlp.n_in,
        "cost": repr(nlp.cost(carried.x) * nlp.scale.cost), "cold": counts[0], "warm": counts[1],
        "limit": ITERATIONS, "longest": max((len(n.name) for n in taken), default=0),
    }  # fmt: skip


def _words(names: Sequence[str]) -> list[str]:
    """Names as parts of names in C: capitals, but for names that differ in these alone; those that
    are the same even so are numbered."""
    words = [re.sub(r"\W", "_", name) for name in names]
    capitals = Counter(word.upper() for word in words)
    words = [w if capitals[w.upper()] > 1 else w.upper() for w in words]
    return [w if words.count(w) == 1 else f"{w}_{i}" for i, w in enumerate(words)]


def _in_comment(text: str) -> str:
    """A user's text, which may not end the comment in C that it stands in, nor begin another."""
    return re.sub(r"(?<=\*)(?=/)|(?<=/)(?=\*)", " ", text)


@cache
def _template(name: str) -> jinja2.Template:
    environment = jinja2.Environment(
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined, autoescape=False,
    )  # fmt: skip
    environment.filters["in_comment"] = _in_comment
    text = resources.files(__package__).joinpath("templates", f"{name}.jinja")
    return environment.from_string(text.read_text(encoding="utf-8"))
