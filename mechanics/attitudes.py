"""Attitudes of a model in what is said of its states: coordinates in their place, and rates of
these in the place of angular velocities."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dmoc.base.arguments import ErrorKind, array, is_number, number, shown
from dmoc.base.errors import ProblemError
from dmoc.base.names import momentum_name, omega_names, velocity_name
from dmoc.codegen.kernels import Array, Kernels
from dmoc.motion.attitude import Attitude, attitude, logarithm, rates, turned

HOW = "expected an attitude such as dmoc.attitude(axis=(0, 0, 1), angle=0.5)"

# A quaternion that is shorter says no attitude.
NO_LENGTH = 1e-6


def coordinates_of(kernels: Kernels, name: str) -> list[str]:
    """The four coordinates of an attitude."""
    return [kernels.coordinates[i] for i in kernels.manifest.attitudes[name]]


def quaternion_of(value: Any, what: str, error: ErrorKind = ProblemError) -> Array:
    """The quaternion of an attitude that is stated, shape (4,)."""
    if isinstance(value, Attitude):
        return np.array(value.quaternion)
    numbers = array(value)
    if numbers is None or numbers.shape != (4,):
        raise error(f"{what} = {shown(value)}: {HOW}, or the four numbers of a quaternion.")
    try:
        return np.array(attitude(value).quaternion)
    except ProblemError as cause:
        raise error(f"{what}: {cause}") from None


def said_of(kernels: Kernels) -> Callable[[list[str]], list[str]]:
    """How messages list names: attitudes and angular velocities in the place of coordinates of
    quaternions and their rates, without their momenta."""
    instead = dict[str, tuple[str, ...]]()
    for name in kernels.manifest.attitudes:
        own = coordinates_of(kernels, name)
        for of in (str, velocity_name, momentum_name):
            instead |= {of(q): () for q in own}
        instead |= {own[0]: (name,), velocity_name(own[0]): omega_names(name)}
    return lambda names: list(dict.fromkeys(n for q in names for n in instead.get(q, (q,))))


def in_coordinates(
    kernels: Kernels, state: Mapping[str, Any], what: str, error: ErrorKind = ProblemError
) -> dict[str, Any]:
    """A state by name, with the coordinates of the attitudes that it names; None leaves all four
    free."""
    plain = dict(state)
    for name in kernels.manifest.attitudes:
        if name not in plain:
            continue
        own, value = coordinates_of(kernels, name), plain.pop(name)
        twice = [q for q in own if q in plain]
        if twice:
            raise error(f"{what} gives {twice[0]!r} twice, also as {name!r}: give it once.")
        none = value is None
        p = [None] * 4 if none else quaternion_of(value, f"{what} of {name}", error).tolist()
        plain |= dict(zip(own, p, strict=True))
    return plain


def in_rates(
    kernels: Kernels, state: Mapping[str, Any], places: Mapping[str, Any], what: str,
    error: ErrorKind = ProblemError,
) -> dict[str, Any]:  # fmt: skip
    """A state by name, with rates of quaternions in the place of angular velocities that are
    numbers, at attitudes that are: p' = G^T omega / 2.  Components that are left out are 0."""
    plain = dict(state)
    for name in kernels.manifest.attitudes:
        own, spin = coordinates_of(kernels, name), omega_names(name)
        said = [n for n in spin if n in plain]
        for rate in map(velocity_name, own):
            if said and rate in plain:
                raise error(f"{what} gives {rate!r} and {said[0]!r}: give one of them.")
        components, p = [plain.get(n, 0.0) for n in spin], [places.get(q) for q in own]
        if not said or not all(map(is_number, [*components, *p])):
            continue
        omega = [number(x, f"{what} of {n}", error) for n, x in zip(spin, components, strict=True)]
        plain = {n: x for n, x in plain.items() if n not in spin}
        moved = np.array(omega) @ np.array(rates(p), dtype=float) / 2
        plain |= dict(zip(map(velocity_name, own), moved.tolist(), strict=True))
    return plain


def on_sphere(kernels: Kernels, q: Array) -> Array:
    """Positions (..., nq) whose quaternions have length 1; the middle of the sphere is no turn."""
    q = q.copy()
    for columns in kernels.manifest.attitudes.values():
        p = q[..., columns]
        length = np.linalg.norm(p, axis=-1, keepdims=True)
        some = np.where(length > NO_LENGTH, p, (1.0, 0.0, 0.0, 0.0))
        q[..., columns] = some / np.where(length > NO_LENGTH, length, 1.0)
    return q


def bulge(kernels: Kernels, a: Array, b: Array, share: Array) -> Array:
    """What is added to straight ways between positions (..., nq), at shares (..., 1) of them, so
    that attitudes turn along their sphere at one speed: zero for all other coordinates."""
    away = np.zeros(np.broadcast_shapes(a.shape, share.shape))
    for columns in kernels.manifest.attitudes.values():
        p, r = a[..., columns], b[..., columns]
        straight = (1 - share) * p + share * r
        away[..., columns] = turned(p, share * logarithm(p, r)) - straight
    return away


def facing(kernels: Kernels, q: Array, v: Array, near: Array) -> tuple[Array, Array]:
    """A state, shape (nq,) each, whose quaternions have the signs that are nearer to a position."""
    q, v = q.copy(), v.copy()
    for columns in kernels.manifest.attitudes.values():
        if q[columns] @ near[columns] < 0:
            q[columns], v[columns] = -q[columns], -v[columns]
    return q, v
