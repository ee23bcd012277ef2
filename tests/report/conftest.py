"""Figures that are laid out as those of users are."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from matplotlib.layout_engine import ConstrainedLayoutEngine


@pytest.fixture(autouse=True)
def laid_out(coarse_figures: Callable[..., None], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", coarse_figures)
