"""Errors against known answers for several numbers of steps and all discretisations; writes
docs/known_answers.md.

Run:  python benchmarks/accuracy.py            (some minutes)
"""

from __future__ import annotations

import math
import sys
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
# The problems are those of the examples and tests, which are folders of scripts and no packages.
sys.path[:0] = [str(ROOT / "examples"), str(ROOT / "tests")]

import block_and_wall  # noqa: E402
import cart_pole  # noqa: E402
import compass_gait  # noqa: E402
import contact_problems as contacts  # noqa: E402
import hit_problems as hits  # noqa: E402
import puck  # noqa: E402
import seed  # noqa: E402
import two_bounces  # noqa: E402
import two_discs  # noqa: E402
from common import clocked, guess, timed  # noqa: E402
from systems import bouncer_problem, bryson_denham, double_integrator  # noqa: E402

import dmoc  # noqa: E402
from dmoc.base.discretisation import ORDERS  # noqa: E402

STEPS = (10, 20, 40, 80, 160)
REPEATS = 5
TITLES = {
    2: "Midpoint rule",
    4: "Quadratic steps with two Gauss points",
    6: "Cubic steps with three Gauss points",
}


@dataclass(frozen=True)
class ReferenceCase:
    """A problem by steps (and order), the known value of a quantity, which is the cost if nothing
    else is said, and where that comes from."""

    name: str
    problem: Callable[..., dmoc.Problem]
    reference: float
    source: str = "closed form"
    quantity: Callable[[dmoc.Solution], float] = lambda s: s.cost
    start: Callable[[dmoc.Problem], np.ndarray] = guess


CASES = (
    ReferenceCase("double integrator, rest to rest", double_integrator, 12.0),
    ReferenceCase("Bryson-Denham, l = 1/9", bryson_denham, 4.0),
    *(
        ReferenceCase(
            f"block and wall, e = {e:g}",
            lambda n, o, e=e: block_and_wall.problem(e, n, o),
            block_and_wall.closed_form(e)[0],
        )
        for e in (1.0, 0.8, 0.5, 0.0)
    ),
    ReferenceCase(
        "two bounces up to a peak: v0",
        two_bounces.problem,
        two_bounces.V0,
        quantity=lambda s: float(s.phases[0].v[0, 0]),
    ),
    ReferenceCase("two discs", two_discs.problem, 1.39654216, "Zhong, Han, Brikis (2022), task 3"),
    ReferenceCase("puck: east, north, west", puck.problem, 0.415, "closed form (unfolded)"),
    ReferenceCase(
        "periodic bouncer, e = 0.7",
        lambda n, o: bouncer_problem(0.7, n, o)[0],
        bouncer_problem(0.7)[1],
    ),
    ReferenceCase(
        "cart-pendulum, lower",
        seed.problem,
        seed.LIMIT,
        "dmoc's own, both discretisations, N = 1600 and 320",
    ),
    ReferenceCase(
        "cart-pole, Kelly's motion",
        cart_pole.problem,
        cart_pole.LIMIT,
        "dmoc's own, both discretisations; Dymos' test: 58.88",
        start=cart_pole.straight,
    ),
)


CONTACT_CASES = (
    ReferenceCase("pushed block: stick, slide, stick", contacts.pushed, contacts.PUSHED),
    ReferenceCase("pushed block, sliding all along", contacts.sliding, 2.09375),
    ReferenceCase(
        "there and back in least time",
        contacts.there_and_back,
        contacts.THERE_AND_BACK,
        "closed form of three arcs; opty's gallery",
    ),
    ReferenceCase("block and wall, friction, e = 1", lambda n: contacts.against_wall(n, 1.0), 24.5),
    ReferenceCase(
        "block and wall, friction, e = 0.5",
        lambda n: contacts.against_wall(n, 0.5),
        contacts.wall_with_friction(0.5),
        "closed form, least over time and speed of the hit",
    ),
    ReferenceCase(
        "Coulomb friction in least time", contacts.turned, contacts.TURNED, "closed form (Driessen)"
    ),
    ReferenceCase(
        "a mass lands on another and pushes it",
        contacts.pushers,
        contacts.pushed_together(),
        "closed form, least over times and speed of the landing",
    ),
    ReferenceCase(
        "rimless wheel: rate before a spoke lands",
        contacts.rimless,
        contacts.rimless_rate(),
        quantity=lambda s: abs(float(s.phases[0].v[-1, 2])),
    ),
    ReferenceCase(
        "passive compass gait: period",
        lambda n: compass_gait.problem(n, order=2).but(
            start={"x": 0.0, "a": 0.0}, durations=[(0.05, None)] * 2
        ),
        compass_gait.PERIOD,
        "event-driven Runge-Kutta of order 8, 1e-12",
        quantity=lambda s: s.final_time,
    ),
    *(
        ReferenceCase(
            f"rod on a floor, {course}: impulse",
            lambda n, rod=(angle, v, mu, course): hits.fallen_rod(*rod, n),
            tangential,
            "Poisson's law by hand, 9 digits",
            quantity=lambda s: float(s.collisions[0].tractions["floor"]),
        )
        for angle, v, mu, _, _, tangential, course in hits.RODS
    ),
    ReferenceCase("spinning ball that comes back", lambda n: hits.back(steps=n), hits.cost_back()),
)


def solve(case: ReferenceCase, steps: int, order: int) -> tuple[float, dmoc.Solution]:
    """Median time of a solve without guess and check, and the solution."""
    problem = case.problem(steps, order)
    x = case.start(problem)
    return timed(lambda: dmoc.solve(problem, "ipm", guess=x, verify=False), REPEATS)


