"""Warnings of the vehicle on the console: each once, with its time, whoever reads them or not."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.signals import FailsafeEvent, Severity, StatusText
from fsw.runtime.console import Console
from tests.waiting import becomes

SECOND = 1_000_000
LOW = StatusText(Severity.WARNING, "battery low: 18 % left")
LANDING = StatusText(Severity.CRITICAL, "failsafe: joint failed: joint 1, landing")
FINE = StatusText(Severity.INFO, "hold to land: command")


class Reader:
    """Notes events; it may not take any for a while, or have left."""

    def __init__(self) -> None:
        self.events: list[tuple[str, str, dict[str, object]]] = []
        self.reads = threading.Event()
        self.reads.set()
        self.left = False

    def report(self, event: str, sentence: str, **details: object) -> None:
        self.reads.wait()
        if self.left:
            raise BrokenPipeError
        self.events.append((event, sentence, details))

    @property
    def sentences(self) -> list[str]:
        return [sentence for _, sentence, _ in self.events]


@pytest.fixture
def reader() -> Iterator[Reader]:
    reader = Reader()
    yield reader
    reader.reads.set()


def console(reader: Any) -> Console:
    return Console(reader, start_us=SECOND)


@pytest.mark.requirement("REQ-LINK-10")
def test_warnings_and_worse_are_printed_with_the_flight_time(reader: Reader) -> None:
    one = console(reader)
    one.observe(SECOND + 12_340_000, (FINE, LOW))
    one.observe(SECOND + 12_342_000, ())
    one.observe(SECOND + 14_000_000, (LANDING,))
    one.close()
    assert reader.sentences == [f"fsw: 12.3 s: {LOW.text}", f"fsw: 14.0 s: {LANDING.text}"]
    event, _, details = reader.events[0]
    assert event == "text"
    assert details == {"t_s": pytest.approx(12.34), "severity": 4, "text": LOW.text}


def test_a_burst_of_the_same_text_is_one_line_and_a_count(reader: Reader) -> None:
    one = console(reader)
    for tick in range(1000):
        one.observe(SECOND + 2_000 * tick, (LOW,))
    for tick in range(1000, 4000):
        one.observe(SECOND + 2_000 * tick, ())
    one.close()
    told = f"fsw: 0.0 s: {LOW.text}"
    assert reader.sentences == [told, f"fsw: 5.0 s: {LOW.text} (again, 999 times)"]


def test_what_was_held_back_when_the_flight_ends_is_counted_then(reader: Reader) -> None:
    one = console(reader)
    for tick in range(3):
        one.observe(SECOND + 2_000 * tick, (LOW,))
    one.close()
    one.close()
    assert reader.sentences[1:] == [f"fsw: 0.0 s: {LOW.text} (again, 2 times)"]


def test_a_flood_of_different_texts_is_cut_and_says_how_many(reader: Reader) -> None:
    one = console(reader)
    for number in range(100):
        one.observe(SECOND, (StatusText(Severity.WARNING, f"text {number}"),))
    one.close()
    assert len(reader.sentences) == 21
    assert reader.sentences[-1] == "fsw: 0.0 s: 80 more texts were left out"


@pytest.mark.requirement("REQ-LINK-10")
def test_a_flood_keeps_no_warning_of_a_failsafe_from_the_console(reader: Reader) -> None:
    event = FailsafeEvent(Condition.ESTIMATE_INVALID.value, "warn", Severity.WARNING)
    invalid = StatusText(Severity.WARNING, "state estimate invalid: warn", event)
    one = console(reader)
    for number in range(100):
        one.observe(SECOND, (StatusText(Severity.WARNING, f"text {number}"),))
    one.observe(SECOND, (invalid,))
    one.close()
    assert f"fsw: 0.0 s: {invalid.text}" in reader.sentences


@pytest.mark.requirement("REQ-LINK-10")
def test_a_console_that_stands_still_delays_no_tick(reader: Reader) -> None:
    reader.reads.clear()
    one = console(reader)
    begin_s = time.monotonic()
    for number in range(5000):
        emergency = StatusText(Severity.EMERGENCY, f"emergency {number}")  # without a limit
        one.observe(SECOND + 2_000 * number, (emergency,))
    one.close()
    assert time.monotonic() - begin_s < 5.0
    assert reader.events == []
    reader.reads.set()
    assert becomes(lambda: len(reader.events) >= 256)


def test_a_reader_that_has_left_does_not_end_the_flight(reader: Reader) -> None:
    reader.left = True
    one = console(reader)
    for number in range(10):
        one.observe(SECOND + 2_000 * number, (StatusText(Severity.WARNING, f"text {number}"),))
    one.close()
    assert reader.events == []


def test_a_damaged_log_is_told_by_who_writes_it(reader: Reader) -> None:
    event = FailsafeEvent(Condition.LOG_STOPPED.value, "warn", Severity.CRITICAL)
    one = console(reader)
    one.observe(SECOND, (StatusText(Severity.CRITICAL, "flight log damaged: …", event),))
    one.close()
    assert reader.events == []
