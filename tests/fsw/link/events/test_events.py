"""Events as a ground station reads them: by the document, in order, and again when it asks."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from typing import Any, cast

import pytest

from fsw.autopilot.flight.commands.arming import CHECKS, Subject
from fsw.autopilot.flight.failsafe.conditions import Action, Condition
from fsw.autopilot.flight.failsafe.table import FAILSAFES
from fsw.autopilot.signals import (
    ArmingReport,
    Command,
    CommandRequest,
    FailsafeEvent,
    Order,
    SensorFrame,
    Severity,
    StatusText,
    TickInputs,
)
from fsw.link.events import (
    ARGUMENTS,
    Event,
    EventLog,
    EventService,
    arming_events,
    condition_of,
    event_document,
    failsafe_event,
)
from fsw.link.wire.outgoing import Outgoing
from messages import message_ids
from messages.frames import FrameWriter, split
from tests.fsw.link.snapshots import outputs_at

_NONE = (0.0, 0.0, 0.0)
STILL = SensorFrame(0, _NONE, _NONE, (1.0, 0.0, 0.0, 0.0), _NONE, _NONE, (0.0, 0.0), (0.0, 0.0))
DOCUMENT: dict[str, Any] = json.loads(event_document())
DESCRIBED = DOCUMENT["components"]["1"]
FORMATS = {"uint8_t": "B", "uint16_t": "H", "uint32_t": "I"}
SECOND = 1_000_000
LOST = FailsafeEvent(Condition.DATALINK_LOST.value, Action.RETURN.value, Severity.CRITICAL)


def explained(event: Event) -> tuple[str, dict[str, Any], dict[str, int]]:
    """The group, the description and the arguments of an event, by the document alone."""
    assert event.id >> 24 == 1
    number = str(event.id & 0xFFFFFF)
    ((group, description),) = [
        (name, events["events"][number])
        for name, events in DESCRIBED["event_groups"].items()
        if number in events["events"]
    ]
    enums = DESCRIBED["enums"]
    kinds = [enums.get(one["type"], one)["type"] for one in description["arguments"]]
    layout = struct.Struct("<" + "".join(FORMATS[kind] for kind in kinds))
    assert layout.size == len(event.arguments) <= ARGUMENTS
    names = [one["name"] for one in description["arguments"]]
    return group, description, dict(zip(names, layout.unpack(event.arguments), strict=True))


def read(event: Event) -> str:
    """The message as people read it."""
    _, description, arguments = explained(event)
    text: str = description["message"]
    for place, described in enumerate(description["arguments"], start=1):
        entries = DESCRIBED["enums"].get(described["type"], {}).get("entries", {})
        entry = entries.get(str(arguments[described["name"]]))
        text = text.replace(f"{{{place}}}", entry["description"] if entry else "?")
    return text


@pytest.mark.requirement("REQ-MODE-1")
@pytest.mark.parametrize("action", Action)
def test_a_condition_and_what_is_done_about_it_are_read_as_in_the_texts(action: Action) -> None:
    for condition in Condition:
        event = failsafe_event(FailsafeEvent(condition.value, action.value, Severity.CRITICAL))
        assert read(event) == f"{condition.value}: {action.value}"
        assert event.severity == Severity.CRITICAL
    over = failsafe_event(LOST._replace(over=True, severity=Severity.INFO))
    assert (read(over), over.severity) == ("Over: no ground station", Severity.INFO)


@pytest.mark.requirement("REQ-MODE-1")
def test_a_delayed_action_is_read_with_what_is_done_until_then_and_for_how_long() -> None:
    later = LOST._replace(action=Action.HOLD.value, later=Action.RETURN.value, delay_us=5 * SECOND)
    event = failsafe_event(later)
    assert read(event) == "no ground station: holding, returning in ? s"
    assert explained(event)[2]["delay_s"] == 5
    assert event != failsafe_event(LOST)
    assert condition_of(event.id, event.arguments) == (Condition.DATALINK_LOST, False)
    assert explained(failsafe_event(later._replace(delay_us=10**9)))[2]["delay_s"] == 255


def test_the_checks_that_fail_are_between_a_summary_and_the_health() -> None:
    tilted = next(k for k, check in enumerate(CHECKS) if check.subject is Subject.ATTITUDE)
    empty = next(k for k, check in enumerate(CHECKS) if check.subject is Subject.BATTERY)
    summary, first, second, health = arming_events(ArmingReport((tilted, empty)))
    group, described, arguments = explained(summary)
    assert (group, described["type"]) == ("arming_check", "summary")
    assert (arguments["can_arm"], arguments["can_run"]) == (0, 0xFFFFFFFF)
    attitude, battery = 1 << 16, 1 << 11
    assert arguments["error"] == attitude | battery, "the bits that PX4 has for them"
    for event, words, bit in (
        (first, "The vehicle is tilted", 16),
        (second, "The battery is nearly empty", 11),
    ):
        group, described, arguments = explained(event)
        assert (group, described["message"], described.get("type")) == ("arming_check", words, None)
        assert (arguments["modes"], arguments["component"]) == (0xFFFFFFFF, bit)
        assert event.severity == Severity.CRITICAL
    group, described, arguments = explained(health)
    assert (group, described["type"]) == ("health", "summary")
    assert arguments["is_present"] & attitude & arguments["error"] == attitude


def test_nothing_that_fails_is_a_summary_that_allows_arming() -> None:
    summary, health = arming_events(ArmingReport())
    assert explained(summary)[2]["can_arm"] == 0xFFFFFFFF
    assert explained(summary)[2]["error"] == explained(health)[2]["error"] == 0


@pytest.mark.parametrize(
    ("condition", "component", "is_error"),
    [
        (Condition.ROTOR_FAILED, "motors_escs", True),
        (Condition.JOINT_FAILED, "motors_escs", True),
        (Condition.SENSOR_LOST, "accel", True),
        (Condition.AIDING_LOST, "local_position_estimate", False),
        (Condition.LOG_STOPPED, "storage", True),
        (Condition.BATTERY_LOW, "battery", False),
        (Condition.BATTERY_EMERGENCY, "battery", True),
    ],
)
def test_a_component_that_is_ill_in_flight_is_in_the_health(
    condition: Condition, component: str, is_error: bool
) -> None:
    """An armed vehicle with a failed rotor said that it was healthy and could be armed."""
    entries = DESCRIBED["enums"]["health_component_t"]["entries"]
    (bit,) = [int(number) for number, one in entries.items() if one["name"] == component]
    summary, health = arming_events(ArmingReport(ill=(condition.value,)))
    for event in (summary, health):
        arguments = explained(event)[2]
        found = (arguments["error"], arguments["warning"])
        assert found == ((bit, 0) if is_error else (0, bit))
    assert explained(summary)[2]["can_arm"] == (0 if is_error else 0xFFFFFFFF)


def test_every_ailment_is_one_of_a_component_that_the_document_knows() -> None:
    components = DESCRIBED["enums"]["health_component_t"]["entries"]
    for condition in (one.condition for one in FAILSAFES if one.component is not None):
        health = explained(arming_events(ArmingReport(ill=(condition.value,)))[-1])[2]
        assert str(health["error"] | health["warning"]) in components


def test_every_check_has_an_event_and_a_component_that_the_document_knows() -> None:
    events = arming_events(ArmingReport(tuple(range(len(CHECKS)))))[1:-1]
    components = DESCRIBED["enums"]["health_component_t"]["entries"]
    for check, event in zip(CHECKS, events, strict=True):
        assert read(event) == check.summary
        assert str(1 << explained(event)[2]["component"]) in components
    assert DESCRIBED["supported_protocols"] == ["health_and_arming_check"]
    groups = DESCRIBED["navigation_mode_groups"]["groups"]
    assert groups["4"] == [4 << 16 | 3 << 24], "hold is PX4's loiter"


# ---------------------------------------------------------------- the log and the link


def ticked(
    log: EventLog,
    t_us: int,
    report: ArmingReport,
    *,
    asked: bool = False,
    armed: bool = False,
    event: FailsafeEvent | None = None,
) -> None:
    commands = (Command(Order.CHECK_ARMING, CommandRequest(401, (0.0,) * 7, 255, 190)),)
    outputs = outputs_at(t_us)
    texts = (StatusText(Severity.CRITICAL, "no ground station", event),)
    snapshot = replace(outputs.snapshot, arming=report, armed=armed)
    outputs = replace(outputs, shown=snapshot, texts=texts)
    log.observe(TickInputs(STILL, commands=commands if asked else ()), outputs)


def test_the_checks_are_reported_at_first_when_they_change_and_when_somebody_asks() -> None:
    log, tilted = EventLog(), ArmingReport((2,))
    ticked(log, 0, tilted)
    assert log.newest == 3
    ticked(log, 10 * SECOND, ArmingReport((2,)))
    assert log.newest == 3, "it is the same"
    ticked(log, 10 * SECOND, ArmingReport())
    assert log.newest == 5
    ticked(log, 11 * SECOND, tilted)
    assert log.newest == 5, "not twice within two seconds"
    ticked(log, 12 * SECOND, tilted)
    assert log.newest == 8
    ticked(log, 12 * SECOND, tilted, asked=True)
    assert log.newest == 11


def test_the_health_is_reported_while_armed_and_a_refused_check_reports_nothing() -> None:
    log, ill = EventLog(), ArmingReport(ill=(Condition.ROTOR_FAILED.value,))
    ticked(log, 0, ArmingReport())
    ticked(log, 2 * SECOND, ill, armed=True)
    assert log.newest == 4
    ticked(log, 3 * SECOND, ill, armed=True, asked=True)
    assert log.newest == 4, "the vehicle is armed: the command was refused"
    ticked(log, 4 * SECOND, ArmingReport(), armed=True)
    assert log.newest == 6


@pytest.mark.requirement("REQ-MODE-1")
def test_a_text_with_an_event_is_one() -> None:
    log = EventLog()
    ticked(log, 0, ArmingReport(), event=LOST)
    assert log.newest == 3
    first = log.find(1)
    assert first is not None
    assert read(first.event) == "no ground station: returning"


def test_a_condition_that_comes_and_goes_is_an_event_once_in_a_while() -> None:
    log = EventLog()
    late = FailsafeEvent(Condition.PLAN_LATE.value, Action.WARN.value, Severity.WARNING)
    for t_us in (0, SECOND, 4 * SECOND):
        ticked(log, t_us, ArmingReport(), event=late)
    assert log.newest == 1 + 2, "and two summaries"
    ticked(log, 5 * SECOND, ArmingReport(), event=late)
    ticked(log, 5 * SECOND, ArmingReport(), event=late._replace(over=True))
    assert log.newest == 3 + 2
    for _ in range(3):
        ticked(log, 6 * SECOND, ArmingReport(), event=LOST)
    assert log.newest == 5 + 3, "what changes the mode always is"


def sequences(messages: Any, message_id: int = message_ids.EVENT) -> list[int]:
    place = {message_ids.EVENT: 2}.get(message_id, 0)
    return [int(one.values[place]) for one in messages if one.message_id == message_id]


def full(count: int) -> EventLog:
    log = EventLog()
    for k in range(count):
        log._add(failsafe_event(LOST), k * SECOND)
    return log


def test_what_is_new_is_sent_once_and_the_newest_announced_now_and_then() -> None:
    log = EventLog()
    service = EventService(log)
    (announced,) = service.poll(0)
    assert (announced.message_id, announced.values) == (411, (0, 1)), "a client begins anew"
    assert list(service.poll(SECOND)) == []
    for t_us in (SECOND, SECOND, 2 * SECOND):
        log._add(failsafe_event(LOST), t_us)
    assert sequences(service.poll(2 * SECOND)) == [1, 2, 3]
    assert list(service.poll(2 * SECOND)) == []
    (announced,) = service.poll(3 * SECOND)
    assert announced.values == (3, 0)


def test_what_came_before_the_first_announcement_comes_behind_it() -> None:
    log = EventLog()
    service = EventService(log)
    log._add(failsafe_event(LOST), 0)
    announced, event = service.poll(5)
    assert announced.values == (0, 1)
    assert sequences([event]) == [1]


def test_an_event_says_when_it_was_and_is_for_everybody() -> None:
    (event,) = [one for one in asked(full(1), 1, 1) if one.message_id == message_ids.EVENT]
    number, time_ms, sequence, component, system, levels, *arguments = event.values
    assert (time_ms, sequence, component, system) == (0, 1, 0, 0)
    assert levels == Severity.CRITICAL << 4 | Severity.CRITICAL
    assert len(arguments) == ARGUMENTS
    assert cast(int, number) >> 24 == 1


def asked(log: EventLog, first: int, last: int, system: int = 1) -> list[Outgoing]:
    writer = FrameWriter(255, 190)
    wire = writer.frame(message_ids.REQUEST_EVENT, first, last, system, 1)
    (frame,) = split(wire)
    return list(EventService(log).handle(frame, 0))


def test_events_are_sent_again_and_what_is_not_kept_is_said_with_the_oldest() -> None:
    log = full(70)  # 64 are kept
    assert sequences(asked(log, 68, 70)) == [68, 69, 70]
    answers = asked(log, 6, 8)
    assert sequences(answers) == [7, 8]
    (error,) = [one for one in answers if one.message_id == message_ids.RESPONSE_EVENT_ERROR]
    assert error.values == (6, 7, 255, 190, 0)
    assert asked(log, 68, 70, system=2) == []
    assert len(asked(log, 100, 99)) == 32, "an absurd request is bounded"


def test_sequence_numbers_go_round() -> None:
    log = full(0x10000 + 2)
    assert log.newest == 2
    assert sequences(asked(log, 0xFFFF, 2)) == [0xFFFF, 0, 1, 2]
    service = EventService(log)
    log._add(failsafe_event(LOST), 0)
    assert sequences(service.poll(0)) == [3]
