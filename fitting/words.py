"""The word of a run, where nobody says it: hits that measured gaps show, those that the laws say,
and words with one event more or less."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from dmoc.base.errors import DmocError, FitError
from dmoc.codegen.kernels import Array
from dmoc.fitting.estimation import FITS, Estimate, check_enough, first_fit
from dmoc.fitting.experiment import Experiment
from dmoc.fitting.noise import first_sigma
from dmoc.fitting.regression import Regression
from dmoc.fitting.windows import hits_of_word, measured_gaps, peaks
from dmoc.mechanics.sequence_words import mode_of, touch_along
from dmoc.mechanics.touch import Touch
from dmoc.problem.problem import Problem

# Gaps, as shares of their range, by which hits are seen in what is measured; how near to zero.
SEEN, NEAR = (0.1, 0.03), (0.15, 0.4)
TRIED = 40  # iterations of a word
# By how much a word is worse whose events do not all happen, or whose motion passes a surface.
FAR = 1e6
MOST_CHANGES = 3  # events that are changed one after the other
# A word is another one's better where its mean squares are so much less.
BETTER = 0.9
LONGEST = 12  # words of events that are looked for


def touch_of_words(problem: Problem, words: Sequence[str]) -> Touch:
    """The modes and events of a word in the problem's contacts."""
    contacts = problem.touch.contacts
    try:
        touch = touch_along(mode_of(problem.contacts, contacts), words, contacts)
    except DmocError as error:
        raise FitError(str(error)) from None
    grips = {*contacts.of_grips}
    for word, event in zip(words, touch.events, strict=True):
        if grips & {*event.lands, *event.leaves}:
            raise FitError(
                f"{word!r} in the sequence is a grip, which closes and opens when a plan says, and "
                "a fit follows events that states bring about: cut the run there, with what is "
                "closed in contacts."
            )
    return touch


def with_words(e: Experiment, words: Sequence[str]) -> Experiment:
    return replace(e, touch=touch_of_words(e.problem, words))


def best_words(
    regression: Regression, i: int, changes: int = MOST_CHANGES
) -> tuple[Experiment, float]:
    """The experiment with the word that fits its run best, and its mean square in standard
    deviations; ``changes`` are how many events are changed, one after the other, where the words
    that are seen do not fit."""
    alone = regression.alone(i)
    check_enough(alone)
    e, sigma = alone.experiments[0], first_sigma(alone)
    tried: dict[tuple[str, ...], float] = {}

    def tell(words: tuple[str, ...]) -> float:
        if words not in tried:
            tried[words] = np.inf
            with suppress(DmocError):
                one = replace(alone, experiments=(with_words(e, words),))
                x, _ = first_fit(one, sigma, TRIED)
                tried[words] = one.square(x, sigma) * (1.0 if _reaches(one, x) else FAR)
        return tried[words]

    best = _best(_first(e, alone.first), tell)
    for _ in range(changes):
        if tell(best) <= FITS:
            break
        other = _best((best, *_changed(e, best, alone.first)), tell)
        if not tell(other) < BETTER * tell(best):
            break
        best = other
    return with_words(e, best), tell(best)


def _best(
    words: Iterable[tuple[str, ...]], tell: Callable[[tuple[str, ...]], float]
) -> tuple[str, ...]:
    """The word that fits best, the first one that fits."""
    best: tuple[str, ...] | None = None
    for word in words:
        best = word if best is None or tell(word) < tell(best) else best
        if tell(best) <= FITS:
            break
    return best or ()


def _reaches(regression: Regression, x: Array) -> bool:
    """Whether all events happen in the time of the run, and no surface is passed."""
    made = regression.predict(x)
    if made is None:
        return False
    course, run = made[0].course, regression.experiments[0].run
    return course.whole and bool((course.events <= run.end).all()) and not passed(regression, x)


