"""What robots from files have beside their dynamics, and what is refused or not taken."""

from __future__ import annotations

import builtins
import math
import os
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import sympy as sp
from robot_files import joint, link, robot
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import MissingExtraError, ModelError
from dmoc.robots.description import LARGEST, read_text

BALL = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
HEAVY = f'<inertial><origin xyz="0 0 0.5"/><mass value="2"/>{BALL}</inertial>'
LIMITS = '<limit lower="-1" upper="2" effort="30" velocity="4"/>'
SHAPES = """
<collision name="foot"><origin xyz="0 0 1"/><geometry><sphere radius="0.1"/></geometry></collision>
<collision name="bar"><origin xyz="0 0 0.5" rpy="1.5707963 0 0"/>
<geometry><capsule radius="0.1" length="0.4"/></geometry></collision>
<collision name="box"><geometry><box size="0.2 0.4 0.6"/></geometry></collision>
<collision name="drum"><origin xyz="0 0 1" rpy="1.5707963267948966 0 0"/>
<geometry><cylinder radius="0.1" length="0.4"/></geometry></collision>
<collision name="skin"><geometry><mesh filename="package://a/skin.stl"/></geometry></collision>
"""
HIP = joint("hip", "revolute", "stand", "leg", f'<axis xyz="0 1 0"/>{LIMITS}')
LEG = robot("leg", link("stand") + link("leg", HEAVY + SHAPES) + HIP)
# A gripper on a rail, of whose fingers one follows the other.
FINGERS = robot(
    "gripper",
    link("rail")
    + "".join(link(name, HEAVY) for name in ("palm", "left", "right"))
    + joint("wrist-roll", "continuous", "rail", "palm", '<axis xyz="0 0 1"/>')
    + joint("left", "prismatic", "palm", "left", f'<axis xyz="0 1 0"/>{LIMITS}')
    + joint("right", "prismatic", "palm", "right",
            f'<axis xyz="0 -1 0"/>{LIMITS}<mimic joint="left" multiplier="0.5" offset="0.1"/>'),
)  # fmt: skip


def read(tmp_path: Path, text: str, **arguments: Any) -> Any:
    file = tmp_path / "robot.urdf"
    file.write_text(text)
    return dmoc.read_robot(file, **arguments)


def number(robot: Any, expression: Any, angle: float) -> float:
    """An expression of a robot whose first joint is turned by an angle."""
    for name, value in reversed(robot.system(cost=1).definitions.items()):
        expression = expression.subs(name, value)
    return float(expression.subs(next(iter(robot.coordinates.values())), angle))


def test_a_leg_has_the_limits_shapes_and_notes_of_its_file(tmp_path: Path) -> None:
    leg = read(tmp_path, LEG)
    assert leg.bounds == {"hip": (-1, 2), "hip_dot": (-4, 4), "u_hip": (-30, 30)}
    assert list(leg.coordinates) == ["hip"] and list(leg.inputs) == ["u_hip"]
    assert leg.shapes == dict.fromkeys(("foot", "bar", "box", "drum"), "leg") and leg.mass == 2
    assert leg.notes == ("shape skin of link leg: a mesh is not read",)
    system = leg.system(cost=leg.inputs["u_hip"] ** 2)
    assert system.name == "leg" and system.mass_matrix == sp.Matrix([[0.6]])
    assert system.units == {"hip": "rad", "u_hip": "N m"}
    lines = [line.split() for line in str(leg).splitlines()]
    assert lines[1] == ["stand", "fixed"]
    assert lines[2][:7] == ["leg", "2", "hip", "-1", "to", "2", "rad"]
    assert lines[2][7:10] == ["±30", "N", "m"] and lines[2][10:] == [
        "foot,",
        "bar,",
        "box,",
        "drum",
    ]
    assert repr(leg) == "<Robot leg: 1 coordinates, 1 inputs>"