def measured_order(errors: list[float]) -> str:
    """Order between the last two meshes whose errors are well above rounding and what the solver
    leaves."""
    usable = [e for e in errors if e > 1e-9]
    if max(errors) < 1e-8:
        return "exact"
    return f"{math.log2(usable[-2] / usable[-1]):.1f}" if len(usable) > 1 else "exact"


Work = dict[str, list[tuple[float, float]]]  # seconds and errors of each problem
Solved = Callable[[ReferenceCase, int, dmoc.Solution | None], tuple[float, dmoc.Solution]]


def table(cases: Sequence[ReferenceCase], solved: Solved) -> tuple[list[str], Work]:
    """A line for each problem; a solve may begin with the motion on the mesh before."""
    lines = [
        "| problem | " + " | ".join(f"N = {n}" for n in STEPS) + " | order |",
        "|---" * (len(STEPS) + 2) + "|",
    ]
    work: Work = {}
    for case in cases:
        errors, cells, solution = [], [], None
        for steps in STEPS:
            seconds, solution = solved(case, steps, solution)
            if solution.status != "solved":
                cells.append(str(solution.status))
                continue
            errors.append(abs(case.quantity(solution) - case.reference) / abs(case.reference))
            cells.append(f"{errors[-1]:.1e}")
            work.setdefault(case.name, []).append((seconds, errors[-1]))
        row = (case.name, *cells, measured_order(errors))
        lines.append(f"| {' | '.join(row)} |")
        print(lines[-1], flush=True)
    return lines, work


def from_the_mesh_before(
    case: ReferenceCase, steps: int, before: dmoc.Solution | None
) -> tuple[float, dmoc.Solution]:
    return clocked(lambda: dmoc.solve(case.problem(steps), "ipm", guess=before))


def per_digit(work: dict[int, Work]) -> list[str]:
    """Time of a solve for a given error, interpolated between meshes."""
    targets = (1e-3, 1e-4, 1e-5, 1e-6)
    lines = [
        "| problem | order | " + " | ".join(f"error {t:g}" for t in targets) + " |",
        "|---" * (len(targets) + 2) + "|",
    ]
    for case in CASES[2:]:
        for order in ORDERS:
            points = sorted(work[order].get(case.name, []), key=lambda p: -p[1])
            errors = np.log([max(e, 1e-12) for _, e in points])
            times = np.log([s for s, _ in points])
            cells = []
            for target in targets:
                x = math.log(target)
                if x < errors[-1]:
                    # Half the steps' size divides the error by 2^order and doubles the time.
                    slope = order * math.log(2)
                    far = times[-1] + (errors[-1] - x) / slope * math.log(2)
                    cells.append(f"({1e3 * math.exp(far):.2g} ms)")
                else:
                    cells.append(f"{1e3 * math.exp(float(np.interp(-x, -errors, times))):.2g} ms")
            lines.append(f"| {case.name} | {order} | " + " | ".join(cells) + " |")
    return lines


def page_of(parts: list[str]) -> str:
    """Tables as they are, paragraphs and items at the width of the other pages."""
    lines = []
    for part in parts:
        indent = "  " if part.startswith("- ") else ""
        table = part.startswith("|")
        lines += [part] if table else textwrap.wrap(part, 100, subsequent_indent=indent) or [""]
    return "\n".join(lines) + "\n"


def main() -> None:
    tables, work = {}, {}
    for order in ORDERS:
        alone = partial(solve, order=order)
        tables[order], work[order] = table(CASES, lambda case, n, _, alone=alone: alone(case, n))
    contacts_lines, _ = table(CONTACT_CASES, from_the_mesh_before)
    sources = [f"- {c.name}, {c.reference:.9g}: {c.source}." for c in (*CASES, *CONTACT_CASES)]
    text = [
        "# Known answers",
        "",
        "Relative errors of the quantity (the cost, if nothing else is named) against the number "
        "of steps of each phase. They are by method `ipm`, from the first automatic guess, without "
        "any other start (but for the cart-pole). `python benchmarks/accuracy.py` writes this "
        "file.",
        "",
        *(
            line
            for order in ORDERS
            for line in (f"## {TITLES[order]} (order {order})", "", *tables[order], "")
        ),
        "## Contacts that last, and friction (order 2)",
        "",
        "The first mesh from the exploration, each further one from the motion on the one "
        "before; inputs are linear between the nodes (constant there and back).",
        "",
        *contacts_lines,
        "",
        "With inputs that are linear in a step, cost and states of an optimum have the order 4 at "
        "most; the motion for given inputs has the order of the discretisation. Where inputs jump "
        "or limits become active between nodes (Bryson-Denham), errors are irregular from mesh to "
        "mesh, and the order between the last two meshes says little.",
        "",
        "## Time for an error",
        "",
        f"Median of {REPEATS} solves, without guess and check, interpolated between the meshes "
        "above; in brackets extrapolated by the order.",
        "",
        *per_digit(work),
        "",
        "## Where the known values come from",
        "",
        *sources,
        "",
        "The cart-pole has a cheaper minimum, 57.9448, which the automatic guesses lead to; "
        "Kelly's motion is found from the straight guess of the paper, which stands in "
        "`examples/cart_pole.py`. CasADi with RK4 steps and IPOPT from the straight guess gives "
        "59.13, 58.888 and 58.828 with 50, 100 and 200 steps of constant input, towards the same "
        "58.808.",
    ]
    (ROOT / "docs" / "known_answers.md").write_text(page_of(text), encoding="utf-8")


if __name__ == "__main__":
    main()
