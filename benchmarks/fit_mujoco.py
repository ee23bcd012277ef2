"""One bouncing track, fitted by dmoc and by MuJoCo's sysid, and a run that was kept out.

python benchmarks/fit_mujoco.py    needs MuJoCo beside dmoc: pip install 'mujoco[sysid]'

A ball is dropped from 1 m and keeps 80 % of its speed at each bounce; its height is measured every
10 ms with errors of 3 mm.  Both fit gravity and what their contact has: dmoc a coefficient of
restitution, MuJoCo the stiffness and damping of its soft contact, from several first values, of
which the best counts.  The run that was kept out drops it from 0.6 m; errors are those of its
heights without noise.
"""

from __future__ import annotations

import logging
from typing import Any

import mujoco
import numpy as np
from common import clocked  # first of ours: it finds the others
from mujoco import sysid
from systems import dropped_ball

import dmoc

GRAVITY, E, NOISE, EVERY, TIME = 9.81, 0.8, 0.003, 0.01, 1.9
DROPS = {"fitted": 1.0, "kept out": 0.6}
TIMESTEP = 1e-4  # of MuJoCo: bounces are resolved, and smaller ones change nothing
# Stiffness to begin with, and the damping that makes of it about the true restitution.
FIRST = tuple((k, 2 * 0.071 * k**0.5) for k in (1e4, 1e5))
XML = f"""
<mujoco><option timestep="{TIMESTEP}" gravity="0 0 -9.5"/><worldbody>
  <geom name="floor" type="plane" size="1 1 .1"/>
  <body name="ball" pos="0 0 0.05"><joint name="y" type="slide" axis="0 0 1"/>
    <geom name="ball" type="sphere" size="0.05" mass="1"/></body></worldbody>
  <contact><pair name="hit" geom1="ball" geom2="floor" solref="-10000 -5" condim="1"/></contact>
  <actuator><motor name="none" joint="y"/></actuator>
  <sensor><jointpos name="height" joint="y"/></sensor></mujoco>
"""


def heights(drop: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and heights of the true ball, in closed form."""
    t = np.arange(0, TIME, EVERY)
    y, begin, speed, place = np.empty_like(t), 0.0, 0.0, drop
    for i, now in enumerate(t):
        while True:
            s = now - begin
            here = place + speed * s - GRAVITY * s**2 / 2
            if here >= 0:
                break
            flight = (speed + np.sqrt(speed**2 + 2 * GRAVITY * place)) / GRAVITY
            begin, speed, place = begin + flight, E * (GRAVITY * flight - speed), 0.0
        y[i] = here
    return t, y


def by_dmoc(t: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Heights of the run that was kept out, as the fit predicts them."""
    kernels = dmoc.build(dropped_ball())
    problem = dmoc.Problem(kernels, start={"q": DROPS["fitted"]}, parameters={"g": 9.5})
    fit = dmoc.fit(problem, {"t": t, "q": seen}, {"g": (5, 15), "e": (0, 1)})
    other = fit.predict({"t": t, "q": heights(DROPS["kept out"])[1]}, {"q": DROPS["kept out"]})
    return other.predicted


def by_mujoco(t: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """The same by the soft contact that fits best."""
    spec = mujoco.MjSpec.from_string(XML)
    model = spec.compile()
    steps = round(TIME / TIMESTEP)
    control = sysid.TimeSeries.from_control_names(
        np.arange(steps) * TIMESTEP, np.zeros((steps, 1)), model
    )
    measured = sysid.TimeSeries.from_names(t, seen[:, None], model)
    start = sysid.create_initial_state(model, np.array([DROPS["fitted"]]))
    runs = sysid.ModelSequences("ball", spec, "drop", start, control, measured)
    residual = sysid.build_residual_fn(models_sequences=[runs])
    best = min((_fitted(residual, *first) for first in FIRST), key=lambda made: made[0])
    print(f"MuJoCo: rms {np.sqrt(best[0] / len(t)):.4f}, {best[1]}")
    return _predicted(t, best[1])


def _fitted(residual: Any, stiffness: float, damping: float) -> tuple[float, dict[str, float]]:
    params = sysid.ParameterDict()
    values = {"g": (GRAVITY, 5.0, 15.0), "k": (np.log(stiffness), 6.0, 15.0),
              "b": (np.log(damping), -2.0, 8.0)}  # fmt: skip
    for name, (first, low, high) in values.items():
        change = {"g": _gravity, "k": _stiffness, "b": _damping}[name]
        params.add(sysid.Parameter(name, first, min_value=low, max_value=high, modifier=change))
    found, _ = sysid.optimize(params, residual, verbose=False, max_iters=100)
    made = residual(found.as_vector(), found)[0]
    square = float(sum(np.sum(np.square(part)) for part in np.atleast_1d(made)))
    return square, {name: float(found[name].value[0]) for name in values}


def _gravity(spec: Any, p: Any) -> None:
    spec.option.gravity = [0, 0, -p.value[0]]


def _stiffness(spec: Any, p: Any) -> None:
    spec.pairs[0].solref[0] = -np.exp(p.value[0])


def _damping(spec: Any, p: Any) -> None:
    spec.pairs[0].solref[1] = -np.exp(p.value[0])


def _predicted(t: np.ndarray, values: dict[str, float]) -> np.ndarray:
    model = mujoco.MjModel.from_xml_string(XML)
    model.opt.gravity[2] = -values["g"]
    model.pair_solref[0] = -np.exp(values["k"]), -np.exp(values["b"])
    data = mujoco.MjData(model)
    data.qpos[0] = DROPS["kept out"]
    made = np.empty(len(t))
    for i, time in enumerate(t):
        while data.time < time - TIMESTEP / 2:
            mujoco.mj_step(model, data)
        made[i] = data.qpos[0]
    return made


def main() -> None:
    logging.disable(logging.WARNING)
    t, y = heights(DROPS["fitted"])
    seen = y + NOISE * np.random.default_rng(0).normal(size=len(t))
    truth = heights(DROPS["kept out"])[1]
    for name, fitted in (("dmoc", by_dmoc), ("MuJoCo sysid", by_mujoco)):
        seconds, made = clocked(lambda fitted=fitted: fitted(t, seen))
        off = float(np.sqrt(np.mean((made - truth) ** 2)))
        print(f"{name}: off by {1000 * off:.3f} mm on the run that was kept out, {seconds:.1f} s")


if __name__ == "__main__":
    main()
