"""What is told in a frame of a film, where and for how long."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from films import TURN, motion
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dmoc.report.animation import stage
from dmoc.report.animation.page import film_room
from dmoc.report.animation.stage import _banner_text, _beside, _force, stage_of
from dmoc.report.film import Take
from dmoc.report.places import Room
from dmoc.report.style import LIGHT


def test_what_is_told_of_a_hit_stays_in_the_picture() -> None:
    figure = Figure((6.4, 3.0), dpi=100)
    canvas = FigureCanvasAgg(figure)
    take = Take("", motion("a wall whose name has more letters than there is room for"))
    draw = stage_of(figure.add_axes((0, 0, 1, 1)), take, film_room([take.scene]), LIGHT)
    draw(TURN + 0.01)
    (words,) = (t for t in figure.axes[0].texts if "impulse" in t.get_text() and t.get_visible())
    canvas.draw()
    extent = words.get_window_extent()
    assert extent.x0 >= 0 and extent.x1 <= 640


def test_the_name_of_a_force_stays_in_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """It stands beyond the tip of its arrow, and beside it where that is outside."""
    monkeypatch.setattr(stage, "phase_at", lambda *_: 0)
    monkeypatch.setattr(stage, "values_at", lambda _, t: np.array([0.5, t, 0.0, 1.0]))
    panel = SimpleNamespace(
        times=[np.array([0.0, 1.0])], curves=[SimpleNamespace(values=[np.ones(2)])]
    )
    shapes = [SimpleNamespace(start=0, size=4)]
    take: Any = SimpleNamespace(panels=[panel], scene=SimpleNamespace(shapes=shapes))
    axes = Figure().add_axes((0, 0, 1, 1))
    arrow = {"panel": 0, "curve": 0, "shape": 0, "kind": "N", "largest": 1.0}
    draw = _force(axes, take, arrow, Room(0.0, 1.0, 0.0, 1.0), LIGHT)  # type: ignore[arg-type]
    for height, place in ((0.5, (0.5, 0.775)), (0.75, (0.555, 0.97))):
        draw(height)
        assert axes.texts[0].get_position() == pytest.approx(place)


@pytest.mark.parametrize(
    ("time", "words"),
    [
        (-0.1, ""), (0.0, "opens"), (1.79, "opens"), (1.81, ""),  # for 0.18 of 10 s
        (3.9, ""), (4.0, "valve: 2 N s"), (4.9, "valve: 2 N s"),
        (5.0, "slips"), (6.79, "slips"), (6.81, ""), (8.0, ""), (9.9, ""),
    ],
)  # fmt: skip
def test_what_has_no_place_is_told_for_a_while_until_the_next(time: float, words: str) -> None:
    events = [
        {"time": 0.0, "word": "opens", "told": "", "marks": []},
        {"time": 4.0, "word": "valve", "told": "2 N s", "marks": []},
        {"time": 5.0, "word": "slips", "told": "", "marks": []},
        {"time": 8.0, "word": "wall", "told": "", "marks": [{}]},  # told where it is
    ]
    take: Any = SimpleNamespace(events=events, trajectory=SimpleNamespace(final_time=10.0))
    assert _banner_text(take, time) == words


@pytest.mark.parametrize(
    ("x", "normal", "width", "aside", "down"),
    [
        # In the middle of 200 points, 100 to both sides; a text of 40 reaches 20 to both.
        (5.0, (1, 0), 40, -12 - 20, 0), (5.0, (-1, 0), 40, 12 + 20, 0),
        (5.0, (0, 1), 40, 0, -16), (5.0, (0, -1), 40, 0, 16),
        (0.0, (0, 1), 40, 24, -16),  # at an edge, which it keeps 4 from
        (10.0, (0, 1), 40, -24, -16),
        (1.0, (1, 0), 40, 4, -24),  # pushed back by 36, over the mechanism: two lines below
        (9.0, (-1, 0), 40, -4, -24),
        (2.7, (1, 0), 40, -30, 0),  # pushed back by 2
        (5.0, (0, 1), 400, 0, -16),  # wider than the picture
    ],
)  # fmt: skip
def test_a_text_stands_beside_its_contact_within_the_picture(
    x: float, normal: tuple[float, float], width: float, aside: float, down: float
) -> None:
    figure = Figure((200 / 72, 100 / 72), dpi=100)
    axes, room = figure.add_axes((0, 0, 1, 1)), Room(0.0, 10.0, 0.0, 5.0)
    mark: Any = {"at": np.array([x, 1.0, *normal])}
    assert _beside(axes, mark, room, width) == pytest.approx((aside, down))
    shifted, room = {"at": np.array([x + 7.0, 1.0, *normal])}, Room(7.0, 17.0, 0.0, 5.0)
    beside: Any = shifted
    assert _beside(axes, beside, room, width) == pytest.approx((aside, down))
