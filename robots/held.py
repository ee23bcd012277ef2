"""Which joints do not move: those that are locked, those that follow them, and how roots stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from dmoc.base.arguments import number, shown
from dmoc.base.errors import ModelError
from dmoc.robots.names import known
from dmoc.robots.records import Description, Joint


def joints_of(description: Description) -> dict[str, Joint]:
    return {joint.name: joint for link in description.links for joint in link.joints}


def based(description: Description, base: str | None) -> Description:
    """The links with roots that stand in the world or float, where this is asked for."""
    if base is None:
        return description
    roots = [link for link in description.links if link.before is None]
    floating = [link for link in roots if any(j.kind == "free" for j in link.joints)]
    links = list(description.links)
    for link in roots:
        joints = tuple(j for j in link.joints if j.kind != "free")
        if base != "fixed" and link in (floating or roots):
            joints = (_free(link.name), *joints)
        links[links.index(link)] = replace(link, joints=joints)
    return replace(description, links=tuple(links))


def _free(name: str) -> Joint:
    return Joint(name, "free", np.zeros(3), np.zeros(3))


def held_values(description: Description, lock: Any, label: str) -> dict[str, float]:
    """Values of the joints that are locked, and of those that follow them or nothing."""
    joints = joints_of(description)
    if not isinstance(lock, Mapping):
        raise ModelError(f'lock = {shown(lock)}: expected a mapping such as {{"finger": 0.0}}.')
    held = {}
    for name, value in lock.items():
        known(name, joints, "joint", f"of {label}")
        if joints[name].kind not in ("hinge", "slide"):
            raise ModelError(
                f"joint {name} of {label} has no single coordinate: expected a hinge or a slide "
                "in lock; base='fixed' holds what floats."
            )
        held[name] = number(value, f"lock of joint {name}", ModelError)
    for name in joints:
        _follow(name, joints, held, label)
    description.notes.extend(_left_behind(name, joints, held) for name in lock)
    return held


def _left_behind(name: str, joints: Mapping[str, Joint], held: Mapping[str, float]) -> str:
    """A note on a joint that is locked elsewhere than where its leader has it; empty for others."""
    leader, _ = joints[name].follows or ("", ())
    if not leader:
        return ""
    if leader not in held:
        return f"joint {name} is locked: it does not follow joint {leader}, which moves alone"
    way = joints[name].zero + powers(joints[name], held[leader] - joints[leader].zero)
    if held[name] == way:
        return ""
    return (
        f"joint {name} is locked at {held[name]:g}, where joint {leader} would have it at {way:g}"
    )


def _follow(name: str, joints: Mapping[str, Joint], held: dict[str, float], label: str) -> None:
    """Hold a joint whose leader is held."""
    chain = [name]
    while joints[chain[-1]].follows and chain[-1] not in held:
        leader, _ = joints[chain[-1]].follows or ("", ())
        if leader in chain:
            raise ModelError(
                f"joints {' and '.join(chain[:3])} of {label} follow each other: expected one "
                "that leads."
            )
        if leader == "":
            held[chain[-1]] = joints[chain[-1]].zero + powers(joints[chain[-1]], 0.0)
            break
        chain.append(leader)
    for follower, leader in reversed([*pairwise(chain)]):
        if leader in held:
            way = held[leader] - joints[leader].zero
            held.setdefault(follower, joints[follower].zero + powers(joints[follower], way))


def powers(follower: Joint, way: Any) -> Any:
    """The way of a joint that follows another one's."""
    _, coefficients = follower.follows or ("", ())
    return sum(c * way**k for k, c in enumerate(coefficients) if c != 0)
