"""Robots from files: what a URDF or an MJCF describes, as bodies of a linkage in space."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from dmoc.base.arguments import choice, listed, shown
from dmoc.base.arguments import names as names_in
from dmoc.base.errors import ModelError
from dmoc.base.signatures import public
from dmoc.base.table import Shown, Table
from dmoc.robots.description import read_text
from dmoc.robots.held import based, held_values, joints_of
from dmoc.robots.machine import Machine
from dmoc.robots.mujoco_reader import read_description
from dmoc.robots.names import Names, known
from dmoc.robots.pairs import pairs_of
from dmoc.robots.parts import Part, carried, parts_of, several
from dmoc.robots.records import Description
from dmoc.robots.shapes import gaps_to_plane, plain, rounded, solid_of
from dmoc.robots.tools import numbers_of, with_tools
from dmoc.robots.tree import table_of
from dmoc.symbolic.expressions import expression_in
from dmoc.symbolic.solids import Box, Capsule, Sphere
from dmoc.symbolic.spatial import Body, World
from dmoc.symbolic.system import MechanicalSystem
from dmoc.symbolic.system_fields import MAPPINGS, mapping
from dmoc.symbolic.vectors import Vector, unit_vector, vector

BASES = ("fixed", "quaternion", "euler")


@public(ModelError)
class Robot(Shown):
    """A robot as a file describes it; made by :func:`dmoc.read_robot`.

    Names of coordinates, inputs and shapes are those of the file where these are identifiers.

    Attributes
    ----------
    name : str
    world : dmoc.spatial.World
        What it stands in; a ball or a box is hung beside it before :meth:`system` is called.
    bodies : mapping of str to dmoc.spatial.Body
        By the names of the links; links that are fixed to each other have the same body.  Its
        frame has its origin at its joint, and the axes of the world, or of the floating link that
        carries it, where the robot is as the file draws it.
    coordinates, inputs : mapping of str to dynamicsymbol
        Joints in rad and m, torques and forces ``u_`` of them in N m and N.
    attitudes : tuple of str
        Names of floating links and ball joints, which are unit quaternions unless the base has
        Euler angles.
    bounds : mapping of str to pair of float
        Limits of coordinates, velocities and inputs, for those of a problem.
    tangents, friction : mappings
        Dry friction of joints, for the fields of a system; without them it has none.
    shapes : mapping of str to str
        What touches, and the link that it belongs to.
    mass : float
        In kg, of all links.
    notes : tuple of str
        What of the file was not taken, and which inertias are those of no body.
    """

    def __init__(self, description: Description, held: Mapping[str, float], euler: bool,
                 gravity: Any, label: str) -> None:  # fmt: skip
        parts = parts_of(description, held, label)
        _check_masses(parts, label)
        joints = joints_of(description)
        self.world = World(gravity)
        machine = Machine(self.world, euler, joints, description.notes)
        machine.build(parts)
        self._description, self._held, self._machine = description, held, machine
        self.name = Names().give(description.name or "robot")
        self.bodies: dict[str, Body] = {}
        self._places: dict[str, tuple[Body, Any, Any]] = {}
        self._shapes: dict[str, tuple[Body, Any]] = {}
        self._touching: list[tuple[str, Part, Any]] = []
        surfaces = Names()
        self.shapes: dict[str, str] = {}
        for part, body in zip(parts, machine.bodies, strict=True):
            self._take(part, body, surfaces)
        self.coordinates, self.inputs = machine.coordinates, machine.inputs
        self.attitudes, self.bounds = tuple(machine.attitudes), machine.bounds
        self.tangents, self.friction = machine.tangents, machine.friction
        self.mass = sum(part.mass for part in parts)
        self.notes = tuple(dict.fromkeys(filter(None, description.notes)))

    def _take(self, part: Part, body: Body, surfaces: Names) -> None:
        """The links and shapes of a part, by their names."""
        for link, (origin, turn) in part.frames.items():
            self.bodies[link] = body
            self._places[link] = body, origin, turn
        for link, shape in part.shapes:
            if shape.kind == "site":
                self._places.setdefault(shape.name, (body, shape.place, shape.turn))
                continue
            name = surfaces.give(shape.name)
            self.shapes[name] = link
            self._shapes[name] = body, replace(shape, name=name)
            self._touching.append((name, part, shape))

    def point(self, link: str, at: Any = (0, 0, 0)) -> Vector:
        """A point of a link: its place (x, y, z) in the world.

        Parameters
        ----------
        link : str
            Of a link, a tool or a site of the file.
        at : triple of float
            The point in the frame of the link, as the file has it, in m.

        Returns
        -------
        triple of Expr
            Definitions of the system, for surfaces and, by ``.diff()``, velocities.

        Raises
        ------
        ModelError
            If there is no such link, or the point is none.
        """
        known(link, self._places, "link", f"of {self.name}")
        body, origin, turn = self._places[link]
        local = numbers_of(at, f"point of link {link}", ((3,),))
        return body.point(*plain(origin + turn @ local))

    def gaps(
        self, shapes: Any = None, place: Any = (0, 0, 0), normal: Any = (0, 0, 1)
    ) -> dict[str, Any]:
        """Distances of shapes from a plane, for the surfaces of a system.

        A sphere has one, n . (c - p) - r with its centre c; a capsule those of its two ends,
        ``_a`` and ``_b``; a box those of its eight corners, ``_1`` to ``_8``.  A cylinder has
        those of its rims, ``_a`` and ``_b``, n . (e - p) - r sqrt(1 - (n . a)^2) with its axis a,
        which have no slope where it stands upright.

        Parameters
        ----------
        shapes : list of str, optional
            Names of shapes; all of them by default.
        place, normal : triples of Expr
            A point p of the plane, and the direction n in which the robot is.

        Returns
        -------
        dict of str to Expr
            In m, by the names of the shapes with those endings.

        Raises
        ------
        ModelError
            If there is no such shape, or the plane is none.
        """
        chosen = (
            [*self.shapes] if shapes is None else names_in(shapes, "shapes", "shapes", ModelError)
        )
        p, n = (
            vector(place, 3, "the place of the plane"),
            unit_vector(normal, 3, "the normal of the plane"),
        )
        gaps: dict[str, Any] = {}
        for name in chosen:
            known(name, self._shapes, "shape", f"of {self.name}")
            body, shape = self._shapes[name]
            gaps |= gaps_to_plane(shape, body, p, n)
        return gaps

    def shape(self, name: str) -> Box | Capsule | Sphere:
        """A shape where it is in the world, for ``world.distance``.

        Parameters
        ----------
        name : str
            Of a shape.

        Returns
        -------
        shape in space
            A cylinder as the capsule around it, which is longer by its radius at both ends.

        Raises
        ------
        ModelError
            If there is no such shape.
        """
        known(name, self._shapes, "shape", f"of {self.name}")
        body, shape = self._shapes[name]
        placed: Box | Capsule | Sphere = body.carried(rounded(solid_of(shape)))
        return placed

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of shapes that may meet: all pairs but those of one body, of bodies that one joint
        connects, and those that overlap where the robot is as the file draws it."""
        return pairs_of(self._touching)

    def distances(self, pairs: Any = None) -> dict[str, Any]:
        """Distances of shapes of the robot from each other, for the surfaces of a system.

        Parameters
        ----------
        pairs : list of pair of str, optional
            Names of shapes; :attr:`pairs` by default.

        Returns
        -------
        dict of str to Expr
            In m, by both names with ``_`` between: those that ``world.distance`` has of what
            :meth:`shape` returns.

        Raises
        ------
        ModelError
            If there is no such shape, or a pair is of one body.
        """
        chosen = self.pairs if pairs is None else pairs
        read = listed(chosen, "pairs", 'pairs of names, such as ("left", "right")', ModelError)
        own = Names()
        found: dict[str, Any] = {}
        for pair in read:
            a, b = self._pair(pair)
            found[own.give(f"{a}_{b}")] = self.world.distance(self.shape(a), self.shape(b))
        return found

    def _pair(self, pair: Any) -> tuple[str, str]:
        """Two names of shapes of different bodies."""
        both = [*pair] if isinstance(pair, (list, tuple)) else []
        if len(both) != 2:
            raise ModelError(f"pair {shown(pair)}: expected two names of shapes.")
        for name in both:
            known(name, self._shapes, "shape", f"of {self.name}")
        if self._shapes[both[0]][0] is self._shapes[both[1]][0]:
            raise ModelError(
                f"shapes {both[0]} and {both[1]} of {self.name} belong to one body: their distance "
                "does not change."
            )
        return both[0], both[1]

    def system(
        self, name: str | None = None, parameters: Mapping[Any, float | None] | None = None,
        **fields: Any,
    ) -> MechanicalSystem:  # fmt: skip
        """Return the system of the robot, and of what hangs beside it in its world.

        Parameters
        ----------
        name : str, optional
            That of the robot by default.
        parameters : mapping of Symbol to float or None, optional
        **fields
            Those of :class:`dmoc.MechanicalSystem`: cost, surfaces, ...  ``inputs`` and ``units``
            come to those of the robot, a ``lagrangian`` and a ``dissipation`` are added to its own.

        Returns
        -------
        MechanicalSystem

        Raises
        ------
        ModelError
            For any of the reasons of MechanicalSystem.
        """
        machine = self._machine
        inputs = listed(fields.pop("inputs", ()), "inputs", "dynamicsymbols", ModelError)
        fields["inputs"] = [*machine.inputs.values(), *inputs]
        fields["units"] = machine.units | mapping(
            fields.get("units", {}), "units", MAPPINGS["units"]
        )
        for key in ("lagrangian", "dissipation"):
            fields[key] = getattr(machine, key) + expression_in(fields.get(key, 0), f"the {key}")
        return self.world.system(self.name if name is None else name, parameters, **fields)

    def summary(self) -> Table:
        """What ``print`` shows: the tree of the links."""
        shapes = {
            name: (self.shapes[name], shape.kind) for name, (_, shape) in self._shapes.items()
        }
        names = self._machine.names.of
        return table_of(self._description, self._held, names, shapes, self.notes)

    def __repr__(self) -> str:
        count = len(self.coordinates) + 4 * len(self._machine.quaternions)
        return f"<Robot {self.name}: {count} coordinates, {len(self.inputs)} inputs>"


