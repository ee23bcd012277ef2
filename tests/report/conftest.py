"""Figures that are laid out as those of users are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from matplotlib.axis import Axis
from matplotlib.figure import Figure


@pytest.fixture(autouse=True)
def laid_out(
    coarse_figures: tuple[Callable[..., Any], Callable[..., Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    layout, drawn = coarse_figures
    monkeypatch.setattr(Figure, "get_layout_engine", layout)
    monkeypatch.setattr(Axis, "draw", drawn)
