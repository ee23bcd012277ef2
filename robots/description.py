"""The text of a file that describes a robot, without whatever names another file.

URDF and MJCF may name meshes, pictures and further descriptions, and XML may name entities.  What
is handed on has none of them: elements that are known are kept, all others are left out, counted,
or refused where they would change the robot.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dmoc.base.arguments import path as path_of
from dmoc.base.arguments import place, shown
from dmoc.base.errors import ModelError
from dmoc.robots.entries import check_urdf

LARGEST = 16 * 2**20  # bytes: descriptions of whole humanoids have a sixteenth of it
DEEPEST = 200  # elements within elements
MOST_LINKS = 1000
LONGEST_WORDS = 200  # of what another parser says
AROUND = b" \t\r\n\0"  # before and behind a description

SOLIDS = ("box", "sphere", "cylinder", "capsule")
# Elements of a URDF by the one they stand in.
URDF = {
    "robot": ("link", "joint"),
    "link": ("inertial", "collision"),
    "inertial": ("origin", "mass", "inertia"),
    "collision": ("origin", "geometry"),
    "geometry": SOLIDS,
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
BODY = ("body", "frame", "joint", "freejoint", "geom", "inertial", "site")
MOTORS = ("motor", "position", "velocity", "intvelocity", "damper", "general")
MJCF = {
    "mujoco": ("compiler", "option", "default", "worldbody", "actuator", "equality"),
    "worldbody": BODY,
    "body": BODY,
    "frame": BODY,
    "default": ("default", "joint", "geom", "site", "equality", *MOTORS),
    "actuator": MOTORS,
    "equality": ("joint",),
}
# Attributes of elements of MJCF that are kept, of those that have others beside.
ATTRIBUTES = {
    "compiler": (
        "angle", "coordinate", "eulerseq", "autolimits", "inertiafromgeom", "inertiagrouprange",
        "boundmass", "boundinertia", "settotalmass", "balanceinertia",
    ),
    "option": ("gravity",),
}  # fmt: skip
DROPPED = ("material", "plugin", "hfield", "file", "user")
# What would add bodies, or take them from other files.
REFUSED = ("include", "replicate", "composite", "flexcomp", "attach")
# What says how a robot looks, or what is done with it: no part of how it moves.
LOOKS = (
    "visual", "material", "gazebo", "asset", "statistic", "size", "sensor", "keyframe", "custom",
    "contact", "camera", "light", "transmission", "mujoco", "mesh", "texture", "flag",
)  # fmt: skip


@dataclass
class Text:
    """A description that names no file, with what its reader does not know of."""

    kind: str
    label: str  # of the file in messages
    xml: str = ""
    notes: list[str] = field(default_factory=list)
    speeds: dict[str, float] = field(default_factory=dict)


class _Tree(ET.TreeBuilder):
    """Elements, not too deep, of a file that declares nothing."""

    def __init__(self, label: str) -> None:
        super().__init__()
        self._label, self._depth = label, 0

    def doctype(self, *_: Any) -> None:
        raise ModelError(
            f"{self._label} declares a document type, whose entities may name other files: take "
            "the <!DOCTYPE ...> out."
        )

    def start(self, tag: Any, attributes: Any) -> Any:
        self._depth += 1
        if self._depth > DEEPEST:
            raise ModelError(
                f"{self._label} has elements more than {DEEPEST} deep: expected a description of "
                "a robot."
            )
        return super().start(tag, attributes)

    def end(self, tag: Any) -> Any:
        self._depth -= 1
        return super().end(tag)


def read_text(path: Any) -> Text:
    """Read a file; raise ModelError for what is no description of a robot."""
    file = path_of(path, "the file of a robot", ModelError)
    label = place(file)
    root = _parsed(_content(file, label), label)
    kinds = {"robot": "URDF", "mujoco": "MJCF"}
    if root.tag not in kinds:
        raise ModelError(
            f"{label} begins with the element {shown(root.tag)}: expected a URDF, <robot>, or an "
            "MJCF, <mujoco>."
        )
    text = Text(kinds[root.tag], label)
    (_clean_urdf if text.kind == "URDF" else _clean_mjcf)(root, text, label)
    text.xml = ET.tostring(root, encoding="unicode")
    return text


def _content(file: Path, label: str) -> bytes:
    try:
        if not file.is_file():
            what = "is no file" if file.exists() else "does not exist"
            raise ModelError(f"{label} {what}: name the URDF or MJCF of a robot.")
        size = file.stat().st_size
        if size > LARGEST:
            raise ModelError(
                f"{label} has {size / 2**20:.0f} MB: expected the description of a robot, of at "
                f"most {LARGEST // 2**20} MB."
            )
        return file.read_bytes()[: LARGEST + 1]
    except OSError as error:
        raise ModelError(
            f"{label} cannot be read ({error.strerror}): name a file that may be read."
        ) from None


def _parsed(content: bytes, label: str) -> ET.Element:
    parser = ET.XMLParser(target=_Tree(label))
    try:
        parser.feed(content.strip(AROUND))  # which other readers of such files take, too
        root: ET.Element = parser.close()
    except (ET.ParseError, ValueError, LookupError) as error:  # of its form, or its encoding
        raise ModelError(
            f"{label} is no description of a robot, {worded(error)}: expected a URDF or an MJCF."
        ) from None
    for element in root.iter():
        if str(element.tag).startswith("{") and "xacro" in element.tag:
            raise ModelError(
                f"{label} is a template: make a URDF of it first, as by `xacro {label} > "
                "robot.urdf`."
            )
    return root


def worded(error: object) -> str:
    """What another parser says, within a sentence."""
    lines = [" ".join(line.split()).rstrip(".") for line in str(error).strip().splitlines()]
    text = ", ".join(filter(None, lines)).replace(". ", ", ")
    return text.removeprefix("XML Error: ").removeprefix("Error: ")[:LONGEST_WORDS]


def _named(element: ET.Element) -> str:
    return f"{element.tag} {element.get('name') or element.get('class') or 'without a name'}"


def _keep(parent: ET.Element, known: Mapping[str, tuple[str, ...]], left: Counter[str]) -> None:
    """Take out what is not known within an element, and below it."""
    parent.text = parent.tail = None
    for child in [*parent]:
        if child.tag in known.get(str(parent.tag), ()):
            _keep(child, known, left)
        else:
            parent.remove(child)
            if child.tag not in LOOKS:
                left[str(child.tag)] += 1


def _note_left(left: Counter[str], text: Text) -> None:
    if left:
        counted = ", ".join(f"{count} {tag}" for tag, count in sorted(left.items()))
        text.notes.append(f"elements that are not read: {counted}")


# URDF ---------------------------------------------------------------------------------------------


def _clean_urdf(root: ET.Element, text: Text, label: str) -> None:
    _check_tree(root, label)
    for link in root.iter("link"):
        for shape in link.findall("collision"):
            mesh = shape.find("geometry/mesh")
            if mesh is not None:
                file = mesh.get("filename", "").replace("\\", "/").rpartition("/")[2]
                text.notes.append(
                    f"shape {shape.get('name') or file} of link {link.get('name')}: a mesh is not "
                    "read"
                )
            if shape.find("geometry") is None or not any(
                shape.find(f"geometry/{solid}") is not None for solid in SOLIDS
            ):
                link.remove(shape)
    left: Counter[str] = Counter()
    _keep(root, URDF, left)
    _note_left(left, text)
    check_urdf(root, label)
    for joint in root.iter("joint"):
        limit = joint.find("limit")
        if limit is not None:
            name = joint.get("name", "")
            text.speeds[name] = _positive(limit.get("velocity"))
            _check_limits(name, limit, label)
    if not root.get("name"):
        root.set("name", "robot")


def _check_limits(name: str, limit: ET.Element, label: str) -> None:
    """Refuse a joint whose range ends before it begins."""
    low, high = limit.get("lower", "0"), limit.get("upper", "0")
    if float(low) > float(high):
        raise ModelError(
            f"joint {name} of {label} has the limits {shown(low)} to {shown(high)}: expected the "
            "lower one first, or no limits in the file of a joint that has none."
        )


def _positive(value: str | None) -> float:
    """A limit, or 0 where there is none."""
    number = float(value or 0)
    return number if 0 < number < float("inf") else 0.0


def _check_tree(root: ET.Element, label: str) -> None:
    """Refuse links that do not make one tree."""
    links = [link.get("name", "") for link in root.findall("link")]
    if not links or len(links) > MOST_LINKS:
        raise ModelError(f"{label} has {len(links)} links: expected 1 to {MOST_LINKS}.")
    joints = root.findall("joint")
    for what, names in (("link", links), ("joint", [j.get("name", "") for j in joints])):
        name, count = Counter(names).most_common(1)[0] if names else ("", 1)
        if count > 1 or "" in names:
            raise ModelError(
                f"{label} has {names.count(name)} {what}s of the name {name!r}: expected a name "
                "for each."
            )
    above: dict[str, str] = {}
    for joint in joints:
        ends = [_end(joint, side) for side in ("parent", "child")]
        for end in ends:
            if end not in links:
                raise ModelError(
                    f"joint {joint.get('name')} of {label} is at {shown(end)}, which is no link "
                    "of the file: name one of its links."
                )
        if ends[1] in above:
            raise ModelError(
                f"link {ends[1]} of {label} hangs from {above[ends[1]]} and from {ends[0]}: "
                "expected a tree, in which a loop is closed by `constraints` of the system."
            )
        above[ends[1]] = ends[0]
    roots = [link for link in links if link not in above]
    if len(roots) != 1:
        which = f"links {', '.join(roots[:4])} hang from no other" if roots else "no link is first"
        raise ModelError(f"{label} is no tree of links, {which}: expected one root.")


def _end(joint: ET.Element, side: str) -> str:
    element = joint.find(side)
    return "" if element is None else element.get("link", "")


# MJCF ---------------------------------------------------------------------------------------------


def _clean_mjcf(root: ET.Element, text: Text, label: str) -> None:
    includes = root.findall("include")
    for include in includes:
        root.remove(include)
        text.notes.append(f"{_what(include)}: another file is not read")
    for element in root.iter():
        if element.tag in REFUSED:
            raise ModelError(
                f"{label} contains {_what(element)} within another element, which is not read: "
                "expected one file that writes every body out."
            )
    for section in root.findall("tendon") + root.findall("deformable"):
        text.notes += [f"{section.tag}: {_named(child)}" for child in section]
        root.remove(section)
    _take_out(root, "actuator", lambda e: "joint" in e.attrib or "jointinparent" in e.attrib, text)
    _take_out(root, "equality", lambda e: e.tag == "joint", text)
    _note_surroundings(root, text)
    left: Counter[str] = Counter()
    _keep(root, MJCF, left)
    _note_left(left, text)
    for element in root.iter():
        kept = ATTRIBUTES.get(str(element.tag))
        for name in [*element.attrib]:
            if name in DROPPED or (kept is not None and name not in kept):
                del element.attrib[name]
    bodies = sum(1 for _ in root.iter("body"))
    if not 1 <= bodies <= MOST_LINKS:
        more = f", beside {', '.join(map(_what, includes))}" if includes else ""
        raise ModelError(f"{label} has {bodies} bodies{more}: expected 1 to {MOST_LINKS}.")


def _what(element: ET.Element) -> str:
    file = element.get("file")
    return f"<{element.tag}>" if file is None else f"<{element.tag} file={shown(file)}>"


def _take_out(root: ET.Element, section: str, taken: Any, text: Text) -> None:
    """Leave out the entries of a section that are not taken, by name."""
    for parent in root.findall(section):
        for child in [*parent]:
            if not taken(child) or (section == "actuator" and child.tag not in MOTORS):
                parent.remove(child)
                text.notes.append(f"{section}: {_named(child)}")


def _note_surroundings(root: ET.Element, text: Text) -> None:
    """A medium and wind, and whether there is gravity."""
    for option in root.findall("option"):
        if any(flag.get("gravity") == "disable" for flag in option.findall("flag")):
            option.set("gravity", "0 0 0")
        for name in ("density", "viscosity", "wind"):
            value = option.get(name)
            if value is not None and any(part.strip("0.") for part in value.split()):
                text.notes.append(f"option {name} = {value}")