def _check_masses(parts: list[Part], label: str) -> None:
    """Refuse joints that move nothing."""
    if all(part.mass == 0 for part in parts):
        raise ModelError(
            f"{label} gives no link a mass: expected <inertial> with a mass and moments of inertia."
        )
    for part in parts:
        if part.joint is None or part.joint.armature > 0:
            continue
        moved = carried(parts, part)
        if all(p.mass == 0 and not p.about.any() for p in moved):
            links = several([link for p in moved for link in p.frames])
            raise ModelError(
                f"joint {part.joint.name} of {label} moves {links} without mass: lock it by "
                f'lock={{"{part.joint.name}": 0.0}}, or give it <inertial>.'
            )


@public(ModelError)
def read_robot(
    path: Any,
    base: str | None = None,
    lock: Mapping[str, float] | None = None,
    tools: Mapping[str, Mapping[str, Any]] | None = None,
    gravity: Any = None,
) -> Robot:
    """Read a robot from its URDF or MJCF.

    Links that are fixed to each other are one body, with the sum of their inertias; joints become
    hinges, slides and ball joints of ``dmoc.spatial.World``, with armature, damping and
    springs, limits become bounds, what drives a joint an input.  A joint that mimics another one
    has no coordinate.  No other file is read: meshes are left out, as is whatever else
    ``Robot.notes`` lists.

    Parameters
    ----------
    path : str or Path
        The file; it needs the package mujoco-core, ``pip install "dmoc[robots]"``.
    base : {"fixed", "quaternion", "euler"}, optional
        Whether the root stands in the world or floats, with a unit quaternion or with yaw, pitch
        and roll; as in the file by default, where that of a URDF stands.
    lock : mapping of str to float, optional
        Joints that do not move, with their values in rad or m: ``{"finger": 0.0}``.
    tools : mapping of str to mapping, optional
        What is fixed to links beside what the file says, by name: ``{"racket": {"link": "hand",
        "at": (0, 0, 0.1), "mass": 0.3}}``, with ``centre`` and ``inertia`` about it in the axes of
        the link, and the ``radius`` of a sphere that touches.
    gravity : Expr, optional
        Its acceleration along -z in m/s2; that of the file by default, 9.81 where it has none.

    Returns
    -------
    Robot

    Raises
    ------
    MissingExtraError
        If mujoco-core is not installed.
    ModelError
        If the file is no robot, or names another file that it cannot do without; if its links
        make no tree, or an inertia is that of no body.

    Notes
    -----
    Turns by a quarter within 1e-7 rad are taken as exact.  The frames of bodies are parallel to
    each other where all joints are as the file draws them, so that a joint is an axis and a place.

    Examples
    --------
    >>> import dmoc
    >>> file = open("pendulum.urdf", "w")
    >>> _ = file.write(
    ...     '<robot name="pendulum"><link name="stand"/><link name="rod"><inertial>'
    ...     '<origin xyz="0 0 -0.5"/><mass value="2"/>'
    ...     '<inertia ixx="0.1" iyy="0.1" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    ...     '<joint name="hip" type="continuous"><parent link="stand"/><child link="rod"/>'
    ...     '<axis xyz="0 1 0"/></joint></robot>'
    ... )
    >>> file.close()
    >>> robot = dmoc.read_robot("pendulum.urdf", tools={"tip": {"link": "rod", "at": (0, 0, -1)}})
    >>> robot
    <Robot pendulum: 1 coordinates, 1 inputs>
    >>> robot.point("tip")[2]
    z_rod_p(t)
    >>> system = robot.system(cost=robot.inputs["u_hip"] ** 2)
    >>> system.mass_matrix
    Matrix([[0.6]])
    """
    if base is not None:
        choice(base, "base", BASES, ModelError)
    text = read_text(path)
    label = text.label
    description = read_description(text, label)
    description = with_tools(based(description, base), {} if tools is None else tools, label)
    held = held_values(description, {} if lock is None else lock, label)
    return Robot(description, held, base == "euler", _gravity(description, gravity, label), label)


def _gravity(description: Description, gravity: Any, label: str) -> Any:
    if gravity is not None:
        return gravity
    x, y, z = description.gravity
    if x != 0 or y != 0 or z > 0:
        raise ModelError(
            f"gravity of {label} is {description.gravity.tolist()}: expected it along -z; turn the "
            "robot in the file, or pass gravity=9.81, which takes its place."
        )
    return plain([abs(z)])[0]
