"""The digest of a system, by which its kernels and solutions know it."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import sympy as sp

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def digest(system: MechanicalSystem) -> str:
    """SHA-256 of the expressions of a system, of which attitudes are some already."""
    stated = (*(system.forces.get(q, sp.S.Zero) for q in system.coordinates), system.dissipation)
    parts = [
        system.name,
        *map(sp.srepr, system.coordinates),
        "|",
        *map(sp.srepr, system.inputs),
        "|",
        *(f"{sp.srepr(s)}={v!r}" for s, v in system.parameters.items()),
        sp.srepr(system.lagrangian),
        *map(sp.srepr, stated if system.definitions else system.force_vector),
        sp.srepr(system.cost),
        sp.srepr(system.terminal_cost),
        *(f"{n}:{sp.srepr(g)}" for n, g in system.gaps.items()),
        "|",
        *(f"{n}:{sp.srepr(r)}" for n, r in system.path_functions.items()),
        "|",
        *(
            f"{n}:{sp.srepr(e)}:{sp.srepr(system.friction.get(n))}"
            for n, e in system.tangents.items()
        ),
        *(f"e_{n}:{sp.srepr(e)}" for n, e in system.restitution.items()),
        *(f"e_t_{n}:{sp.srepr(e)}" for n, e in system.tangential_restitution.items()),
        *(f"law_{n}:{law}" for n, law in system.impact_laws.items()),
        *(f"within_{n}:{sp.srepr(w)}" for n, w in system.inside.items()),
        *(f"grip_{n}:{sp.srepr(sp.Tuple(*parts))}" for n, parts in system.grips.items()),
        *(f"strength_{n}:{sp.srepr(e)}" for n, e in system.strength.items()),
        *(f"{n}=0:{sp.srepr(c)}" for n, c in system.constraints.items()),
        *(f"{sp.srepr(x)}:={sp.srepr(e)}" for x, e in system.definitions.items()),
        *(f"z_{n}:{sp.srepr(e)}" for n, e in system.quantities.items()),
        *(f"I_{n}:{sp.srepr(e)}" for n, e in system.integrals.items()),
        *(f"w_{n}:{sp.srepr(e)}" for n, e in system.switches.items()),
        *((f"objective:{sp.srepr(system.objective)}",) if system.objective != 0 else ()),
    ]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()
