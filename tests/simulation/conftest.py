"""Kernels of the motions in closed form."""

from __future__ import annotations

import motions
import pytest

import dmoc
from dmoc.codegen.kernels import Kernels


@pytest.fixture(scope="session")
def ball() -> Kernels:
    return dmoc.build(motions.ball_system())


@pytest.fixture(scope="session")
def compass() -> Kernels:
    return dmoc.build(motions.compass_system())


@pytest.fixture(scope="session")
def floor() -> Kernels:
    return dmoc.build(motions.floor_system())


@pytest.fixture(scope="session")
def rail() -> Kernels:
    return dmoc.build(motions.rail_system())