def test_gaps_are_the_distances_of_shapes_from_a_plane(tmp_path: Path) -> None:
    """Against the lowest of many points of each shape."""
    leg = read(tmp_path, LEG)
    gaps = {name: number(leg, gap, 0.4) for name, gap in leg.gaps(place=(0, 0, -1)).items()}
    assert len(gaps) == 1 + 2 + 8 + 2
    c, s = math.cos(0.4), math.sin(0.4)
    assert gaps["foot"] == pytest.approx(c + 1 - 0.1, abs=1e-12)
    assert [gaps["bar_a"], gaps["bar_b"]] == pytest.approx([0.5 * c + 0.9] * 2, abs=1e-7)
    corners = [gaps[f"box_{k}"] for k in range(1, 9)]
    expected = [1 + z * c - x * s for x in (0.1, -0.1) for z in (0.3, -0.3)]
    assert sorted(corners) == pytest.approx(sorted(expected * 2), abs=1e-12)
    turns = np.linspace(0, 2 * np.pi, 721)
    rim = 1 + c + np.min(0.1 * (np.sin(turns) * c - np.cos(turns) * s))
    assert gaps["drum_a"] == pytest.approx(rim, abs=1e-6)
    sideways = leg.gaps(["foot"], place=(2, 0, 0), normal=(-2, 0, 0))
    assert number(leg, sideways["foot"], 0.4) == pytest.approx(2 - s - 0.1, abs=1e-12)


def test_distances_of_shapes_of_a_robot(tmp_path: Path) -> None:
    """Of an arm that folds: neighbours do not count, a cylinder does as the capsule around it."""
    drum = '<collision name="{}"><origin xyz="0 0 0.5"/><geometry>{}</geometry></collision>'
    solids = ('<box size="0.2 0.2 0.6"/>', '<cylinder radius="0.1" length="0.4"/>',
              '<sphere radius="0.1"/>', '<sphere radius="0.2"/>')  # fmt: skip
    links = [link(f"link{k}", HEAVY + drum.format(f"s{k}", e)) for k, e in enumerate(solids)]
    place = '<origin xyz="0 0 1"/><axis xyz="0 1 0"/>' + LIMITS
    joints = [joint(f"j{k}", "revolute", f"link{k}", f"link{k + 1}", place) for k in range(3)]
    arm = read(tmp_path, robot("arm", "".join(links + joints)))
    assert arm.pairs == (("s0", "s2"), ("s0", "s3"), ("s1", "s3"))
    found = arm.distances([("s0", "s2"), ("s1", "s3")])
    assert [*found] == ["s0_s2", "s1_s3"]
    # link 1 stands on link 0 and is turned by 0.3: places in the plane of the motion
    c, s = math.cos(0.3), math.sin(0.3)
    values = dict.fromkeys(arm.coordinates.values(), 0.0) | {arm.coordinates["j0"]: 0.3}
    for name, value in arm.system(cost=1).definitions.items():
        if not value.has(sp.Derivative):
            values[name] = value.xreplace(values)
    gaps = {key: float(gap.xreplace(values)) for key, gap in found.items()}
    x, z = 1.5 * s, 1 + 1.5 * c  # the middle of the ball of link 2
    assert gaps["s0_s2"] == pytest.approx(math.hypot(x - 0.1, z - 0.8) - 0.1, abs=1e-9)
    assert gaps["s1_s3"] == pytest.approx(2 - 0.2 - 0.1 - 0.2, abs=1e-9)  # along one line
    assert isinstance(arm.shape("s1"), dmoc.spatial.Capsule)
    folded = robot("arm", "".join(links + joints)).replace('xyz="0 0 1"', 'xyz="0 0 0"')
    assert read(tmp_path, folded).pairs == ()  # all overlap as they are drawn
    for pair, message in (
        (("s0", "none"), "shape"), (("s0",), "expected two names"), (("s1", "s1"), "one body"),
    ):  # fmt: skip
        with pytest.raises(ModelError, match=message):
            arm.distances([pair])


def test_a_tool_is_a_link_that_is_fixed(tmp_path: Path) -> None:
    racket = {"link": "leg", "at": (0, 0, 1), "mass": 0.5, "inertia": (0, 0, 0), "radius": 0.2}
    leg = read(tmp_path, LEG, tools={"racket": racket})
    assert leg.system(cost=1).mass_matrix[0] == pytest.approx(0.6 + 0.5)
    assert leg.shapes["racket"] == "racket" and leg.mass == 2.5
    assert number(leg, leg.gaps(["racket"])["racket"], 0.3) == pytest.approx(math.cos(0.3) - 0.2)
    assert leg.point("racket", (0, 0, 1)) == leg.point("leg", (0, 0, 2))


def test_a_joint_that_mimics_has_no_coordinate(tmp_path: Path) -> None:
    fingers = read(tmp_path, FINGERS, gravity=0)
    assert list(fingers.coordinates) == ["wrist_roll", "left"]
    assert fingers.system(cost=1).mass_matrix[1, 1] == 2 * (1 + 0.5**2)
    locked = read(tmp_path, FINGERS, lock={"left": 0.2})
    assert list(locked.coordinates) == ["wrist_roll"]
    assert locked.bodies["right"] is locked.bodies["palm"]
    places = [number(locked, locked.point(name)[1], math.pi) for name in ("left", "right")]
    assert places == pytest.approx([-0.2, 0.5 * 0.2 + 0.1])
    assert not locked.notes and not fingers.notes


