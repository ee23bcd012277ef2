"""Bounces of table-tennis balls on nine rackets, measured by T. Gossard and others (arXiv
2604.11349), fitted.

python benchmarks/fit_rackets.py FOLDER    data/train of the repository gossardt/tt_rackets

Their law: v_z+ = -(c0 + c1 v_z) v_z, and a tangential impulse of k_p times the slip, which is a
tangential restitution e_t of a hollow sphere, k_p = 0.4 M (1 + e_t).  They take means of the ratios
of single bounces, k_p of velocity and spin: a fit does so where the standard deviation of what a
bounce changes grows as what it is divided by.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import sympy as sp
from common import clocked
from sympy.physics.mechanics import dynamicsymbols

import dmoc

MASS, RADIUS, HOLLOW = 2.7e-3, 0.02, 2 / 3  # kg, m, and the moment of inertia by M R^2
# By racket: the mean coefficient of restitution, and k_p in kg.
PUBLISHED = {
    "01": (0.76815, 1.83987e-3), "02": (0.73826, 1.80838e-3), "03": (0.72409, 1.86315e-3),
    "04": (0.69240, 1.81219e-3), "05": (0.69829, 0.80344e-3), "06": (0.69055, 0.66773e-3),
    "07": (0.67848, 1.39777e-3), "08": (0.75618, 1.86985e-3), "09": (0.75470, 1.86423e-3),
}  # fmt: skip
SHARE = 0.1  # of a ratio: its standard deviation


def problem() -> dmoc.Problem:
    """A ball that hits a racket."""
    x, z, a = dynamicsymbols("x z a")
    r, k, c0, c1, e_t = sp.symbols("r k c0 c1 e_t")
    ball = dmoc.MechanicalSystem(
        "table_tennis", [x, z, a],
        (x.diff() ** 2 + z.diff() ** 2 + k * r**2 * a.diff() ** 2) / 2,
        {r: RADIUS, k: HOLLOW, c0: 0.8, c1: 0.0, e_t: 0.0}, surfaces={"racket": z >= r},
        tangents={"racket": x - r * a}, tangential_restitution={"racket": e_t},
        restitution={"racket": c0 - c1 * dmoc.approach_speed},
    )  # fmt: skip
    start = {"x": 0, "z": 1, "a": 0}
    return dmoc.Problem(dmoc.build(ball), start=start, sequence=["racket"])


def bounces(path: Path) -> dict[str, np.ndarray]:
    """The table of the bounces of a racket."""
    rows = np.genfromtxt(path, delimiter=",", names=True)
    columns = {"x_dot": ("v_in_x", "v_out_x"), "z_dot": ("v_in_z", "v_out_z"),
               "a_dot": ("spin_before_y", "spin_after_y")}  # fmt: skip
    table = {}
    for name, (before, after) in columns.items():
        table |= {f"{name} before": rows[before], f"{name} after": rows[after]}
    slip = np.abs(rows["v_in_x"] - RADIUS * rows["spin_before_y"])
    table["of x"] = SHARE * slip
    table["of a"] = SHARE * slip / (HOLLOW * RADIUS)
    table["of z"] = SHARE * np.abs(rows["v_in_z"])
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder, stated = parser.parse_args().folder, problem()
    sigma = {f"{name}_dot": f"of {name}" for name in "xza"}
    ranges = {"c0": (0.0, 1.0), "c1": (0.0, 0.1), "e_t": (-1.0, 1.0)}
    for racket, (e, k_p) in PUBLISHED.items():
        path = folder / f"racket_{racket}.csv"
        if not path.exists():
            continue
        table = bounces(path)
        seconds, fit = clocked(lambda table=table: dmoc.fit(stated, table, ranges, sigma=sigma))
        mean = float(np.mean(fit["c0"] + fit["c1"] * table["z_dot before"]))
        found = 0.4 * MASS * (1 + fit["e_t"])
        told = [f"{racket}: {len(table['of x'])} bounces in {seconds:.2f} s"]
        told += [f"c0 {fit['c0']:.5f}, c1 {fit['c1']:.6f}", f"mean e {mean:.5f} ({e:.5f})"]
        told += [f"k_p {1e3 * found:.4f}e-3 ({1e3 * k_p:.4f}e-3)"]
        print(", ".join(told))


if __name__ == "__main__":
    main()
