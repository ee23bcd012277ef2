"""What is told in a frame of a film, where and for how long."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from films import TURN, motion
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dmoc.report.animation.page import film_room
from dmoc.report.animation.stage import _banner_text, stage_of
from dmoc.report.film import Take
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
