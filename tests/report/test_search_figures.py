"""Figures of a search, by what they show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn import nothing_is_cut_off
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from systems import block_system

import dmoc
from dmoc.report.search_tree import MOST_LABELS, plot_motions, plot_tree
from dmoc.report.style import DARK, VERDICTS

NODES = [
    ((), "feasible", 5.3408),
    (("east",), "optimal", 0.53514),
    (("west",), "infeasible", None),
    (("east", "west"), "unverified", 2.0),
    (("east", "east"), "feasible", 3.0),
]


def links(axes: Axes) -> set[tuple[tuple[float, float], ...]]:
    """Lines of a tree, each as (depth, row) of both ends."""
    return {
        tuple(map(tuple, line.get_xydata())) for line in axes.lines if len(line.get_xdata()) == 2
    }


def test_what_is_proposed_stands_behind_what_was_not_looked_at() -> None:
    """Of proposals alone nothing says that what they begin with is a node."""
    (axes,) = plot_tree([NODES[3], (("west", "east"), "optimal", 1.0)]).axes
    nodes = [text for text in axes.texts if text.get_text()[2:] in ("west 2", "east 1")]
    assert {text.get_text() for text in axes.texts if text not in nodes} == {"east", "west"}
    columns = axes.get_xticks()
    assert len(nodes) == 2 and {text.get_position()[0] for text in nodes} == {columns[2]}
    first = ((columns[0], 0.5), (columns[1], 0.0)), ((columns[1], 0.0), (columns[2], 0.0))
    assert links(axes) > set(first) and len(links(axes)) == 4


def test_a_tree_shows_sequences_costs_and_verdicts() -> None:
    figure = plot_tree(NODES)
    (axes,) = figure.axes
    texts = {text.get_text()[2:]: (text, text.get_position()) for text in axes.texts}
    assert set(texts) == {"no collision 5.341", "east 0.5351", "west", "west 2", "east 3"}
    columns = list(axes.get_xticks())
    depths = {name: columns.index(place[0]) for name, (_, place) in texts.items()}
    assert depths == {
        "no collision 5.341": 0,
        "east 0.5351": 1,
        "west": 1,
        "west 2": 2,
        "east 3": 2,
    }
    places = [place for _, place in texts.values()]
    assert len(set(places)) == len(places)
    for name, verdict in (
        ("east 0.5351", "optimal"),
        ("west", "infeasible"),
        ("west 2", "unverified"),
    ):
        assert to_hex(texts[name][0].get_bbox_patch().get_facecolor()).upper() == VERDICTS[verdict]
    assert [texts[name][0].get_weight() for name in ("east 0.5351", "east 3")] == ["bold", "normal"]
    at = {name: tuple(map(float, place)) for name, (_, place) in texts.items()}
    parents = {
        "east 0.5351": "no collision 5.341",
        "west": "no collision 5.341",
        "west 2": "east 0.5351",
        "east 3": "east 0.5351",
    }
    assert links(axes) == {(at[parent], at[child]) for child, parent in parents.items()}
    assert axes.get_xlabel() == "collisions"
    assert [t.get_text() for t in axes.get_xticklabels()] == ["0", "1", "2"]
    (legend,) = figure.legends
    assert {t.get_text()[2:] for t in legend.get_texts()} == {
        "optimal (1)",
        "feasible (2)",
        "unverified (1)",
        "infeasible (1)",
    }


def test_a_tree_of_landings_and_friction_is_one_of_events() -> None:
    nodes = [((), "infeasible", None), (("+foot:slip-",), "optimal", 1.0)]
    (axes,) = plot_tree(nodes).axes
    assert axes.get_xlabel() == "events"
    assert {text.get_text()[2:] for text in axes.texts} == {"no event", "+foot:slip- 1"}


@pytest.mark.slow
def test_a_large_tree_has_points_instead_of_texts() -> None:
    many = [
        ((), "feasible", 1.0),
        *((("left",) * k, "failed", None) for k in range(1, MOST_LABELS + 1)),
    ]
    (axes,) = plot_tree(many).axes
    points = [line for line in axes.lines if line.get_marker() == "o"]
    assert not axes.texts and len(points) == len(many)
    assert {to_hex(p.get_color()).upper() for p in points} == {
        VERDICTS["feasible"],
        VERDICTS["failed"],
    }


@pytest.mark.slow
def test_motions_stand_side_by_side_with_their_collisions(
    solution: dmoc.Solution, tmp_path: Path
) -> None:
    motion = solution.trajectory
    figure = plot_motions(
        [("left", solution.cost, motion), ("again", 2.0, motion)], tmp_path / "best.pdf"
    )
    pictures, panels = figure.axes[:2], figure.axes[2:]
    titles = [f"left\ncost {solution.cost:.6g}", "again\ncost 2"]
    assert [a.get_title() for a in pictures] == titles and len(panels) == 6
    labels = [a.get_ylabel() for a in panels if a.get_ylabel()]
    assert labels == [r"$\alpha$ [rad]", "$x$ [m]", "input $F$ [N]"]
    assert [a.get_xlabel() for a in panels if a.get_xlabel()] == ["time $t$ [s]"] * 2
    for row, axes in enumerate(panels[::2]):
        assert any(list(a.get_xdata()) == [motion.collisions[0].time] * 2 for a in axes.lines)
        curves = [a.get_xydata() for a in axes.lines if len(a.get_xdata()) > 2]
        if row == 2:
            curves = [steps[::2] for steps in curves]  # each step has both of its ends
        wanted = [
            (p.q[:, row] if row < 2 else p.u[:, 0], p.t if row < 2 else p.t[:-1])
            for p in motion.phases
        ]
        assert len(curves) == len(wanted) == 2
        for curve, (values, times) in zip(curves, wanted, strict=True):
            np.testing.assert_allclose(curve, np.column_stack([times, values]), rtol=1e-15)
    assert (tmp_path / "best.pdf").read_bytes().startswith(b"%PDF-")


@pytest.mark.slow
def test_the_best_motions_are_drawn_at_one_scale_and_nothing_is_cut_off(
    solution: dmoc.Solution,
) -> None:
    motion = solution.trajectory
    figure = plot_motions([("left", 1.0, motion), ("again", 2.0, motion)], style="dark")
    nothing_is_cut_off(figure)
    ways = [a.transData.transform([(0, 0), (1, 0)]) for a in figure.axes[:2]]
    scales = [way[1, 0] - way[0, 0] for way in ways]
    assert scales[0] == pytest.approx(scales[1], rel=1e-6)
    masses = [line for line in figure.axes[0].lines if line.get_marker() == "o"]
    assert len(masses) == 2 * 7  # of both phases
    assert {to_hex(a.get_facecolor()) for a in figure.axes} == {DARK.paper}


@pytest.mark.slow
def test_an_axis_of_motions_side_by_side_holds_all_of_them(solution: dmoc.Solution) -> None:
    motion = solution.trajectory
    larger = replace(motion, phases=tuple(replace(p, u=5.0 * p.u) for p in motion.phases))
    largest = max(float(np.abs(p.u).max()) for p in larger.phases)
    for pair in ((motion, larger), (larger, motion)):
        *_, one, other = plot_motions([("a", 1.0, pair[0]), ("b", 2.0, pair[1])]).axes
        assert one.get_ylim() == other.get_ylim() and max(map(abs, one.get_ylim())) >= largest


def test_verdicts_differ_in_more_than_their_colours() -> None:
    nodes = [((), "optimal", 1.0), *(((v,), v, None) for v in VERDICTS if v != "optimal")]
    (axes,) = plot_tree(nodes).axes
    assert len({text.get_text()[0] for text in axes.texts}) == len(VERDICTS)
    assert to_hex(plot_tree(nodes, style="dark").get_facecolor()) == DARK.paper


@pytest.mark.slow
def test_a_search_draws_its_nodes_and_its_best_motions(
    block: dmoc.codegen.kernels.Kernels, tmp_path: Path
) -> None:
    problem = dmoc.Problem(
        block, start={"x": 0.0}, goal={"x": 0.5, "x_dot": 0.0}, steps=10, final_time=1.0
    )
    result = dmoc.search(problem, 1)
    (axes,) = result.plot(tmp_path / "tree.png").axes
    assert [t.get_text()[2:] for t in axes.texts] == [
        f"{name} {node.cost:.4g}"
        for name, node in zip(("no collision", "wall"), result.nodes, strict=True)
    ]
    confirmed = [n for n in result.nodes if n.verdict in ("optimal", "feasible")]
    titles = [a.get_title() for a in result.plot_best(tmp_path / "best.png").axes if a.get_title()]
    assert len(titles) == len(confirmed) > 0
    assert (
        result.best is not None and titles[0] == f"{result.best.name}\ncost {result.best.cost:.6g}"
    )
    for file in ("tree.png", "best.png"):
        assert (tmp_path / file).read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


def test_a_search_without_a_motion_says_so(block: dmoc.codegen.kernels.Kernels) -> None:
    unreachable = dmoc.Problem(
        block, start={"x": 0.0}, goal={"x": -5.0}, steps=10, bounds={"u": (-1, 1)},
        final_time=(None, 1.0),
    )  # fmt: skip
    (axes,) = dmoc.search(unreachable, 0).plot_best().axes
    assert [t.get_text() for t in axes.texts] == ["no confirmed motion"] and not axes.lines


def test_inputs_of_order_4_are_drawn_at_their_times() -> None:
    kernels = dmoc.build(block_system(), order=4)
    problem = dmoc.Problem(
        kernels, start={"x": 0.0}, goal={"x": 0.5, "x_dot": 0.0}, steps=6, final_time=1.0
    )
    motion = dmoc.solve(problem, "ipm").trajectory
    figure = plot_motions([("none", 1.5, motion)])
    inputs = next(a for a in figure.axes if a.get_ylabel() == "input $u$")
    (line,) = inputs.lines
    (phase,) = motion.phases
    drawn = np.column_stack([motion.input_times(phase), phase.u[:, 0]])
    np.testing.assert_array_equal(line.get_xydata(), drawn)


@pytest.mark.parametrize("name", ["tree.xyz", "tree"])
def test_an_unknown_format_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(dmoc.DmocError, match="has no known format"):
        plot_tree(NODES, tmp_path / name)
    assert not list(tmp_path.iterdir())
