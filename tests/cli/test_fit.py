"""`dmoc fit`: what it takes, writes and tells."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from commands import Run

import dmoc


@pytest.fixture
def track(tmp_path: Path) -> Path:
    """A pendulum that is let go and hits its wall once, with e = 0.8 and g = 9.81."""
    motion = dmoc.simulate(
        dmoc.load("bouncing_pendulum"), {"theta": 0.9}, restitution=0.8, step_size=0.001,
        steps=1000, every=20,
    )  # fmt: skip
    noise = 0.002 * np.random.default_rng(1).normal(size=len(motion.t))
    rows = zip(motion.t.tolist(), (motion.q[:, 0] + noise).tolist(), strict=True)
    path = tmp_path / "track.csv"
    path.write_text("t [s],theta [rad]\n" + "".join(f"{t},{x}\n" for t, x in rows))
    return path


def test_a_run_is_fitted_and_all_is_written(run: Run, track: Path) -> None:
    options = "--start theta=0.9 --sigma theta=0.002 --parameter g=5:20,e=0:1 --out out"
    code, out, err = run(f"fit bouncing_pendulum {track.name} {options}")
    assert code == 0 and not err and "no sequence is given: wall fits track best" in out
    fit = dmoc.Fit.load("out/fit.npz")
    assert abs(fit["e"] - 0.8) < 4 * fit.errors["e"] < 0.01
    assert json.loads(Path("out/fit.json").read_text())["words"] == {"track": ["wall"]}
    assert {p.name for p in Path("out").iterdir()} == {
        f"fit.{ending}" for ending in ("npz", "json", "csv", "png", "html")
    }


def test_a_misfit_has_another_exit_status(run: Run, track: Path) -> None:
    options = "--start theta=0.9 --sequence wall --parameter m=0.1:10 --set g=5 --json -"
    code, out, _ = run(f"fit bouncing_pendulum {track.name} {options}")
    assert code == 1 and json.loads(out)["status"] == "misfit"
