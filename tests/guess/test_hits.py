"""First values within a hit with friction follow from the velocity before it, by hand: a ball of
1 kg, radius 0.1 m and k = 0.4, for which r/(k r^2) = 25."""

from __future__ import annotations

import numpy as np
import pytest
from hit_problems import back

from dmoc.guess.automatic import initial_guesses
from dmoc.program.hit_stages import END
from dmoc.program.layout import Layout

WORDS = (
    "slip+", "slip-", "stick", "slip+:stick", "slip+:stick:late", "slip+:slip-", "slip+:slip-:late",
    "slip-:slip+",
)  # fmt: skip


@pytest.mark.parametrize("word", WORDS)
def test_velocities_change_by_the_impulses_until_then(word: str) -> None:
    problem = back(sequence=[f"floor:{word}"])
    lay = Layout.of(problem)
    (passage,) = lay.hit.passages
    moments = list(passage.moments)
    for guess in initial_guesses(problem):
        x = guess.x
        before = x[lay.impact.v_a[0]]
        P, T = x[lay.hit.P_h[0, moments]], x[lay.hit.T_h[0, moments]]
        within = x[lay.hit.v_h[0, moments]]
        np.testing.assert_allclose(within - before, np.stack([T, P, 25 * T], axis=1), atol=1e-12)
        P, T = x[lay.impact.lam[0]], x[lay.contact.T_c[0, 0]]
        np.testing.assert_allclose(x[lay.impact.v_c[0]] - before, [T, P, 25 * T], atol=1e-12)
        assert x[lay.hit.P_h[0, END]] == pytest.approx(-before[1])  # compression takes it all
        assert pytest.approx(-1.8 * before[1]) == P
