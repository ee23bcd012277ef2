"""What many starts have led to, and what further ones may, in words and as plain data."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dmoc.results.solution import Minimum, Solution

# Share of starts with unseen minima above which more of them are advised, so many times as many.
FEW_UNSEEN, MORE = 0.1, 4


def exploration_in_words(s: Solution) -> str:
    """A sentence about the starts: how many have led to a solution, from which one on, and to what
    else. It says how likely a further one leads to another minimum, and, where that is more than
    little, what tries more."""
    several, other = len(s.others), "other " if s.agreeing_starts else ""
    minima = f"one {other}minimum" if several == 1 else f"{several} {other}minima"
    if not s.agreeing_starts:
        if several:
            return f"{s.starts} starts led to {minima} on a coarse mesh alone"
        return f"none of {s.starts} starts on a coarse mesh led to a motion"
    from_first = f", the first of them {s.first_start}" if s.first_start else ""
    if several:
        led = f"{s.agreeing_starts} of {s.starts} starts led to it{from_first}, others to {minima}"
        return f"{led}{_unseen_in_words(s)}"
    if s.agreeing_starts == s.starts:
        led = f"all {s.starts} starts led to it{from_first}"
    else:
        led = f"{s.agreeing_starts} of {s.starts} starts led to it{from_first}, none to another one"
    if s.unseen_share is None:
        return led
    return (
        f"{led}, which leaves open that about {s.unseen_share:.0%} of further ones lead to another "
        "minimum"
    )


def _unseen_in_words(s: Solution) -> str:
    if s.unseen_share is None:
        return ""
    share = (
        f"; about {s.unseen_share:.0%} of further ones would lead to a minimum not met so far, "
        "cheaper or not"
    )
    if s.unseen_share <= FEW_UNSEEN:
        return share
    return f"{share}, as dmoc.solve with starts={MORE * s.starts} tries in {MORE} times the time"


def exploration_of(s: Solution) -> dict[str, Any]:
    """The outcome of the starts as plain data, as JSON has it."""
    return {
        "starts": s.starts,
        "found": s.agreeing_starts,
        "first_start": s.first_start,
        "unseen_share": s.unseen_share,
        "others": [_other(m) for m in s.others],
    }


def _other(m: Minimum) -> dict[str, Any]:
    facts = asdict(m)
    return {"cost": facts.pop("cost"), "found": facts.pop("agreeing_starts"), **facts}
