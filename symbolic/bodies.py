"""Bodies of linkages in space: their frames, joints, energies and looks."""

from __future__ import annotations

from typing import Any

import sympy as sp

from dmoc.base.arguments import choice
from dmoc.base.errors import ModelError
from dmoc.base.names import check_name
from dmoc.base.signatures import public
from dmoc.symbolic.attitudes import quaternion, regularised
from dmoc.symbolic.distances import carried_shape
from dmoc.symbolic.drawing import Part
from dmoc.symbolic.expressions import expression_in
from dmoc.symbolic.joints import (
    ORIGIN,
    Ball,
    Hinge,
    Joint,
    Load,
    read_axis,
    read_load,
)
from dmoc.symbolic.linkage import Linkage, Member
from dmoc.symbolic.looks import BodyLook, shapes_in_space
from dmoc.symbolic.vectors import Vector, added, cross, dot, rate, times, vector


@public(ModelError)
class Body(Member):
    """A body of a linkage; made by :meth:`hinge`, :meth:`slide`, :meth:`ball` and
    :meth:`World.free`.

    Its kinetic energy is m v.v/2 + w.I w/2 with the velocity v of its centre of mass and its
    angular velocity w, its potential energy m g z.

    Attributes
    ----------
    name : str
        That of its coordinate, or the one given.
    spin : triple of Expr
        Its angular velocity in its own frame, in rad/s.

    Examples
    --------
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> import dmoc
    >>> a, b = dynamicsymbols("a b")
    >>> column = dmoc.spatial.World().hinge(a, "z", tip=(0, 0, 0.5), mass=2)
    >>> arm = column.hinge(b, "y", tip=(0.4, 0, 0), mass=1)
    >>> arm.spin[1], arm.tip
    (Derivative(b(t), t), (x_b(t), y_b(t), z_b(t)))
    """

    def __init__(
        self, linkage: Linkage, gravity: Any, name: str, tip: Vector, joint: Joint,
        before: Body | None = None,
    ) -> None:  # fmt: skip
        self.name = name
        self._linkage, self._gravity = linkage, gravity
        self._before, self._joint, self._end = before, joint, tip
        self._rows: dict[int, Vector] = {}
        self._points: dict[tuple[Vector, int], Any] = {}
        self._look = BodyLook(joint, self._placed, self._directed, self._points)
        self._velocity = self.spin = ORIGIN
        if before is None:
            return
        moved = added(before._velocity, cross(before.spin, joint.at), rate(joint.at))
        self.spin = self._named("w", added(joint.turned(before.spin), joint.spin))
        self._velocity = self._named("v", joint.turned(moved))

    @property
    def origin(self) -> Vector:
        """The place of its joint in the world."""
        return self._placed(ORIGIN)

    @property
    def tip(self) -> Vector:
        """The place of its tip in the world."""
        return self._place(self._end, "")

    def point(self, a: Any, b: Any, c: Any) -> Vector:
        """A point of the body: its place (x, y, z) in the world.

        Parameters
        ----------
        a, b, c : Expr
            The point in the frame of the body, in the unit of lengths.

        Returns
        -------
        triple of Expr
            Definitions of the system, for surfaces and, by ``.diff()``, velocities.

        Raises
        ------
        ModelError
            If they are no expressions.
        """
        return self._placed(vector((a, b, c), 3, f"point of body {self.name}"))

    def velocity_at(self, x: Any, y: Any, z: Any) -> Vector:
        """The velocity in the world of what of the body is at a place: where it touches, as the
        lowest point of a ball, ``ball.velocity_at(x, y, z - r)``.

        Parameters
        ----------
        x, y, z : Expr
            The place in the world, in the unit of lengths.

        Returns
        -------
        triple of Expr

        Raises
        ------
        ModelError
            If they are no expressions.
        """
        place = vector((x, y, z), 3, f"place on body {self.name}")
        arm = added(place, times(-1, self.origin))
        return added(rate(self.origin), cross(self._directed(self.spin), arm))

    def draw(self, *shapes: Part) -> Body:
        """Show the body by some shapes, in the place of those that its joints and its inertia have.

        Parameters
        ----------
        *shapes : shapes in space
            ``dmoc.spatial.Box``, ``Sphere``, ``Capsule``, ``Cylinder``, ``Plane`` and
            ``Arrow``, and :class:`dmoc.Link`, ``Point``, ``Spring`` and ``Contact``, whose places
            are triples: all of them in the frame of the body.  Without any the body is not seen.

        Returns
        -------
        Body
            The body itself.

        Raises
        ------
        ModelError
            If something is no shape in space.

        Examples
        --------
        >>> from sympy.physics.mechanics import dynamicsymbols
        >>> import dmoc
        >>> x, y, z = dynamicsymbols("x y z")
        >>> world = dmoc.spatial.World(gravity=9.81)
        >>> ball = world.free((x, y, z), mass=1, inertia=(0.004, 0.004, 0.004))
        >>> ball.draw(dmoc.spatial.Sphere(0.1))
        <Body q>
        >>> system = world.system("ball", surfaces={"floor": z >= 0.1}, cost=1)
        >>> [type(shape).__name__ for shape in system.drawing]
        ['Sphere', 'Contact', 'Plane']
        """
        self._look.shapes = [*(self._look.shapes or ()), *shapes_in_space(shapes, self.name)]
        return self

    def carried(self, shape: Any) -> Any:
        """A shape of the body as it is in the world, for :meth:`World.distance`.

        Parameters
        ----------
        shape : Sphere, Capsule, Box, Cylinder, Hull or Plane of ``dmoc.spatial``
            In the frame of the body.

        Returns
        -------
        shape in space

        Examples
        --------
        >>> from sympy.physics.mechanics import dynamicsymbols
        >>> import dmoc
        >>> a = dynamicsymbols("a")
        >>> world = dmoc.spatial.World()
        >>> arm = world.hinge(a, "y", tip=(1, 0, 0), mass=1)
        >>> hand = arm.carried(dmoc.spatial.Sphere(0.1, at=(0.9, 0, 0)))
        >>> world.distance(hand, dmoc.spatial.Plane(at=(0, 0, -0.5)))
        z_a_p(t) + 0.4
        """
        return carried_shape(shape, self._placed, self._directed, self.name)

    def hinge(
        self,
        angle: Any,
        axis: Any,
        *,
        zero: Any = 0,
        torque: Any = 0,
        at: Any = None,
        tip: Any = ORIGIN,
        mass: Any = 0,
        centre: Any = None,
        inertia: Any = None,
        name: str | None = None,
    ) -> Body:
        """Hang a body from this one by a hinge.

        Parameters
        ----------
        angle : dynamicsymbol or Expr
            The coordinate in rad, by which the body is turned from this one; or an expression in
            those of other joints, which it follows as a gear does, with a ``name``.
        axis : {"x", "y", "z"} or triple of float
            Of the hinge, in the frames of both bodies.
        zero : Expr
            Angle of the body where the coordinate is 0.
        torque : Expr
            About the axis, from this body on the other; mostly an input.
        name : str, optional
            Of the body, behind the names of what is defined; that of the coordinate by default.
        at : triple of Expr, optional
            The joint in the frame of this body; its tip by default.
        tip : triple of Expr, optional
            Where the next joint is by default, in the frame of the body; its origin by default.
        mass : Expr, optional
        centre : triple of Expr, optional
            The centre of mass in the frame of the body; half-way to the tip by default.
        inertia : triple of Expr or matrix, optional
            Moments of inertia about the centre of mass and the axes of the frame; those of a
            slender rod to the tip by default.

        Returns
        -------
        Body

        Raises
        ------
        ModelError
            If the coordinate is no function of time or belongs to a joint already, or something
            is no expression of its size.
        """
        name, start = self._read_joint(angle, name, at)
        turn = angle + expression_in(zero, f"the zero of body {name}")
        joint = Hinge(start, read_axis(axis, name), turn)
        load = read_load(self._linkage.size, name, tip, mass, centre, inertia)
        self._linkage.join(name, (angle, "rad"), torque, turn)
        return self._joined(name, joint, load, times(torque, joint.axis), True)

    def slide(
        self,
        distance: Any,
        axis: Any,
        *,
        force: Any = 0,
        at: Any = None,
        tip: Any = ORIGIN,
        mass: Any = 0,
        centre: Any = None,
        inertia: Any = None,
        name: str | None = None,
    ) -> Body:
        """Put a body on a straight rail of this one.

        Parameters
        ----------
        distance : dynamicsymbol or Expr
            The coordinate in m: how far the body is along the rail; or an expression in those of
            other joints, with a ``name``.
        axis : {"x", "y", "z"} or triple of float
            Of the rail, in the frames of both bodies.
        force : Expr
            Along the rail, from this body on the other; mostly an input.
        name, at, tip, mass, centre, inertia
            As those of :meth:`hinge`; the rail begins at ``at``.

        Returns
        -------
        Body
        """
        name, start = self._read_joint(distance, name, at)
        along = read_axis(axis, name)
        load = read_load(self._linkage.size, name, tip, mass, centre, inertia)
        self._linkage.join(name, (distance, "m"), force, distance + dot(start, along))
        rail = Hinge(added(start, times(distance, along)))
        return self._joined(name, rail, load, times(force, along))

    def ball(
        self,
        attitude: str,
        *,
        torque: Any = ORIGIN,
        axes: str = "body",
        at: Any = None,
        tip: Any = ORIGIN,
        mass: Any = 0,
        centre: Any = None,
        inertia: Any = None,
        name: str | None = None,
    ) -> Body:
        """Hang a body from this one by a ball joint, which lets it turn in any way.

        Parameters
        ----------
        attitude : str
            Name of its attitude against this body, ``"q"``: a unit quaternion, whose coordinates
            are q0, q1, q2, q3.  Problems state it by :func:`dmoc.attitude`, and its angular
            velocity in the axes of the new body by the quantities q_omega_x, q_omega_y, q_omega_z
            in rad/s.
        torque : triple of Expr
            From this body on the other; mostly inputs.
        axes : {"body", "world"}
            Those of the torque: of the new body, or of the world.
        name : str, optional
            Of the body, behind the names of what is defined; that of the attitude by default.
        at, tip, mass, centre, inertia
            As those of :meth:`hinge`.

        Returns
        -------
        Body

        Examples
        --------
        >>> from sympy.physics.mechanics import dynamicsymbols
        >>> import dmoc
        >>> torque = dynamicsymbols("T_x T_y T_z")
        >>> world = dmoc.spatial.World()
        >>> body = world.ball("q", inertia=(3, 2, 1), torque=torque)
        >>> system = world.system("satellite", inputs=torque, cost=1)
        >>> system.coordinates, list(system.quantities)
        ((q0(t), q1(t), q2(t), q3(t)), ['q_omega_x', 'q_omega_y', 'q_omega_z'])
        """
        p = quaternion(check_name(attitude, "attitude"))
        (name, start), *_ = [self._read_joint(e, attitude if name is None else name, at) for e in p]
        load = read_load(self._linkage.size, name, tip, mass, centre, inertia)
        acting = vector(torque, 3, f"the torque on body {name}")
        choice(axes, f"the axes of body {name}", ("body", "world"), ModelError)
        ball = Ball.of(start, p, name, self._linkage.define)
        body = self._joined(name, ball, load, acting, True)
        if axes == "world":
            rows = [times(T, body._row(k)) for k, T in enumerate(acting) if T != 0]
            acting = added(*rows) if rows else ORIGIN
            body._look.effort = acting
        self._linkage.turn(attitude, p, acting)
        moments = load.inertia.trace() / 3 + load.mass * dot(load.centre, load.centre)
        self._linkage.lagrangian += regularised(p, moments if moments != 0 else 1)
        return body

    def _joined(
        self, name: str, joint: Joint, load: Load, effort: Vector, turns: bool = False
    ) -> Body:
        """A body behind a joint, with its energies and what acts at the joint."""
        body = Body(self._linkage, self._gravity, name, load.tip, joint, self)
        look = body._look
        look.before, look.load, look.effort, look.turns = self._look, load, effort, turns
        self._linkage.looks.append(look)
        velocity = added(body._velocity, cross(body.spin, load.centre), rate(load.centre))
        turning = dot(body.spin, tuple(load.inertia * sp.Matrix(body.spin)))
        energy = load.mass * dot(velocity, velocity) / 2 + turning / 2
        weight = load.mass * self._gravity
        if weight != 0:
            energy -= weight * body._coordinate(load.centre, 2, "_c")
        self._linkage.lagrangian += energy
        return body

    def _row(self, k: int) -> Vector:
        """A direction of the world in the frame of the body."""
        if self._before is None:
            return tuple(sp.Integer(i == k) for i in range(3))
        if k not in self._rows:
            turned = self._joint.turned(self._before._row(k))
            self._rows[k] = self._named(f"r{'xyz'[k]}", turned)
        return self._rows[k]

    def _coordinate(self, local: Vector, k: int, ending: str) -> Any:
        """A coordinate in the world of a point of the frame."""
        if self._before is None:
            return local[k]
        if (local, k) not in self._points:
            origin = self._before._coordinate(self._joint.at, k, "_p")
            place = origin + dot(self._row(k), local)
            ending = "" if local == self._end else ending
            name = f"{'xyz'[k]}_{self.name}{ending}"
            self._points[local, k] = self._linkage.define(name, place)
        return self._points[local, k]

    def _placed(self, local: Vector) -> Vector:
        """A point of the frame in the world."""
        return self._place(local, "_o" if local == ORIGIN else "_p")

    def _directed(self, v: Vector) -> Vector:
        """A direction of the frame in the world."""
        return tuple(dot(self._row(k), v) for k in range(3))

    def _place(self, local: Vector, ending: str) -> Vector:
        return tuple(self._coordinate(local, k, ending) for k in range(3))

    def _named(self, letter: str, values: Vector) -> Vector:
        return tuple(
            self._linkage.define(f"{letter}{i}_{self.name}", sp.sympify(e))
            for i, e in enumerate(values, 1)
        )
