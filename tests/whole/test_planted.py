"""Errors of every kind, planted in true motions, are refused by the check."""

from __future__ import annotations

import numpy as np
import pytest
from planted_errors import KINDS, TrueMotion
from planted_motions import true_motions

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

pytestmark = pytest.mark.slow

Motions = dict[str, tuple[Trajectory, Kernels]]
# The system that feels each kind.
PLACES = dict.fromkeys(KINDS, "ball") | {
    "friction": "block", "scaled": "block", "drift": "block", "cone": "wheel",
}  # fmt: skip


@pytest.fixture(scope="module")
def motions() -> Motions:
    names = ("ball", "block", "rimless wheel")
    return {name.split()[-1]: (motion, kernels) for name, motion, kernels in true_motions(names)}


@pytest.mark.parametrize("kind", KINDS)
def test_a_planted_error_is_refused(motions: Motions, kind: str) -> None:
    """A tenth of what is changed, or of the range."""
    motion, kernels = motions[PLACES[kind]]
    wrong = KINDS[kind](TrueMotion(motion, kernels, 0.1, np.random.default_rng(3)))
    assert wrong is not None and dmoc.verify(motion, kernels).passed
    check = dmoc.verify(wrong, kernels)
    assert not check.passed and check.message


@pytest.mark.parametrize("size", [0.03, 0.1])
def test_a_post_between_two_nodes_is_seen_by_its_own_size(motions: Motions, size: float) -> None:
    """Its gap r^2 - d^2 is tiny beside what the motion makes of it far away."""
    motion, kernels = motions["ball"]
    wrong = KINDS["wall"](TrueMotion(motion, kernels, size, np.random.default_rng(3)))
    assert wrong is not None
    check = dmoc.verify(wrong, kernels)
    assert not check.passed
    assert "'post'" in check.message or "penetration" in check.message


@pytest.mark.parametrize(("name", "kind", "size"), [
    ("ball", "late", 0.03), ("ball", "scaled", 0.1), ("wheel", "late", 0.03),
])  # fmt: skip
def test_small_errors_that_add_up_over_a_phase_are_refused(
    motions: Motions, name: str, kind: str, size: float
) -> None:
    """No tenth of the phase is off by 1 %."""
    motion, kernels = motions[name]
    wrong = KINDS[kind](TrueMotion(motion, kernels, size, np.random.default_rng([1, 1, 0])))
    assert wrong is not None
    check = dmoc.verify(wrong, kernels)
    assert check.max_segment_defect < 0.01 and check.message.startswith("phase error")
    assert dmoc.verify(motion, kernels).phase_error < 0.01
