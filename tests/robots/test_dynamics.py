"""Robots from their files have the mass matrices and inverse dynamics that MuJoCo has of them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import pytest
from robot_files import arm, differences, legged

import dmoc

# Joints in all positions, a chain of two in one body, a ball joint, shapes that make the inertia,
# degrees, defaults, springs, armatures, a joint that follows, a body that floats.
MJCF = """
<mujoco model="mixed">
  <compiler angle="degree" eulerseq="zyx"/>
  <default>
    <joint armature="0.1" damping="0.3"/>
    <default class="heavy"><geom density="3000"/></default>
  </default>
  <worldbody>
    <geom name="ground" type="plane" size="1 1 1"/>
    <body name="cart" pos="0.1 0.2 0.3">
      <joint name="rail" type="slide" axis="1 2 0" stiffness="7" springref="0.2"/>
      <joint name="turn" type="hinge" axis="0 1 1" pos="0.1 0 0.2" ref="25" range="-90 90"/>
      <geom name="block" type="box" size="0.1 0.2 0.05" pos="0.1 0 0" euler="10 0 0"/>
      <body name="arm" pos="0 0 0.5">
        <joint name="shoulder" type="ball" pos="0 0.1 0"/>
        <geom class="heavy" type="capsule" fromto="0 0 0 0.3 0.1 0.2" size="0.04"/>
        <site name="hand" pos="0.3 0.1 0.2"/>
        <frame euler="0 0 30">
          <body name="left" pos="0.3 0 0">
            <joint name="left" axis="0 0 1" frictionloss="0.4"/>
            <geom type="cylinder" size="0.03 0.1" mass="0.7" contype="0" conaffinity="0"/>
          </body>
        </frame>
        <body name="right" pos="0.3 0 0.1" euler="20 30 40">
          <joint name="right" type="slide" axis="0 1 1"/>
          <inertial pos="0 0.1 0" mass="0.5" fullinertia="0.02 0.03 0.04 0.001 0.002 0.003"/>
        </body>
      </body>
    </body>
    <body name="ball" pos="1 0 0">
      <joint name="ball" type="free" armature="0.2"/><geom name="ball" size="0.1"/>
    </body>
  </worldbody>
  <equality><joint joint1="right" joint2="left" polycoef="0.1 -0.5 0 0 0"/></equality>
  <actuator>
    <motor name="push" joint="rail" gear="5" ctrllimited="true" ctrlrange="-2 3"/>
    <position name="servo" joint="turn" kp="40" forcerange="-30 30"/>
  </actuator>
</mujoco>
"""


def compiled(text: str, floating: str = "") -> Any:
    """MuJoCo's own model of a text, with a root that floats."""
    spec = mujoco.MjSpec.from_string(text)
    spec.compiler.fusestatic = not floating
    if floating:
        spec.worldbody.first_body().add_freejoint(name=floating)
    return spec.compile()


@pytest.mark.parametrize(
    ("text", "base", "count"),
    [
        (arm(5), None, 5),
        (legged("lr", 2), "quaternion", 11),
        (legged("abc", 1), "euler", 9),
    ],
    ids=["arm", "biped", "tripod"],
)
def test_a_urdf_has_the_dynamics_of_mujoco(
    tmp_path: Path, text: str, base: str | None, count: int
) -> None:
    """Turned frames and axes, products of inertia, links that are fixed, damping."""
    (tmp_path / "robot.urdf").write_text(text)
    robot = dmoc.read_robot(tmp_path / "robot.urdf", base=base)
    model = compiled(text, "trunk" if base else "")
    assert len(robot.system(cost=1).coordinates) == count
    assert robot.mass == pytest.approx(model.body_mass.sum(), rel=1e-12)
    assert max(differences(robot, model)) < 1e-12


def test_an_mjcf_has_the_dynamics_of_mujoco(tmp_path: Path) -> None:
    (tmp_path / "mixed.xml").write_text(MJCF)
    robot = dmoc.read_robot(tmp_path / "mixed.xml")
    assert max(differences(robot, compiled(MJCF), {"right": ("left", -0.5, 0.1)})) < 1e-12
    quarter = pytest.approx(math.pi / 2)
    assert robot.bounds == {
        "u_rail": (-10, 15), "u_turn": (-30, 30), "turn": (-quarter.expected, quarter.expected)
    }  # fmt: skip
    assert robot.attitudes == ("shoulder", "ball") and robot.friction == {"left": 0.4}
    assert list(robot.shapes) == ["block", "arm", "ball"]
    assert robot.point("hand") == robot.point("arm", (0.3, 0.1, 0.2))
    assert robot.notes == (
        "actuator servo: its law; its force is the input",
        "shape ground of the world: state it as a surface",
    )
