"""What hits add to the integrals of a model, and quantities that it has at hits alone: of impulses,
approaches, departures and losses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import shown, whole
from dmoc.base.errors import ModelError
from dmoc.base.signatures import public
from dmoc.symbolic.continuous import Continuous, dot, gap_rates, mass_matrix
from dmoc.symbolic.conversion import to_nodes
from dmoc.symbolic.definitions import atoms_below, expanded
from dmoc.symbolic.expressions import reference
from dmoc.symbolic.kernel_family import family, state_inputs
from dmoc.symbolic.kinks import check_smooth
from dmoc.symbolic.spec import Input, KernelSpec

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem

IMPULSE, APPROACH, DEPARTURE, LOSS = KINDS = "impulse", "approach", "departure", "loss"
EVERY = 0  # the number of a hit where all of them count
MOST_HITS = 10_000


@public(ModelError)
def impulse(surface: str, hit: int | None = None) -> Any:
    """The normal impulse lam >= 0 of a hit or landing, in newton seconds, in an integral: its terms
    with such names are added at each hit of the surface.

    Parameters
    ----------
    surface : str
        One of the ``surfaces`` of the model.
    hit : int, optional
        The number of the hit of this surface that counts alone, from 1 on.  Where a sequence of a
        search has fewer, it adds nothing.

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If the surface is no name, or the number no number.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.impulse("stop") ** 2
    impulse(stop)**2
    >>> dmoc.impulse("stop", 1)
    impulse(stop, 1)
    """
    return _reference(IMPULSE, surface, hit)


@public(ModelError)
def approach(surface: str, hit: int | None = None) -> Any:
    """The rate of the gap before a hit, with which the bodies approach, in an integral; see
    :func:`dmoc.impulse`.

    Parameters
    ----------
    surface : str
    hit : int, optional

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If the surface is no name, or the number no number.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.approach("bell")
    approach(bell)
    """
    return _reference(APPROACH, surface, hit)


@public(ModelError)
def departure(surface: str, hit: int | None = None) -> Any:
    """The rate with which the bodies separate after a hit, in an integral; see
    :func:`dmoc.impulse`.

    Parameters
    ----------
    surface : str
    hit : int, optional

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If the surface is no name, or the number no number.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.departure("racket", 2)
    departure(racket, 2)
    """
    return _reference(DEPARTURE, surface, hit)


@public(ModelError)
def loss(surface: str, hit: int | None = None) -> Any:
    """The kinetic energy that a hit takes, in joule, in an integral; negative where a surface that
    moves gives more.  See :func:`dmoc.impulse`.

    Parameters
    ----------
    surface : str
    hit : int, optional

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If the surface is no name, or the number no number.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.loss("floor")
    loss(floor)
    """
    return _reference(LOSS, surface, hit)


def _reference(kind: str, surface: Any, hit: Any) -> Any:
    of = reference(kind, surface, "a surface", "wall")
    if hit is None:
        return of
    number = whole(hit, f"hit of {of}", 1, MOST_HITS, ModelError)
    return of.func(*of.args, sp.Integer(number))


@dataclass(frozen=True)
class EventTerm:
    """What the hits of a surface add to an integral, or a quantity is at them: at all of them or at
    the one of a number."""

    name: str
    surface: str
    hit: int
    value: Any


def references_in(expression: Any) -> list[Any]:
    """What of hits an expression contains, in order."""
    parts = (a for a in expression.atoms(AppliedUndef) if a.args != (dynamicsymbols._t,))
    return sorted((a for a in parts if a.func.__name__ in KINDS), key=str)


def integrands_of(system: MechanicalSystem) -> dict[str, Any]:
    """What of the integrals is integrated: their terms without hits."""
    return {
        name: sp.Add(*(term for term in sp.Add.make_args(value) if not references_in(term)))
        for name, value in system.integrals.items()
    }


def event_terms(system: MechanicalSystem) -> list[EventTerm]:
    """What hits add to the integrals; raise ModelError for terms of several hits."""
    return [
        EventTerm(name, *at, term)
        for name, value in system.integrals.items()
        for term in sp.Add.make_args(value)
        for at in _hits_in(term, f"integral {name!r}", "in each term of a sum")
    ]


def hit_quantities(system: MechanicalSystem) -> list[EventTerm]:
    """The quantities that there are at hits alone; raise ModelError for those of several hits."""
    return [
        EventTerm(name, *at, value)
        for name, value in system.quantities.items()
        for at in _hits_in(value, f"quantity {name!r}", "in a quantity")
    ]


def quantities_along(system: MechanicalSystem) -> dict[str, Any]:
    """The quantities that a motion has at any time."""
    return {n: value for n, value in system.quantities.items() if not references_in(value)}


def _hits_in(value: Any, what: str, where: str) -> list[tuple[str, int]]:
    """The surface and the hits that an expression is about, if any."""
    of = {(str(a.args[0]), int(a.args[1]) if a.args[1:] else EVERY): a
          for a in references_in(value)}  # fmt: skip
    if len(of) > 1:
        raise ModelError(
            f"{what} contains {shown(value)}, with hits of "
            f"{' and '.join(str(a) for a in of.values())}: expected those of one surface "
            f"{where}, all or one number."
        )
    return list(of)


def check_event_terms(system: MechanicalSystem) -> None:
    """Refuse terms of hits of what is no surface, of several hits, and of what has no value at a
    hit."""
    named = [("integral", term) for term in event_terms(system)]
    for kind, term in (*named, *(("quantity", term) for term in hit_quantities(system))):
        what = f"{kind} {term.name!r}"
        if term.surface not in system.gaps:
            raise ModelError(
                f"{what} contains hits of {term.surface!r}, which is no surface: expected one of "
                f"{', '.join(system.gaps) or 'none, the model has no surfaces'}."
            )
        check_smooth(term.value, what, kinks=True)
        places = {*system.coordinates, *system.parameters}
        rest = atoms_below(term.value, system.definitions) - {*references_in(term.value)}
        for atom in sorted(rest - places - {*system.definitions}, key=str):
            if str(atom) != "t" and not isinstance(atom, sp.Integer):
                raise ModelError(
                    f"{what} has {shown(atom)} in a term of hits: expected dmoc.impulse, approach, "
                    "departure and loss, coordinates, the time and parameters."
                )


def event_rows(system: MechanicalSystem) -> list[list[int]]:
    """The integral, the surface and the hit of each term, by numbers."""
    integrals, surfaces = list(system.integrals), _numbers(system)
    return [[integrals.index(t.name), surfaces[t.surface], t.hit]
            for t in event_terms(system)]  # fmt: skip


def hit_quantity_rows(system: MechanicalSystem) -> dict[str, list[int]]:
    """The surface and the hit of each quantity of hits, by numbers."""
    surfaces = _numbers(system)
    return {t.name: [surfaces[t.surface], t.hit] for t in hit_quantities(system)}


def _numbers(system: MechanicalSystem) -> dict[str, int]:
    """The place of each surface in the model."""
    return {name: j for j, name in enumerate(system.gaps)}


def event_kernels(system: MechanicalSystem, plain: Continuous, f: Continuous) -> list[KernelSpec]:
    """The kernels of what hits add to integrals, and of the quantities at them."""
    return [
        kernel
        for name, a, text, terms in (
            ("hit_sum", "I_c", "What a hit adds to integrals", event_terms(system)),
            ("hit_value", "z_c", "Quantities at a hit", hit_quantities(system)),
        )
        if terms
        for kernel in _of_hits(system, plain, f, (name, a, text), terms)
    ]


def _of_hits(
    system: MechanicalSystem, plain: Continuous, f: Continuous, names: tuple[str, str, str],
    terms: Sequence[EventTerm],
) -> list[KernelSpec]:  # fmt: skip
    """A family of kernels of values at hits; its name, that of its output, and what it is."""
    graph, surfaces = f.L.graph, _numbers(system)
    name, a, text = names
    q, _, _, t, par = state_inputs(f)
    v_a, v_c = (Input.vector(graph, own, len(f.q)) for own in ("v_a", "v_c"))
    lam = Input.vector(graph, "lam", len(f.g))
    before, after = (dict(zip(f.v, side.symbols, strict=True)) for side in (v_a, v_c))
    rates, M = gap_rates(f), mass_matrix(f)
    energy = dot(f.v, [dot(row, f.v) for row in M])
    lost = (energy.subs(before) - energy.subs(after)) / 2
    values = []
    for term in terms:
        j = surfaces[term.surface]
        of_kind = {
            IMPULSE: lam.symbols[j], APPROACH: rates[j].subs(before),
            DEPARTURE: -rates[j].subs(after), LOSS: lost,
        }  # fmt: skip
        own = {part: sp.Dummy(real=True) for part in references_in(term.value)}
        written = expanded(term.value, system.definitions).xreplace(own)
        (value,) = plain.rewritten(system, [written])
        nodes = {s: graph.symbol(s.name) for s in (*plain.q, plain.t, *plain.par)}
        nodes |= {dummy: of_kind[part.func.__name__] for part, dummy in own.items()}
        values += to_nodes(graph, [value], nodes)
    text = f"{text}, from velocities before and after it and its impulses."
    return family(name, text, (q, v_a, v_c, lam, t), {a: values}, par)
