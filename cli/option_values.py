"""Values of options: numbers, ranges, states, places, guesses."""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dmoc.base.errors import ProblemError

if TYPE_CHECKING:
    from dmoc.results.solution import Solution

MOST_VALUES = 10_000  # of a range
# END=START, with a minus before it and a difference behind it, or a state alone.
RELATION = re.compile(r"(?:([^\s=+-]+)\s*=\s*(-?)\s*)?([^\s=+-]+)\s*(?:([+-])\s*(\S+))?")


def read_names(text: str) -> tuple[str, ...]:
    """Read names with commas between them."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def read_events(text: str) -> tuple[str, ...]:
    """Read words of events with commas between them; one may end the last."""
    words = [word.strip() for word in text.split(",")]
    if not words[-1] and (len(words) == 1 or words[0]):
        words.pop()
    if "" in words:
        raise ProblemError(
            f"--sequence {text}: a word is missing beside a comma: expected words of events with "
            "one comma between any two, or '' for none."
        )
    return tuple(words)


def read_steps(text: str) -> int | list[int]:
    """Read a number of steps, or one for each phase with commas between them."""
    numbers = [read_whole(part, "--steps") for part in text.split(",")]
    return numbers[0] if len(numbers) == 1 else numbers


def read_durations(text: str) -> list[Any]:
    """Read durations of the phases, values or ranges with commas between them."""
    return [read_value(part.strip(), "--durations") for part in text.split(",")]


def read_periodic(text: str) -> tuple[str, ...] | dict[str, Any]:
    """Read states that end as they start, or END=START with a difference for some of them."""
    parts = read_names(text)
    if not any("=" in part for part in parts):
        return parts
    relations: dict[str, Any] = {}
    for part in parts:
        match = RELATION.fullmatch(part)
        end, minus, start, sign, by = match.groups() if match else (None,) * 5
        end = start if sign is None and end is None else end
        if end is None or start is None or end in relations:
            raise ProblemError(
                f"--periodic {part}: expected NAME, END=START, END=-START, END=START+0.5 or "
                "END=START+?, each END once."
            )
        relations[end] = _start_and_difference(part, (minus or "") + start, sign, by)
    return relations


def _start_and_difference(part: str, start: str, sign: str | None, by: str | None) -> Any:
    if sign is None or by is None:
        return start
    if by == "?":
        return start, None
    number = read_number(by, f"the difference in --periodic {part}", "expected a number, or ?")
    return start, number if sign == "+" else -number


def read_via(text: str) -> list[dict[str, Any] | None]:
    """Read coordinates at the events, NAME=VALUE with commas between them, ';' between events."""
    return [
        by_name((read_pair(part, "--via") for part in read_names(event)), "--via") or None
        for event in text.split(";")
    ]


def read_restitution(texts: list[str]) -> float | dict[str, Any]:
    """Read one number for all surfaces, or SURFACE=E for some."""
    texts = separate(texts)
    numbers = [text for text in texts if "=" not in text]
    if numbers and len(texts) > 1:
        raise ProblemError(
            f"--restitution {numbers[0]} stands beside others: give one number for all surfaces, "
            "or SURFACE=E for each."
        )
    if numbers:
        return read_number(
            numbers[0], "--restitution", "expected a number from 0 to 1, or SURFACE=E"
        )
    return read_pairs(texts, "--restitution")


def read_guess(texts: list[str] | None) -> Solution | dict[str, Any] | None:
    """Read one solution file, or NAME=V1,V2,... for some coordinates, inputs and the durations."""
    files = [text for text in texts or [] if "=" not in text or Path(text).exists()]
    if not texts:
        return None
    if files and len(texts) > 1:
        raise ProblemError(
            f"--guess {files[0]} stands beside others: give one file, or NAME=V1,V2,... for each "
            "coordinate and input."
        )
    if files:
        from dmoc.results.solution import Solution

        return Solution.load(files[0])
    courses: dict[str, Any] = {}
    for text in texts:
        name, _, values = text.partition("=")
        name, what = name.strip(), f"--guess {name.strip()}"
        if not name or name in courses:
            raise ProblemError(f"--guess {text}: expected NAME=V1,V2,..., each name once.")
        expected = "expected numbers such as 0,0.5,-3.1"
        courses[name] = [read_number(part, what, expected) for part in values.split(",")]
    return courses


def separate(texts: list[str] | None) -> list[str]:
    """Values of an option that may be repeated, also with commas in one text."""
    return [part for text in texts or [] for part in read_names(text) or [text]]


def read_pairs(texts: list[str] | None, option: str, lists: int = 0) -> dict[str, Any]:
    """Read NAME=VALUE of an option that may be repeated, also with commas between them; a value may
    be so many with commas, or more."""
    parts = with_lists(separate(texts)) if lists else separate(texts)
    values = by_name((read_pair(text, option) for text in parts), option)
    for name, value in values.items():
        if isinstance(value, list) and len(value) < lists:
            raise ProblemError(
                f"{option} {name} has {len(value)} values: expected one, a range LOW:HIGH, or the "
                f"{lists} numbers of an attitude."
            )
    return values


def with_lists(parts: list[str]) -> list[str]:
    """Parts between commas, of which those without a name go on with the values before them."""
    joined = list[str]()
    for part in parts:
        if "=" in part or not joined:
            joined.append(part)
        else:
            joined[-1] += f",{part}"
    return joined


def by_name(pairs: Iterable[tuple[str, Any]], option: str) -> dict[str, Any]:
    """Pairs as a mapping; two of one name that differ are refused."""
    values: dict[str, Any] = {}
    for name, value in pairs:
        if name in values and values[name] != value:
            raise ProblemError(f"{option} {name} is given twice: expected one value for each name.")
        values[name] = value
    return values


def read_pair(text: str, option: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise ProblemError(f"{option} {text}: expected NAME=VALUE.")
    what = f"{option} {name.strip()}"
    if "," in value:
        expected = "expected numbers such as 10,50, one for each phase or part of an attitude"
        return name.strip(), [read_number(part, what, expected) for part in value.split(",")]
    return name.strip(), read_value(value, what)


def read_value(text: str, what: str) -> Any:
    """Read a number, a range LOW:HIGH with empty ends open, or free."""
    if text == "free":
        return None
    if ":" in text:
        low, _, high = text.partition(":")
        return (read_number(low, what) if low else None, read_number(high, what) if high else None)
    return read_number(text, what)


def read_range(text: str, what: str) -> list[float] | None:
    """Read a range FROM:TO:COUNT as equally spaced values; None for what is no such range."""
    parts = text.split(":")
    if len(parts) != 3:
        return None
    expected = "expected a range FROM:TO:COUNT such as 0.4:0.8:50"
    first, last = (read_number(part, what, expected) for part in parts[:2])
    count = read_whole(parts[2], f"COUNT of {what}")
    if not (isfinite(first) and isfinite(last) and 1 <= count <= MOST_VALUES):
        raise ProblemError(f"{what} = {text!r}: {expected}, with 1 to {MOST_VALUES} finite values.")
    step = (last - first) / max(count - 1, 1)
    return [first + i * step for i in range(count - 1)] + [last if count > 1 else first]


def read_number(
    text: str, what: str, expected: str = "expected a number such as 0.5, or a range such as -1:1"
) -> float:
    try:
        return float(text)
    except ValueError:
        raise ProblemError(f"{what} = {text!r}: {expected}.") from None


def read_whole(text: str, what: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ProblemError(f"{what} = {text!r}: expected a whole number.") from None
