"""What a command of the command line gives to a test."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

# Exit status, standard output and standard error of ``dmoc`` with the words of a command, as a
# shell reads them, and further arguments as they are.
Run = Callable[..., tuple[int, str, str]]
Model = Callable[[str], str]  # the name of a model that a line of Python makes


def printed(
    *command: str | Path, cwd: Path | None = None, env: Mapping[str, str] | None = None
) -> str:
    """What a program prints that succeeds."""
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=300, cwd=cwd, env=os.environ | (env or {})
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


# Files of models, to which lines may be added.
FALLING = """
import math
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
import dmoc
x, y, u, d = dynamicsymbols("x y u durations")
m, g, k = sp.symbols("m g k")
t = dynamicsymbols._t
both = y.diff(t)**2 + d.diff(t)**2
def make(name="mass", lagrangian=None, **changes):
    falling = m * y.diff(t)**2 / 2 - m * g * y
    given = dict(coordinates=[y], inputs=[u], lagrangian=lagrangian or falling, forces={y: u},
                 surfaces={"floor": y >= 0}, parameters={m: 1.0, g: 9.81}, cost=u**2 / 2)
    return dmoc.MechanicalSystem(name, **{**given, **changes})
"""
CONTACT_MODELS = """
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
import dmoc
x, y, u = dynamicsymbols("x y u")
m, f, g, mu = sp.symbols("m f g mu")
t = dynamicsymbols._t
railed = dmoc.MechanicalSystem(
    "railed", [x], m * x.diff(t)**2 / 2, {m: 1.0, f: 1.0}, inputs=[u], forces={x: u},
    cost=u**2 / 2, tangents={"rail": x}, friction={"rail": f})
landing = dmoc.MechanicalSystem(
    "landing", [x, y], m * (x.diff(t)**2 + y.diff(t)**2) / 2 - m * g * y,
    {m: 1.0, g: 10.0, mu: 0.1}, inputs=[u], forces={x: u}, cost=u**2 / 2,
    surfaces={"floor": y >= 0, "side": x <= 9}, tangents={"floor": x}, friction={"floor": mu})
rodded = dmoc.MechanicalSystem(
    "rodded", [x, y], (x.diff(t)**2 + y.diff(t)**2) / 2 - 10 * y, inputs=[u],
    forces={x: -u * y, y: u * x}, cost=u**2, constraints={"rod": sp.Eq(x**2 + y**2, 1)})
def problem():
    return dmoc.Problem(
        landing, start={"x": 0, "y": 0}, goal={"x": 1, "x_dot": 0}, contacts=["floor"],
        sequence=["floor:slip+", "floor:stick"], via=[{"x": 0}, {"x": 1}], ignored=["side"],
        final_time=4, steps=12)
"""
