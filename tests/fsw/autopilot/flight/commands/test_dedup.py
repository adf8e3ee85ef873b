"""A command that comes twice acts once."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.flight.commands.dedup import COURSE, answered_before, remember, still_true
from fsw.autopilot.signals import CommandRequest

NAN = math.nan


def asked(
    command: int = 22, first: float = NAN, sender: int = 255, again: int = 0
) -> CommandRequest:
    return CommandRequest(command, (first, *(NAN,) * 6), sender, 190, again)  # type: ignore[arg-type]


@pytest.mark.requirement("REQ-MODE-10")
def test_the_same_words_within_half_a_second_are_the_same_command() -> None:
    memory = remember((), asked(), 0, 1_000_000)
    unused = CommandRequest(22, (float("nan"),) * 7, 255, 190)  # type: ignore[arg-type]
    before = answered_before(memory, unused, 1_499_999)  # one NaN is as good as another
    assert before is not None
    assert before.result == 0
    assert answered_before(memory, asked(), 1_500_000) is None


@pytest.mark.requirement("REQ-MODE-10")
def test_one_that_says_it_is_a_repetition_is_known_for_three_seconds() -> None:
    memory = remember((), asked(), 0, 1_000_000)
    assert answered_before(memory, asked(again=3), 3_999_999) is not None
    assert answered_before(memory, asked(again=3), 4_000_000) is None


def test_other_words_another_sender_or_something_in_between_are_a_new_command() -> None:
    memory = remember((), asked(), 0, 0)
    assert answered_before(memory, asked(first=1.0), 1) is None
    assert answered_before(memory, asked(sender=1), 1) is None
    given = remember((), asked(first=1.0), 0, 0)
    assert answered_before(given, asked(first=1.0), 1) is not None
    assert answered_before(given, asked(first=2.0), 1) is None
    memory = remember(memory, asked(command=21), 0, 1)
    assert answered_before(memory, asked(again=1), 2) is None


def test_a_refusal_is_no_answer_for_good() -> None:
    memory = remember((), asked(), 1, 0)
    assert answered_before(memory, asked(), 1) is None
    before = answered_before(memory, asked(again=1), 1)
    assert before is not None
    assert before.result == 1


def test_a_flood_of_senders_does_not_grow_the_memory() -> None:
    memory = ()
    for sender in range(256):
        memory = remember(memory, asked(sender=sender), 0, sender)  # type: ignore[assignment]
    assert len(memory) <= 8
    assert answered_before(memory, asked(sender=255), 256) is not None


def test_the_first_repetition_is_a_repetition() -> None:
    memory = remember((), asked(), 0, 1_000_000)
    assert answered_before(memory, asked(again=1), 3_999_999) is not None
    assert answered_before(memory, asked(again=0), 3_999_999) is None


@pytest.mark.parametrize(
    ("changes", "kept"),
    [((), 3), (("look_at",), 2), (("home",), 1), (("home", "speed"), 1), ((COURSE,), 0)],
)
def test_answers_about_what_has_changed_since_are_forgotten(
    changes: tuple[str, ...], kept: int
) -> None:
    memory = remember((), asked(179, sender=1), 0, 0, frozenset({"home"}))
    memory = remember(memory, asked(22, sender=2), 0, 0, frozenset({COURSE}))
    memory = remember(memory, asked(21, sender=3), 1, 0)  # refused; it may be possible now
    assert len(still_true(memory, frozenset(changes))) == kept