@pytest.mark.parametrize(
    ("lock", "notes"),
    [
        ({"right": 0.3}, "joint right is locked: it does not follow joint left, which moves alone"),
        ({"left": 0.2, "right": 0.3}, "joint right is locked at 0.3, where joint left would have"),
        ({"left": 0.2, "right": 0.2}, ""),
    ],
)
def test_a_joint_that_is_locked_and_mimics_is_noted(
    tmp_path: Path, lock: dict[str, float], notes: str
) -> None:
    fingers = read(tmp_path, FINGERS, lock=lock)
    assert [note[: len(notes)] for note in fingers.notes] == ([notes] if notes else [])
    assert ("left" in fingers.coordinates) == ("left" not in lock)


@pytest.mark.parametrize("base", ["quaternion", "euler"])
def test_a_base_may_float(tmp_path: Path, base: str) -> None:
    trunk = robot(
        "hopper", link("trunk", HEAVY) + link("leg", HEAVY) + HIP.replace("stand", "trunk")
    )
    hopper = read(tmp_path, trunk, base=base)
    system = hopper.system(cost=1)
    assert hopper.attitudes == ("trunk",) and set(hopper.coordinates) >= {"trunk_x", "hip"}
    assert len(system.coordinates) == (8 if base == "quaternion" else 7)
    assert list(system.attitudes) == ["trunk"]
    assert hopper.bounds.keys() == {"hip", "hip_dot", "u_hip"}


