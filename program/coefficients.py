"""Coefficients of friction times impulses: linear entries of rows where they are constant, terms
where they vary along a motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import NOWHERE, Entries, Index
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term


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


# The arguments (q, v, u_k, u_kp1, c) of places, and their times.
Site = Callable[[Index, Places], tuple[Index, ...]]


def entries_of(mu: Array, products: Iterable[Product]) -> Iterator[Entries]:
    """Entries of the products whose coefficients are numbers."""
    for p in products:
        if not np.isnan(mu[p.tangent]):
            p = p.there
            yield p.rows, p.unknowns, mu[p.tangent] * p.factors


def terms_of(
    mu: Array, products: Iterable[Product], site: Site, places: Places, kernel: str = "bearing"
) -> Iterator[Term]:
    """Terms of the others, by the kernel of what slides or of what sticks."""
    for p in products:
        if np.isnan(mu[p.tangent]) and len((p := p.there).rows):
            pressed = np.full((len(p.rows), len(mu)), places.zero)
            rows = np.full_like(pressed, NOWHERE)
            pressed[:, p.tangent], rows[:, p.tangent] = p.unknowns, p.rows
            *state, t = site(p.at, places)
            yield Term(kernel, (*state, pressed, t), (rows,), p.factors[:, None])


def at_events(lay: Layout) -> Site:
    """The arguments at events, by their numbers: an impact has neither velocity nor inputs."""

    def site(events: Index, places: Places) -> tuple[Index, ...]:
        nodes, none = lay.collision_nodes[events], places.zero
        v, u = (np.full((len(nodes), n), none) for n in (lay.nq, lay.index_u.shape[1]))
        return lay.index_q[nodes], v, u, u, np.full((1, 1), none), places.times(nodes)

    return site


def at_stations(lay: Layout) -> Site:
    """The arguments at the stations of phases, by their rows: where steps share a node, the input
    there is the mean of those of both."""
    at = lay.stations

    def site(rows: Index, places: Places) -> tuple[Index, ...]:
        place = at.place[rows]
        first, last, share = _inputs(lay, rows)
        v, c = np.full((len(rows), lay.nq), places.zero), places.number(share)
        q = lay.index_places[place]
        return q, v, lay.index_u[first], lay.index_u[last], c[:, None], places.times_of(place)

    return site


def at_nodes(lay: Layout) -> Site:
    """The arguments at the nodes of a motion without phases of its own."""

    def site(nodes: Index, places: Places) -> tuple[Index, ...]:
        before, after = np.maximum(nodes - 1, 0), np.minimum(nodes, lay.total - 1)
        u = lay.index_u[lay.row_u_kp1[before]], lay.index_u[lay.row_u_k[after]]
        v = np.full((len(nodes), lay.nq), places.zero)
        c = places.number(np.full((1, 1), 0.5))
        return lay.index_q[nodes], v, *u, c, places.times(nodes)

    return site


def _inputs(lay: Layout, rows: Index) -> tuple[Index, Index, Array]:
    """Rows of u on both sides of stations, and the place between them."""
    at = lay.stations
    step = at.step[rows]
    if at.own:
        return lay.row_u_k[step], lay.row_u_kp1[step], at.within[rows]
    inner = ~(at.is_first | at.is_last)[rows]
    before = np.where(inner, lay.row_u_kp1[step - 1], lay.row_u_kp1[step])
    first = np.where(at.is_first[rows], lay.row_u_k[step], before)
    last = np.where(at.is_last[rows], lay.row_u_kp1[step], lay.row_u_k[step])
    return first, last, np.full(len(rows), 0.5)
