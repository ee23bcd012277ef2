"""Figures of motions with contacts that last, by what they show: modes, forces, cones, impulses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drawn import drawn, labelled, legend, limits
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from systems import landing_problem

import dmoc
from dmoc.report.style import LIGHT

FLOOR = LIGHT.colours[0]


@pytest.fixture(scope="module")
def landed() -> dmoc.Solution:
    """The puck falls, lands sliding at 0.2 s with 2 N s, and sticks at last."""
    return dmoc.solve(landing_problem(), starts=1)


@pytest.fixture(scope="module")
def figure(landed: dmoc.Solution) -> Figure:
    return landed.plot()


def solid(axes: Axes) -> list[np.ndarray]:
    return [np.asarray(a.get_xydata()) for a in axes.lines if a.get_linestyle() == "-" and many(a)]


def many(line: object) -> bool:
    return len(line.get_xdata()) > 2  # type: ignore[attr-defined]


def marks(axes: Axes) -> dict[str, float]:
    """Texts of the impulses, and the times of their marks."""
    times = [float(np.asarray(a.get_xdata())[0]) for a in axes.lines if a.get_marker() == "v"]
    texts = [t.get_text() for t in axes.texts]
    return dict(zip(texts, times, strict=True))


def test_panels_of_forces_stand_below_those_of_every_motion(figure: Figure) -> None:
    below = ["mode", "coordinates", "momenta", "input $u$", "normal forces [N]", "friction [N]"]
    assert [a.get_ylabel() for a in figure.axes if a.get_ylabel()] == [*below[1:], "mode"]
    heights = [labelled(figure, label).get_position().y0 for label in below]
    assert heights == sorted(heights, reverse=True)


def test_modes_are_spans_of_their_phases_with_their_names(
    landed: dmoc.Solution, figure: Figure
) -> None:
    strip = labelled(figure, "mode")
    ends = [(p.t[0], p.t[-1]) for p in landed.phases]
    spans = [(p.get_x(), p.get_x() + p.get_width()) for p in strip.patches]  # type: ignore[attr-defined]
    np.testing.assert_allclose(spans, ends)
    names = {t.get_text(): t.get_position()[0] for t in strip.texts if type(t).__name__ == "Text"}
    assert names == pytest.approx(
        {p.mode: (p.t[0] + p.t[-1]) / 2 for p in landed.phases}, rel=1e-12
    )


def test_events_stand_over_the_modes_in_words(landed: dmoc.Solution, figure: Figure) -> None:
    strip = labelled(figure, "mode")
    words = {t.get_text(): t.xy[0] for t in strip.texts if isinstance(t, Annotation)}
    assert list(words) == ["+floor:slip+", "floor:stick"]
    assert [*words.values()] == pytest.approx([c.time for c in landed.collisions])


def test_forces_and_impulses_are_those_of_the_motion(landed: dmoc.Solution, figure: Figure) -> None:
    touching = landed.phases[1:]
    for label, force, impulse in (
        ("normal forces [N]", "normal", "2 N s"),
        ("friction [N]", "tangential", "\N{MINUS SIGN}0.2 N s"),
    ):
        axes = labelled(figure, label)
        wanted = [np.column_stack([p.t, getattr(p, force)[:, 0]]) for p in touching]
        # What is zero but for rounding is drawn as zero.
        np.testing.assert_allclose(np.concatenate(solid(axes)), np.concatenate(wanted), atol=1e-12)
        assert marks(axes) == {impulse: landed.collisions[0].time}
        low, high = axes.get_ylim()
        values = np.concatenate(wanted)[:, 1]
        # Room for the mark above the curves.
        assert low <= values.min() and values.max() < high - 0.1 * (high - low)
    assert legend(labelled(figure, "normal forces [N]")) == [r"$N_{\mathrm{floor}}$"]


def test_friction_stands_in_its_cone(landed: dmoc.Solution, figure: Figure) -> None:
    """mu N = 1 N on both sides, behind the curve and in its colour."""
    axes = labelled(figure, "friction [N]")
    assert {a.get_color() for a in limits(axes)} == {FLOOR}
    levels = [float(np.mean(np.asarray(a.get_ydata()))) for a in limits(axes)]
    assert levels == pytest.approx([1.0, -1.0] * 2, rel=1e-9)
    curve = next(a for a in axes.lines if a.get_linestyle() == "-" and many(a))
    assert all(a.get_zorder() < curve.get_zorder() for a in limits(axes))
    assert legend(axes) == [r"$T_{\mathrm{floor}}$", r"$\pm\mu N$"]


def test_a_far_cone_is_named_and_flattens_nothing(landed: dmoc.Solution) -> None:
    axes = labelled(drawn(landed, friction={"floor": 30.0}), "friction [N]")
    assert not limits(axes)
    assert legend(axes)[-1] == r"$\pm\mu N$ (floor: outside)"
    assert max(map(abs, axes.get_ylim())) < 2


@pytest.mark.slow
def test_what_a_contact_holds_still_has_no_axis_of_its_own(landed: dmoc.Solution) -> None:
    """Rounding errors would fill it."""
    noise = [1.0, 1e-17]
    phases = tuple(replace(p, q=p.q * noise) for p in landed.phases)
    figure = drawn(landed, phases=phases)
    assert legend(labelled(figure, "coordinates")) == ["$x$", "$y$"]


@pytest.mark.slow
def test_short_phases_are_named_in_a_legend_and_words_do_not_overlap(
    landed: dmoc.Solution,
) -> None:
    """Here the fall and the sliding take 1 % of the time each."""
    fall, slide, rest = landed.phases
    times = [np.linspace(*ends, 9) for ends in ((0.0, 0.015), (0.015, 0.03), (0.03, 1.5))]
    phases = tuple(replace(p, t=t) for p, t in zip((fall, slide, rest), times, strict=True))
    events = tuple(
        replace(c, time=float(t[0])) for c, t in zip(landed.collisions, times[1:], strict=True)
    )
    figure = drawn(landed, phases=phases, collisions=events)
    strip = labelled(figure, "mode")
    assert [t.get_text() for t in strip.texts if type(t).__name__ == "Text"] == ["floor:stick"]
    (below,) = figure.legends
    assert [t.get_text() for t in below.get_texts()] == ["free", "floor:slip+"]
    colours = [tuple(round(c, 6) for c in p.get_facecolor()) for p in strip.patches]
    assert colours == [
        tuple(round(c, 6) for c in to_rgba(c)) for c in (LIGHT.free, *LIGHT.tints[:2])
    ]
    figure.canvas.draw()
    words = [t.get_window_extent() for t in strip.texts if isinstance(t, Annotation)]
    assert len(words) == 2 and not words[0].overlaps(words[1])


@pytest.mark.slow
def test_legends_and_words_lie_within_the_figure(landed: dmoc.Solution) -> None:
    """Of many coordinates, too, whose legend stands beside the axes."""
    wide = tuple(f"coordinate_{i}" for i in range(7))
    phases = tuple(
        replace(p, **{name: getattr(p, name)[:, [0] * 7] for name in "qvp"}) for p in landed.phases
    )
    events = tuple(
        replace(
            c,
            time=1.499 - 0.001 * i,
            **{
                name: getattr(c, name)[[0] * 7]
                for name in ("position", "momentum_before", "momentum_after")
            },
        )
        for i, c in enumerate(landed.collisions)
    )
    free = np.full((7, 2), (-np.inf, np.inf))
    figure = drawn(
        landed, phases=phases, collisions=events, coordinates=wide, coordinate_bounds=free
    )
    figure.canvas.draw()
    boxes = [a.get_legend().get_window_extent() for a in figure.axes if a.get_legend()]
    boxes += [t.get_window_extent() for a in figure.axes for t in a.texts]
    assert len(boxes) >= 8
    for box in boxes:
        assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1
    coordinates = labelled(figure, "coordinates")
    key = coordinates.get_legend()
    assert key is not None and key.get_window_extent().x0 >= coordinates.bbox.x1
    styles = {(a.get_color(), str(a._unscaled_dash_pattern)) for a in coordinates.lines if many(a)}  # type: ignore[attr-defined]
    assert len(styles) == 7


def test_a_rail_has_a_limit_instead_of_a_cone(landed: dmoc.Solution) -> None:
    bare = np.zeros((9, 0))
    phases = tuple(
        replace(p, closed=(), normal=bare, rubbing={"rail": 1}, tangential=np.full((9, 1), -2.0))
        for p in landed.phases
    )
    events = tuple(replace(c, tractions={}) for c in landed.collisions)
    figure = drawn(landed, phases=phases, collisions=events, friction={"rail": 2.0})
    assert "normal forces [N]" not in [a.get_ylabel() for a in figure.axes]
    axes = labelled(figure, "friction [N]")
    assert legend(axes) == [r"$T_{\mathrm{rail}}$", r"$\pm F$"]
    assert {float(y) for a in limits(axes) for y in np.asarray(a.get_ydata())} == {2.0, -2.0}
    # What is hit and has no curve is named.
    assert marks(axes) == {"2 N s of floor": landed.collisions[0].time}
