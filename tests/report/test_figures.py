"""The figure of a motion, by what it shows: curves, jumps, bounds, collisions, snapshots."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.errors import OutputError
from dmoc.registry import find


def labelled(figure: Figure, label: str) -> Axes:
    (axes,) = (a for a in figure.axes if a.get_ylabel() == label)
    return axes


def curves(axes: Axes) -> list[np.ndarray]:
    """Solid lines of more than two points, as rows (time, value)."""
    lines = [line for line in axes.lines if line.get_linestyle() == "-"]
    return [line.get_xydata() for line in lines if len(line.get_xdata()) > 2]


@pytest.fixture(scope="module")
def figure(solution: dmoc.Solution) -> Figure:
    return solution.plot()


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("alpha", r"\alpha"),
        ("x_1", "x_{1}"),
        ("q_", "q"),
        ("a__b", "a_{b}"),
        ("theta_l_1", r"\theta_{l,1}"),
        ("l" * 64, rf"\mathrm{{{'l' * 64}}}"),
    ],
)
def test_every_name_of_a_model_can_be_drawn(solution: dmoc.Solution, name: str, shown: str) -> None:
    t = solution.trajectory
    renamed = replace(t, coordinates=(name, "x"), inputs=(name,), model="other")
    figure = replace(solution, trajectory=renamed).plot()
    figure.canvas.draw()
    momenta, inputs = labelled(figure, "momenta"), labelled(figure, f"input ${shown}$")
    assert [t.get_text() for t in momenta.get_legend().get_texts()] == [
        f"$p_{{{shown}}}$",
        "$p_{x}$",
    ]
    assert inputs.get_xlabel() == "time $t$ [s]"


def test_positions_and_momenta_are_those_of_the_motion(
    solution: dmoc.Solution, figure: Figure
) -> None:
    positions = labelled(figure, "coordinates")
    assert [t.get_text() for t in positions.get_legend().get_texts()] == [r"$\alpha$", "$x$"]
    wanted = [np.column_stack([p.t, p.q[:, i]]) for i in (0, 1) for p in solution.phases]
    np.testing.assert_array_equal(np.concatenate(curves(positions)), np.concatenate(wanted))
    wanted = [np.column_stack([p.t, p.p[:, i]]) for i in (0, 1) for p in solution.phases]
    np.testing.assert_array_equal(
        np.concatenate(curves(labelled(figure, "momenta"))), np.concatenate(wanted)
    )


def test_momenta_jump_at_the_collision_and_it_is_named(
    solution: dmoc.Solution, figure: Figure
) -> None:
    (hit,) = solution.collisions
    jumps = [line for line in labelled(figure, "momenta").lines if line.get_linestyle() == ":"]
    assert [list(line.get_xdata()) for line in jumps] == [[hit.time] * 2] * 2
    drawn = np.array([line.get_ydata() for line in jumps])
    np.testing.assert_allclose(
        drawn, np.column_stack([hit.momentum_before, hit.momentum_after]), atol=1e-10
    )
    assert drawn[0, 0] != drawn[0, 1]
    for label in ("coordinates", "momenta", "input $F$"):
        axes = labelled(figure, label)
        assert any(
            list(line.get_xdata()) == [hit.time] * 2 for line in axes.lines if line not in jumps
        )
    assert [t.get_text() for t in labelled(figure, "coordinates").texts] == ["left"]


def test_inputs_are_steps_and_far_bounds_are_noted(solution: dmoc.Solution, figure: Figure) -> None:
    inputs = labelled(figure, "input $F$")
    assert [t.get_text() for t in inputs.texts] == [
        "lower bound -200 \u2193",
        "upper bound 200 \u2191",
    ]
    assert not [
        line for line in inputs.lines if line.get_linestyle() == "--" and line.get_xdata()[0] == 0
    ]
    steps = [patch.get_data() for patch in inputs.patches]
    assert len(steps) == 2
    for step, phase in zip(steps, solution.phases, strict=True):
        np.testing.assert_array_equal(step.values, phase.u[:, 0])
        np.testing.assert_array_equal(step.edges, phase.t)


def test_snapshots_stand_over_the_curves(solution: dmoc.Solution, figure: Figure) -> None:
    """Eight of each phase: rods and masses; the cart at both ends; the limiter where it is hit."""
    titled = [a for a in figure.axes if a.get_title()]
    assert [a.get_title() for a in titled] == [
        "before 'left': 0 to 0.0964 s",
        "after 'left': 0.0964 to 1 s",
    ]
    for axes, phase in zip(titled, solution.phases, strict=True):
        masses = [line.get_xydata()[0] for line in axes.lines if line.get_marker() == "o"]
        alpha, x = phase.q[[0, -1]].T
        tips = np.column_stack([x + 0.5 * np.cos(alpha), 0.5 * np.sin(alpha)])
        assert len(masses) == 8
        np.testing.assert_allclose([masses[0], masses[-1]], tips, atol=1e-12)


def test_coordinates_of_other_sizes_have_axes_of_their_own(solution: dmoc.Solution) -> None:
    phases = tuple(replace(p, q=p.q * [1.0, 100.0]) for p in solution.phases)
    figure = replace(
        solution, trajectory=replace(solution.trajectory, phases=phases, model="other")
    ).plot()
    for label, column in ((r"$\alpha$", 0), ("$x$", 1)):
        wanted = [np.column_stack([p.t, p.q[:, column]]) for p in phases]
        np.testing.assert_array_equal(
            np.concatenate(curves(labelled(figure, label))), np.concatenate(wanted)
        )


def test_bounds_near_the_inputs_are_drawn(seed: dmoc.Problem) -> None:
    figure = dmoc.solve(seed.but(bounds={"F": (-40, 40)}, steps=40), "ipm", verify=False).plot()
    inputs = labelled(figure, "input $F$")
    dashed = [line for line in inputs.lines if line.get_linestyle() == "--"]
    levels = {
        float(np.asarray(line.get_ydata())[0]) for line in dashed if line.get_color() != "#8a8a8a"
    }
    assert levels == {-40.0, 40.0} and not inputs.texts


def test_other_models_are_drawn_as_curves(block: Kernels, tmp_path: Path) -> None:
    problem = dmoc.Problem(
        block, start={"x": 0.0}, goal={"x": 0.5, "x_dot": 0.0}, final_time=1.0, steps=20
    )
    solution = dmoc.solve(problem, "ipm")
    figure = solution.plot(tmp_path / "b.pdf")
    assert [a.get_ylabel() for a in figure.axes] == ["$x$", "momenta", "input $u$"]
    assert not [a for a in figure.axes if a.get_title()]
    assert (tmp_path / "b.pdf").read_bytes().startswith(b"%PDF-")
    with pytest.raises(OutputError, match="no known format"):
        solution.plot(tmp_path / "b.xyz")
    assert [p.name for p in tmp_path.iterdir()] == ["b.pdf"]


@pytest.mark.parametrize("order", [2, 4])
def test_shipped_models_are_drawn_as_themselves_at_both_orders(order: int) -> None:
    reference = find("cart_pendulum")
    problem = dmoc.Problem(reference.kernels(order), **reference.defaults | {"steps": 6})
    solution = dmoc.solve(problem, "ipm", verify=False)
    other = replace(solution, trajectory=replace(solution.trajectory, fingerprint="0" * 64))
    snapshots = [[a for a in s.plot().axes if a.get_title()] for s in (solution, other)]
    assert [len(axes) for axes in snapshots] == [2, 0]
