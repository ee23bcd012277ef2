"""Functions with kinks in the cost, in integrals and in path constraints, split into smooth ones.

A cost that contains abs(a) or Max(a, b) with a positive factor gets a hidden unknown s in its
place, with s >= a and s >= -a, or s >= b; one with Min(a, b) and a negative factor gets s <= a and
s <= b.  The minimum puts s onto the function.  An integral is split in the same way, or in the
opposite one: then it is one that is to be large.  A path constraint that contains kinks with the
other sign holds if it holds for each of their branches.  Where the sign is that of a parameter,
made as Symbol(..., positive=True), the split is right for values of that sign alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from operator import mul
from typing import TYPE_CHECKING, Any, NamedTuple

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.errors import ModelError
from dmoc.symbolic.powers import rooted

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem

JUMPS = (sp.sign, sp.Heaviside, sp.floor, sp.ceiling, sp.frac, sp.Mod)
SPLIT = (sp.Abs, sp.Max, sp.Min)
SIGNS = ("positive", "negative", "nonnegative", "nonpositive")  # that symbols are made with
KINKS = (*SPLIT, *JUMPS, sp.Piecewise)
SMOOTH = "use a smooth function, such as sqrt(x**2 + e**2) for abs(x) or tanh(x/e) for sign(x)"


MADE = "_split"  # the attribute in which a system keeps its split
COST = ""  # what hidden unknowns of the cost belong to, in the place of an integral
# What abs and Max must do where they can be split.
COST_SIDES = "raise a cost, Min must lower it"
INTEGRAL_SIDES = "all raise an integral and Min lower it, or the other way round"
PATH_SIDES = "be limited from above, Min from below"


class Hidden(NamedTuple):
    """A hidden unknown: its symbol, the function that it is at a minimum, the integral that it
    belongs to or COST, and functions >= 0 that limit it."""

    symbol: Any
    kink: Any
    of: str
    limits: tuple[Any, ...]

    def mapped(self, table: Mapping[Any, Any]) -> Hidden:
        """The same hidden unknown in other symbols."""
        limits = tuple(limit.xreplace(table) for limit in self.limits)
        return self._replace(kink=self.kink.xreplace(table), limits=limits)


class _Place(NamedTuple):
    """Where an expression stands, in words, and what abs and Max must do in such a place."""

    name: str
    sides: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Split:
    """The smooth cost, integrals and path constraints of a system.

    Attributes
    ----------
    cost : Expr
        The terms of the cost without kinks.
    lifted : Expr
        The other ones, with hidden unknowns.
    integrals : mapping of str to Expr
    senses : mapping from names of integrals with kinks to int
        1 where hidden unknowns may be too large, -1 where they may make the integral too small.
    rows : tuple of (str, Expr)
        Functions >= 0 with the name of their path constraint.
    unknowns : tuple of Hidden
    signs : mapping from Symbol to int
        Parameters whose values must not be negative (1), or not positive (-1), for the split to be
        right.
    """

    cost: Any
    lifted: Any
    integrals: Mapping[str, Any]
    senses: Mapping[str, int]
    rows: tuple[tuple[str, Any], ...]
    unknowns: tuple[Hidden, ...]
    signs: Mapping[Any, int]


def split(system: MechanicalSystem) -> Split:
    """Split the cost, integrals and path constraints of a system, which is done once; raise
    ModelError for what cannot be split."""
    if MADE not in vars(system):
        vars(system)[MADE] = _split(system)
    made: Split = vars(system)[MADE]
    return made


def _split(system: MechanicalSystem) -> Split:
    real, back = real_symbols(system)
    signs: dict[Any, int] = {}
    of_cost = _Lifted(COST, _Place("the cost", COST_SIDES), signs, 0)
    terms = [(e, e.xreplace(real)) for e in sp.Add.make_args(system.cost)]
    cost = sp.Add(*(e for e, own in terms if not _has_kinks(own)))
    lifted = sp.Add(*(of_cost.over(own, 1) for _, own in terms if _has_kinks(own)))
    unknowns, senses, integrals = of_cost.unknowns, {}, dict(system.integrands)
    for name, value in system.integrands.items():
        if _has_kinks(value.xreplace(real)):
            smooth, senses[name], own = _either(name, value.xreplace(real), signs, len(unknowns))
            integrals[name] = smooth.xreplace(back)
            signs |= own.signs
            unknowns = [*unknowns, *own.unknowns]
    rows: list[tuple[str, Any]] = []
    moving = set(real.values()) - {real[s] for s in system.parameters}
    for name, r in system.path_functions.items():
        own = r.xreplace(real)
        powers = {power: sp.Dummy("power", real=True) for power in _smooth_powers(own)}
        place = _Place(f"path constraint {name!r}", PATH_SIDES)
        as_they_were = {dummy: power for power, dummy in powers.items()}
        for part in _branches(own.xreplace(powers), place, signs):
            row = rooted(part.xreplace(as_they_were), moving)
            rows.append((name, r if row == own else row.xreplace(back)))
    return Split(
        cost, lifted.xreplace(back), integrals, senses, tuple(rows),
        tuple(hidden.mapped(back) for hidden in unknowns), {back[s]: n for s, n in signs.items()},
    )  # fmt: skip


def _either(
    name: str, value: Any, signs: Mapping[Any, int], first: int
) -> tuple[Any, int, _Lifted]:
    """An integrand with hidden unknowns, with which sign it can be split, and these."""

    def with_sign(sense: int) -> tuple[Any, int, _Lifted]:
        place = _Place(f"integral {name!r}", INTEGRAL_SIDES)
        lifted = _Lifted(name, place, dict(signs), first)
        return lifted.over(value, sense), sense, lifted

    try:
        return with_sign(1)
    except ModelError:
        return with_sign(-1)


def check_smooth(expression: Any, where: str, kinks: bool = False) -> None:
    """Refuse functions that jump, and those with kinks too."""
    refused = KINKS if kinks else JUMPS
    for function in sorted(expression.atoms(*refused), key=str):
        what = "kink" if isinstance(function, (*SPLIT, sp.Piecewise)) else "jump"
        raise ModelError(
            f"{where} contains {sp.sstr(function)}, whose {what} no method of smooth functions "
            f"can follow: {SMOOTH}."
        )


class _Lifted:
    """Hidden unknowns for the kinks of a function that is minimised, numbered from one on."""

    def __init__(self, of: str, where: _Place, signs: dict[Any, int], first: int) -> None:
        self.of, self.where, self.signs, self.first = of, where, signs, first
        self.unknowns: list[Hidden] = []

    def over(self, e: Any, sign: int) -> Any:
        """The function with hidden unknowns for its kinks; ``sign`` is that with which it
        counts."""
        if not _has_kinks(e):
            return e
        if isinstance(e, sp.Add):
            return e.func(*(self.over(part, sign) for part in e.args))
        if isinstance(e, sp.Mul):
            smooth, kink = _factors(e, self.where)
            own = _sign_of(smooth, kink, self.where, self.signs)
            return smooth * self.over(kink, sign * own)
        power = isinstance(e, sp.Pow) and e.exp.is_number and not e.exp < 1
        if power and sign > 0 and _is_nonnegative(e.base, self.signs):
            return self.over(e.base, 1) ** e.exp
        if isinstance(e, sp.exp):
            return sp.exp(self.over(e.args[0], sign))
        if isinstance(e, (sp.Abs, sp.Max) if sign > 0 else sp.Min):
            return self._unknown(e, sign)
        raise _refused(e, self.where)

    def _unknown(self, kink: Any, sign: int) -> Any:
        same = [hidden.symbol for hidden in self.unknowns if hidden.kink == kink]
        if same:
            return same[0]
        s = sp.Dummy(f"s_{self.first + len(self.unknowns)}", real=True)
        limits = [
            limit
            for value in _values(kink)
            for limit in _branches(sign * (s - value), self.where, self.signs)
        ]
        self.unknowns.append(Hidden(s, kink, self.of, tuple(limits)))
        return s


def _smooth_powers(e: Any) -> set[Any]:
    """Powers of absolute values that have two derivatives everywhere: abs(a)**c, c > 2, of which
    SymPy makes a**2*abs(a) for c = 3."""

    def is_smooth(part: Any) -> bool:
        powers = dict(part.as_powers_dict())
        kinks = {f: c + powers.get(f.args[0], 0) for f, c in powers.items() if f.func is sp.Abs}
        high = all((c - 2).is_positive for c in kinks.values())
        return bool(kinks) and high and not any(_has_kinks(f) for f in powers if f not in kinks)

    return {part for part in e.atoms(sp.Pow, sp.Mul) if part.has(sp.Abs) and is_smooth(part)}


def _branches(r: Any, where: _Place, signs: dict[Any, int]) -> list[Any]:
    """Smooth functions that are all >= 0 where r is."""
    if not _has_kinks(r):
        return [r]
    kink = next(_outer(r, 1, where, signs))
    parts = (r.xreplace({kink: value}) for value in _values(kink))
    return [smooth for part in parts for smooth in _branches(part, where, signs)]


def _outer(e: Any, sign: int, where: _Place, signs: dict[Any, int]) -> Iterator[Any]:
    """Kinks of a function that must be >= 0, in which it is monotone: Abs and Max that lower it,
    Min that raises it."""
    if not _has_kinks(e):
        return
    if isinstance(e, sp.Add):
        for part in e.args:
            yield from _outer(part, sign, where, signs)
    elif isinstance(e, sp.Mul):
        smooth, kink = _factors(e, where)
        yield from _outer(kink, sign * _sign_of(smooth, kink, where, signs), where, signs)
    elif isinstance(e, (sp.Abs, sp.Max) if sign < 0 else sp.Min):
        yield e
    else:
        raise _refused(e, where)


def _values(kink: Any) -> tuple[Any, ...]:
    """The functions that a kink is the largest, or the smallest, of."""
    return (kink.args[0], -kink.args[0]) if isinstance(kink, sp.Abs) else tuple(kink.args)


def _factors(product: Any, where: _Place) -> tuple[Any, Any]:
    """The smooth factor of a product, and the one with kinks; several absolute values are one."""
    kinks = [part for part in product.args if _has_kinks(part)]
    smooth = reduce(mul, (part for part in product.args if part not in kinks), sp.S.One)
    if len(kinks) > 1 and all(isinstance(part, sp.Abs) for part in kinks):
        kinks = [sp.Abs(reduce(mul, (part.args[0] for part in kinks)), evaluate=False)]
    if len(kinks) > 1:
        raise _refused(product, where)
    return smooth, kinks[0]


def _sign_of(factor: Any, kink: Any, where: _Place, signs: dict[Any, int]) -> int:
    """The sign of a factor; ``signs`` gets the parameters that it stands and falls with."""
    if kink.has(*JUMPS, sp.Piecewise):
        raise _refused(kink, where)
    for sign in (1, -1):
        if (sign * factor).is_nonnegative:
            signs |= _needed(sign * factor)
            return sign
    raise ModelError(
        f"{where} multiplies {plain(kink)} by {plain(factor)}, whose sign is not known: make its "
        "parameters as Symbol(..., positive=True), or " + SMOOTH + "."
    )


def _is_nonnegative(kink: Any, signs: dict[Any, int]) -> bool:
    if isinstance(kink, sp.Abs):
        return True
    parts = kink.args if isinstance(kink, sp.Max) else ()
    needed = [_needed(part) for part in parts if part.is_nonnegative]
    fewest = sorted(needed, key=len)[:1]
    signs.update(*fewest)
    return bool(needed)


def _needed(nonnegative: Any) -> dict[Any, int]:
    """Signs of parameters without which an expression might be negative."""
    return {
        s: 1 if s.is_nonnegative else -1
        for s in nonnegative.free_symbols
        if not nonnegative.xreplace({s: sp.Dummy(s.name, real=True)}).is_nonnegative
    }


def _refused(e: Any, where: _Place) -> ModelError:
    hard = e.atoms(*JUMPS, sp.Piecewise) or e.atoms(*KINKS)
    kink = min(hard, key=lambda part: (len(str(part)), str(part)))
    if isinstance(kink, (*JUMPS, sp.Piecewise)):
        why = "which cannot be split into smooth functions"
    else:
        why = f"where it cannot be split: abs and Max must {where.sides}"
    return ModelError(f"{where} contains {plain(kink)}, {why}; {SMOOTH}.")


def _has_kinks(e: Any) -> bool:
    return bool(e.has(*KINKS))


def plain(e: Any) -> str:
    return str(e.xreplace({s: sp.Symbol(s.name) for s in e.atoms(sp.Dummy)}))


def real_symbols(system: MechanicalSystem) -> tuple[dict[Any, Any], dict[Any, Any]]:
    """All symbols as real ones, of which SymPy knows that abs(a)**2 = a**2, and back."""
    places = (*system.coordinates, *system.definitions)
    symbols = (*places, *system.inputs, dynamicsymbols._t)
    table = {s: sp.Dummy(str(s.func if s.args else s), real=True) for s in symbols}
    rates = (*system.velocities, *(x.diff(dynamicsymbols._t) for x in system.definitions))
    table |= {v: sp.Dummy(f"{q.func}'", real=True) for q, v in zip(places, rates, strict=True)}
    for s in system.parameters:
        sign = next((name for name in SIGNS if getattr(s, f"is_{name}")), None)
        table[s] = sp.Dummy(s.name, real=True, **({sign: True} if sign else {}))
    return table, {dummy: s for s, dummy in table.items()}
