"""A solution as plain data: what the command line prints as JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from dmoc.motion.friction import friction_word
from dmoc.motion.largest_forces import largest_forces
from dmoc.motion.trajectory import Collision
from dmoc.results.exploration import exploration_of

if TYPE_CHECKING:
    from dmoc.results.solution import Solution


def data_of_solution(s: Solution) -> dict[str, Any]:
    """The summary of a solution."""
    check, proposal, refinement = s.verification, s.proposal, dict[str, Any]()
    if s.meshes:  # to a tolerance
        refinement = {"error_estimate": s.error_estimate}
        refinement["meshes"] = [asdict(m) for m in s.meshes]
    return {
        "model": s.trajectory.model,
        "method": s.method,
        "status": str(s.status),
        **_named(s, "message cost final_time"),
        "totals": dict(s.trajectory.totals),
        "design": dict(s.design),
        "active_bounds": list(map(str, s.active_bounds)),
        "phases": [_named(p, "steps step_size duration mode") for p in s.phases],
        "collisions": [_event(c) for c in s.collisions],
        "largest_forces": [asdict(force) for force in largest_forces(s.trajectory)],
        **_named(s, "max_violation optimality iterations"),
        "seconds": dict(s.seconds),
        "verification": None if check is None else check.to_dict(),
        "certificate": s.certificate and s.certificate.to_dict(),
        "conflicts": list(s.conflicts),
        "scale": dict(s.scale),
        **exploration_of(s),
        "proposal": None if proposal is None else asdict(proposal),
        **refinement,
    }


def _named(value: Any, names: str) -> dict[str, Any]:
    return {name: getattr(value, name) for name in names.split()}


def _event(c: Collision) -> dict[str, Any]:
    """A collision as plain data."""
    arrays = _named(c, "position momentum_before momentum_after")
    return {
        "event": c.word,
        "surface": c.surface or None,
        **_named(c, "time impulse rate_before rate_after grazes course"),
        **{name: array.tolist() for name, array in arrays.items()},
        **{name: list(names) for name, names in _named(c, "lands leaves off").items()},
        "friction": {name: friction_word(s) for name, s in c.friction.items()},
        "impulses": dict(c.impulses),
        "tractions": dict(c.tractions),
    }
