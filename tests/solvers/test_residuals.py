"""Multipliers and gaps of points of a program whose slopes are known."""

from __future__ import annotations

import numpy as np
import pytest
from systems import double_integrator

from dmoc.guess.automatic import initial_guesses
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription
from dmoc.solvers import slsqp_runs
from dmoc.solvers.compiled import left_over, missed_by
from dmoc.solvers.kkt import duality_gap, with_bounds
from dmoc.solvers.outcome import Duals


def program(**fields: object) -> Transcription:
    problem = double_integrator(4).but(**fields)
    return Transcription(problem, scale_of(problem, initial_guesses(problem)[0].x))


@pytest.mark.parametrize(
    ("bounds", "u", "active"),
    [((2, 5), 2, True), ((2, 5), 5, False), ((-5, -2), -2, True), ((-5, -2), -5, False)],
)
def test_a_bound_holds_what_would_cost_less_beyond_it(
    bounds: tuple[float, float], u: float, active: bool
) -> None:
    """int u^2 has the slope 2 h u in the input of a step."""
    nlp = program(bounds={"u": bounds}, controls="constant")
    y, at = np.zeros(nlp.n), nlp.layout.index_u[:, 0]
    y[nlp.layout.index_h], y[at] = 0.25, u
    duals = with_bounds(nlp, nlp.scaled(y), np.zeros(nlp.n_eq), np.zeros(nlp.n_in))
    slope = 2 * 0.25 * u * nlp.sizes[at] / nlp.scale.cost
    assert duals.z[at] == pytest.approx(slope if active else 0.0, rel=1e-9)


def test_the_gap_has_what_holds_in_it() -> None:
    """Products of distances and multipliers, in units of the cost; a multiplier below its distance
    is what a barrier leaves of what holds nothing."""
    nlp = program(bounds={"u": (-3, 5)}, final_time=(0.5, 2.0), controls="constant")
    y, at = np.zeros(nlp.n), nlp.layout.index_u[:, 0]
    y[nlp.layout.index_h], y[at] = 0.25, 1.0
    x, no_y, no_w = nlp.scaled(y), np.zeros(nlp.n_eq), np.zeros(nlp.n_in)
    away, z = 4 / nlp.sizes[at[0]], np.zeros(nlp.n)
    z[at[:4]] = 1.1 * away, -1.2 * away, 0.9 * away, -0.9 * away
    bounds = nlp.scale.cost * 2.3 * away**2
    assert duality_gap(nlp, x, Duals(no_y, no_w, z)) == pytest.approx(bounds, rel=1e-9)
    d = np.abs(nlp.inequality(x))
    for share, counted in ((0.9, 0.0), (1.1, 1.1)):
        rows = counted * nlp.scale.cost * float((d**2).sum())
        gap = duality_gap(nlp, x, Duals(no_y, share * d, z))
        assert gap == pytest.approx(bounds + rows, rel=1e-9)
    assert d.min() > 0


def test_what_is_left_over_is_the_largest_of_all_parts() -> None:
    """Beside the same in arrays: slopes by reach, products of distances, the mean multiplier and
    the violation; fixed unknowns have neither slope nor multiplier."""
    rng, n, eq, rows = np.random.default_rng(5), 9, 4, 5
    for _ in range(200):
        slope, reach, x, c, y, d, w, z = (
            rng.normal(size=k) * rng.integers(0, 2, k) for k in (n, n, n, eq, eq, rows, rows, n)
        )
        c, d = (part * 10.0 ** rng.integers(-4, 1) for part in (c, d))  # any of them is largest
        lower, upper = x - rng.uniform(-0.1, 1, n), x + rng.uniform(-0.1, 1, n)
        lower[0], upper[1], upper[2] = -np.inf, np.inf, lower[2]
        z[0], z[1] = min(z[0], 0.0), max(z[1], 0.0)
        upper = np.maximum(lower, upper)
        free = lower < upper
        own = np.where(free, z, 0.0)
        with np.errstate(invalid="ignore"):
            distance = np.where(own > 0, x - lower, np.where(own < 0, upper - x, 0.0))
        parts = np.where(free, reach * (slope - own), 0.0), own * distance, w * d
        mean = np.abs(np.concatenate([y, w, own])).mean()
        missed = np.concatenate([np.abs(c), -d, lower - x, x - upper, [0.0]]).max()
        wanted = max(np.abs(p).max() for p in parts), mean
        values = slope, np.abs(reach), x, lower, upper, z, c, y, d, w
        assert left_over(*values) == pytest.approx(wanted, rel=1e-12)
        assert missed_by(x, lower, upper, c, d) == pytest.approx(missed, rel=1e-12)
        for which, place in ((0, 0), (7, 1), (8, 1)):
            bad = [v.copy() for v in values]
            bad[which][place] = np.nan
            assert left_over(*bad)[0] == np.inf
        for which in (2, 6, 8):
            bad = [v.copy() for v in values]
            bad[which][1] = np.nan
            assert missed_by(*bad[2:5], bad[6], bad[8]) == np.inf
    with pytest.raises(ValueError, match="expected multipliers of 4 equations"):
        left_over(*values[:7], np.zeros(3), d, w)
    with pytest.raises(ValueError, match="expected numbers of 9 unknowns"):
        left_over(slope[:8], *values[1:])
    with pytest.raises(ValueError, match="expected bounds of 9 unknowns"):
        missed_by(x, lower, upper[:8], c, d)


def test_least_squares_are_for_what_is_singular_or_not_square(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A regular matrix is solved; of a singular one and of a wide one the shortest is taken."""
    A, b = np.array([[2.0, 1.0], [0.0, 4.0]]), np.array([4.0, 8.0])
    singular, wide = np.array([[1.0, 1.0], [1.0, 1.0]]), np.array([[1.0, 1.0]])
    np.testing.assert_allclose(slsqp_runs.solve_linear(singular, np.array([2.0, 2.0])), [1.0, 1.0])
    np.testing.assert_allclose(slsqp_runs.solve_linear(wide, np.array([2.0])), [1.0, 1.0])
    monkeypatch.setattr(slsqp_runs, "least_squares", None)
    np.testing.assert_allclose(slsqp_runs.solve_linear(A, b), [1.0, 2.0])
