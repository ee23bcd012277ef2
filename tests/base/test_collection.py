"""Work during which nobody looks for unreachable cycles."""

from __future__ import annotations

import gc

import pytest

from dmoc.base.collection import uncollected


def test_the_collector_is_as_before_also_after_errors() -> None:
    with uncollected():
        assert not gc.isenabled()
        with uncollected():
            pass
        assert not gc.isenabled()
    assert gc.isenabled()
    with pytest.raises(ValueError, match="wrong"), uncollected():
        raise ValueError("wrong")
    assert gc.isenabled()
