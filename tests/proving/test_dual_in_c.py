"""Bounds of the dual over a box in C, beside the dual in exact fractions at durations in it."""

from __future__ import annotations

import ctypes
import itertools
import math
import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from c_objects import C11
from exact_dual import DOUBLES, Priced, RandomProblem, least

from dmoc.codegen.kernels import Array

HERE, ROOT = Path(__file__).parent, Path(__file__).resolve().parents[2]
SOURCES = """box centre costates convex dual ends line_systems phase point shifts small step_map
    steps_cache times violated""".split()
CENTRE = np.array([0.625, 0.5])
TERMS = [key for d in range(4) for key in itertools.combinations_with_replacement(range(2), d)]

# Places in a box, from -1 to 1, the last ones where the sum is bounded.
SHARES = [(0, 0), (1, 1), (-1, -1), (1, -0.75), (-0.75, 1), (1, -0.25), (-0.75, 0.25), (-1, 1)]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    target = tmp_path_factory.mktemp("dual") / "dual.so"
    sources = [HERE / "dual_of_a_box.c", *(ROOT / "proving" / f"{name}.c" for name in SOURCES)]
    command = ["gcc", *C11, "-O0", "-ffp-contract=off", "-fPIC", "-shared", f"-I{ROOT / 'proving'}"]
    subprocess.run([*command, *sources, "-o", target, "-lm"], check=True)
    return ctypes.CDLL(str(target))


def bounds(
    library: ctypes.CDLL, of: RandomProblem, box: Array, m: Array, slope: Array, total: Array
) -> Array:
    """What the engine says of a box (2, 2)."""
    struct, to = of.struct(), np.empty(15)
    low, high, m, slope, within = map(np.ascontiguousarray, (*box, m, slope, total))
    priced = (Priced * len(of.priced))(*(Priced(*one) for one in of.priced))
    arrays = (x.ctypes.data_as(DOUBLES) for x in (low, high, m, slope, within, to))
    assert not library.dual_of_a_box(ctypes.byref(struct), len(priced), priced, *arrays)
    return to


def without_price_of_start(of: RandomProblem, m: Array) -> Array:
    """Multipliers at which the share of the start costs next to nothing in the middle."""
    none, one = (np.append(first, m[1:]) for first in (0.0, 1.0))
    rest = of.price_of_start(none)
    return np.append(-round(64 * rest / (of.price_of_start(one) - rest)) / 64, m[1:])


def followed(m: Array, slope: Array, away: Array) -> list[Fraction]:
    """Multipliers at distances from the middle."""
    rows = zip(m.tolist(), slope.T.tolist(), strict=True)
    far = [Fraction(x) for x in away.tolist()]
    return [
        Fraction(a) + sum(Fraction(s) * d for s, d in zip(by, far, strict=True)) for a, by in rows
    ]


