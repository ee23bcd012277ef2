"""Conditions: what a mode demands of a motion, and what keeps it so.

A condition is of one function of the motion: of a gap that is closed, a tangential position that
sticks, a joint of the model, which holds in every mode and may be of a rate alone.  It has a rate
c, whose slope C by the velocity is that of its value, and a force lam, which pushes along B
(equation :eq:`reaction` of the theory)::

    C a + bend = 0,      M a = F + lam B

B is C or, of a gap, which its force opens, -C; and what slides on a closed contact drags on it::

    B = -grad g - s mu grad tau       in the direction s in which tau slides, since T = -s mu lam

A rail that slides drags by itself.  What a force keeps to is its cone: a contact does not pull, and
what sticks is held by no more than its friction, |T| <= mu_s N; a joint has none.

A mode is the tuple of its conditions, in an order.  Forces of a mode are rows of their multipliers
lam, or :class:`Forces` of all surfaces, tangents and joints of a model.

Conditions that say the same twice have slopes that depend on each other: by the masses and to the
length 1, up to :data:`~dmoc.base.tolerances.DEPENDENT`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import multipliers, solved_transpose
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.contacts import RAIL, Contacts
from dmoc.mechanics.model import Model


class Functions(NamedTuple):
    """Functions of the motion that conditions are of.

    Attributes
    ----------
    kind : str
        Of the forces of a phase: "normal", "tangential", "reaction".
    values, slopes, rates, bends : callables
        Values at (q, t), derivatives by (q, t), rates at (q, v, t), and their derivatives along a
        motion without acceleration.
    placed : callable
        Which of the functions of a model have a place; the others are rates alone, whose value is
        zero everywhere, and their slopes by q those of the rates by v.
    push : float
        A force lam pushes with push * lam * slope.
    """

    kind: str
    values: Callable[..., Array]
    slopes: Callable[..., Array]
    rates: Callable[..., Array]
    bends: Callable[..., Array]
    placed: Callable[[Model], NDArray[np.bool_]]
    push: float


GAPS = Functions(
    "normal", Model.gaps, Model.gap_slopes, Model.gap_rates, Model.gap_accelerations,
    lambda model: ~np.isin(np.arange(model.nc), model.contacts.floating), push=-1.0,
)  # fmt: skip
TANGENTS = Functions(
    "tangential", Model.tangents, Model.tangent_slopes, Model.slide_rates,
    Model.slide_accelerations, lambda model: model.contacts.in_place, push=1.0,
)  # fmt: skip
JOINTS = Functions(
    "reaction", Model.joints, Model.joint_slopes, Model.joint_rates, Model.joint_accelerations,
    lambda model: model.joints_in_place, push=1.0,
)  # fmt: skip


class Condition(NamedTuple):
    """A function that a mode keeps, by its number in the model."""

    functions: Functions
    number: int


class Drag(NamedTuple):
    """A tangent that slides in a direction ``way``, and the condition of its mode that presses it;
    RAIL where its friction is a force of its own."""

    tangent: int
    way: float
    pressed_by: int


class Forces(NamedTuple):
    """Rows of forces or impulses of all surfaces (n, nc), tangents (n, nt) and joints (n, nj)."""

    normal: Array
    tangential: Array
    joint: Array


@record(frozen=True, eq=False)
class Conditions:
    """The conditions of a mode in their order, m of them, and what drags."""

    of: tuple[Condition, ...]
    drags: tuple[Drag, ...]

    def __len__(self) -> int:
        return len(self.of)

    @cached_property
    def _groups(self) -> tuple[tuple[Functions, list[int]], ...]:
        """Functions, and the numbers of those of them that stand side by side."""
        groups = list[tuple[Functions, list[int]]]()
        for functions, number in self.of:
            if not groups or groups[-1][0] is not functions:
                groups.append((functions, []))
            groups[-1][1].append(number)
        return tuple(groups)

    @cached_property
    def _signs(self) -> Array:
        """Along or against its slope, how each pushes, shape (m, 1)."""
        return np.array([condition.functions.push for condition in self.of])[:, None]

    @cached_property
    def _places(self) -> dict[str, tuple[list[int], list[int]]]:
        places = {functions.kind: (list[int](), list[int]()) for functions in ALL}
        for i, condition in enumerate(self.of):
            here, numbers = places[condition.functions.kind]
            here.append(i)
            numbers.append(condition.number)
        return places

    def places(self, functions: Functions) -> tuple[list[int], list[int]]:
        """Conditions of some functions by their places here, and the numbers of these."""
        return self._places[functions.kind]

    # At positions and states ----------------------------------------------------------------------

    def slopes(self, model: Model, q: Array, t: Any) -> Array:
        """Derivatives by (q, t), shape (..., m, nq + 1)."""
        rows = [f.slopes(model, q, t)[..., at, :] for f, at in self._groups]
        if len(rows) == 1:
            return rows[0]
        empty = np.zeros((*q.shape[:-1], 0, model.nq + 1))
        return np.concatenate(rows, axis=-2) if rows else empty

    def values(self, model: Model, q: Array, t: Any) -> Array:
        """Values of the functions, zero where they have no place, shape (..., m)."""
        values = _beside([f.values(model, q, t)[..., at] for f, at in self._groups], q)
        return values * self.placed(model) if model.contacts.floating else values

    def rates(self, model: Model, q: Array, v: Array, t: Any) -> Array:
        """Rates along a motion, shape (..., m)."""
        return _beside([f.rates(model, q, v, t)[..., at] for f, at in self._groups], q)

    def bends(self, model: Model, q: Array, v: Array, t: Any) -> Array:
        """Rates of the rates without acceleration, shape (..., m)."""
        return _beside([f.bends(model, q, v, t)[..., at] for f, at in self._groups], q)

    def placed(self, model: Model) -> NDArray[np.bool_]:
        """Conditions that keep a place, and not a rate alone, shape (m,)."""
        rows = [f.placed(model)[at] for f, at in self._groups]
        return np.concatenate([*rows, np.zeros(0, dtype=bool)])

    def pushes(self, model: Model, q: Array, t: Any, slopes: Array | None = None) -> Array:
        """Directions B in which units of the forces push, with the friction that the model has at
        these positions, shape (..., m, nq). ``slopes`` are those there, shape (..., m, nq + 1), if
        they are known."""
        C = (self.slopes(model, q, t) if slopes is None else slopes)[..., : model.nq]
        B = self._signs * C
        if any(drag.pressed_by != RAIL for drag in self.drags):
            along = model.tangent_slopes(q, t)[..., :-1]
            for k, way, j in self.drags:
                if j != RAIL:
                    B[..., j, :] -= way * model.friction[..., k, None] * along[..., k, :]
        return B

    def dragged(self, model: Model, q: Array, t: Any) -> Array:
        """Forces of the rails that slide, shape (..., nq)."""
        F = np.zeros(q.shape)
        for k, way, j in self.drags:
            if j == RAIL:
                along = model.tangent_slopes(q, t)[..., k, :-1]
                F -= way * model.friction[..., k, None] * along
        return F

    # Forces ---------------------------------------------------------------------------------------

    def answers(self, model: Model, q: Array, t: Any, wanted: Array) -> tuple[Array, Array]:
        """The change M^-1 B^T lam of accelerations or velocities (n, nq) that changes the rates by
        what is wanted (n, m), and its multipliers: the shortest where several would do."""
        C = self.slopes(model, q, t)[..., :-1]
        return answers(model.mass(q, t), C, self.pushes(model, q, t, C), wanted)

    def spread(self, model: Model, lam: Array) -> Forces:
        """Multipliers (n, m) as forces of all surfaces, tangents and joints."""
        forces = Forces(*(np.zeros((len(lam), size)) for size in (model.nc, model.nt, model.nj)))
        for into, functions in zip(forces, ALL, strict=True):
            here, numbers = self.places(functions)
            into[:, numbers] = lam[:, here]
        slide = [drag.tangent for drag in self.drags]
        ways = np.array([drag.way for drag in self.drags])
        if slide:
            forces.tangential[:, slide] = -ways * model.dragging(forces.normal)[:, slide]
        return forces

    def changes(self, model: Model, lam: Array) -> Forces:
        """Changes of multipliers (n, m) as changes of forces: rails drag as before."""
        forces, still = self.spread(model, lam), self.spread(model, 0 * lam)
        return Forces(*(a - b for a, b in zip(forces, still, strict=True)))

    def gathered(self, forces: Forces) -> Array:
        """The multipliers of forces, shape (n, m)."""
        lam = np.zeros((len(forces.normal), len(self)))
        for of, functions in zip(forces, ALL, strict=True):
            here, numbers = self.places(functions)
            lam[:, here] = of[:, numbers]
        return lam

    def margins(self, model: Model, forces: Forces) -> Array:
        """Distances of forces from the edges of their cones, negative outside of them, shape (n,
        closed + 2 sticking): pushing forces, and the friction that is left in both directions."""
        closed, stuck = self.places(GAPS)[1], self.places(TANGENTS)[1]
        closed = [j for j in closed if not model.contacts.pull[j]]
        holds, rubs = model.bearing(forces.normal)[:, stuck], forces.tangential[:, stuck]
        return np.concatenate([forces.normal[:, closed], holds - rubs, holds + rubs], axis=1)

    def forward(self, rates: Array) -> dict[int, Array]:
        """Sliding velocities (..., nt) of the tangents that slide, each in its direction."""
        return {drag.tangent: drag.way * rates[..., drag.tangent] for drag in self.drags}


ALL = GAPS, TANGENTS, JOINTS  # in the order of Forces


def conditions_of(model: Model, mode: Mode, *, joints: bool = True) -> Conditions:
    """The conditions of a mode: closed contacts, what sticks, joints, and grips that are closed in
    the model whatever the mode is, unless these are left out."""
    kept = (model.nj, model.gripped) if joints else (0, ())
    return conditions_among(model.contacts, mode, *kept)


def number_of(model: Model, mode: Mode) -> int:
    """How many conditions a mode has, joints and grips that are closed beside it among them."""
    return len({*mode.closed, *model.gripped}) + len(mode.sticking) + model.nj


@lru_cache(maxsize=256)
def conditions_among(
    contacts: Contacts, mode: Mode, joints: int, gripped: tuple[int, ...] = ()
) -> Conditions:
    """The conditions of a mode in a model with such contacts, a number of joints, and places of
    grips that are closed beside those of the mode."""
    nc, nt = len(contacts.surfaces), len(contacts.tangents)
    if not {*mode.closed} <= {*range(nc)} or not {*mode.rubbing} <= {*range(nt)}:
        raise ValueError(f"expected some of {nc} surfaces and of {nt} tangents, got {mode}")
    conditions = (
        *(Condition(GAPS, j) for j in mode.closed),
        *(Condition(GAPS, j) for j in gripped if j not in mode.closed),
        *(Condition(TANGENTS, k) for k in mode.sticking),
        *(Condition(JOINTS, i) for i in range(joints)),
    )
    return in_order(contacts, conditions, mode)


def in_order(contacts: Contacts, conditions: tuple[Condition, ...], mode: Mode) -> Conditions:
    """Some of the conditions of a mode in an order, with what drags in it."""
    places = {condition: i for i, condition in enumerate(conditions)}
    drags = list[Drag]()
    for k, s in mode.sliding:
        j = contacts.supports[k]
        if j != RAIL and Condition(GAPS, j) not in places:
            raise ValueError("expected closed surfaces under what slides")
        drags.append(Drag(k, float(s), RAIL if j == RAIL else places[Condition(GAPS, j)]))
    return Conditions(conditions, tuple(drags))


def answers(M: Array, C: Array, B: Array, wanted: Array) -> tuple[Array, Array]:
    """The change M^-1 B^T lam (n, nq) that changes C a by what is wanted (n, m), with its
    multipliers lam (n, m): the shortest, in sizes by the masses, where several would do. M is (n,
    nq, nq), B and C are (n, m, nq)."""
    response = solved_transpose(M, B)
    A = C @ response
    if A.shape[1] == 1:
        lam = np.asarray(wanted / A[:, 0])
    else:
        lam = multipliers(A, sizes_by_mass(M, C), wanted)
    return (response @ lam[..., None])[..., 0], lam


def sizes_by_mass(M: Array, C: Array) -> Array:
    """Lengths of slopes (n, m, nq) measured by the masses (n, nq, nq), and 1 of those without a
    length, shape (n, m)."""
    squares = np.einsum("nmi,nim->nm", C, solved_transpose(M, C))
    return np.where(squares > 0, np.sqrt(np.abs(squares)), 1.0)


def _beside(columns: Sequence[Array], q: Array) -> Array:
    """Columns of conditions side by side."""
    if len(columns) == 1:
        return columns[0]
    return np.concatenate(columns, axis=-1) if columns else np.zeros((*q.shape[:-1], 0))
