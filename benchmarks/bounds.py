"""Bounds of dmoc.prove: how long they take, and a million motions beside them. These are feasible
motions of random problems with durations in random boxes, and their costs have a closed form.

python benchmarks/bounds.py                          all, into results/bounds.md
python benchmarks/bounds.py --motions 1e4 --hits 2   fewer, printed

A block of 1 kg hits walls at 0 and 1. Between hits its place is a cubic polynomial of the time, by
the places and speeds at both ends; such motions are motions of the program too.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import Section, filled, machine
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.files import write_whole
from dmoc.codegen.kernels import Array
from dmoc.proving.branch import Branch
from dmoc.proving.linear_problem import linear_problem

MOTIONS, OF_A_BOX, STEPS = 1_000_000, 2000, 4
# Rounding errors of costs, relative to them, and of places.
ROUNDING, PLACES = 1e-12, 1e-12
# Places from the start to the goal, the first and last of which are no hits, and least costs known.
HITS = {
    1: ((0.0, 1, 0.0), 24.58630915),
    2: ((0.3, 1, 0, 0.6), 32.89248634),
    3: ((0.3, 1, 0, 1, 0.6), 60.16031905),
    4: ((0.3, 1, 0, 1, 0, 0.6), 126.8071915),
    5: ((0.3, 1, 0, 1, 0, 1, 0.6), 183.8586),
}
REPORT = Path(__file__).parent / "results" / "bounds.md"


def block() -> Any:
    x, u = dynamicsymbols("x u")
    system = dmoc.MechanicalSystem(
        "between", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2 / 2,
        surfaces={"right": x <= 1, "left": x >= 0},
    )  # fmt: skip
    return dmoc.build(system, order=4)


class Case:
    """A problem: ranges of the speeds at the start, before each hit and at the end, a place in each
    of these, the restitution, and the largest force."""

    def __init__(self, rng: np.random.Generator) -> None:
        hits = int(rng.integers(0, 4))
        walls = np.resize(rng.permutation([0.0, 1.0]), hits)
        first, last = rng.uniform(0.1, 0.9, 2)
        self.places = np.array([first, *walls, last])
        self.e = float(rng.uniform(0.3, 1.0))
        low, high = np.sort(rng.normal(size=(2, 2)), axis=0)
        fixed = rng.random(2) < 0.5
        self.low = np.array([low[0], *np.where(walls > 0, 0.0, -99.0), low[1]])
        self.high = np.array([high[0], *np.where(walls > 0, 99.0, 0.0), high[1]])
        self.high[[0, -1]] = np.where(fixed, self.low[[0, -1]], self.high[[0, -1]])
        self.final_time = float(rng.uniform(0.5, 2.0))
        self.force = np.inf if rng.random() < 0.5 else float(rng.uniform(5, 60))

    def problem(self, kernels: Any) -> dmoc.Problem:
        pairs = [(a, b) if a < b else a for a, b in zip(self.low, self.high, strict=True)]
        walls = ["right" if place == 1 else "left" for place in self.places[1:-1]]
        return dmoc.Problem(
            kernels, start={"x": self.places[0], "x_dot": pairs[0]}, sequence=walls,
            goal={"x": self.places[-1], "x_dot": pairs[-1]}, restitution=self.e, steps=STEPS,
            final_time=self.final_time, bounds={"u": (-self.force, self.force)},
        ).in_rates()  # fmt: skip

    def motions(self, rng: np.random.Generator, low: Array, high: Array) -> Array:
        """Costs of feasible motions with durations in a box, about the best ones for these."""
        T = rng.uniform(low, high, (4 * OF_A_BOX, len(low)))
        T[:, -1] = self.final_time - T[:, :-1].sum(axis=1)
        T = T[(T[:, -1] >= low[-1]) & (T[:, -1] <= high[-1])]
        v = self._best(T)
        v += rng.normal(size=v.shape) * 10.0 ** rng.uniform(-6, 0.5, (len(v), 1))
        v = np.clip(v, self.low, self.high)
        after = np.where(np.arange(v.shape[1]) > 0, -self.e * v, v)[:, :-1]
        d, a, b = np.diff(self.places) / T, after, v[:, 1:]
        cost = (2 / T * ((a - d) ** 2 + (a - d) * (b - d) + (b - d) ** 2)).sum(axis=1)
        force = np.maximum(np.abs(6 * d - 4 * a - 2 * b), np.abs(6 * d - 2 * a - 4 * b)) / T
        s = np.linspace(0, 1, 4 * STEPS + 1)[:, None, None]
        bent = s * (a + s * (3 * d - 2 * a - b + s * (a + b - 2 * d)))
        x = self.places[:-1] + T * bent
        inside = ((x >= -PLACES) & (x <= 1 + PLACES)).all(axis=(0, 2))
        return np.asarray(cost[inside & (force <= self.force).all(axis=1)][:OF_A_BOX])

    def _best(self, T: Array) -> Array:
        """Speeds of least cost for durations, without any limit, shape (motions, speeds)."""
        count, n = len(T), len(self.places)
        to_a, to_b = np.eye(n)[:-1], np.eye(n)[1:]
        to_a[1:] *= -self.e
        d = np.diff(self.places)
        H, g = np.zeros((count, n, n)), np.zeros((count, n))
        for i in range(n - 1):
            a, b, t = to_a[i], to_b[i], T[:, i]
            curved = 2 * np.outer(a, a) + 2 * np.outer(b, b) + np.outer(a, b) + np.outer(b, a)
            H += 2 * curved / t[:, None, None]
            g -= 6 * (a + b) * (d[i] / t**2)[:, None]
        fixed = self.low == self.high
        v = np.tile(np.where(fixed, self.low, 0.0), (count, 1))
        g = (g + np.einsum("kij,kj->ki", H, v))[:, ~fixed]
        if not fixed.all():
            v[:, ~fixed] = -np.linalg.solve(H[:, ~fixed][:, :, ~fixed], g[..., None])[..., 0]
        return v


def compared(rng: np.random.Generator, kernels: Any) -> tuple[Array, float]:
    """Costs of motions of a random box of a random problem, and its bound."""
    case = Case(rng)
    phases = len(case.places) - 1
    middle = rng.dirichlet(np.full(phases, 6.0)) * case.final_time
    width = np.exp(10.0 ** rng.uniform(-4, -0.5, phases))
    low, high = middle / width, middle * width
    costs = case.motions(rng, low, high)
    if not len(costs):
        return costs, 0.0
    linear = linear_problem(case.problem(kernels).but(durations=[*zip(low, high, strict=True)]))
    size = float(costs.min()) + 1.0
    branch = Branch(linear, np.inf, 1e4 * size, 1e-9, 1e-9 * size, size)
    branch.run(int(rng.integers(1, 60)))
    return costs, branch.bound


def proved(hits: int, kernels: Any) -> list[Any]:
    """Boxes and processor seconds of bounds within 1e-4 of the least cost."""
    places, cost = HITS[hits]
    problem = dmoc.Problem(
        kernels, start={"x": places[0]}, goal={"x": places[-1], "x_dot": 0.0}, final_time=1.0,
        sequence=["right" if place == 1 else "left" for place in places[1:-1]], steps=10,
        restitution=0.8,
    )  # fmt: skip
    linear = linear_problem(problem.in_rates())
    begin = time.process_time()
    branch = Branch(linear, cost * (1 + 1e-6), 1e4 * cost, 0.5e-4, 1e-9 * cost, cost)
    while branch.run(10_000):
        pass
    seconds = time.process_time() - begin
    return [hits, f"{cost:.6g}", f"{branch.bound:.6g}", branch.boxes, f"{seconds:.2f}"]


def sampled(wanted: float, kernels: Any) -> list[Any]:
    """Motions, boxes, motions below a bound, and the nearest of them."""
    rng = np.random.default_rng(0)
    motions = boxes = below = 0
    nearest = np.inf
    while motions < wanted:
        costs, bound = compared(rng, kernels)
        if not len(costs):
            continue
        motions, boxes = motions + len(costs), boxes + 1
        below += int((costs < bound - ROUNDING * np.abs(costs)).sum())
        nearest = min(nearest, float((costs.min() - bound) / costs.min()))
    return [motions, boxes, below, f"{nearest:.1e}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", type=float, default=MOTIONS)
    parser.add_argument("--hits", type=int, default=max(HITS))
    options, kernels = parser.parse_args(), block()
    times = [proved(hits, kernels) for hits in HITS if hits <= options.hits]
    row = sampled(options.motions, kernels)
    print(*times, row, sep="\n")
    if options.motions < MOTIONS or options.hits < max(HITS):
        return
    sections = (
        Section(
            "How long they take",
            "A block of 1 kg between walls at 0 and 1, from rest to rest in a second, e = 0.8, 10 "
            "steps of order 4 in each phase, a gap of 1e-4. Processor seconds of one thread, which "
            "are more where others work on the same cores.",
            ["hits", "least cost", "bound", "boxes", "seconds"],
            times,
        ),
        Section(
            "Whether they hold",
            "Costs of feasible motions, closed forms of random problems with up to three hits, "
            "beside the bounds of boxes that have their durations. Nearest: how far the least cost "
            "of a box was above its bound, relative to it.",
            ["motions", "boxes", "below the bound", "nearest"],
            [row],
        ),
    )
    text = "\n\n".join(("# Bounds", filled(machine()), *(s.markdown().strip() for s in sections)))
    write_whole(REPORT, f"{text}\n".encode())


if __name__ == "__main__":
    main()
