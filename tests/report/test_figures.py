"""The figure of a motion, by what it shows: snapshots, curves, jumps, bounds, collisions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn import drawn, labelled, legend, limits, nothing_is_cut_off
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from systems import block_system

import dmoc
from dmoc.base.errors import OutputError
from dmoc.codegen.kernels import Kernels
from dmoc.models.registry import find
from dmoc.motion.trajectory import Phase
from dmoc.report.style import DARK, LIGHT


def curves(axes: Axes) -> list[np.ndarray]:
    """Lines of more than two points, as rows (time, value)."""
    return [line.get_xydata() for line in axes.lines if len(line.get_xdata()) > 2]


@pytest.mark.slow
def test_a_figure_is_an_image_in_a_notebook(figure: Figure) -> None:
    """Without pyplot, whose import tells notebooks how to show figures."""
    image = figure._repr_png_()
    width, height = (int.from_bytes(image[i : i + 4], "big") for i in (16, 20))
    inches = figure.get_size_inches()
    assert image.startswith(b"\x89PNG") and (width, height) == pytest.approx(inches * 100, abs=1)


@pytest.fixture(scope="module")
def figure(solution: dmoc.Solution) -> Figure:
    return solution.plot()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("alpha", r"\alpha"), ("x_1", "x_{1}"), ("x1", "x_{1}"), ("theta2_l", r"\theta_{2,l}"),
        ("q_", "q"), ("a__b", "a_{b}"), ("theta_l_1", r"\theta_{l,1}"),
        ("l" * 64, rf"\mathrm{{{'l' * 64}}}"),
    ],
)  # fmt: skip
def test_every_name_of_a_model_can_be_drawn(solution: dmoc.Solution, name: str, label: str) -> None:
    figure = drawn(solution, coordinates=(name, "y"), inputs=(name,), units={}, scene=None)
    figure.canvas.draw()
    assert legend(labelled(figure, "momenta")) == [f"$p_{{{label}}}$", "$p_{y}$"]
    assert labelled(figure, f"input ${label}$").get_xlabel() == "time $t$ [s]"


def test_curves_are_those_of_the_motion_with_their_units(
    solution: dmoc.Solution, figure: Figure
) -> None:
    labels = [a.get_ylabel() for a in figure.axes if not a.get_title()]
    states = [r"$\alpha$ [rad]", "$x$ [m]", r"$p_{\alpha}$ [N m s]", "$p_{x}$ [N s]"]
    assert labels == [*states, "input $F$ [N]"]
    for label, name, i in zip(states, "qqpp", (0, 1, 0, 1), strict=True):
        wanted = [np.column_stack([p.t, getattr(p, name)[:, i]]) for p in solution.phases]
        np.testing.assert_allclose(
            np.concatenate(curves(labelled(figure, label))), np.concatenate(wanted), rtol=1e-15
        )


@pytest.mark.slow
def test_what_has_one_unit_has_one_panel_with_a_legend(solution: dmoc.Solution) -> None:
    figure = drawn(solution, units={"alpha": "m", "x": "m"})
    coordinates = labelled(figure, "coordinates [m]")
    assert legend(coordinates) == [r"$\alpha$", "$x$"]
    key = coordinates.get_legend()
    figure.canvas.draw()
    assert key is not None and key.get_window_extent().x0 >= coordinates.bbox.x1
    looks = {line.get_label(): (line.get_color(), line.get_linestyle()) for line in key.get_lines()}
    assert len({colour for colour, _ in looks.values()}) == 2
    assert len({style for _, style in looks.values()}) == 2
    assert legend(labelled(figure, "momenta [N s]")) == [r"$p_{\alpha}$", "$p_{x}$"]


def test_velocities_are_drawn_on_request(solution: dmoc.Solution) -> None:
    figure = solution.plot(velocities=True)
    for label, i in ((r"$\dot{\alpha}$ [rad/s]", 0), (r"$\dot{x}$ [m/s]", 1)):
        wanted = [np.column_stack([p.t, p.v[:, i]]) for p in solution.phases]
        np.testing.assert_array_equal(
            np.concatenate(curves(labelled(figure, label))), np.concatenate(wanted)
        )


@pytest.mark.slow
def test_coordinates_are_round_between_few_nodes() -> None:
    reference = find("bouncing_pendulum")
    problem = dmoc.Problem(
        reference.kernels(4), start={"theta": 1.0}, sequence=["wall"], steps=4, final_time=0.9
    )
    figure = dmoc.solve(problem, "ipm", verify=False).plot()
    (first, _) = curves(labelled(figure, r"$\theta$ [rad]"))
    assert len(first) > 60
    bends = np.abs(np.diff(first[:, 1], 2))
    assert bends.max() < 5 * np.median(bends)


def test_momenta_jump_at_the_collision_and_it_is_named(
    solution: dmoc.Solution, figure: Figure
) -> None:
    (hit,) = solution.collisions
    for i, label in enumerate((r"$p_{\alpha}$ [N m s]", "$p_{x}$ [N s]")):
        (jump,) = (a for a in labelled(figure, label).lines if a.get_gid() == "jump")
        assert list(jump.get_xdata()) == [hit.time] * 2
        wanted = hit.momentum_before[i], hit.momentum_after[i]
        np.testing.assert_allclose(jump.get_ydata(), wanted, atol=1e-10)
    assert hit.momentum_before[0] != hit.momentum_after[0]
    panels = [a for a in figure.axes if not a.get_title()]
    for axes in panels:
        assert any(
            list(line.get_xdata()) == [hit.time] * 2 and line.get_gid() is None
            for line in axes.lines
        )
    assert [[t.get_text() for t in axes.texts] for axes in panels] == [["lower"], [], [], [], []]


def test_inputs_are_steps_and_far_bounds_are_told_beside_them(
    solution: dmoc.Solution, figure: Figure
) -> None:
    inputs = labelled(figure, "input $F$ [N]")
    assert legend(inputs) == [r"$-200\leq F\leq 200$"] and not inputs.texts
    assert not limits(inputs)
    steps = curves(inputs)
    assert len(steps) == 2
    for step, phase in zip(steps, solution.phases, strict=True):
        np.testing.assert_array_equal(step[::2], np.column_stack([phase.t[:-1], phase.u[:, 0]]))
        np.testing.assert_array_equal(step[1::2], np.column_stack([phase.t[1:], phase.u[:, 0]]))


def test_a_bound_near_the_inputs_is_drawn_and_the_far_one_told(solution: dmoc.Solution) -> None:
    figure = drawn(solution, input_bounds=np.array([[-60.0, 500.0]]))
    inputs = labelled(figure, "input $F$ [N]")
    levels = {float(a.get_ydata()[0]) for a in limits(inputs)}
    assert levels == {-60.0}
    assert legend(inputs) == [r"$F\leq 500$", "bounds"]


def test_no_bound_is_told_where_there_is_none(solution: dmoc.Solution) -> None:
    inf = np.inf
    for bounds, labels in (([-inf, inf], []), ([-inf, 500.0], [r"$F\leq 500$"])):
        figure = drawn(solution, input_bounds=np.array([bounds]))
        inputs = labelled(figure, "input $F$ [N]")
        assert legend(inputs) == labels
        assert not limits(inputs)


def test_snapshots_are_the_scene_at_seven_times_of_each_phase(
    solution: dmoc.Solution, figure: Figure
) -> None:
    titled = [a for a in figure.axes if a.get_title()]
    assert [a.get_title() for a in titled] == [
        "0 to 0.0964 s,\nthen lower",
        "0.0964 to 1 s,\nafter lower",
    ]
    for axes, phase in zip(titled, solution.phases, strict=True):
        masses = [line.get_xydata()[0] for line in axes.lines if line.get_marker() == "o"]
        alpha, x = phase.q[[0, -1]].T
        tips = np.column_stack([x + 0.5 * np.cos(alpha), 0.5 * np.sin(alpha)])
        assert len(masses) == 7
        np.testing.assert_allclose([masses[0], masses[-1]], tips, atol=1e-12)
        (carts,) = {len(axes.patches)}
        assert carts == 7
        corners = axes.patches[-1].get_xy()
        np.testing.assert_allclose(corners.mean(axis=0)[1], 0.0, atol=0.07)
        np.testing.assert_allclose(np.ptp(corners, axis=0), (0.25, 0.125))


@pytest.mark.slow
def test_snapshots_of_all_phases_have_one_scale_and_hold_everything(
    solution: dmoc.Solution, figure: Figure
) -> None:
    figure.canvas.draw()
    titled = [a for a in figure.axes if a.get_title()]
    scales = [
        a.transData.transform([(1, 0), (0, 1)]) - a.transData.transform((0, 0)) for a in titled
    ]
    np.testing.assert_allclose(scales[0], scales[1], rtol=1e-6)
    assert scales[0][0, 0] == pytest.approx(scales[0][1, 1])
    for axes in titled:
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        for line in axes.lines:
            x, y = np.asarray(line.get_xydata()).T
            assert (left <= x).all() and (x <= right).all()
            assert (low <= y).all() and (y <= high).all()


def test_an_arrow_shows_where_and_how_the_surface_pushes(
    solution: dmoc.Solution, figure: Figure
) -> None:
    before, after = (a for a in figure.axes if a.get_title())
    assert not after.texts
    (arrow,) = before.texts
    alpha, x = solution.phases[0].q[-1]
    np.testing.assert_allclose(
        arrow.xyann, (x + 0.5 * np.cos(alpha), 0.5 * np.sin(alpha)), atol=1e-9
    )
    push = np.subtract(arrow.xy, arrow.xyann)
    np.testing.assert_allclose(push / np.hypot(*push), (-np.sin(alpha), np.cos(alpha)), atol=1e-9)


@pytest.mark.slow
def test_nothing_is_cut_off_and_no_text_lies_on_curves(solution: dmoc.Solution) -> None:
    for style in ("light", "dark"):
        figure = solution.plot(velocities=True, style=style)
        nothing_is_cut_off(figure)
        for axes in figure.axes:
            if not axes.get_title():
                inner = Bbox.from_extents(*np.add(axes.bbox.extents, (1, 1, -1, -1)))
                beside = [*axes.texts, *filter(None, [axes.get_legend()])]
                assert not any(t.get_window_extent().overlaps(inner) for t in beside)


def _contrast(a: str, b: str) -> float:
    """Contrast of two colours after the Web Content Accessibility Guidelines 2.2."""

    def luminance(colour: str) -> float:
        linear = [
            c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)
        ]
        return float(np.dot((0.2126, 0.7152, 0.0722), linear))

    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.slow
def test_dark_figures_are_light_on_dark(solution: dmoc.Solution, tmp_path: Path) -> None:
    figure = solution.plot(tmp_path / "dark.png", style="dark")
    assert to_hex(figure.get_facecolor()) == DARK.paper
    for axes in figure.axes:
        assert to_hex(axes.get_facecolor()) == DARK.paper
        texts = [axes.yaxis.label, *axes.get_xticklabels(), *axes.get_yticklabels()]
        assert {to_hex(t.get_color()) for t in texts} == {DARK.ink}
    from matplotlib.image import imread

    corner = imread(tmp_path / "dark.png")[0, 0, :3]
    np.testing.assert_allclose(corner, to_rgb(DARK.paper), atol=0.01)


@pytest.mark.parametrize("style", [LIGHT, DARK])
def test_texts_can_be_read_and_curves_be_seen(style: object) -> None:
    assert isinstance(style, type(LIGHT))
    assert _contrast(style.ink, style.paper) > 12 and _contrast(style.muted, style.paper) > 4.5
    assert all(_contrast(colour, style.paper) > 2 for colour in style.colours)
    assert all(_contrast(style.ink, tint) > 4.5 for tint in (*style.tints, style.free))
    assert all(_contrast(style.on_verdict, c) > 4.5 for c in style.verdicts.values())


def test_an_unknown_style_is_refused(solution: dmoc.Solution) -> None:
    with pytest.raises(OutputError, match="style = 'sepia': expected one of light, dark"):
        solution.plot(style="sepia")


def test_coordinates_of_other_sizes_without_units_have_panels_of_their_own(
    solution: dmoc.Solution,
) -> None:
    phases = tuple(replace(p, q=p.q * [1.0, 100.0]) for p in solution.phases)
    figure = drawn(solution, phases=phases, units={}, scene=None)
    assert [a.get_ylabel() for a in figure.axes if a.get_ylabel()][:2] == [r"$\alpha$", "$x$"]


@pytest.mark.slow
def test_a_model_without_a_drawing_is_drawn_by_its_coordinates(
    block: Kernels, tmp_path: Path
) -> None:
    problem = dmoc.Problem(
        block, start={"x": 0.0}, goal={"x": 0.5, "x_dot": 0.0}, final_time=1.0, steps=20
    )
    solution = dmoc.solve(problem, "ipm")
    figure = solution.plot(tmp_path / "b.pdf")
    assert [a.get_ylabel() for a in figure.axes] == ["", "$x$", "$p_{x}$", "input $u$"]
    (snapshots,) = (a for a in figure.axes if a.get_title())
    assert snapshots.get_title() == "0 to 1 s" and not snapshots.axison
    assert [t.get_text() for t in snapshots.texts] == ["$x$"]
    assert (tmp_path / "b.pdf").read_bytes().startswith(b"%PDF-")
    with pytest.raises(OutputError, match="no known format"):
        solution.plot(tmp_path / "b.xyz")
    assert [p.name for p in tmp_path.iterdir()] == ["b.pdf"]


def test_what_is_zero_but_for_rounding_has_an_axis_of_its_own_size(
    solution: dmoc.Solution,
) -> None:
    """An idle input, a conserved momentum of zero and a coordinate at rest, each with noise of
    1e-13 of what moves; what is merely small is drawn as it is."""
    noise = np.random.default_rng(1)

    def still(phase: Phase) -> Phase:
        def beside(values: np.ndarray, size: float) -> np.ndarray:
            small = size * noise.uniform(-1, 1, len(values))
            return np.column_stack([values[:, 0], small])

        return replace(
            phase, q=beside(phase.q, 1e-17), v=beside(phase.v, 1e-13), p=beside(phase.p, 1e-13),
            u=1e-13 * noise.uniform(-1, 1, phase.u.shape),
        )  # fmt: skip

    figure = drawn(solution, phases=tuple(map(still, solution.phases)))
    for label in ("$x$ [m]", "$p_{x}$ [N s]", "input $F$ [N]"):
        low, high = labelled(figure, label).get_ylim()
        assert low < 0 < high and high - low > 0.01
        assert not any(values[:, 1].any() for values in curves(labelled(figure, label)))
    small = drawn(
        solution, phases=tuple(replace(p, u=1e-6 * p.u, q=1e-9 * p.q) for p in solution.phases)
    )
    for label, values in (
        ("input $F$ [N]", np.concatenate([p.u[:, 0] for p in solution.phases]) * 1e-6),
        ("$x$ [m]", np.concatenate([p.q[:, 1] for p in solution.phases]) * 1e-9),
    ):
        low, high = labelled(small, label).get_ylim()
        assert high - low < 1.5 * np.ptp(values)


@pytest.fixture(scope="module")
def masses(block: Kernels) -> dmoc.Batch:
    problem = dmoc.Problem(block, start={"x": 0.0}, steps=3, final_time=1.0)
    return dmoc.sweep(problem, {"m": [1.0, 2.0]}, method="ipm", verify=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "units", [("$", "US$"), (r"\$", "$x"), ("$x$", "$x_$"), ("a$b$c$", "m")], ids=" and ".join
)
def test_a_dollar_in_a_unit_or_a_column_is_a_dollar(
    tmp_path: Path, masses: dmoc.Batch, units: tuple[str, str]
) -> None:
    system = block_system("priced")
    named = dict(zip((*system.coordinates, *system.inputs), units, strict=True))
    kernels = dmoc.build(replace(system, units=named), backend="numpy")
    motion = dmoc.simulate(kernels, {"x": 0.0}, {"x": 0.5}, step_size=0.1, steps=4)
    figure = motion.plot(tmp_path / "motion.png", velocities=True)
    labels = [axes.get_ylabel() for axes in figure.axes]
    dmoc.animate(motion, tmp_path / "motion.gif", fps=2)
    for unit in units:
        ending = f"[{unit.replace('$', chr(92) + '$')}]"
        assert any(label.endswith(ending) for label in labels)
        foreign = replace(masses, varied={unit: masses.varied["m"]})  # as a file may have it
        foreign.plot(tmp_path / "sweep.png")


def test_what_is_small_and_no_rounding_error_is_drawn(solution: dmoc.Solution) -> None:
    """A coordinate whose velocity times momentum is 1e-16 of the motion's: both are 1e-8 of those
    of the first one, far above rounding errors of 1e-13."""

    def little(phase: Phase) -> Phase:
        return replace(phase, **{name: getattr(phase, name)[:, :1] * [1.0, 1e-8] for name in "qvp"})

    figure = drawn(solution, phases=tuple(map(little, solution.phases)))
    drawn_v = [phase.q[:, 0] * 1e-8 for phase in solution.phases]
    lines = curves(labelled(figure, "$x$ [m]"))
    assert np.ptp(np.concatenate([v[:, 1] for v in lines])) == pytest.approx(
        np.ptp(np.concatenate(drawn_v)), rel=1e-6
    )
