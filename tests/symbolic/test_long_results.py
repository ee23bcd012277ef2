"""Long results: the shortest time of an arm's hand to a ball, and its derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.build import numpy_kernels
from dmoc.codegen.manifest import Manifest
from dmoc.codegen.operation_counts import count_of
from dmoc.codegen.text import manifest, numpy_text
from dmoc.symbolic.families import model_spec
from dmoc.symbolic.spec import ModelSpec


@pytest.fixture(scope="module")
def arm() -> ModelSpec:
    """Three hinges, and a ball beside the hand: its shortest times."""
    q1, q2, q3 = dynamicsymbols("q1:4")
    world = dmoc.spatial.World()
    body = world.hinge(q1, "z", tip=(0.1, 0.2, 0.5))
    body = body.hinge(q2, "y", tip=(0.4, 0.1, 0))
    x, y, z = body.hinge(q3, "x", tip=(0.3, 0, 0.1), mass=1).tip
    gap = 1 - (x - 1) ** 2 - (y - 0.5) ** 2 - (z - 0.2) ** 2
    model = model_spec(world.system("arm", surfaces={"ball": gap <= 0}, cost=1))
    return replace(model, kernels=tuple(k for k in model.kernels if "min_time" in k.name))


def test_a_gradient_takes_a_few_times_the_operations_of_its_value(arm: ModelSpec) -> None:
    """At most five times them (Griewank & Walther, "Evaluating Derivatives", 2008, section 4.6),
    here 3.2; differentiated symbol by symbol 3.6, and more the more symbols there are."""
    counts = {k.name: count_of(k).operations for k in arm.kernels}
    assert counts["min_time"] > 300
    assert counts["min_time_jac"] < 3.4 * counts["min_time"]


def test_a_gradient_from_the_end_has_the_slopes_of_differences(arm: ModelSpec) -> None:
    kernels = numpy_kernels(Manifest.read(manifest(arm)), numpy_text(arm))
    facts = kernels.manifest.kernels["min_time_jac"]
    sizes = [size for _, size in facts["inputs"]]
    rng = np.random.default_rng(2)
    at = rng.uniform(0.1, 0.6, sum(sizes))
    ends = np.cumsum(sizes)[:-1]

    def time(x: np.ndarray) -> float:
        return float(kernels.call("min_time", *(p[None] for p in np.split(x, ends)))[0][0, 0])

    slopes = np.zeros(facts["outputs"][0]["shape"][1])
    (values,) = kernels.call("min_time_jac", *(p[None] for p in np.split(at, ends)))
    slopes[list(facts["outputs"][0]["columns"])] = values[0]
    steps = 1e-5 * np.eye(len(at))[: len(slopes)]
    differences = [(time(at + step) - time(at - step)) / 2e-5 for step in steps]
    assert np.isfinite(slopes).all() and abs(slopes).max() > 0.1
    np.testing.assert_allclose(slopes, differences, rtol=1e-6, atol=1e-8)
