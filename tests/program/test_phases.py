"""Programs of parameters with a value for each phase: whose values rows have, and derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from every_constraint import (
    differences,
    driven_problem,
    ending,
    force_problem,
    hit_problem,
    point,
)

import dmoc
from dmoc.program.transcription import Transcription


def by_phase(problem: dmoc.Problem, name: str) -> tuple[dmoc.Problem, list[dmoc.Problem]]:
    """A problem with other values of a parameter in each phase, and with each of these in all."""
    value = problem.models.values[name]
    values = [float(value) * (1 + 0.2 * i) for i in range(problem.phases)]
    stated = dict(problem.parameters)
    return (
        problem.unchecked(parameters={**stated, name: values}),
        [problem.in_rates().unchecked(parameters={**stated, name: x}) for x in values],
    )


def places(nlp: Transcription) -> dict[int, int]:
    """The phase of each row whose place its block says."""
    lay, found = nlp.layout, dict[int, int]()
    step, events = lay.phase_of_step, np.arange(lay.phases - 1)
    nodes = np.append(step, lay.phases - 1)
    nodes[lay.collision_nodes] = -1
    laws, nq = nlp.laws, lay.nq
    for block, phases in (
        (laws.step.momentum, nodes), (laws.step.inside, step), (laws.impact.arrival, events),
        (laws.impact.departure, events + 1), (laws.ends.start_velocity, [0] * nq),
        (laws.ends.goal_velocity, [lay.phases - 1] * nq),
        *([(laws.hit.within, events)] if lay.hit.passages else []),
        *([(laws.force.along, step[lay.force.step])] if lay.force.count else []),
    ):  # fmt: skip
        for row, at in zip(block.index, phases, strict=False):
            rows = np.ravel(row)
            found |= {int(r): int(at) for r in rows[rows >= 0] if at >= 0}
    return found


PROBLEMS = {
    "driven": lambda: (driven_problem(2), "m"),
    "driven, order 4": lambda: (driven_problem(4), "m"),
    "hits": lambda: (hit_problem(2), "m"),
    "forces": lambda: (force_problem(2, "linear"), "m"),
    "ending": lambda: (ending(driven_problem(2)), "m"),
}


MORE = "driven, order 4", "forces", "ending"


@pytest.fixture(
    scope="module",
    params=["driven", "hits", *(pytest.param(p, marks=pytest.mark.slow) for p in MORE)],
)
def stated(request: pytest.FixtureRequest) -> tuple[dmoc.Problem, list[dmoc.Problem]]:
    return by_phase(*PROBLEMS[request.param]())


def test_rows_have_the_values_of_their_phase(
    stated: tuple[dmoc.Problem, list[dmoc.Problem]],
) -> None:
    """Each row is that of the problem with the values of its phase; at events, the momentum has
    what the change of values makes of it beside those of both steps."""
    several, each = stated
    nlp = Transcription(several)
    x = point(nlp, np.random.default_rng(2))
    own, others = nlp.values(x)[1:], np.array([Transcription(p).values(x)[1:] for p in each])
    phases, differ = places(nlp), np.ptp(others, axis=0) > 1e-12 * np.abs(others).max(axis=0)
    rows = [r for r in phases if differ[r]]
    assert {phases[r] for r in rows} == set(range(several.phases))
    for row in rows:
        assert own[row] == pytest.approx(others[phases[row], row], rel=1e-12), row
    lay, momentum = nlp.layout, nlp.laws.step.momentum.index
    step = [np.array(part) for part in lay.step_inputs(x)]
    for i, k in enumerate(lay.collision_nodes):
        q, v, t = x[lay.index_q[k]], x[lay.impact.v_c[i]], lay.times(x)[k]
        before, after = each[i].model, each[min(i + 1, len(each) - 1)].model
        change = after.momentum(q, v, t) - before.momentum(q, v, t)
        expected = others[i, momentum[k]] + change
        if k < lay.total:
            starts = [m.step_momenta([a[[k]] for a in step])[0][0] for m in (after, before)]
            expected -= starts[0] - starts[1]
        np.testing.assert_allclose(own[momentum[k]], expected, rtol=1e-10, atol=1e-10)


def test_derivatives_are_those_of_the_values(
    stated: tuple[dmoc.Problem, list[dmoc.Problem]],
) -> None:
    nlp = Transcription(stated[0])
    x = point(nlp, np.random.default_rng(3))
    J, D = nlp.equality_jacobian(x).toarray(), differences(nlp.equality, x)
    np.testing.assert_allclose(J, D, atol=1e-6 * np.abs(J).max())
    y = np.random.default_rng(4).normal(size=nlp.n_eq)
    w = np.zeros(nlp.n_in)
    upper = nlp.lagrangian_hessian(x, y, w).toarray()
    whole = upper + np.triu(upper, 1).T
    slopes = differences(lambda z: nlp.lagrangian_gradient(z, y, w).copy(), x)
    np.testing.assert_allclose(whole, slopes, atol=1e-6 * np.abs(whole).max())