@pytest.mark.parametrize(("bounded", "flat"), [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize("width", [2.0**-30, 2.0**-7, 2.0**-3])
def test_bounds_are_below_the_dual(
    library: ctypes.CDLL, bounded: bool, flat: bool, width: float
) -> None:
    for seed, fixed in ((0, False), (1, True)):
        of, rng = RandomProblem(seed, bounded, flat), np.random.default_rng(seed)
        box = CENTRE + width * np.array([[-1], [1]])
        total = CENTRE.sum() + width * np.array([0.25, 0.25] if fixed else [-0.5, 0.75])
        m, slope = rng.integers(-64, 64, of.count) / 64, rng.integers(-64, 64, (2, of.count)) / 64
        if fixed:  # few inputs are far from their bounds
            m = without_price_of_start(of, m / 4)
        to = bounds(library, of, box, m, slope, total)
        for share in SHARES if width > 1e-6 else SHARES[:2]:
            t = [Fraction(float(a + width * b)) for a, b in zip(CENTRE, share, strict=True)]
            prices = followed(m, slope, width * np.array(share))
            exact, size = of.dual(t, prices), 1 + abs(to[0])
            x = [Fraction(b) for b in share]
            terms = zip(map(Fraction, to[:10].tolist()), TERMS, strict=True)
            polynomial = sum(c * math.prod(x[i] for i in key) for c, key in terms)
            assert polynomial - Fraction(to[10]) <= exact
            assert to[11] <= exact
            if total[0] <= sum(t) <= total[1]:
                assert to[12] <= exact
            if width < 1e-6:  # larger boxes have chords of what bends at a bound
                assert exact <= polynomial + Fraction(to[10]) + Fraction(1e-7 * size)
            assert to[13] <= of.dual(t, [Fraction(a) for a in m.tolist()])
            if not any(share) and not flat:
                assert abs(to[14] - exact) < 1e-6 * size


@pytest.mark.parametrize("fixed", [False, True])
def test_curvature_bounds_polynomials(library: ctypes.CDLL, fixed: bool) -> None:
    """Of any curvature; where a sum is fixed, only along it."""
    library.least_by_curvature.restype = ctypes.c_double
    rng, near = np.random.default_rng(0), 0
    for _ in range(300):
        far = rng.uniform(0.1, 1, 2)
        c = rng.normal(size=10) * np.repeat([1, 1, 0.5, 0.1], [1, 2, 3, 4])
        c[[3, 5]] += rng.uniform(-0.5, 2)
        total = np.sort(rng.uniform(-1, 1, 2)) * far.sum()
        total[0] = total[1] if fixed else total[0]
        arrays = [x.ctypes.data_as(DOUBLES) for x in (far, c, total)]
        rest = ctypes.c_double(1e-3)
        bound = library.least_by_curvature(*arrays[:2], rest, arrays[2])
        x = np.stack(np.meshgrid(*[np.linspace(-1, 1, 81)] * 2)).reshape(2, -1)
        if fixed:
            x[1] = (total[0] - far[0] * x[0]) / far[1]
        sums = far @ x
        x = x[:, (np.abs(x) <= 1).all(axis=0) & (fixed | (total[0] <= sums) & (sums <= total[1]))]
        if not x.size:
            continue
        values = sum(a * np.prod(x[list(key)], axis=0) for a, key in zip(c, TERMS, strict=True))
        assert bound <= values.min() - 1e-3 + 1e-12
        near += values.min() - bound < 0.05
    assert near > 20


def test_choices_of_inputs_bound_a_phase(library: ctypes.CDLL) -> None:
    """Whatever inputs are at their bounds at first: for all prices of the state at the end."""
    rng = np.random.default_rng(0)
    for seed in range(150):
        of = RandomProblem(seed, True, seed % 2 == 1)
        phase, h = of.phases[0], 0.25
        struct, d, count = of.struct().phase[0], 3, 4
        begin, kinds = of.middle, rng.integers(0, 3, count).astype(np.uint8)
        kinds[1::2] = np.maximum(kinds[1::2], seed % 2)  # what costs nothing is at a bound
        middle, width = rng.uniform(-3, 3, (d, 1)), rng.choice([0.0, 0.5, 2.0])
        costate = np.ascontiguousarray(middle + width * np.array([-1, 1]))
        costate[-1] = 1
        made = [np.empty(size) for size in (d, (d, d), d, (count, d))]
        assert not library.phase_of_costates(
            ctypes.byref(struct), ctypes.c_double(0.5), begin.ctypes.data_as(DOUBLES),
            kinds.ctypes.data_as(ctypes.c_void_p), costate.ctypes.data_as(DOUBLES),
            *(x.ctypes.data_as(DOUBLES) for x in made),
        )  # fmt: skip
        linear, square, without, response = made
        for share in (0.0, 1.0, *rng.random((6, d))):
            L = costate[:, 0] + share * (costate[:, 1] - costate[:, 0])
            y = (response @ L).tolist()
            exact = without @ L + float(sum(least(phase, h, y[k : k + 2]) for k in (0, 2)))
            assert linear @ L - L @ square @ L / 2 <= exact + 1e-9