def test_what_hangs_beside_a_robot_is_part_of_its_system(tmp_path: Path) -> None:
    """And fields of a user come to those of the robot."""
    leg, (x, F) = read(tmp_path, LEG, gravity=sp.Symbol("g")), dynamicsymbols("x F")
    cart = leg.world.slide(x, "x", mass=3)
    system = leg.system(
        "both", {sp.Symbol("g"): 1.6}, inputs=[F], forces={x: F}, units={F: "N"},
        dissipation=x.diff() ** 2, lagrangian=-(x**2), surfaces={"wall": cart.origin[0] <= 1},
        friction={"hip": 0.5}, tangents={"hip": leg.coordinates["hip"]},
    )  # fmt: skip
    assert [str(u.func) for u in system.inputs] == ["u_hip", "F"]
    assert system.forces == {leg.coordinates["hip"]: leg.inputs["u_hip"], x: F}
    assert system.dissipation == x.diff() ** 2 and system.units["F"] == "N"
    assert sp.expand(system.lagrangian).coeff(x, 2) == -1


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        ("", {}, "is no description of a robot, no element found"),
        ("<html></html>", {}, "begins with the element 'html': expected a URDF"),
        ("\x00\x01", {}, "is no description of a robot"),
        (robot("a", ""), {}, "has 0 links: expected 1 to 1000"),
        ("<mujoco/>", {}, "has 0 bodies: expected 1 to 1000"),
        (robot("a", link("a") + link("b") + joint("j", "revolute", "a", "b", LIMITS)), {},
         r"gives no link a mass: expected <inertial>"),
        (LEG.replace(HEAVY, "").replace(link("stand"), link("stand", HEAVY)), {},
         r"joint hip of .* moves leg without mass: lock it by lock=\{\"hip\": 0.0\}"),
        (LEG.replace('izz="0.1"', 'izz="-0.3"'), {},
         "inertia of leg in .* has the principal moments -0.3, 0.1 and 0.1 kg m2: expected none"),
        (LEG.replace('xyz="0 0 0.5"', 'xyz="0, 0 0.5"', 1), {},
         "<origin xyz='0, 0 0.5'> in link leg of .*: expected three numbers with blanks"),
        (LEG.replace('upper="2"', 'upper="2.."'), {},
         "<limit upper='2..'> in joint hip of .*: expected a number"),
        (LEG.replace("<axis", '<axis xyz="1 0 0"/><axis'), {},
         "joint hip of .* has 2 elements <axis>: expected one"),
        ('<mujoco><compiler coordinate="global"/><worldbody><body><joint/><geom size="1"/></body>'
         "</worldbody></mujoco>", {}, r"is not read, global .* 'compiler': correct the file\."),
        (LEG.replace('<mass value="2"/>', '<mass value="-2"/>'), {}, "the mass -2 kg"),
        (LEG.replace('<mass value="2"/>', '<mass value="nan"/>'), {}, "nan"),
        (LEG.replace('lower="-1"', 'lower="3"'), {},
         "joint hip of .* has the limits '3' to '2': expected the lower one first"),
        (LEG.replace('<child link="leg"/>', '<child link="arm"/>'), {},
         "joint hip of .* is at 'arm', which is no link of the file"),
        (robot("a", "".join(link(n, HEAVY) for n in "abc") + joint("i", "fixed", "a", "b")
               + joint("j", "fixed", "a", "c") + joint("k", "fixed", "b", "c")), {},
         "link c of .* hangs from a and from b: expected a tree"),
        (robot("a", "".join(link(n, HEAVY) for n in "ab") + joint("i", "fixed", "a", "b")
               + joint("j", "fixed", "b", "a")), {}, "no link is first: expected one root"),
        (robot("a", link("a") + link("b")), {}, "links a, b hang from no other"),
        (robot("a", link("a") * 2), {}, "2 links of the name 'a'"),
        (LEG, {"lock": {"knee": 0}}, "unknown joint 'knee' of .*: expected one of hip"),
        (LEG, {"lock": {"hip": "far"}}, "lock of joint hip = 'far': expected a number"),
        (LEG, {"lock": {3: 0}}, "joint 3 of .*: expected a name"),
        (LEG, {"lock": ["hip"]}, r"lock = \['hip'\]: expected a mapping"),
        (LEG, {"base": "floating"}, "base = 'floating': expected one of fixed, quaternion, euler"),
        (LEG, {"tools": {"t": {"at": (0, 0, 1)}}}, "tool 't' = .* expected a mapping with a link"),
        (LEG, {"tools": {"t": {"link": "hand"}}}, "unknown link 'hand' of"),
        (LEG, {"tools": {"t": {"link": "leg", "weight": 1}}}, "unknown part 'weight' of tool 't'"),
        (LEG, {"tools": {"t": {"link": "leg", "at": (0, 1)}}}, "at of tool 't' = .* three finite"),
        (LEG, {"tools": {"t": {"link": "leg", "mass": -1}}}, "link t of .* has the mass -1 kg"),
        (LEG, {"tools": {"leg": {"link": "leg"}}}, "tool 'leg' has the name of a link"),
        (LEG, {"gravity": "down"}, "gravity of the world is not a scalar"),
        (LEG.replace("revolute", "flexible"), {}, "is not read, .*: correct the file"),
        ("<a>" * 300 + "</a>" * 300, {}, "elements more than 200 deep"),
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro/></robot>', {},
         "is a template: make a URDF of it first, as by `xacro "),
    ],
)  # fmt: skip
def test_what_is_no_robot_is_one_sentence(
    tmp_path: Path, text: str, arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(ModelError, match=message) as refused:
        read(tmp_path, text, **arguments)
    assert str(refused.value).endswith(".") and "\n" not in str(refused.value)


def test_moments_of_no_body_are_taken_and_said(tmp_path: Path) -> None:
    """Many files have some: energies are positive with them."""
    leg = read(tmp_path, LEG.replace('izz="0.1"', 'izz="0.3"'))
    assert leg.notes[-1] == (
        "inertia of leg: no body has the principal moments 0.1, 0.1 and 0.3 kg m2, of which the "
        "last exceeds the sum of the others; taken as it is"
    )
    assert leg.system(cost=1).mass_matrix == sp.Matrix([[0.6]])
    assert "note: inertia of leg" in str(leg)


def test_what_stands_around_a_description_does_no_harm(tmp_path: Path) -> None:
    assert read(tmp_path, f'\n <?xml version="1.0"?>\n{LEG}\n\0').name == "leg"


def test_what_a_joint_has_beside_is_said(tmp_path: Path) -> None:
    """A ball joint and a joint that follows have no coordinate that it could count along."""
    text = (
        '<mujoco><worldbody><body name="a"><joint name="neck" type="ball" stiffness="2"'
        ' frictionloss="0.1" limited="true" range="0 30"/><geom size="0.1"/></body>'
        '<body name="b"><joint name="lead" stiffness="1 0.5"/><geom size="0.1"/></body>'
        '<body name="c"><joint name="rear" frictionloss="0.2" damping="0 0.5"/><geom size="0.1"/>'
        '</body></worldbody><equality><joint joint1="rear" joint2="lead"/></equality><actuator>'
        '<motor joint="rear"/><motor joint="neck" gear="1 0 0"/></actuator></mujoco>'
    )
    assert read(tmp_path, text).notes == (
        "joint neck: its limits", "joint neck: its spring", "joint neck: its dry friction",
        "joint neck: what drives it", "joint lead: its spring beyond the linear term",
        "joint rear: its dry friction", "joint rear: what drives it",
        "joint rear: its damping beyond the linear term",
    )  # fmt: skip


def test_a_path_that_leads_to_no_description_is_one_sentence(tmp_path: Path) -> None:
    large = tmp_path / "large.urdf"
    with large.open("wb") as stream:
        stream.truncate(100 * 2**20)
    for path, message in (
        (large, f"has 100 MB: expected the description of a robot, of at most {LARGEST >> 20} MB"),
        (tmp_path, "is no file: name the URDF or MJCF"),
        (tmp_path / "none.urdf", "does not exist: name the URDF or MJCF"),
        (None, "the file of a robot = None: expected the path"),
        ("/dev/zero", "/dev/zero is no file"),
    ):
        with pytest.raises(ModelError, match=message):
            dmoc.read_robot(path)


SECRET = "a word that stands in another file"
BODY = '<body name="b"><joint name="j"/><geom size="0.1"/></body>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f'<!DOCTYPE robot [<!ENTITY x SYSTEM "{{secret}}">]>{LEG.replace("leg", "&x;")}',
         "declares a document type, whose entities may name other files"),
        ('<!DOCTYPE a [<!ENTITY x "y"><!ENTITY z "&x;&x;&x;">]><robot>&z;</robot>',
         "declares a document type"),
        (f'<mujoco><worldbody><include file="{{secret}}"/>{BODY}</worldbody></mujoco>',
         "contains <include file=.*> within another element, which is not read"),
        ('<mujoco><include file="{secret}"/></mujoco>', "has 0 bodies, beside <include file="),
        ('<mujoco><asset><mesh name="m" file="{secret}"/></asset><worldbody><body name="b">'
         '<joint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>',
         "body b of .* has its mass from the mesh m, which is not read: give it <inertial>"),
        (f'<mujoco><worldbody>{BODY}<body><replicate count="9"/></body></worldbody></mujoco>',
         "contains <replicate>"),
    ],
)  # fmt: skip
def test_no_other_file_is_read(tmp_path: Path, text: str, message: str) -> None:
    secret = tmp_path / "secret.xml"
    secret.write_text(SECRET)
    with pytest.raises(ModelError, match=message) as refused:
        read(tmp_path, text.replace("{secret}", str(secret)))
    assert "word" not in str(refused.value)


