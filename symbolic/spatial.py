"""Linkages in space, built body by body: arms, legs, bodies that float.

z points upwards.  A body has a frame with its origin at its joint.  Velocities and angular
velocities are those of the body before it, turned into its own frame (Featherstone, "Rigid Body
Dynamics Algorithms", 2008, chapter 5); places in the world are made where they are asked for.

Examples
--------
A column that turns, with an arm that lifts:

>>> from sympy.physics.mechanics import dynamicsymbols
>>> import dmoc
>>> a, b, u = dynamicsymbols("a b u")
>>> world = dmoc.spatial.World(gravity=9.81)
>>> column = world.hinge(a, "z", mass=5, inertia=(0.1, 0.1, 0.2))
>>> arm = column.hinge(b, "y", tip=(0.6, 0, 0), mass=2, torque=u)
>>> system = world.system("crane", inputs=[u], surfaces={"floor": arm.tip[2] >= -0.3}, cost=u**2)
>>> system.forces, system.gaps
({b(t): u(t)}, {'floor': -z_b(t) - 0.3})
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp

from dmoc.base.errors import ModelError
from dmoc.base.names import check_name
from dmoc.base.signatures import public
from dmoc.symbolic.bodies import Body as Body
from dmoc.symbolic.distances import distance_of
from dmoc.symbolic.drawing import Part
from dmoc.symbolic.expressions import expression_in
from dmoc.symbolic.features import edges as edges
from dmoc.symbolic.features import faces as faces
from dmoc.symbolic.features import features as features
from dmoc.symbolic.features import rims as rims
from dmoc.symbolic.hulls import Hull as Hull
from dmoc.symbolic.joints import ORIGIN, Hinge
from dmoc.symbolic.linkage import Ground, Linkage, coordinates
from dmoc.symbolic.looks import looks_of
from dmoc.symbolic.solids import Arrow as Arrow
from dmoc.symbolic.solids import Box as Box
from dmoc.symbolic.solids import Capsule as Capsule
from dmoc.symbolic.solids import Cylinder as Cylinder
from dmoc.symbolic.solids import Plane as Plane
from dmoc.symbolic.solids import Sphere as Sphere


@public(ModelError)
class World(Body, Ground):
    """The world that linkages in space stand in, with gravity along -z.

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
    A spherical pendulum of a point mass:

    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> import dmoc
    >>> a, b = dynamicsymbols("a b")
    >>> world = dmoc.spatial.World(gravity=9.81)
    >>> rod = world.hinge(a, "z").hinge(
    ...     b, "y", tip=(0, 0, -1), mass=1, centre=(0, 0, -1), inertia=(0, 0, 0)
    ... )
    >>> world.system("spherical", cost=1).mass_matrix
    Matrix([
    [sin(b(t))**2, 0],
    [           0, 1]])
    """

    def __init__(self, gravity: Any = 0) -> None:
        acceleration = expression_in(gravity, "the gravity of the world")
        fixed = Hinge(ORIGIN)
        super().__init__(Linkage(), acceleration, "world", ORIGIN, fixed)

    def _looks(self, fields: Mapping[str, Any]) -> list[Part]:
        return looks_of([self._look, *self._linkage.looks], fields)

    def free(
        self,
        place: Any,
        angles: Any = None,
        *,
        attitude: str | None = None,
        name: str | None = None,
        **body: Any,
    ) -> Body:
        """Add a body that nothing holds.

        Parameters
        ----------
        place : triple of dynamicsymbols
            Coordinates of its origin in m.
        angles : triple of dynamicsymbols, optional
            Coordinates in rad that turn it about its z axis, then its y axis, then its x axis: yaw,
            pitch, roll, in the place of a quaternion.  Where the pitch is a quarter of a turn, the
            mass matrix is singular: problems keep it within 85 degrees unless they bound it.
        attitude : str, optional
            Name of its attitude, a unit quaternion, as that of :meth:`Body.ball`; "q" by default.
        name : str, optional
            That of the attitude, or of the last angle, by default.
        **body
            ``tip``, ``mass``, ``centre`` and ``inertia``, as of :meth:`Body.hinge`; with an
            attitude ``torque`` and ``axes``, as of :meth:`Body.ball`.

        Returns
        -------
        Body
        """
        x, y, z = coordinates(place, 3, "place of a free body")
        carrier = self.slide(x, "x").slide(y, "y").slide(z, "z")
        if angles is None:
            return carrier.ball(attitude or "q", name=name, **body)
        yaw, pitch, roll = coordinates(angles, 3, "angles of a free body")
        turned = carrier.hinge(yaw, "z").hinge(pitch, "y").hinge(roll, "x", name=name, **body)
        label = check_name(attitude or f"{turned.name}_attitude", "attitude")
        self._linkage.attitudes[label] = yaw, pitch, roll
        return turned

    def distance(self, a: Any, b: Any) -> Any:
        """The distance of two shapes, for a surface ``world.distance(a, b) >= 0``, or for a path
        constraint.

        It is negative where both overlap, and zero where they touch.  Of spheres, capsules, points
        and cylinders against anything, and of anything against a plane, it is the least distance
        of two of their points.  Of boxes and hulls against each other it is the largest gap
        between both along the normals of faces and the directions across two edges: the least
        distance where a corner is nearest to a face or an edge to another one, less where corners
        or edges pass each other, and zero exactly where both touch.

        Parameters
        ----------
        a, b : shapes in space, or triples of Expr
            Where they are in the world, as :meth:`Body.carried` has them:
            ``dmoc.spatial.Sphere``, ``Capsule``, ``Box``, ``Cylinder``, ``Hull`` and ``Plane``; a
            point is its place (x, y, z).

        Returns
        -------
        Expr
            In the unit of lengths; names for its parts are definitions of the system.

        Raises
        ------
        ModelError
            If something is no shape, both are planes, or a rim meets a whole box or cylinder.

        Notes
        -----
        Two segments c + s a, abs(s) <= h, and e + t b, abs(t) <= k, with d = c - e, p = d . a,
        q = d . b, u = a . b are nearest at s = (u q - p)/(1 - u^2), brought between -p - abs(u) k
        and -p + abs(u) k and then between -h and h, and at w = q + u s, brought between -k and k.
        Normals and directions across edges are the separating axes of S. Gottschalk, M. C. Lin,
        D. Manocha, "OBBTree", SIGGRAPH 1996.

        A rim is nearest to a line, or to another rim, at an angle that is the root of an equation:
        the code of kernels finds it.

        Where the nearest points jump, as on parallel segments or faces, the distance has a kink:
        state a surface for each of :func:`~dmoc.symbolic.features.features` there.

        Examples
        --------
        >>> import dmoc
        >>> world = dmoc.spatial.World()
        >>> rod, ball = dmoc.spatial.Capsule(0.1, 2.0), dmoc.spatial.Sphere(0.2, at=(0.5, 0, 0.3))
        >>> round(float(world.distance(rod, ball)), 12)
        0.2
        >>> round(float(world.distance((0, 3, 5), dmoc.spatial.Box((2, 2, 4)))), 8)
        3.60555128
        """
        return distance_of(a, b, lambda e: self._linkage.define("apart", sp.sympify(e)))
