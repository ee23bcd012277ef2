"""Motions run on models that are wrong, open loop, with their feedback and with plans of the rest:
how many arrive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from common import Section, clocked, find  # first: it finds the examples

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Array

MODELS, PLANNED = 200, 50  # with plans a run takes seconds
EVERY = 0.01  # seconds between plans
ARRIVED = 0.1  # of the size of each state of the goal
NOISE = 1e-3, 1e-2  # of coordinates and velocities, in m and rad


@dataclass(frozen=True)
class FeedbackCase:
    """A motion: its problem, the states that have to arrive, what of its model is wrong by a tenth,
    and, by names, by how much else."""

    name: str
    problem: Callable[[], dmoc.Problem]
    arrive: tuple[str, ...]
    masses: tuple[str, ...] = ()
    walls: dict[str, float] = field(default_factory=dict)
    start: dict[str, float] = field(default_factory=dict)
    restitution: float = 0.0
    weights: dict[str, Any] = field(default_factory=dict)
    tolerance: float = 0.0


def shipped(name: str, steps: int) -> dmoc.Problem:
    reference = find(name)
    return dmoc.Problem(reference.kernels(4), **{**reference.defaults, "steps": steps})


def example(name: str, *arguments: int) -> dmoc.Problem:
    """The problem of an example."""
    made: dmoc.Problem = import_module(name).problem(*arguments)
    return made


LINKS = ("torso", "thigh_l", "shin_l", "thigh_r", "shin_r")
LIMITERS = {"alpha_min": 0.02, "alpha_max": 0.02}
CASES = (
    FeedbackCase("swing-up", lambda: shipped("cart_pendulum", 40), ("alpha", "alpha_dot", "x_dot"),
         ("m_p", "m_c"), LIMITERS, restitution=0.1),
    FeedbackCase("swing-up from hanging", lambda: shipped("cart_pendulum_hanging", 60),
         ("alpha", "alpha_dot", "x_dot"), ("m_p", "m_c"), LIMITERS, restitution=0.1),
    FeedbackCase("hop", lambda: example("hopper", 40, 4), ("y", "phi", "r"), ("M", "m"),
         start={"y": 0.01}, restitution=0.1, weights={"Q": 100.0}, tolerance=0.04),
    FeedbackCase("step of a walker", lambda: example("walker"), ("x", *LINKS),
         start={f"{name}_dot": 0.05 for name in LINKS}, tolerance=0.02),
)  # fmt: skip


def wrong(case: FeedbackCase, motion: dmoc.Solution, random: np.random.Generator) -> dict[str, Any]:
    """Arguments of a simulation of a model that is wrong."""
    trajectory = motion.trajectory

    def around(size: float) -> float:
        return float(random.uniform(-size, size))

    own = trajectory.parameters
    parameters = {name: own[name] * (1 + around(0.1)) for name in case.masses}
    parameters |= {name: own[name] + around(size) for name, size in case.walls.items()}
    states = [(n, NOISE[0]) for n in trajectory.coordinates]
    states += [(f"{n}_dot", NOISE[1]) for n in trajectory.coordinates]
    disturb = {
        "noise": dict(states),
        "start": {name: around(size) for name, size in case.start.items()},
        "seed": int(random.integers(2**31)),
    }
    change: dict[str, Any] = {"parameters": parameters, "disturb": disturb}
    if case.restitution:
        change["restitution"] = {
            name: float(np.clip(e + around(case.restitution), 0.0, 1.0))
            for name, e in trajectory.restitution.items()
            if e is not None
        }
    return change


def off(
    case: FeedbackCase, motion: dmoc.Solution, sizes: dict[str, float], run: dmoc.Simulation
) -> float:
    """By how much the end is off, in the sizes of states."""
    names = motion.trajectory.coordinates
    every = (*names, *(f"{n}_dot" for n in names))
    last = motion.phases[-1]
    ends = [np.append(run.q[-1], run.v[-1]), np.append(last.q[-1], last.v[-1])]
    errors: Array = np.abs(ends[0] - ends[1])
    chosen = case.arrive or every
    return max(errors[every.index(name)] / sizes[name] for name in chosen)


def compare(quick: bool, folder: Path) -> Section:
    models, planned = (20, 5) if quick else (MODELS, PLANNED)
    section = Section(
        "Feedback: how many motions arrive on models that are wrong?",
        f"{models} models each, drawn at random, of which plans run on the first {planned}: masses "
        "wrong by up to 10 %, limiters by 0.02 rad (1 cm at the tip), restitution by 0.1, starts "
        "as said; measured are all states, each millisecond, with normal errors of "
        f"{NOISE[0]:g} in coordinates and {NOISE[1]:g} in velocities (m, rad, s). Arrived: the "
        "states named are, at the final time, within "
        f"{ARRIVED:g} of their sizes of those of the plan. Gains over one hop and one step, too; "
        "default weights, of the hop 100 times Q. A plan is made each "
        f"{1e3 * EVERY:g} ms, to within 0.04 and 0.02 of the sizes for hop and step. Off: the "
        "median.",
        [
            "motion", "states", "open loop", "feedback", "plans", "off: feedback", "off: plans",
            "s: feedback", "s: plans",
        ],
        after="![shares that arrive](feedback.png)",
    )  # fmt: skip
    shares = {}
    for case in CASES:
        problem = case.problem()
        motion = dmoc.solve(problem, "ipm")
        once = replace(motion, periodic={})  # one hop, one step
        stability, hold = motion.stability(), dmoc.feedback(once, **case.weights)
        sizes = dict(zip(stability.states, map(float, stability.sizes), strict=True))
        ways = (
            (None, models), (hold, models),
            (dmoc.Planner(problem, motion, every=EVERY, tolerance=case.tolerance), planned),
        )  # fmt: skip
        runs = [tried(case, motion, sizes, steers, count) for steers, count in ways]
        shares[case.name] = [np.mean(errors < ARRIVED) for errors, _ in runs]
        section.row(
            case.name, ", ".join(case.arrive) or "all",
            *(f"{100 * share:.0f} %" for share in shares[case.name]),
            *(f"{np.median(errors):.2g}" for errors, _ in runs[1:]),
            *(f"{seconds:.2f}" for _, seconds in runs[1:]),
        )  # fmt: skip
    _plot(shares, folder / "feedback.png")
    return section


def tried(
    case: FeedbackCase, motion: dmoc.Solution, sizes: dict[str, float], steers: Any, models: int
) -> tuple[Array, float]:
    """By how much the ends of runs on some models are off, infinite where a run has no end, and the
    median of their seconds."""
    random, errors, seconds = np.random.default_rng(0), list[float](), list[float]()
    for _ in range(models):
        change = wrong(case, motion, random)
        try:
            time, run = clocked(partial(dmoc.simulate, motion, feedback=steers, **change))
        except SimulationError:
            errors.append(np.inf)
            continue
        errors.append(off(case, motion, sizes, run))
        seconds.append(time)
    return np.array(errors), median(seconds) if seconds else np.nan


def _plot(shares: dict[str, list[float]], path: Path) -> None:
    """A group of bars for each motion."""
    figure, axes = plt.subplots(figsize=(6.4, 2.6), layout="constrained")
    for k, name in enumerate(("open loop", "feedback", "plans")):
        at = np.arange(len(shares)) + 0.26 * (k - 1)
        bars = axes.bar(at, [100 * share[k] for share in shares.values()], 0.24, label=name)
        axes.bar_label(bars, fmt="%.0f", fontsize=8)
    axes.set_xticks(range(len(shares)), list(shares))
    axes.set(ylabel="models that arrive, %", ylim=(0, 125))
    axes.legend(ncols=3, frameon=False, fontsize=8, loc="upper left")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    figure.savefig(path, dpi=150)
    plt.close(figure)
