"""Critics: what looks at an answer, one after the other."""

from typing import Any

import pytest

from dmoc.solving.case import first_of


@pytest.mark.parametrize(("changes", "expected"), [((), "-"), ((1, 2), "-1"), ((2,), "-2")])
def test_the_first_critic_that_changes_an_answer_has_the_last_word(
    changes: tuple[int, ...], expected: str
) -> None:
    asked = list[int]()

    def critic(number: int) -> Any:
        def look(answer: Any, case: Any) -> Any:
            asked.append(number)
            return f"{answer}{number}" if number in case else answer

        return look

    look: Any = first_of(*map(critic, range(3)))
    assert look("-", changes) == expected
    assert asked == [*range(min(changes, default=2) + 1)]
