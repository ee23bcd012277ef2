"""Linkages in the plane, built body by body: carts, links, legs, chains.

x points to the right, y upwards, angles grow counterclockwise in rad.  A body has a frame: its
origin is at its joint, its first axis points along it.  Its pose follows from that of the body
before it (Featherstone, "Rigid Body Dynamics Algorithms", 2008, chapter 4).

Examples
--------
A double pendulum of slender rods:

>>> from sympy.physics.mechanics import dynamicsymbols
>>> import dmoc
>>> a, b = dynamicsymbols("a b")
>>> world = dmoc.planar.World(gravity=9.81)
>>> forearm = world.hinge(a, length=1, mass=1).hinge(b, length=0.5, mass=0.3)
>>> world.system("double_pendulum", surfaces={"floor": forearm.tip[1] >= -1.4}).gaps
{'floor': -y_b(t) - 1.4}
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import flag
from dmoc.base.errors import ModelError
from dmoc.base.signatures import public
from dmoc.symbolic.drawing import Box, Link, Place, Point
from dmoc.symbolic.expressions import expression_in
from dmoc.symbolic.linkage import Ground, Linkage, Member, coordinates
from dmoc.symbolic.vectors import Vector, added, dot, times, unit_vector, vector


@public(ModelError)
class Body(Member):
    """A body of a linkage; made by :meth:`hinge`, :meth:`slide` and :meth:`World.free`.

    Its kinetic energy is m (x'^2 + y'^2)/2 + I angle'^2/2 with the centre of mass (x, y), its
    potential energy m g y.

    Attributes
    ----------
    name : str
        That of its coordinate, or the one given.
    angle : Expr
        Of its first axis, from that of the world.
    origin, tip : pair of Expr
        Places of its joint and of its end, from which the next body hangs by default.

    Examples
    --------
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> import dmoc
    >>> a, b = dynamicsymbols("a b")
    >>> arm = dmoc.planar.World().hinge(a, length=0.5, mass=1)
    >>> hand = arm.hinge(b, length=0.2, mass=0.3)
    >>> hand.angle, hand.tip
    (a(t) + b(t), (x_b(t), y_b(t)))
    """

    def __init__(
        self, linkage: Linkage, gravity: Any, name: str, angle: Any, origin: Place, length: Any
    ) -> None:
        self.name, self.angle, self.origin = name, angle, origin
        self._linkage, self._gravity, self._end = linkage, gravity, (length, sp.S.Zero)
        self._axis = tuple(
            linkage.define(f"{letter}_{name}", function(angle))
            for letter, function in (("c", sp.cos), ("s", sp.sin))
        )
        self._points: dict[Place, Place] = {(sp.S.Zero, sp.S.Zero): origin}
        self.tip = self._place(self._end, "")

    def point(self, along: Any, across: Any = 0) -> Place:
        """A point of the body: its place (x, y) in the world.

        Parameters
        ----------
        along, across : Expr
            The point in the frame of the body, along its first axis and to the left of it, in the
            unit of lengths.

        Returns
        -------
        pair of Expr
            Definitions of the system, for surfaces, drawings and, by ``.diff()``, velocities.

        Raises
        ------
        ModelError
            If they are no expressions.
        """
        return self._place(vector((along, across), 2, f"point of body {self.name}"), "_p")

    def hinge(
        self,
        angle: Any,
        *,
        length: Any = 0,
        mass: Any = 0,
        centre: Any = None,
        inertia: Any = None,
        at: Any = None,
        absolute: bool = False,
        zero: Any = 0,
        torque: Any = 0,
        box: Any = None,
        name: str | None = None,
    ) -> Body:
        """Hang a link from this body by a hinge.

        Parameters
        ----------
        angle : dynamicsymbol or Expr
            The coordinate in rad: the angle of the link from this body; or an expression in those
            of other joints, which it follows as a gear does, with a ``name``.
        length : Expr
            Of the link, from the hinge to its tip.
        mass : Expr
        centre : Expr, optional
            Distance of the centre of mass from the hinge, or a pair (along, across); half the
            length by default.
        inertia : Expr, optional
            Moment of inertia about the centre of mass; that of a slender rod, m l^2/12, by
            default.  A point mass at the tip is ``centre=l, inertia=0``.
        at : pair of Expr, optional
            The hinge in the frame of this body; its tip by default.  It moves over this body where
            it depends on coordinates: a wheel that rolls has ``at=(-r * angle, r)``.
        absolute : bool
            The coordinate is the angle from the world's first axis instead.
        zero : Expr
            Angle of the link where the coordinate is 0: ``-sp.pi / 2`` of one that hangs down.
        torque : Expr
            Between this body and the link, counterclockwise on the link; mostly an input.
        box : pair of Expr, optional
            Width and height of the box that is drawn instead of a line.
        name : str, optional
            Of the link, behind the names of its places; that of the coordinate by default.

        Returns
        -------
        Body

        Raises
        ------
        ModelError
            If the coordinate is no function of time or belongs to a joint already, or something
            is no expression.
        """
        name, start = self._read_joint(angle, name, at)
        load = self._read_load(name, length, mass, centre, inertia, box)
        turned = angle + expression_in(zero, f"the zero of body {name}")
        if not flag(absolute, "absolute", ModelError):
            turned = self.angle + turned
        self._linkage.join(name, (angle, "rad"), torque, turned - self.angle)
        return self._joined(name, turned, self._place(start, "_p"), load)

    def slide(
        self,
        distance: Any,
        *,
        direction: Any = (1, 0),
        length: Any = 0,
        mass: Any = 0,
        centre: Any = None,
        inertia: Any = None,
        at: Any = None,
        force: Any = 0,
        box: Any = None,
        name: str | None = None,
    ) -> Body:
        """Put a body on a straight rail of this body: a cart, or the foot of a leg that extends.

        Parameters
        ----------
        distance : dynamicsymbol or Expr
            The coordinate in m: how far the body is along the rail; or an expression in those of
            other joints, with a ``name``.
        direction : pair of float
            Of the rail, in the frame of this body.
        force : Expr
            Along the rail, from this body on the other; mostly an input.
        length, mass, centre, inertia, at, box, name
            As those of :meth:`hinge`; the body has the angle of this one, and its joint is on the
            rail, which begins at ``at``.

        Returns
        -------
        Body
        """
        name, start = self._read_joint(distance, name, at)
        load = self._read_load(name, length, mass, centre, inertia, box)
        along = unit_vector(direction, 2, f"the direction of body {name}")
        self._linkage.join(name, (distance, "m"), force, distance + dot(start, along))
        local = added(start, times(distance, along))
        origin = self._place(local, "_o" if load.length != 0 else "", name)
        return self._joined(name, self.angle, origin, load)

    def _place(self, local: Place, ending: str, name: str = "") -> Place:
        """A point of the frame in the world, with names of its own if it has none."""
        if local not in self._points:
            (a, b), (c, s), (x, y) = local, self._axis, self.origin
            places = (("x", x + a * c - b * s), ("y", y + a * s + b * c))
            x, y = (
                self._linkage.define(f"{letter}_{name or self.name}{ending}", place)
                for letter, place in places
            )
            self._points[local] = (x, y)
        return self._points[local]

    def _read_load(
        self, name: str, length: Any, mass: Any, centre: Any, inertia: Any, box: Any
    ) -> _Load:
        what, size = f"of body {name}", self._linkage.size
        length = size(length, f"the length {what}", "; sp.pi more in `zero` turns a link round")
        mass = size(mass, f"the mass {what}")
        middle = length / 2 if centre is None else centre
        pair = middle if isinstance(middle, (tuple, list, sp.MatrixBase)) else (middle, 0)
        rod = mass * length**2 / 12 if inertia is None else inertia
        return _Load(
            length,
            mass,
            vector(pair, 2, f"the centre {what}"),
            size(rod, f"the inertia {what}"),
            None if box is None else vector(box, 2, f"the box {what}"),
        )

    def _joined(self, name: str, angle: Any, origin: Place, load: _Load) -> Body:
        """A body behind a joint, with the energies and the picture of what it consists of."""
        linkage, t = self._linkage, dynamicsymbols._t
        body = Body(linkage, self._gravity, name, angle, origin, load.length)
        x, y = body._place(load.centre, "_c") if load.mass != 0 else origin
        speed, rate = x.diff(t) ** 2 + y.diff(t) ** 2, angle.diff(t)
        linkage.lagrangian += load.mass * speed / 2 + load.inertia * rate**2 / 2
        linkage.lagrangian -= load.mass * self._gravity * y
        if load.box:
            width, height = load.box
            linkage.drawing.append(Box((x, y), width, height, angle))
        elif load.length != 0:
            linkage.drawing.append(Link(origin, body.tip))
        if not load.box and load.mass != 0 and load.inertia == 0:
            linkage.drawing.append(Point((x, y)))
        return body


@dataclass(frozen=True)
class _Load:
    """What a body consists of; its centre of mass in its frame."""

    length: Any
    mass: Any
    centre: Vector
    inertia: Any
    box: Place | None


@public(ModelError)
class World(Body, Ground):
    """The world that linkages in the plane hang in, with gravity downwards.

    Parameters
    ----------
    gravity : Expr
        Its acceleration, such as 9.81 or a parameter.

    Raises
    ------
    ModelError
        If it is no expression.

    Examples
    --------
    A pendulum on a cart:

    >>> import sympy as sp
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> import dmoc
    >>> x, a, F = dynamicsymbols("x a F")
    >>> l = sp.Symbol("l")
    >>> world = dmoc.planar.World(gravity=9.81)
    >>> cart = world.slide(x, mass=1, force=F, box=(0.4, 0.2))
    >>> pole = cart.hinge(a, length=l, mass=0.3)
    >>> system = world.system("cart_pole", {l: 0.5}, inputs=[F], cost=F**2)
    >>> system.definitions[pole.tip[0]]
    l*c_a(t) + x(t)
    >>> system.forces, len(system.drawing)
    ({x(t): F(t)}, 2)
    """

    def __init__(self, gravity: Any = 0) -> None:
        acceleration = expression_in(gravity, "the gravity of the world")
        zero = sp.S.Zero
        super().__init__(Linkage(), acceleration, "world", zero, (zero, zero), zero)

    def free(self, place: Any, angle: Any, *, name: str | None = None, **body: Any) -> Body:
        """Add a body that nothing holds.

        Parameters
        ----------
        place : pair of dynamicsymbols
            Coordinates of its origin in m.
        angle : dynamicsymbol
            The coordinate that turns it, in rad.
        name : str, optional
            That of the angle by default.
        **body
            ``length``, ``mass``, ``centre``, ``inertia``, ``box`` and ``zero``, as of
            :meth:`Body.hinge`.

        Returns
        -------
        Body
        """
        x, y = coordinates(place, 2, "place of a free body")
        return self.slide(x).slide(y, direction=(0, 1)).hinge(angle, name=name, **body)
