"""What a search is told, beside its problem: checked once, handed on as a whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dmoc.base.arguments import shown
from dmoc.base.errors import ProblemError, SearchError
from dmoc.base.options import read
from dmoc.mechanics.contacts import Contacts
from dmoc.mechanics.phase_models import check_one_for_all
from dmoc.mechanics.possible_words import possible_after, words_after
from dmoc.mechanics.sequence_words import event_of, mode_of, word_between
from dmoc.problem.problem import Problem
from dmoc.results.solution import Solution
from dmoc.sequences.keywords import SearchKeywords
from dmoc.solving.methods import METHODS

# Share of the largest final time that a phase keeps, unless the search is told otherwise: bounces
# at ever shorter intervals would pump energy without limit (Zeno).
SHORTEST = 0.01
# Events that sequences which motions propose may have beyond the depth: those of two stays of a
# contact at the edge of its mode.
BEYOND = 4


@dataclass(frozen=True, kw_only=True)
class Settings(SearchKeywords):
    """The keywords of a search as they are for its problem."""

    surfaces: tuple[str, ...]
    method: str
    shortest_phase: float


def surfaces_of(problem: Problem, names: Sequence[str] | None) -> tuple[str, ...]:
    """The surfaces that may be hit: all of the model, or some of them."""
    surfaces = problem.touch.contacts.grasped(problem.kernels.surfaces)
    if not surfaces and problem.kernels.tangents and names is None:
        return ()
    if not surfaces:
        raise SearchError(
            f"model {problem.kernels.name!r} has no surfaces: there are no sequences to search."
        )
    chosen = tuple(surfaces if names is None else names)
    for name in chosen:
        if name not in surfaces:
            raise SearchError(
                f"unknown surface {shown(name)} in surfaces: expected some of "
                f"{', '.join(surfaces)}."
            )
    if not chosen or len(set(chosen)) < len(chosen):
        raise SearchError(
            f"surfaces = {', '.join(chosen) or 'none'}: expected each surface once, and at least "
            f"one of {', '.join(surfaces)}."
        )
    return chosen


def events_of(problem: Problem, words: Sequence[str] | None) -> tuple[str, ...] | None:
    """The words that may happen; None for all that can."""
    if words is None:
        return None
    chosen = tuple(words)
    for word in chosen:
        try:
            _check_word(word, problem.touch.contacts)
        except ProblemError as error:
            raise SearchError(f"events: {error}") from None
    if not chosen or len(set(chosen)) < len(chosen):
        raise SearchError(
            f"events = {', '.join(chosen) or 'none'}: expected each word once, and at least one."
        )
    return chosen


def _check_word(word: str, contacts: Contacts) -> None:
    """Refuse a word that is none, whichever surfaces are closed."""
    try:
        event_of(word, contacts)
    except ProblemError:
        event_of(word, contacts, range(len(contacts.surfaces)))


def hits_alone(problem: Problem, settings: Settings) -> bool:
    """Whether every event is a hit, and every sequence of them one that a problem can have."""
    grips = problem.touch.contacts.grips
    every = settings.events is None and not problem.lasting
    return every and not problem.kernels.tangents and not grips


def children(problem: Problem, sequence: tuple[str, ...], settings: Settings) -> list[str]:
    """The words that may follow a sequence: hits alone where no contact lasts and no word says
    otherwise, else whatever its last mode leaves possible."""
    if hits_alone(problem, settings):
        return list(settings.surfaces)
    mode = problem.but(sequence=sequence, durations=None, via=None).touch.modes[-1]
    if settings.events is not None:
        return list(possible_after(mode, settings.events, problem.touch.contacts))
    return list(words_after(mode, problem.touch.contacts, settings.surfaces))


def proposed(problem: Problem, solution: Solution | None, settings: Settings) -> tuple[str, ...]:
    """The sequence that a motion proposes, if its words may happen and it is not much longer than
    the search is deep; else the empty one."""
    proposal = None if solution is None else solution.proposal
    if proposal is None:
        return ()
    words = proposal.sequence
    if proposal.contacts is not None:  # the search begins as the problem does
        contacts = problem.touch.contacts
        start = problem.touch.modes[0], mode_of(proposal.contacts, contacts)
        words = (word_between(contacts, *start), *words)
    fits = settings.events is None or set(words) <= set(settings.events)
    return words if fits and len(words) <= settings.max_collisions + BEYOND else ()


def refusal(problem: Problem, sequence: tuple[str, ...]) -> str:
    """Why no problem can have a sequence, as where contacts that depend on each other would be
    closed together; empty where one can."""
    try:
        problem.but(sequence=sequence, durations=None, via=None)
    except ProblemError as error:
        return str(error)
    return ""


def shortest_of(problem: Problem, seconds: float | None) -> float:
    """The shortest duration of a phase; 0 for none."""
    latest = problem.final_time_bounds[1]
    if seconds is None:
        return SHORTEST * latest if np.isfinite(latest) else 0.0
    if seconds < 0:
        raise SearchError(
            f"shortest_phase = {shown(seconds)}: expected a duration in seconds, 0 or more."
        )
    return seconds


def settings_of(problem: Problem, keywords: Mapping[str, Any]) -> Settings:
    """The keywords of a search as they are read, its method among them; what does not fit, by
    itself and with the problem, is refused."""
    stated = read(SearchKeywords, keywords, SearchError)
    of_problem = {
        "surfaces": surfaces_of(problem, stated.surfaces),
        "events": events_of(problem, stated.events),
        "shortest_phase": shortest_of(problem, stated.shortest_phase),
    }
    settings = Settings(**{**vars(stated), **of_problem})
    if settings.resume and settings.journal is None:
        raise SearchError("resume needs the journal of the search that shall go on: name it.")
    _check_problem(problem, settings)
    return settings


def _check_problem(problem: Problem, s: Settings) -> None:
    """The deepest sequences must be problems too, and ones that the method can solve."""
    why = "sequences differ in the number of their phases"
    check_one_for_all(problem.models, why, SearchError)
    method = METHODS[s.method]
    method.require(problem.kernels.backend, SearchError)
    if not isinstance(problem.steps, int):
        raise SearchError(
            f"steps = {problem.steps!r}: expected one number for every phase, because sequences "
            "differ in length."
        )
    if problem.ends_with_event:
        raise SearchError(
            "the problem ends with its last event, and a search does not know which event is the "
            "last: leave its durations out, or solve one sequence after the other."
        )
    if problem.durations is not None:
        raise SearchError(
            "the problem bounds the durations of its phases, whose number differs in a search: use "
            "shortest_phase."
        )
    method.check_size(
        problem.steps, (s.max_collisions + 1) * problem.steps * problem.nu, SearchError
    )
    latest = problem.final_time_bounds[1]
    if s.max_collisions and 2 * s.shortest_phase > latest:
        raise SearchError(
            f"shortest_phase = {s.shortest_phase:g} s: two phases of it do not fit into the final "
            f"time of at most {latest:g} s; make it shorter."
        )
    if problem.via is not None:
        raise SearchError(
            "the problem has via, one entry for each event: expected none in a search."
        )
    if hits_alone(problem, s):
        for surface in s.surfaces:
            problem.but(sequence=[surface] * s.max_collisions)
