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

from dmoc.base.errors import ModelError
from dmoc.base.names import check_name
from dmoc.base.signatures import public
from dmoc.symbolic.bodies import Body as Body
from dmoc.symbolic.drawing import Part
from dmoc.symbolic.expressions import expression_in
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
