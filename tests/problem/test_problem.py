"""What is kept of a problem of which something else is changed."""

from __future__ import annotations

import pickle

import dmoc


def test_a_problem_in_the_rates_stays_so(seed: dmoc.Problem) -> None:
    """Whatever is changed of it, and in another process; and it is no other problem."""
    stated = seed.in_rates()
    changed = (
        stated.but(steps=10),
        stated.meshed(10),
        stated.unchecked(steps=10),
        stated.in_rates(),
        pickle.loads(pickle.dumps(stated)),
    )
    assert all(problem.by_rates for problem in changed) and not seed.by_rates
    assert not seed.but(steps=10).by_rates and repr(stated) == repr(seed)
