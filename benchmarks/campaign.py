"""Random problems, solved as a user would and judged by an event-driven simulation that shares no
code with dmoc and finds modes, cones and impacts by itself.

Run:  python benchmarks/campaign.py [--contacts] [--problems 200] [--verbose]

Prints a table by kind, which `make bench` writes into its report; the exit status is 1 if any
answer with the status `solved` or `grazes` is contradicted.
"""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import campaign_kinds
import contact_kinds
import numpy as np
from campaign_judge import MOST, NO_EFFECT, JudgedSolve, judge
from campaign_kinds import Draw, Instance
from common import Section
from event_simulation import ContactMechanism

import dmoc

SEED = 2018
VOUCHED = ("solved", "grazes")  # statuses that say: this motion is right
STEPS = {2: 40, 4: 20}


@dataclass(frozen=True)
class Series:
    """Kinds of problems, how many of them in all, orders in turn, every how many-th of a kind is
    solved by slsqp too, and the seconds of a solve."""

    title: str
    kinds: Mapping[str, Callable[[Draw], Instance]]
    problems: int
    orders: tuple[int, ...]
    share: int
    seconds: float

    def draw(self, number: int) -> tuple[str, int, Instance]:
        """Kind, order and instance of a problem: they depend on the number alone."""
        names, orders = list(self.kinds), self.orders
        kind, order = names[number % len(names)], orders[number // len(names) % len(orders)]
        return kind, order, self.kinds[kind](np.random.default_rng([SEED, number]))

    def methods(self, number: int) -> tuple[str, ...]:
        by_both = self.share and number // len(self.kinds) % self.share == 0
        return ("ipm", "slsqp") if by_both else ("ipm",)

    def groups(self, problems: int) -> list[list[int]]:
        """Problems by model and order, the largest models first."""
        chosen: dict[tuple[int, str, int], list[int]] = {}
        for number in range(problems):
            _, order, instance = self.draw(number)
            key = (-order * len(instance.description.coordinates), instance.description.name, order)
            chosen.setdefault(key, []).append(number)
        return [chosen[key] for key in sorted(chosen)]


FREE = Series(
    "Campaign: random problems under another simulation",
    campaign_kinds.KINDS, problems=200, orders=(2, 4), share=5, seconds=10.0,
)  # fmt: skip
HELD = Series(
    "Campaign: contacts and friction under another simulation",
    contact_kinds.KINDS, problems=100, orders=(2,), share=0, seconds=60.0,
)  # fmt: skip


def system_of(instance: Instance) -> dmoc.MechanicalSystem:
    d = instance.description
    cost = sum(u**2 for u in d.inputs) / 2 if d.inputs else 1
    return dmoc.MechanicalSystem(**vars(d), cost=cost)


def run_group(series: Series, numbers: list[int]) -> list[JudgedSolve]:
    """Problems of one model and order: the kernels and the equations of motion are made once."""
    _, order, first = series.draw(numbers[0])
    kernels = dmoc.build(system_of(first), order=order)
    mechanism = ContactMechanism(first.description)
    return [
        _solved(series, number, method, kernels, mechanism)
        for number in numbers
        for method in series.methods(number)
    ]


def _solved(
    series: Series, number: int, method: str, kernels: Any, mechanism: ContactMechanism
) -> JudgedSolve:
    kind, order, instance = series.draw(number)
    result = JudgedSolve(kind, number, order, method, "")
    try:
        problem = dmoc.Problem(kernels, steps=STEPS[order], **instance.problem)
        solution = dmoc.solve(problem, method, seconds=series.seconds)
        result.status = solution.status
        if solution.status in (*VOUCHED, "not_verified"):
            judge(result, instance, solution, mechanism)
    except dmoc.DmocError as error:
        result.status = f"refused: {error}"
    except ArithmeticError as error:  # the judge finds no end: the motion is not one
        result.against.append(str(error))
    except Exception:  # a traceback is a finding, and the other problems go on
        result.status = "traceback"
        result.against = [traceback.format_exc().strip().splitlines()[-1]]
    return result


# Report -------------------------------------------------------------------------------------------

TEXT = """{problems} random problems of {kinds} kinds (seed {seed}) with the sequence given, solved
as a user would: {solves} solves, {judged} of them `solved` or `grazes`, {confirmed} confirmed,
{contradicted} contradicted, {broken} tracebacks. Orders {orders} in turn, with {steps} steps a
phase{slsqp}.

The judge (`benchmarks/event_simulation.py`) is told no mode: from the motion's own nodes it looks
for consistent contact and friction forces, follows them through lift-off, sticking and sliding, and
compares impacts with the nearest outcome of Newton's law without friction, of Poisson's law for one
contact with friction, or of plastic impacts of several. An answer is confirmed if no error exceeds:
{limits}. No tenth of a phase may meet an impact that was not planned. `excess` is the cost above
the optimum, for the kind where it is known. A collision whose approach is below {effect:g} of the
largest rate of its gap has no effect, and `solved` must not count it as one. `doubted` are answers
with the status `not_verified` that the judge finds right. The columns after it show the worst of
all answers that are `solved` or `grazes`."""


def rows(series: Series, results: list[JudgedSolve]) -> Iterator[list[Any]]:
    """A line of the table for each kind and method."""
    for kind, method in dict.fromkeys((r.kind, r.method) for r in results):
        own = [r for r in results if (r.kind, r.method) == (kind, method)]
        judged = [r for r in own if r.status in VOUCHED]
        bad = sum(bool(r.against) for r in judged)
        doubted = sum(r.status == "not_verified" and not r.against for r in own)
        ends = Counter(r.status.split(":")[0] for r in own).most_common()
        worst = [max((r.errors[c] for r in judged if c in r.errors), default=None) for c in MOST]
        cells = ("-" if w is None else f"{w:.1e}" for w in worst)
        statuses = ", ".join(f"{n} {s}" for s, n in ends)
        yield [kind, method, len(own), statuses, len(judged) - bad, bad, doubted, *cells]


def wrong_ones(results: list[JudgedSolve]) -> list[JudgedSolve]:
    """Answers that are vouched for and contradicted, and tracebacks."""
    return [r for r in results if r.against and r.status != "not_verified"]


def section(series: Series, results: list[JudgedSolve], problems: int) -> Section:
    judged = [r for r in results if r.status in VOUCHED]
    contradicted = sum(bool(r.against) for r in judged)
    wrong = [
        f"- {r.kind}, problem {r.number}, order {r.order}, {r.method}, {r.status}: "
        f"{'; '.join(r.against)}"
        for r in wrong_ones(results)
    ]
    text = TEXT.format(
        problems=problems, kinds=len(series.kinds), seed=SEED, solves=len(results),
        judged=len(judged), confirmed=len(judged) - contradicted, contradicted=contradicted,
        broken=sum(r.status == "traceback" for r in results), effect=NO_EFFECT,
        orders=" and ".join(map(str, series.orders)),
        steps=" and ".join(str(STEPS[order]) for order in series.orders),
        slsqp=f", every {series.share}th of a kind by `slsqp` too" if series.share else "",
        limits=", ".join(f"{name} {value:g}" for name, value in MOST.items()),
    )  # fmt: skip
    header = "kind method solves statuses confirmed contradicted doubted".split()
    after = "\n".join(["Contradicted:", "", *wrong]) if wrong else ""
    return Section(series.title, text, [*header, *MOST], list(rows(series, results)), after)


def judged_by_simulation(series: Series, problems: int) -> list[JudgedSolve]:
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
        parts = pool.map(partial(run_group, series), series.groups(problems))
        results = [r for part in parts for r in part]
    return sorted(results, key=lambda r: (list(series.kinds).index(r.kind), r.method, r.number))


def campaign(series: Series, quick: bool) -> Section:
    problems = len(series.kinds) * len(series.orders) if quick else series.problems
    return section(series, judged_by_simulation(series, problems), problems)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--contacts", action="store_true", help="contacts that last and friction")
    parser.add_argument("--problems", type=int)
    parser.add_argument("--verbose", action="store_true", help="a line for each problem")
    options = parser.parse_args()
    series = HELD if options.contacts else FREE
    problems = options.problems or series.problems
    results = judged_by_simulation(series, problems)
    for r in results if options.verbose else ():
        errors = ", ".join(f"{n} {x:.1e}" for n, x in r.errors.items())
        sys.stdout.write(f"{r.kind} {r.number} {r.status}: {'; '.join(r.against)} [{errors}]\n")
    sys.stdout.write(section(series, results, problems).markdown())
    return int(bool(wrong_ones(results)))


if __name__ == "__main__":
    sys.exit(main())
