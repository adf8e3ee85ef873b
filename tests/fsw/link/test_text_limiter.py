"""Repeated texts are counted, others are sent, and a flood ends in one summary."""

from __future__ import annotations

import pytest

from fsw.autopilot.signals import FailsafeEvent, Severity, StatusText
from fsw.link.text_limiter import REPEAT_US, TextLimiter

REFUSED = StatusText(Severity.CRITICAL, "no takeoff: the vehicle is in the air already")
S = 1_000_000


def test_a_sentence_is_said_once_and_counted() -> None:
    limiter = TextLimiter()
    assert limiter.admit(REFUSED, 0) is REFUSED
    assert [limiter.admit(REFUSED, k * S // 2) for k in range(1, 8)] == [None] * 7
    (counted,) = limiter.overdue(REPEAT_US)
    assert counted == StatusText(Severity.INFO, f"{REFUSED.text} (again, 7 times)"), (
        "it alarmed once"
    )
    assert list(limiter.overdue(3 * REPEAT_US)) == []


def test_one_that_comes_again_later_says_how_often_it_was_held_back() -> None:
    limiter = TextLimiter()
    limiter.admit(REFUSED, 0)
    limiter.admit(REFUSED, S)
    again = limiter.admit(REFUSED, REPEAT_US)
    assert again == StatusText(Severity.CRITICAL, f"{REFUSED.text} (again, once)")
    assert limiter.admit(REFUSED, 3 * REPEAT_US) == REFUSED


def test_other_sentences_are_said_at_once() -> None:
    limiter = TextLimiter()
    texts = [StatusText(Severity.INFO, f"mission step {k}") for k in range(10)]
    assert [limiter.admit(text, k) for k, text in enumerate(texts)] == texts


def test_a_flood_of_different_sentences_is_bounded_and_told() -> None:
    """Refusals with a number that changes, a hundred times a second."""
    limiter = TextLimiter()
    reported = [
        limiter.admit(StatusText(Severity.CRITICAL, f"no goto: {k} m is too low"), k * S // 100)
        for k in range(1000)
    ]
    assert sum(text is not None for text in reported) <= 20 + 5 * 10 + 1
    (left_out,) = [text for text in limiter.overdue(11 * S) if "left out" in text.text]
    assert left_out.text.startswith(f"{sum(text is None for text in reported)} more texts")
    assert limiter.admit(REFUSED, 20 * S) is REFUSED, "and then there is room again"


FAILSAFE = StatusText(Severity.CRITICAL, "failsafe: battery critical, returning")


@pytest.mark.requirement("REQ-LINK-7")
@pytest.mark.parametrize("severity", list(Severity))
def test_no_flood_keeps_a_failsafe_or_an_emergency_from_being_sent(severity: Severity) -> None:
    """Whatever a client provokes in one tick: more refusals than a budget has, of any kind."""
    limiter = TextLimiter()
    for k in range(100):
        limiter.admit(StatusText(severity, f"no goto: {k}.5 m is too low"), 1 * S)
    assert limiter.admit(FAILSAFE, 1 * S) is FAILSAFE
    emergencies = [StatusText(Severity.EMERGENCY, f"tilt lost: {k}") for k in range(50)]
    assert [limiter.admit(text, 1 * S) for text in emergencies] == emergencies


INVALID = StatusText(
    Severity.WARNING,
    "state estimate invalid: warn",
    FailsafeEvent("state estimate invalid", "warn", Severity.WARNING),
)
VALID = StatusText(
    Severity.INFO,
    "over: state estimate invalid",
    FailsafeEvent("state estimate invalid", "none", Severity.INFO, over=True),
)


@pytest.mark.requirement("REQ-LINK-7")
@pytest.mark.parametrize("text", [INVALID, VALID])
@pytest.mark.parametrize("severity", [Severity.WARNING, Severity.INFO])
def test_no_flood_keeps_a_failsafe_that_only_warns_from_being_sent(
    text: StatusText, severity: Severity
) -> None:
    """A client of one link sent refused failures to inject, each of another instance."""
    limiter = TextLimiter()
    for k in range(200):
        limiter.admit(StatusText(severity, f"no failure injected: gyro {k}"), k * S // 16)
    assert limiter.admit(text, 200 * S // 16) is text


@pytest.mark.requirement("REQ-LINK-7")
def test_warnings_of_one_condition_use_up_the_budget_of_no_other_and_of_no_action() -> None:
    limiter = TextLimiter()
    low = FailsafeEvent("battery low", "warn", Severity.WARNING)
    sent = [
        limiter.admit(StatusText(Severity.WARNING, f"battery low: {k} s left", low), k * S // 100)
        for k in range(1000)
    ]
    assert 20 <= sum(text is not None for text in sent) <= 20 + 5 * 10 + 1, "it is bounded too"
    assert limiter.admit(INVALID, 10 * S) is INVALID
    lands = StatusText(Severity.CRITICAL, "battery low: landing", low._replace(action="land"))
    assert limiter.admit(lands, 10 * S) is lands


def test_a_flood_of_less_severe_sentences_is_cut() -> None:
    limiter = TextLimiter()
    texts = [StatusText(Severity.WARNING, f"parameter {chr(97 + k % 26)}{k}") for k in range(200)]
    assert sum(limiter.admit(text, 1 * S) is not None for text in texts) == 20


LOST = StatusText(Severity.CRITICAL, "failsafe: offboard setpoints stopped, holding", prompt=True)
READY = StatusText(Severity.INFO, "ready to arm", prompt=True)


@pytest.mark.requirement("REQ-LINK-7")
@pytest.mark.parametrize("text", [LOST, READY])
def test_a_second_failsafe_and_a_second_answer_in_the_same_words_are_sent_at_once(
    text: StatusText,
) -> None:
    limiter = TextLimiter()
    assert [limiter.admit(text, k * S) for k in range(4)] == [text] * 4
    assert list(limiter.overdue(10 * S)) == []


@pytest.mark.requirement("REQ-LINK-7")
def test_a_condition_that_flaps_does_not_flood_and_is_counted() -> None:
    limiter = TextLimiter()
    sent = [limiter.admit(LOST, k * S // 10) for k in range(600)]
    passed = [text for text in sent if text is not None]
    assert 4 + 60 // 5 - 2 <= len(passed) <= 4 + 60 // 5
    assert {text.severity for text in passed} == {Severity.CRITICAL}
    assert passed[4].text.startswith(f"{LOST.text} (again, ")
    for at in (100 * S, 102 * S, 104 * S):
        assert limiter.admit(LOST, at) is not None, "after a while there is room again"
