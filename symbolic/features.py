"""What of shapes in space meets others: corners, ends, edges, rims and faces, as shapes of their
own."""

from __future__ import annotations

from typing import Any

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.base.signatures import public
from dmoc.symbolic.cores import Block, Cut, Drum, Edge, Round, core_of
from dmoc.symbolic.solids import Plane, Sphere
from dmoc.symbolic.vectors import added, times


@public(ModelError)
def features(shape: Any) -> dict[str, Any]:
    """What of a shape meets another one first: each a shape of its own, for a surface of its own.

    A box and a hull have their corners, ``_1``, ``_2``, ...; a capsule has the spheres at its ends,
    ``_a`` and ``_b``; a sphere or a point is one feature, without an ending.

    Parameters
    ----------
    shape : shape in space
        As those of :meth:`World.distance`.

    Returns
    -------
    dict of str to shape
        By the endings of their names.

    Raises
    ------
    ModelError
        If the shape has no such features, as a cylinder and a plane.

    Examples
    --------
    >>> import dmoc
    >>> world = dmoc.spatial.World()
    >>> box, floor = dmoc.spatial.Box((2, 2, 2), at=(0, 0, 1.5)), dmoc.spatial.Plane()
    >>> corners = dmoc.spatial.features(box)
    >>> [float(world.distance(corners[k], floor)) for k in ("_1", "_8")]
    [2.5, 0.5]
    """
    core = core_of(shape)
    match core:
        case Round():
            ends = core.ends
            balls = ends if core.radius == 0 else [Sphere(core.radius, end) for end in ends]
            return dict(zip(("_a", "_b") if core.along else ("",), balls, strict=True))
        case Block() | Cut():
            return {f"_{k}": corner for k, corner in enumerate(core.corners, 1)}
    raise ModelError(
        f"{shown(shape)} has no corners or ends: expected a box, a capsule, a hull or a sphere."
    )


@public(ModelError)
def edges(shape: Any) -> dict[str, Any]:
    """The edges of a box or a hull, ``_1``, ``_2``, ...: two of them that cross have a distance
    between their lines, which is smooth and negative where they overlap.

    With the directions u, v, places a, b and sums o, p of the normals of the faces beside them, it
    is s n . (b - a) of the unit vector n along u x v, with the sign s of n . (o - p).

    Parameters
    ----------
    shape : shape in space
        A box or a hull as it is in the world, ``body.carried(...)``.

    Returns
    -------
    dict of str to shape
        By the endings of their names; beside other shapes an edge is a segment.  Of a box the first
        four are along x, at y and z with the signs ++, +-, -+ and --, then come those along y and
        along z alike; of a hull they have the order of its ``edges``, pairs of its ``points``.

    Raises
    ------
    ModelError
        If the shape has no straight edges.

    Examples
    --------
    >>> import dmoc
    >>> world, turn = dmoc.spatial.World(), dmoc.attitude(axis=(0, 0, 1), angle=0.7)
    >>> roof = [(-1, -1, 0), (-1, 1, 0), (-1, 0, 1), (1, -1, 0), (1, 1, 0), (1, 0, 1)]
    >>> ridge = dmoc.spatial.edges(dmoc.spatial.Hull(roof))["_6"]
    >>> keel = dmoc.spatial.edges(dmoc.spatial.Hull([(y, x, 3 - z) for x, y, z in roof]))["_6"]
    >>> float(world.distance(ridge, keel))
    1.0
    """
    core = core_of(shape)
    if not isinstance(core, Block | Cut):
        raise ModelError(
            f"{shown(shape)} has no straight edges: expected a box or a hull; the side of a "
            "cylinder is that of a Capsule of its radius and length."
        )
    pairs = zip(core.edges, core.outward, strict=True)
    own = [Edge(e.at, e.along, e.half, e.radius, out) for e, out in pairs]
    return {f"_{k}": edge for k, edge in enumerate(own, 1)}


@public(ModelError)
def rims(shape: Any) -> dict[str, Any]:
    """The rims of a cylinder, ``_1`` along z and ``_2`` along -z: circles, which have smooth
    distances from edges and from other rims, negative where these overlap.

    Where a rim is nearest to the line of the edge, or to the other rim, it has a tangent; the
    distance is that of two :func:`edges`.

    Parameters
    ----------
    shape : shape in space
        A cylinder as it is in the world, ``body.carried(...)``.

    Returns
    -------
    dict of str to shape
        By the endings of their names; beside points, spheres and capsules a rim is a circle, and
        a capsule the line of its axis.

    Raises
    ------
    ModelError
        If the shape has no rims.

    Examples
    --------
    >>> import dmoc
    >>> world = dmoc.spatial.World()
    >>> edge = dmoc.spatial.edges(dmoc.spatial.Box((2, 4, 2), at=(1, 0, 0)))["_7"]
    >>> lying = dmoc.attitude(axis=(1, 0, 0), angle=1.5707963267948966)
    >>> roller = dmoc.spatial.Cylinder(0.5, 2.0, at=(0, 0, 2), attitude=lying)
    >>> round(float(world.distance(dmoc.spatial.rims(roller)["_1"], edge)), 9)
    0.5
    """
    core = core_of(shape)
    if not isinstance(core, Drum):
        raise ModelError(f"{shown(shape)} has no rims: expected a cylinder.")
    return {f"_{k}": rim for k, rim in enumerate(core.rims, 1)}


@public(ModelError)
def faces(shape: Any) -> dict[str, Plane]:
    """The faces of a box, a hull or a cylinder, ``_1``, ``_2``, ...: planes, from which other
    shapes have smooth distances.

    Parameters
    ----------
    shape : shape in space
        As it is in the world, ``body.carried(...)``.

    Returns
    -------
    dict of str to Plane
        By the endings of their names; each is taken as a plane without an end.  Those of a box look
        along x, -x, y, -y, z and -z, of a cylinder along z and -z, of a hull in the order of its
        ``faces``.

    Raises
    ------
    ModelError
        If the shape has no flat faces.

    Examples
    --------
    >>> import dmoc
    >>> world = dmoc.spatial.World()
    >>> lid = dmoc.spatial.faces(dmoc.spatial.Cylinder(0.5, 2.0))["_1"]
    >>> float(world.distance((0.2, 0, 1.7), lid))
    0.7
    """
    core = core_of(shape)
    if isinstance(core, Drum):
        ways = [times(sign, core.along) for sign in (1, -1)]
        own = [(n, added(core.at, times(core.half, n))) for n in ways]
    elif isinstance(core, Block | Cut):
        own = list(core.faces)
    else:
        raise ModelError(f"{shown(shape)} has no flat faces: expected a box, a cylinder or a hull.")
    return {f"_{k}": Plane(at, normal) for k, (normal, at) in enumerate(own, 1)}
