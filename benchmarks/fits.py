"""Fits: how often errors say the truth, and how long a fit takes."""

from __future__ import annotations

from typing import Any

import numpy as np
from common import Section, find, ms, timed  # first: it finds the examples

import dmoc

RUNS, QUICK = 200, 20
NOISE = 0.002  # rad, of an angle that is measured every 10 ms
SAMPLES, FORCE = 1000, 6.0  # of the pushed cart, newton


def compare(quick: bool) -> Section:
    section = Section(
        "Fits",
        "`dmoc.fit` of runs through hits, with noise of a known size that the fit has to estimate. "
        "Errors within twice the standard error are 95 % of all where the errors say the truth.",
        ("what", "runs", "values", "found"),
    )
    for name, share in coverage(QUICK if quick else RUNS).items():
        section.row("errors within twice the standard error", QUICK if quick else RUNS, name, share)
    seconds, fit = timed(pushed_cart, 3)
    section.row(f"{SAMPLES} samples of a cart-pendulum, a hit, checked", 1,
                f"{len(fit.unknowns)} parameters", ms(seconds))  # fmt: skip
    return section


def coverage(runs: int) -> dict[str, str]:
    """Of fits of a pendulum through three hits, the share of errors within twice the standard
    error, by unknown."""
    truth = {"g": 9.81, "e": 0.8, "start of theta": 0.9, "start of theta_dot": 0.0}
    start = {"theta": None, "theta_dot": None}
    problem = dmoc.Problem(find("bouncing_pendulum").kernels(), start=start, sequence=["wall"] * 3)
    motion = dmoc.simulate(
        problem.kernels, {"theta": 0.9}, restitution=0.8, step_size=2e-4, steps=16000, every=50
    )
    within = dict.fromkeys(truth, 0)
    for seed in range(runs):
        noise = NOISE * np.random.default_rng(seed).normal(size=len(motion.t))
        seen = {"t": motion.t, "theta": motion.q[:, 0] + noise}
        fit = dmoc.fit(problem, seen, {"g": (5, 20), "e": (0, 1)})
        for name, value in truth.items():
            within[name] += abs(fit[name] - value) < 2 * fit.errors[name]
    return {name: f"{100 * count / runs:.1f} %" for name, count in within.items()}


def pushed_cart() -> Any:
    """A fit of five parameters of a cart-pendulum that is pushed through two hits."""
    kernels, duration = find("cart_pendulum").kernels(), 0.25
    force = FORCE * np.sin(17 * np.linspace(0, duration, SAMPLES + 1))
    problem = dmoc.Problem(kernels, start={"alpha": 0.47, "x": 0.0}, sequence=["lower"])
    if not RUN:  # once
        motion = dmoc.simulate(
            kernels, {"alpha": 0.47, "x": 0.0}, parameters={"m_p": 1.2, "m_c": 0.8, "l": 0.55},
            inputs=np.repeat(force[:-1], 10)[:, None], restitution=0.6, every=10,
            step_size=duration / SAMPLES / 10, steps=10 * SAMPLES,
        )  # fmt: skip
        noise = NOISE * np.random.default_rng(1).normal(size=(2, len(motion.t)))
        RUN.update({"t": motion.t, "alpha": motion.q[:, 0] + noise[0],
                    "x": motion.q[:, 1] + noise[1], "F": force})  # fmt: skip
    unknown = {"m_p": (0.5, 2), "m_c": (0.5, 2), "l": (0.3, 0.8), "g": (5, 15), "e": (0, 1)}
    fit = dmoc.fit(problem, RUN, unknown)
    assert fit.motions[0].solved
    return fit


RUN: dict[str, Any] = {}
