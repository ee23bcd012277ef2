"""Figures that are laid out as those of users are."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from matplotlib.figure import Figure


@pytest.fixture(autouse=True)
def laid_out(coarse_figures: Callable[..., object], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Figure, "get_layout_engine", coarse_figures)