def test_what_names_files_is_left_out_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither Python nor MuJoCo opens another file, and none is written."""
    monkeypatch.chdir(tmp_path)
    inside = (
        '<compiler meshdir="/x"/><include file="secret.xml"/><asset><mesh name="m" file="s.stl"/>'
        '<hfield name="h" file="h.png"/><texture name="t" file="t.png" type="2d"/></asset>'
        '<extension><plugin plugin="p"/></extension><worldbody><geom type="hfield" hfield="h"/>'
        '<body name="b"><joint name="j"/><geom size="0.1" material="m"/>'
        '<geom name="skin" type="mesh" mesh="m" mass="0"/></body></worldbody>'
        '<tendon><fixed name="rope"><joint joint="j" coef="1"/></fixed></tendon>'
        '<actuator><motor name="pull" tendon="rope"/></actuator>'
    )
    file = tmp_path / "robot.xml"
    file.write_text(f"<mujoco>{inside}</mujoco>")
    text = read_text(file)
    assert not [word for word in ("file", ".png", ".stl", "/x", "plugin") if word in text.xml]
    opened, plain = [], builtins.open
    monkeypatch.setattr(builtins, "open", lambda f, *a, **k: opened.append(f) or plain(f, *a, **k))
    found = dmoc.read_robot(file)
    assert not [f for f in opened if str(f) != str(file)] and os.listdir(tmp_path) == ["robot.xml"]
    assert found.notes[:3] == (
        "<include file='secret.xml'>: another file is not read", "tendon: fixed rope",
        "actuator: motor pull",
    )  # fmt: skip
    assert "shape skin of link b: a mesh is not read" in found.notes


def test_without_its_reader_a_robot_names_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mujoco, "__version__", "3.3.7")
    with pytest.raises(MissingExtraError, match=r"need MuJoCo 4, and 3.3.7 is installed"):
        read(tmp_path, LEG)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtraError, match=r'pip install "dmoc\[robots\]"'):
        read(tmp_path, LEG)
