"""`dmoc simulate`: what it takes, writes and tells."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import Run
from systems import there_and_back

import dmoc

BETWEEN = """
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
import dmoc
x = dynamicsymbols("x")
m, a = sp.symbols("m a")
between = dmoc.MechanicalSystem("between", [x], m * x.diff() ** 2 / 2, {m: 1.0, a: 1.0},
    surfaces={"left": x >= -a, "right": x <= a})
"""


def test_a_model_is_simulated(run: Run, tmp_path: Path) -> None:
    """The pendulum falls from the side and bounces off its wall, at the bottom, elastically."""
    options = "--start theta=1 --final-time 2 --steps 200 --out ."
    code, out, _ = run(f"simulate bouncing_pendulum {options}")
    assert code == 0 and "collision wall" in out and "2 s in 200 recorded steps" in out
    motion = dmoc.Simulation.load("simulation.npz")
    assert motion.q[0, 0] == 1 and len(motion.collisions) >= 1
    assert Path("simulation.csv").exists() and Path("simulation.png").exists()


def test_a_solution_is_simulated(run: Run, seed: dmoc.Problem) -> None:
    dmoc.solve(seed.but(steps=40), "ipm", starts=1).save("s.npz")
    code, out, _ = run("simulate s.npz")
    assert code == 0 and "collision lower" in out


def test_a_solution_of_a_model_that_is_named_is_simulated(
    run: Run, block: dmoc.codegen.kernels.Kernels
) -> None:
    dmoc.solve(there_and_back(block, steps=10), "ipm", starts=1).save("s.npz")
    systems = Path(__file__).parents[1] / "systems.py"
    code, out, err = run(f"simulate s.npz --model {systems}:block_system")
    assert code == 0 and "collision wall" in out, err


@pytest.mark.slow
def test_several_values_stand_in_one_option_with_commas(run: Run) -> None:
    """A mass between two walls that take different shares of its speed."""
    Path("between.py").write_text(BETWEEN)
    outputs = set()
    for options in (
        "--start x=0.5,x_dot=1 --restitution right=0.5,left=0.8 --set 'm=2, a=0.75'",
        "--start x=0.5 --start x_dot=1 --restitution right=0.5 --restitution left=0.8 "
        "--set m=2 --set a=0.75",
    ):
        code, out, err = run(f"simulate between.py:between --final-time 3 {options}")
        assert code == 0, err
        outputs.add(out)
    # 2 kg come with 1 m/s to the right wall after 0.25 m.
    (text,) = outputs
    assert "impulse 3" in text and "at 0.25 s" in text


TOP = """
import dmoc

world = dmoc.spatial.World(gravity=0)
world.ball("q", inertia=(1, 1, 2))
top = world.system("spinner", cost=1)
"""


def test_an_attitude_is_four_numbers(run: Run) -> None:
    Path("top.py").write_text(TOP, encoding="utf-8")
    words = "simulate top.py:top --final-time 1 --steps 10 --start".split()
    code, out, err = run(*words, "q=0,1,0,0,q_omega_z=2", "--start", "q_omega_x=1")
    assert code == 0 and err == ""
    assert "between 4.5 and 4.5" in " ".join(out.split())
    for wrong, message in (
        ("q=1", "--start q: expected four numbers with commas, such as 1,0,0,0."),
        ("q_omega_x=1,0,0,0", "--start q_omega_x: expected a number."),
        ("w=1", "--start w: expected one of q, q0, q1, q2, q3, q0_dot, "),
    ):
        code, _, err = run(*words, wrong)
        assert code == 2 and message in " ".join(err.split())