def passed(regression: Regression, x: Array) -> list[tuple[str, str, float]]:
    """Surfaces that motions pass without a word: the run, the surface, and when."""
    made, found = regression.predict(x), list[tuple[str, str, float]]()
    for e, own in zip(regression.experiments, made or (), strict=True):
        ignored = set(e.problem.ignored)
        nq, course = e.problem.nq, own.course
        last = int(np.searchsorted(course.mesh.t, e.run.end, side="right"))
        for arc in course.arcs:
            gaps = course.laws.model.barriers(np.ascontiguousarray(arc.y[:, :nq]), arc.t)
            size = np.abs(np.where(np.isfinite(gaps), gaps, 0.0)).max(axis=0) + 1e-300
            for j, name in enumerate(e.problem.kernels.surfaces):
                over = gaps[:, j] > 1e-3 * size[j]
                over &= arc.t <= course.mesh.t[min(last, len(course.mesh.t) - 1)]
                holds = name not in ignored and not course.laws.model.contacts.pull[j]
                if holds and j not in arc.mode.closed and over.any():
                    found.append((e.run.name, name, float(arc.t[int(np.argmax(over))])))
    return found


def in_order(made: Estimate) -> tuple[Regression, list[str]]:
    """The runs with their events in the order in which they happen, and a sentence about each whose
    word has another one."""
    experiments, told = list(made.regression.experiments), list[str]()
    for i, (e, own) in enumerate(zip(experiments, made.predictions, strict=True)):
        times = own.course.events[: len(own.course.arcs) - 1]
        order = [*np.argsort(times, kind="stable").tolist(), *range(len(times), len(e.words))]
        if order == sorted(order):
            continue
        words = tuple(e.words[k] for k in order)
        with suppress(FitError):
            experiments[i] = with_words(e, words)
            told.append(f"events of {e.run.name} happen in another order, {', '.join(words)}")
    return replace(made.regression, experiments=tuple(experiments)), told


def by_laws(e: Experiment, x: Array) -> Experiment:
    """The experiment with the hits that its motion has by the laws: those of its word that happen
    in the time of the run, and those on surfaces that it would pass else."""
    alone = Regression((e,), e.parameters)
    for _ in range(LONGEST):
        made = alone.predict(x)
        if made is None:
            break
        course = made[0].course
        words = e.words[: int((course.events < e.run.end).sum())]
        if len(words) == len(e.words):
            behind = passed(alone, x)
            if not behind:
                break
            words = (*words, behind[0][1])
        e = with_words(e, words)
        alone = Regression((e,), e.parameters)
    return e


def _first(e: Experiment, x: Array) -> Iterator[tuple[str, ...]]:
    """Words to begin with: those that sensors show, and without any those that the laws say."""
    if e.run.events:
        yield tuple(word for word, _ in e.run.events)
    seen = _all_seen(e, x)
    yield e.words
    yield from seen
    if not any(seen):
        yield by_laws(e, x).words


def _all_seen(e: Experiment, x: Array) -> list[tuple[str, ...]]:
    """Hits as measured gaps show them, if less and less is taken for one."""
    return [_seen(e, x, fall, near) for near in NEAR for fall in SEEN]


def in_order_of_sight(e: Experiment, x: Array) -> Experiment:
    """The experiment with its hits in the order in which measured gaps show them, where they show
    as many of each surface."""
    hits = sorted((time, e.problem.kernels.surfaces[j]) for time, j in hits_of_word(e, x))
    words = tuple(name for _, name in hits)
    return with_words(e, words) if sorted(words) == sorted(e.words) and words else e


def _seen(e: Experiment, x: Array, least: float, near: float) -> tuple[str, ...]:
    """Hits where measured gaps are largest and fall on both sides, by a share of their range, and
    are within another one of their surfaces."""
    t, gaps = measured_gaps(e, x)
    hits = []
    for time, j, fall in peaks(e, x):
        size = float(np.ptp(gaps[:, j]))
        if fall > least and abs(float(np.interp(time, t, gaps[:, j]))) < near * size:
            hits.append((time, e.problem.kernels.surfaces[j]))
    return tuple(name for _, name in sorted(hits))[:LONGEST]


def _changed(e: Experiment, words: tuple[str, ...], x: Array) -> Iterator[tuple[str, ...]]:
    """Words with one hit less or more; where hits are seen, with more at the end alone."""
    for k in range(len(words)):
        yield words[:k] + words[k + 1 :]
    for name in e.problem.kernels.surfaces if len(words) < LONGEST else ():
        if name not in e.problem.ignored:
            for k in range(
                len(words) if words and words in _all_seen(e, x) else 0,
                len(words) + 1,
            ):
                yield (*words[:k], name, *words[k:])
