"""Coefficients of friction times impulses: linear entries of rows where they are constant, terms
where they vary along a motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import NOWHERE, Entries, Index
from dmoc.program.layout import Layout
from dmoc.program.terms import PARABOLA, Places, Term


class Product(NamedTuple):
    """The coefficient of a tangent at some stations or events times unknowns and factors, which is
    added to rows; all of shape (n,), nothing where row or unknown is NOWHERE."""

    tangent: int
    at: Index
    rows: Index
    unknowns: Index
    factors: Array

    @property
    def there(self) -> Product:
        """Without what is nowhere."""
        kept = (self.rows != NOWHERE) & (self.unknowns != NOWHERE)
        return Product(self.tangent, *(part[kept] for part in self[1:]))


# The phases that events begin.
AFTER = slice(1, None)


def against(lay: Layout, phases: Index | slice, product: Product) -> Product:
    """The product with factors times the directions in which its tangent slides in ``phases``,
    shape (n,), or a slice: friction acts against these."""
    return product._replace(factors=product.factors * lay.touch.signs[phases, product.tangent])


# The arguments (q, v, u_k, u_kp1, c) of places, and their times.
Site = Callable[[Index, Places], tuple[Index, ...]]


def entries_of(mu: Array, products: Iterable[Product]) -> Iterator[Entries]:
    """Entries of the products whose coefficients are numbers; ``mu`` are those at all places of
    products, shape (places, nt)."""
    for p in products:
        if len((p := p.there).rows) and not np.isnan(mu[p.at, p.tangent]).any():
            yield p.rows, p.unknowns, mu[p.at, p.tangent] * p.factors


def terms_of(
    mu: Array, products: Iterable[Product], site: Site, places: Places, kernel: str = "bearing"
) -> Iterator[Term]:
    """Terms of the products whose coefficients in ``mu``, as :func:`entries_of` has them, are no
    numbers, as they vary along the motion; ``kernel`` is that of sliding or of sticking
    tangents."""
    for p in products:
        if len((p := p.there).rows) and np.isnan(mu[p.at, p.tangent]).any():
            pressed = np.full((len(p.rows), mu.shape[1]), places.zero)
            rows = np.full_like(pressed, NOWHERE)
            pressed[:, p.tangent], rows[:, p.tangent] = p.unknowns, p.rows
            *state, t = site(p.at, places)
            yield Term(kernel, (*state, pressed, t), (rows,), p.factors[:, None])


def at_events(lay: Layout) -> Site:
    """The arguments at events, by their numbers: an impact has no inputs."""

    def site(events: Index, places: Places) -> tuple[Index, ...]:
        nodes = lay.collision_nodes[events]
        u = np.full((len(nodes), lay.index_u.shape[1]), places.zero)
        c = np.full((1, 1), places.zero)
        return lay.index_q[nodes], _at_rest(lay, len(u), places), u, u, c, places.times(nodes)

    return site


def _at_rest(lay: Layout, count: int, places: Places) -> Index:
    """Sliding speeds of zero, shape (count, nt)."""
    return np.full((count, len(lay.touch.contacts.tangents)), places.zero)


def at_stations(lay: Layout) -> Site:
    """The arguments at the stations of phases, by their rows: where steps share a node, the input
    there is the mean of those of both."""
    at = lay.stations

    def site(rows: Index, places: Places) -> tuple[Index, ...]:
        place = at.place[rows]
        q, speeds = lay.index_places[place], _at_rest(lay, len(rows), places)
        return q, speeds, *_between(lay, rows, places), places.times_of(place)

    return site


def where_it_slides(lay: Layout) -> Site:
    """The arguments of :func:`at_stations` for tangents that slide with a friction of their rate.
    The velocity is that of the step's polynomial, which keeps the order of the step. At nodes that
    steps share it is that of the parabola through the three nodes of the phase next to them."""

    def site(rows: Index, places: Places) -> tuple[Index, ...]:
        at = lay.stations
        place, phase = at.place[rows], at.phase[rows]
        around, slopes = _in_steps(lay, rows) if at.own else _in_phases(lay, rows)
        return (
            lay.index_places[place], lay.index_places[around].reshape(len(rows), -1),
            places.number(slopes), lay.index_h[phase][:, None],
            places.number(lay.touch.signs[phase]), *_between(lay, rows, places),
            places.times_of(place),
        )  # fmt: skip

    return site


def _in_steps(lay: Layout, rows: Index) -> tuple[Index, Array]:
    """The d + 1 places of the step of each station, and the slopes there of the polynomials that
    are one at one of them, shape (rows, d + 1) each."""
    at, d = lay.stations, lay.scheme.degree
    return d * at.step[rows, None] + np.arange(d + 1), lay.scheme.slopes_of_nodes[at.number[rows]]


def _in_phases(lay: Layout, rows: Index) -> tuple[Index, Array]:
    """Three nodes of the phase of each station, which has two steps at least, and the slopes there
    of the parabolas that are one at one of them, shape (rows, 3) each."""
    at, node = lay.stations, lay.stations.place[rows]
    first, last = lay.ends[at.phase[rows]], lay.ends[at.phase[rows] + 1]
    begin = np.maximum(np.minimum(node - 1, last - 2), first)
    return begin[:, None] + np.arange(3), PARABOLA[node - begin]


def at_nodes(lay: Layout) -> Site:
    """The arguments at the nodes of a motion without phases of its own."""

    def site(nodes: Index, places: Places) -> tuple[Index, ...]:
        before, after = np.maximum(nodes - 1, 0), np.minimum(nodes, lay.total - 1)
        u = lay.index_u[lay.row_u_kp1[before]], lay.index_u[lay.row_u_k[after]]
        c = places.number(np.full((1, 1), 0.5))
        rest = _at_rest(lay, len(nodes), places)
        return lay.index_q[nodes], rest, *u, c, places.times(nodes)

    return site


def _between(lay: Layout, rows: Index, places: Places) -> tuple[Index, Index, Index]:
    """Inputs on both sides of stations, and the place between them."""
    at = lay.stations
    step = at.step[rows]
    if at.own:
        share = places.number(at.within[rows])
        return lay.index_u[lay.row_u_k[step]], lay.index_u[lay.row_u_kp1[step]], share[:, None]
    inner = ~(at.is_first | at.is_last)[rows]
    before = np.where(inner, lay.row_u_kp1[step - 1], lay.row_u_kp1[step])
    first = np.where(at.is_first[rows], lay.row_u_k[step], before)
    last = np.where(at.is_last[rows], lay.row_u_kp1[step], lay.row_u_k[step])
    return lay.index_u[first], lay.index_u[last], places.number(np.full((1, 1), 0.5))
