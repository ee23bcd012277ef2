"""Boxes of durations that a proof leaves: they are all durations, and what is drawn of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.proving.global_proof import Proof
from dmoc.proving.paving import Paving

x, u = dynamicsymbols("x u")
BLOCK = dmoc.MechanicalSystem(
    "between", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2 / 2,
    surfaces={"right": x <= 1, "left": x >= 0},
)  # fmt: skip
ONE, TWO = {"sequence": ["right"], "goal": {"x": 0.3, "x_dot": 0}}, {"sequence": ["right", "left"]}


def problem(**more: Any) -> dmoc.Problem:
    """A block of 1 kg that hits walls at 0 and 1 m, from rest to rest."""
    fields: dict[str, Any] = {
        "start": {"x": 0.3}, "goal": {"x": 0.6, "x_dot": 0}, "restitution": 0.8,
        "final_time": 1, "steps": 4,
    }  # fmt: skip
    return dmoc.Problem(dmoc.build(BLOCK, order=4), **{**fields, **more})


def interrupted(_: object) -> None:
    raise KeyboardInterrupt


@pytest.fixture(scope="module")
def weak() -> Proof:
    """With at most 20 N."""
    return dmoc.prove(problem(**TWO, bounds={"u": (-20, 20)}), gap=1e-2)


def area(corners: Any) -> float:
    """Of a polygon, by its corners; the length of a line."""
    if corners.shape[1] == 1:
        return float(np.ptp(corners))
    a, b = corners.T
    return float(abs(a @ np.roll(b, 1) - b @ np.roll(a, 1)) / 2)


def size(paving: Paving | None) -> float:
    assert paving is not None
    return sum(area(region) for region in paving.regions() if len(region))


def test_two_durations_that_decide_the_third_are_covered_once(weak: Proof) -> None:
    """They are a triangle: three durations of at least 1/1000 s add up to 1 s."""
    assert weak.paving is not None and weak.paving.free == (0, 1)
    assert size(weak.paving) == pytest.approx(0.997**2 / 2, rel=1e-9)


@pytest.mark.parametrize(
    ("more", "free", "all_of_it"),
    [
        ({"final_time": 1}, (0,), 0.998),
        # the sum of two durations is from 1/2 to 1: of a square of 0.6 two corners are cut off
        (
            {"final_time": (0.5, 1), "durations": [(0.1, 0.7), (0.2, 0.8)]}, (0, 1),
            0.6**2 - 0.2**2 / 2 - 0.5**2 / 2,
        ),
        ({"final_time": (0.5, 1), "durations": [0.5, None]}, (1,), 0.499),
    ],
)  # fmt: skip
def test_durations_that_are_free_are_covered_once(
    more: dict[str, Any], free: tuple[int, ...], all_of_it: float
) -> None:
    proof = dmoc.prove(problem(**ONE, **more), gap=1e-2)
    assert proof.paving is not None and proof.paving.free == free
    assert size(proof.paving) == pytest.approx(all_of_it, rel=1e-8)


def test_a_proof_that_goes_on_has_the_boxes_of_both(tmp_path: Path) -> None:
    journal, whole = tmp_path / "left.npz", 0.997**2 / 2
    for progress in (interrupted, None):
        proof = dmoc.prove(problem(**TWO), gap=1e-2, journal=journal, progress=progress)
        assert size(proof.paving) == pytest.approx(whole, rel=1e-9)
    assert proof.proved


def test_boxes_without_a_motion_are_those_that_leave_no_time(weak: Proof) -> None:
    """To the wall, 0.7 m away, 20 N take it in 0.2646 s from rest, and not in less."""
    paving = weak.paving
    assert paving is not None and weak.solution is not None and weak.cost is not None
    none = paving.without_motion(weak.cost)
    areas = np.array([area(region) if len(region) else 0.0 for region in paving.regions()])
    short = paving.longest[:, 0] < np.sqrt(2 * 0.7 / 20)
    assert areas[short & none].sum() > 0.6 * areas[short].sum()
    best = np.array([phase.duration for phase in weak.solution.phases])
    holds = ((paving.shortest <= best) & (best <= paving.longest)).all(axis=1)
    assert holds.any() and not (none & holds).any()
    assert (paving.bound[~none] < paving.beyond).all()


def test_the_figure_has_the_boxes_and_the_best_motion(weak: Proof, tmp_path: Path) -> None:
    figure = weak.plot(tmp_path / "proof.png")
    assert weak.paving is not None and weak.solution is not None and weak.cost is not None
    axes, bar = figure.axes
    empty, undone, dear = axes.collections
    none, there = weak.paving.without_motion(weak.cost), [len(r) > 0 for r in weak.paving.regions()]
    assert len(empty.get_paths()) == (none & there).sum() > 0
    assert len(dear.get_paths()) == (~none & there).sum() and not undone.get_paths()
    np.testing.assert_array_equal(dear.get_array(), weak.paving.bound[~none & there])
    assert empty.get_hatch() and bar.get_ylabel() == "cost at least"
    (star,) = axes.get_lines()
    first = [phase.duration for phase in weak.solution.phases[:2]]
    np.testing.assert_allclose(star.get_xydata(), [first])
    assert axes.get_xlabel() == "duration of phase 0 [s]"
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == [
        f"best motion, cost {weak.cost:.6g}",
        f"no motion ({(none & there).sum()} boxes)",
    ]
    assert (tmp_path / "proof.png").read_bytes().startswith(b"\x89PNG")


def test_boxes_that_are_not_done_are_drawn_apart() -> None:
    proof = dmoc.prove(problem(**TWO), progress=interrupted)
    assert proof.paving is not None and proof.waiting > 0
    _, undone, dear = proof.plot(style="dark").axes[0].collections
    assert len(undone.get_paths()) == proof.waiting and undone.get_hatch()
    assert (dear.get_array() >= (1 - 1e-4) * proof.cost).all()


def test_one_duration_has_a_line_for_each_box() -> None:
    proof = dmoc.prove(problem(**ONE, bounds={"u": (-9, 9)}), gap=1e-2)
    assert proof.paving is not None and proof.cost is not None
    (axes,) = proof.plot().axes
    none = proof.paving.without_motion(proof.cost)
    lines = np.array(axes.collections[0].get_segments())
    there = np.array([len(region) > 0 for region in proof.paving.regions()])
    assert 0 < (none & there).sum() == len(axes.patches)
    np.testing.assert_array_equal(lines[:, 0, 1], proof.paving.bound[~none & there])
    level, star = axes.get_lines()
    assert level.get_ydata()[0] == star.get_ydata()[0] == proof.cost


def test_no_motion_at_all_is_drawn() -> None:
    proof = dmoc.prove(problem(**TWO, bounds={"u": (-5, 5)}))
    empty, undone, *dear = proof.plot().axes[0].collections
    assert empty.get_paths() and not undone.get_paths() and not dear


def test_costs_that_nothing_bounds_make_no_box_empty() -> None:
    """Such boxes are those of motions that count as none."""
    proof = dmoc.prove(problem(**TWO), gap=1e-2)
    words = [text.get_text() for text in proof.plot().legends[0].get_texts()]
    assert proof.paving is not None
    dear = (proof.paving.bound >= proof.limit) & [len(r) > 0 for r in proof.paving.regions()]
    assert (
        words[1:] == [f"no motion below {proof.limit:.3g} ({dear.sum()} boxes)"][: int(dear.any())]
    )


def test_more_durations_have_no_figure() -> None:
    proof = dmoc.prove(problem(sequence=["right", "left", "right"]), progress=interrupted)
    assert proof.paving is None
    with pytest.raises(dmoc.DmocError, match="durations of 4 phases: a figure shows those of 1"):
        proof.plot()


def test_a_final_time_that_is_free_is_one_duration() -> None:
    rest = {"sequence": [], "goal": {"x": 0.9, "x_dot": 0}, "final_time": (0.5, 9)}
    proof = dmoc.prove(problem(**rest))
    assert proof.paving is not None and proof.paving.free == (0,)
    assert size(proof.paving) == pytest.approx(8.5, rel=1e-9)
