"""Paths are as long as an operating system takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from dmoc.base.errors import OutputError
from dmoc.base.messages import path


def test_a_path_has_at_most_4096_bytes() -> None:
    """Also where letters take two each."""
    for longest in ("x" * 4096, "é" * 2048):
        assert path(longest) == Path(longest)
        with pytest.raises(OutputError, match="expected the path of a file"):
            path(longest + "x")
