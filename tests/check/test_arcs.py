"""Where a motion lies on a surface: nodes by hand, a second apart."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.check import arcs
from dmoc.check.arcs import GRAZED, PENETRATION, Arc, allowance, arcs_of


def found(
    monkeypatch: pytest.MonkeyPatch, patterns: list[str], hits: list[tuple[str, float]], end: float
) -> list[tuple[int, float, float]]:
    """Surface, middle and depth of the arcs of one phase, for an x at each node that lies on each
    surface and an o at one beside it."""
    away = {"x": 0.5e-4, "o": 2e-4, ".": 4e-4}
    on = -np.array([[away[c] for c in pattern] for pattern in patterns]).T
    names = {"floor": 0, "roof": 1}
    gaps = on * np.array([2.0, 3.0])
    monkeypatch.setattr(arcs, "gap_sizes", lambda slopes, sizes: np.array([2.0, 3.0]))
    nodes: Any = SimpleNamespace(
        gaps=gaps, model=SimpleNamespace(surface_numbers=names, ends={}),
        of_phase=lambda i: slice(None), gap_slopes=np.zeros((len(on), 2, 1)),
    )  # fmt: skip
    phase = SimpleNamespace(
        steps=len(on) - 1, t=np.arange(float(len(on))), step_size=1.0, closed=()
    )
    events = [SimpleNamespace(surface=name, time=t, grazes=False) for name, t in hits]
    motion: Any = SimpleNamespace(phases=[phase], collisions=events)
    sizes: Any = SimpleNamespace(gap=np.array([2.0, 3.0]), time=end)
    made = arcs_of(motion, nodes, sizes)
    assert all(arc.end - arc.begin == pytest.approx(2.0) for arc in made)
    scale = np.array([2.0, 3.0])
    return [(a.surface, (a.begin + a.end) / 2, a.depth / scale[a.surface]) for a in made]


@pytest.mark.parametrize("surface", [0, 1])
@pytest.mark.parametrize(
    ("pattern", "deep", "shallow"),
    [
        (".........", [], []), ("....x....", [], [4]), ("...xx....", [], [3, 4]),
        ("...xxx...", [3, 4, 5], []), ("xxx......", [0, 1, 2], []), ("xx.......", [], [0, 1]),
        ("x........", [], [0]), ("..xxxxx..", [2, 3, 4, 5, 6], []), ("x.x.x.x..", [], [0, 2, 4, 6]),
        ("xx.xxx.x.", [3, 4, 5], [0, 1, 7]), (".....xxx.", [5, 6, 7], []),
        ("......xx.", [], [6, 7]), ("..ooooo..", [2, 3, 4, 5, 6], []), ("...oooo..", [], []),
        ("xoxox.oo.", [0, 1, 2, 3, 4], []), ("oox..xxx.", [5, 6, 7], [2]),
    ],
)  # fmt: skip
def test_nodes_in_a_row_slide_and_fewer_touch(
    monkeypatch: pytest.MonkeyPatch,
    surface: int,
    pattern: str,
    deep: list[int],
    shallow: list[int],
) -> None:
    patterns = ["........."] * 2
    patterns[surface] = pattern
    made = found(monkeypatch, patterns, [], 100.0)
    expected = [(k, PENETRATION) for k in deep] + [(k, GRAZED) for k in shallow]
    assert [(t, depth) for _, t, depth in made] == [
        (pytest.approx(k), pytest.approx(d)) for k, d in sorted(expected)
    ]
    assert all(j == surface for j, _, _ in made)


def test_what_touches_at_the_end_counts_as_if_it_slid(monkeypatch: pytest.MonkeyPatch) -> None:
    made = found(monkeypatch, ["....x...x", "........."], [], 8.0)
    assert [depth for _, _, depth in made] == pytest.approx([GRAZED, PENETRATION])


@pytest.mark.parametrize(
    ("time", "left"), [(1.4, [4, 5]), (1.6, [5]), (6.4, [3]), (6.6, [3, 4]), (9.0, [3, 4, 5])]
)
def test_nodes_beside_a_hit_of_the_surface_are_no_arc(
    monkeypatch: pytest.MonkeyPatch, time: float, left: list[int]
) -> None:
    """Within two and a half steps; a hit of another surface is none of it."""
    pattern = ["...xxx...", "........."]
    assert [t for _, t, _ in found(monkeypatch, pattern, [("floor", time)], 100.0)] == left
    assert len(found(monkeypatch, pattern, [("roof", time)], 100.0)) == 3


def test_a_time_has_the_depth_of_the_deepest_arc_around_it() -> None:
    """Both ends belong to an arc; what is ignored has no depth."""
    allowed = allowance(
        [Arc(0, 1.0, 3.0, 0.2), Arc(0, 2.0, 4.0, 0.1), Arc(1, 3.0, 5.0, 0.5)], 3, [2]
    )
    times = [0.9, 1.0, 1.9, 2.0, 3.0, 3.1, 4.0, 4.1, 5.0, 5.1]
    deep = [0.0, 0.2, 0.2, 0.2, 0.2, 0.1, 0.1, 0.0, 0.0, 0.0]
    other = [0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 0.5, 0.5, 0.0]
    expected = np.column_stack([deep, other, np.full(10, np.inf)])
    assert (allowed(np.array(times)) == expected).all()
    assert (allowance([], 2, [])(np.array([1.0])) == 0.0).all()
