"""Whatever a tick is given comes back from the log as it was."""

from __future__ import annotations

import dataclasses
import json
import random
import typing
from pathlib import Path
from typing import Any

import pytest

from fsw.autopilot.measurements import Sample
from fsw.autopilot.signals import PlanTimings, SensorFrame, TickInputs
from fsw.log import topics
from fsw.log.encoder import SAMPLES, TYPED, LogEncoder
from fsw.log.flight_log import FlightLog, LogSubject
from fsw.log.json_codec import JsonCodec
from pandion.logged_ticks import LoggedTick, open_flight, ticks
from tests.fsw.link.snapshots import VEHICLE, outputs_at
from tests.fsw.log.specimens import inputs

SUBJECT = LogSubject({"ver_sw": "a test"}, {"airframe.mass": 3.5}, {"PD_ROLL_P": 50.0}, VEHICLE)


def digits(value: Any) -> str:
    """A value to the bit: NaN equals itself, and 0.0 is not -0.0."""
    return repr(value)


def logged(path: Path, given: list[TickInputs], lockstep: bool) -> list[TickInputs]:
    log = FlightLog(path, SUBJECT)
    log.begin(given[0].sensors.t_us, lockstep)
    for one in given:
        log.add(one, outputs_at(one.sensors.t_us))
    log.close()
    assert log.unwritten_ticks == 0
    found = list(ticks(open_flight(path)))
    assert all(isinstance(tick, LoggedTick) for tick in found)
    return [tick.inputs for tick in found if isinstance(tick, LoggedTick)]


@pytest.mark.drawn(3)
@pytest.mark.parametrize("seed", range(8))
def test_every_input_of_every_tick_comes_back(seed: int, tmp_path: Path) -> None:
    """Made from the annotations: an input that is added later is in here without an edit."""
    dice = random.Random(seed)
    given = [inputs(1_000_000 + 2000 * k, dice) for k in range(40)]
    found = logged(tmp_path / "flight.ulg", given, lockstep=False)
    assert [digits(one) for one in found] == [digits(one) for one in given]


@pytest.mark.long
def test_each_input_is_missed_if_it_is_not_recorded(tmp_path: Path) -> None:
    """Field by field: only this one changes between two ticks, and the log shows it."""
    dice = random.Random(1)
    kinds = typing.get_type_hints(TickInputs)
    assert {field.name for field in dataclasses.fields(TickInputs)} == set(kinds)
    first = inputs(1_000_000, dice)
    for name in kinds:
        for _ in range(50):
            other = getattr(inputs(1_002_000, dice), name)
            if digits(other) != digits(getattr(first, name)):
                break
        second = dataclasses.replace(first, **{name: other})
        found = logged(tmp_path / f"{name}.ulg", [first, second, first], lockstep=False)
        assert digits(getattr(found[1], name)) == digits(other), name
        assert digits(found[2]) == digits(first), name


def test_the_topic_of_the_sensors_has_every_field_of_theirs() -> None:
    fields = {field.name for field in dataclasses.fields(SensorFrame)}
    assert {field.name for field in topics.BY_NAME["sensor_frame"].fields} == fields - {"t_us"}
    assert {field.type for field in topics.BY_NAME["sensor_frame"].fields} == {"double"}
    assert typing.get_type_hints(TickInputs)[TYPED] is SensorFrame


def test_the_topic_of_each_kind_of_sample_has_its_fields_in_their_order() -> None:
    assert set(topics.OF_SAMPLES) == set(typing.get_args(Sample))
    for kind, topic in topics.OF_SAMPLES.items():
        hints = typing.get_type_hints(kind)
        sizes = [len(typing.get_args(hint)) for hint in hints.values()]
        fields = [field for field in topic.fields if field.name != topics.SAMPLED]
        assert [field.count for field in fields] == sizes
        known = {int: "uint32_t", bool: "bool"}
        types = [known.get(hint, "double") for hint in hints.values()]
        assert [field.type for field in fields] == types
    assert typing.get_type_hints(TickInputs)[SAMPLES] == tuple[Sample, ...]


def test_in_lockstep_nothing_the_wall_clock_measured_is_written(tmp_path: Path) -> None:
    dice = random.Random(3)
    given = [inputs(1_000_000 + 2000 * k, dice) for k in range(60)]
    found = logged(tmp_path / "flight.ulg", given, lockstep=True)
    kept = PlanTimings(-1.0, -1.0, -1.0)
    for one, other in zip(found, given, strict=True):
        plan = other.plan
        if plan is not None:
            plan = dataclasses.replace(plan, timings=kept)
        assert digits(one) == digits(dataclasses.replace(other, plan=plan))


def test_an_input_that_would_not_survive_is_refused_at_once() -> None:
    @dataclasses.dataclass(frozen=True)
    class Bad:
        sensors: SensorFrame
        map: dict[str, float]

    for kind in (Bad,):
        with pytest.raises(TypeError, match="would not survive a log"):
            JsonCodec(kind)


def test_the_schema_names_every_field_down_to_the_numbers() -> None:
    schema = json.loads(JsonCodec(TickInputs).schema)
    assert schema["sensors"]["p_WB"] == ["float", "float", "float"]
    assert set(schema["plan"]) == {"Plan", "PlanFailure"}


def test_a_number_too_large_for_a_float_is_infinite_and_no_error() -> None:
    reported = outputs_at(1_000_000)
    snapshot = reported.snapshot
    far = snapshot.estimate._replace(p_WB=(1e300, -1e300, 0.0))
    reported = dataclasses.replace(reported, shown=dataclasses.replace(snapshot, estimate=far))
    encoder, out = LogEncoder(measured=True, airframe=VEHICLE), bytearray()
    encoder.add(inputs(1_000_000, random.Random(4)), reported, out)
    assert out
