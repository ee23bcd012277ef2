"""Programs share what their laws follow from with those of other problems, and are what each makes
alone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from every_constraint import ending, point, program_of
from systems import landing_system

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.problem.derived import MADE, like
from dmoc.program.scale import Scale
from dmoc.program.structure_cache import MEMORY
from dmoc.program.transcription import Transcription

# Forms, and how many of their neighbours share the laws of the first one.
QUICK = {"contacts, periodic": 10, "tangential": 4, "driven": 6, "relaxed": 0}
SLOW = {
    "contacts, slippery": 11, "joints, periodic": 10, "lift-off": 6, "kinked": 3,
    "balls, order 2": 5, "ending tangential": 4, "ending hits with friction, order 4": 5,
}  # fmt: skip
FORMS = [*QUICK.items(), *(pytest.param(*one, marks=pytest.mark.slow) for one in SLOW.items())]


def neighbours(base: dmoc.Problem) -> Iterator[dmoc.Problem]:
    """Problems with another number each: of the model, of both ends, of the time, of hits."""
    values = dict(zip(base.kernels.parameters, base.parameter_values[0].tolist(), strict=True))
    for name in sorted(values.keys() - {*base.design}):
        yield base.but(parameters={**base.parameters, name: 1.01 * values[name]})
    low, high = base.final_time_bounds
    yield base.but(final_time=1.1 * high if low == high else (low, 1.1 * high))
    for field in ("start", "goal"):
        stated = getattr(base, field)
        for name, value in stated.items():
            if isinstance(value, tuple) and None not in value:
                yield base.but(**{field: {**stated, name: (value[0], value[1] + 0.01)}})
    if base.kernels.surfaces and not np.isnan(base.restitution_values).any():
        yield base.but(restitution=0.25)


def fresh(problem: dmoc.Problem) -> dmoc.Problem:
    """The problem without what follows from it."""
    return like(problem, (MADE,))


def contents(nlp: Transcription, x: np.ndarray) -> tuple[list[Any], list[np.ndarray]]:
    """Names of the rows, their values, derivatives and sizes."""
    blocks = (*nlp.equalities, *nlp.inequalities)
    y, w = np.linspace(-1, 2, nlp.n_eq), np.linspace(-1, 1, nlp.n_in)
    matrices = (
        nlp.equality_jacobian(x), nlp.inequality_jacobian(x), nlp.lagrangian_hessian(x, y, w)
    )  # fmt: skip
    names = [(b.name, b.index.shape, [b.name_of(i) for i in range(b.count)]) for b in blocks]
    arrays = [b.index for b in blocks] + [m.toarray() for m in matrices]
    return names, [*arrays, nlp.values(x), nlp.row_sizes]


@pytest.mark.parametrize(("form", "count"), FORMS)
def test_programs_are_what_each_makes_alone(
    form: str, count: int, pendulum: Kernels, puck: Kernels
) -> None:
    """Laws are shared where fixed values settle the same rows, and a size of none is a number of
    its own."""
    stated = program_of(form.removeprefix("ending "), pendulum, puck)
    base = ending(stated.problem) if form.startswith("ending") else stated.problem
    shared = 0
    for problem in neighbours(base):
        MEMORY.clear()
        alone = Transcription(problem)
        x = point(alone, np.random.default_rng(7))
        names, arrays = contents(alone, x)
        MEMORY.clear()
        first = Transcription(fresh(base))
        assert first.structure
        nlp = Transcription(fresh(problem))
        shared += nlp.laws.remembered is first.laws.remembered
        mine, ours = contents(nlp, x)
        assert mine == names
        assert nlp.laws.breakaway.friction is nlp.laws.rolling.friction is nlp.laws.friction
        assert all(map(np.array_equal, ours, arrays))
    assert shared == count


def test_programs_of_one_problem_have_its_laws() -> None:
    """In other sizes they are found once, and those of other fixed values anew."""
    problem = dmoc.Problem(
        landing_system(), start={"x": 0.0, "y": 0.0}, contacts=["floor"], goal={"x": 0.5, "y": 0.0},
        steps=3, final_time=1.0,
    )  # fmt: skip
    MEMORY.clear()
    first = Transcription(problem)
    MEMORY.clear()
    scaled = Transcription(problem, Scale.none(problem))
    assert scaled.laws is first.laws
    assert Transcription(problem, pulling=True).laws is not first.laws
    assert Transcription(fresh(problem)).laws is not first.laws


def test_friction_of_none_has_rows_of_its_own(pendulum: Kernels, puck: Kernels) -> None:
    """Bounds say that what sticks without it holds nothing, and no cone."""
    base = program_of("contacts, periodic", pendulum, puck).problem
    smooth = base.but(parameters={**base.parameters, "mu": 0.0})
    MEMORY.clear()
    alone = Transcription(smooth)
    MEMORY.clear()
    rough, beside = Transcription(base), Transcription(fresh(smooth))
    assert rough.laws.friction.cone.count > beside.laws.friction.cone.count
    x = point(alone, np.random.default_rng(7))
    assert all(map(np.array_equal, contents(beside, x)[1], contents(alone, x)[1]))


def test_what_other_limits_settle_is_found_anew() -> None:
    """A goal that is a constraint fixes nothing, also of a problem in which it did."""
    problem = dmoc.Problem(
        landing_system(), start={"x": 0.0, "y": 0.0}, contacts=["floor"], goal={"x": 0.0, "y": 0.0},
        steps=3, final_time=1.0,
    )  # fmt: skip
    counts = [
        Transcription(problem, goal_as_rows=rows).laws.contact.closed.count
        for rows in (False, True, False)
    ]
    assert counts == [2, 3, 2]
