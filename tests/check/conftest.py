"""Models whose motions are checked."""

from __future__ import annotations

import pytest
from flights import cube_system

import dmoc
from dmoc.codegen.kernels import Kernels


@pytest.fixture(scope="session")
def cube() -> Kernels:
    return dmoc.build(cube_system())
