"""Hits of an ellipse on a floor, measured by N. Fazeli and others (arXiv 1710.05947), fitted.

python benchmarks/fit_ellipse.py ellipse_uniform.mat    from the repository DAIRLab/ImpactModeling

Each of the 2000 hits has its velocities before and after, and its contact point, by the normal
(0, 1, n) and the tangent (1, 0, d) there.  A model whose gap is y + n theta, at theta = 0, has the
same.  Errors are lengths of velocities, with the angular one times the radius of gyration.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import sympy as sp
from common import clocked
from scipy.io import loadmat
from sympy.physics.mechanics import dynamicsymbols

import dmoc

MASS, GYRATION = 0.0364, 0.0192  # kg, m
PUBLISHED = {"mu": 0.0569, "e": 0.5905}


def system() -> dmoc.MechanicalSystem:
    """A body whose contact point says two coordinates of their own, n and d."""
    x, y, theta, n, d = dynamicsymbols("x y theta n d")
    m, rho, mu = sp.symbols("m rho mu")
    squares = [x.diff(), y.diff(), rho * theta.diff(), n.diff(), d.diff()]
    return dmoc.MechanicalSystem(
        "ellipse", [x, y, theta, n, d], m * sum(v**2 for v in squares) / 2,
        {m: MASS, rho: GYRATION, mu: 0.1}, surfaces={"floor": y + n * theta >= 0},
        tangents={"floor": x + d * theta}, friction={"floor": mu},
    )  # fmt: skip


def hits(path: Path) -> dict[str, np.ndarray]:
    """The table of all hits without a flag."""
    every = loadmat(path, struct_as_record=False, squeeze_me=True)["bounce_array"]
    kept = [hit for hit in every if not hit.flags.any()]
    states = np.array([hit.states for hit in kept])
    table = {"n before": np.array([hit.n[2] for hit in kept]),
             "d before": np.array([hit.d[2] for hit in kept])}  # fmt: skip
    for i, name in enumerate(("x", "y", "theta")):
        table[f"{name}_dot before"] = states[:, 3 + i]
        table[f"{name}_dot after"] = states[:, 9 + i]
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    table = hits(parser.parse_args().file)
    start = dict.fromkeys(["x", "y", "theta", "n", "d"], 0.0) | {"y_dot": None}
    problem = dmoc.Problem(dmoc.build(system()), start=start, sequence=["floor"])
    sigma = {"x_dot": 1.0, "y_dot": 1.0, "theta_dot": 1 / GYRATION}
    ranges = {"mu": (1e-3, 1.0), "e": (0.0, 1.0)}
    seconds, fit = clocked(lambda: dmoc.fit(problem, table, ranges, sigma=sigma))
    count = len(table["n before"])
    print(fit)
    print(f"{count} hits, rms {np.sqrt(fit.chi2 / count):.4f} m/s, {seconds:.1f} s")
    values = problem.but(parameters={"mu": PUBLISHED["mu"]}, restitution=PUBLISHED["e"])
    kept = dmoc.fit(
        values, table, {"rho": (GYRATION * (1 - 1e-9), GYRATION * (1 + 1e-9))}, sigma=sigma
    )
    print(f"with the published values: rms {np.sqrt(kept.chi2 / count):.4f} m/s")


if __name__ == "__main__":
    main()
