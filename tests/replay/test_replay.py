"""A logged flight, fed through the tick again: equal to the bit, or the first difference named."""

from __future__ import annotations

import json
import math
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pyulog import ULog

from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.state import first_state
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.signals import TickInputs, TickOutputs
from fsw.autopilot.tuning import flat
from fsw.log import topics
from fsw.log.flight_log import LogSubject, definitions
from fsw.runtime.assembly import flight_software
from messages import ulog
from messages.ulog_reader import UlogError
from pandion.flight_replay import Replayed, other_numbers, replay
from pandion.logged_ticks import open_flight
from pandion.replay import main
from pandion.replayed_definitions import compare_definitions
from tests.replay.recorded import CHOICE, flight, written
from view.flight_data import read_flight

SECONDS = 0.8


@pytest.fixture(scope="module")
def flown() -> list[tuple[TickInputs, TickOutputs]]:
    return flight(SECONDS)


def replayed(path: Path, config: FlightConfig | None = None) -> Replayed:
    """What a replay finds; with another configuration than the flight's, if one is given."""
    program = flight_software(CHOICE, to_plan=False)
    if config is not None:
        loop = Autopilot(config)
        program = replace(
            program, control=loop.control, conclude=loop.conclude, numbers=flat(config)
        )
    return replay(open_flight(path), program, lambda done, total: None)


@pytest.mark.requirement("REQ-TIME-8")
@pytest.mark.parametrize("lockstep", [True, False], ids=["lockstep", "realtime"])
def test_the_same_code_does_the_same(
    lockstep: bool, flown: list[tuple[TickInputs, TickOutputs]], tmp_path: Path
) -> None:
    path = written(tmp_path / "flight.ulg", flown, lockstep)
    assert replayed(path) == Replayed(len(flown), None, 0)


def test_what_a_log_holds_names_the_vehicle(
    flown: list[tuple[TickInputs, TickOutputs]], tmp_path: Path
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    assert main([str(path), "--json", str(tmp_path / "found.json")]) == 0
    assert json.loads((tmp_path / "found.json").read_text())["vehicle"] == "paper"


def with_another_gain() -> FlightConfig:
    config = flight_config(body="points")
    tuning = replace(config.tuning, joint=replace(config.tuning.joint, kp=625.001))
    return replace(config, tuning=tuning)


def test_one_gain_changed_is_found_at_the_tick_at_which_it_first_matters(
    flown: list[tuple[TickInputs, TickOutputs]], tmp_path: Path
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    config = with_another_gain()
    loop, state, right = Autopilot(config), first_state(AIRFRAME), -1
    for k, (inputs, outputs) in enumerate(flown):
        state, now = loop.tick(state, inputs)
        if now.actuators != outputs.actuators:
            right = k
            break
    found = replayed(path, config)
    assert found.difference is not None
    assert found.ticks == found.difference.tick == right > 0
    assert found.difference.t_us == flown[right][0].sensors.t_us
    assert found.difference.field.startswith("actuator_command.")
    logged, now_is = found.difference.logged, found.difference.replayed
    both = (*outputs.actuators.rotor_thrust, *outputs.actuators.joint_torque)
    assert logged in both
    assert now_is in (*now.actuators.rotor_thrust, *now.actuators.joint_torque)
    program = replace(flight_software(CHOICE, to_plan=False), numbers=flat(config))
    assert other_numbers(open_flight(path), program) == (
        "tuning.joint.kp is 625.001 here and was 625.0",
    )


def spoil(path: Path, topic: str, tick: int, value: int, byte: int = 0) -> None:
    """Flip the lowest bit of a byte of a double in a record of a tick."""
    data, at = bytearray(path.read_bytes()), 0
    head = head_of(topic)
    for _ in range(tick + 1):
        at = data.index(head, at) + len(head)
    data[at + 8 + 8 * value + byte] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("tick", [0, 77, 200])
def test_a_bit_of_a_sensor_is_found_in_the_tick_that_used_it(
    tick: int, flown: list[tuple[TickInputs, TickOutputs]], tmp_path: Path
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    spoil(path, "sensor_frame", tick, value=2, byte=5)  # the height, by some 50 um
    found = replayed(path)
    assert found.difference is not None
    assert found.ticks == found.difference.tick == tick


def test_a_bit_of_an_actuator_is_found_and_named_with_both_values(
    flown: list[tuple[TickInputs, TickOutputs]], tmp_path: Path
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    spoil(path, "actuator_command", 50, 2)
    found = replayed(path)
    assert found.difference is not None
    assert found.ticks == found.difference.tick == 50
    assert found.difference.field == "actuator_command.rotor_thrust[2]"
    assert found.difference.replayed == flown[50][1].actuators.rotor_thrust[2]
    assert found.difference.logged == pytest.approx(found.difference.replayed, rel=1e-15)
    assert found.difference.logged != found.difference.replayed


def test_a_text_said_otherwise_is_found(
    flown: list[tuple[TickInputs, TickOutputs]], tmp_path: Path
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    path.write_bytes(
        path.read_bytes().replace(b"hold to trajectory: command", b"hold to trajectory: commanx")
    )
    found = replayed(path).difference
    assert found is not None
    assert (found.tick, found.field) == (1, "text")
    assert str(found.logged).replace("commanx", "command") == found.replayed


@pytest.mark.parametrize(
    ("field", "was", "becomes"),
    [
        ("vehicle_status.mode", b"trajectory\0\0\0\0\0\0", b"trajectorx\0\0\0\0\0\0"),
        ("tick_input.text", b"0.0,", b"0e0,"),  # the same number otherwise
    ],
)
def test_a_letter_is_found_and_told_as_text_in_json_too(
    field: str,
    was: bytes,
    becomes: bytes,
    flown: list[tuple[TickInputs, TickOutputs]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    data = path.read_bytes()
    at = data.index(was, data.index(head_of("sensor_frame")))
    said, result = verified(path, data[:at] + becomes + data[at + len(was) :], capsys, code=1)
    assert f": {field} was '" in said
    found = result["difference"]
    assert found["field"] == field
    assert becomes.rstrip(b"\0").decode() in found["logged"]
    assert was.rstrip(b"\0").decode() in found["replayed"]


def test_what_is_no_number_is_told_as_text_for_json_has_none(
    flown: list[tuple[TickInputs, TickOutputs]], tmp_path: Path
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    data, head = bytearray(path.read_bytes()), head_of("actuator_command")
    at = data.index(head) + len(head) + 8
    data[at : at + 8] = struct.pack("<d", math.nan)
    path.write_bytes(data)
    found = replayed(path).difference
    assert found is not None
    assert (found.field, found.logged) == ("actuator_command.rotor_thrust[0]", "nan")


def verified(
    path: Path, content: bytes, capsys: pytest.CaptureFixture[str], code: int = 0
) -> tuple[str, dict[str, Any]]:
    """What a comparison prints of a log of these bytes, and its result, with this exit code."""
    path.write_bytes(content)
    assert main([str(path), "--verify", "--json", str(path.parent / "found.json")]) == code
    found: dict[str, Any] = json.loads((path.parent / "found.json").read_text())
    return capsys.readouterr().out, found


@pytest.mark.parametrize("lockstep", [True, False], ids=["lockstep", "realtime"])
def test_what_stands_around_the_ticks_is_compared_or_named(
    lockstep: bool,
    flown: list[tuple[TickInputs, TickOutputs]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = written(tmp_path / "flight.ulg", flown, lockstep)
    said, found = verified(path, path.read_bytes(), capsys)
    assert (found["other_numbers"], found["other_definitions"]) == ([], [])
    assert (found["whole"], found["not_compared"]) == (True, ["vehicle", "loop_timing", "cpuload"])
    assert said.splitlines() == [
        "note: not compared, for no tick makes it: vehicle, loop_timing, cpuload",
        f"no difference in {len(flown)} ticks",
    ]


def test_a_parameter_of_the_first_tick_is_no_difference(
    flown: list[tuple[TickInputs, TickOutputs]], tmp_path: Path
) -> None:
    """A vehicle whose parameters are not the default tells its first tick."""
    gain = BY_NAME["TRK_DIST_TAU"]
    tuning = ((gain.path, 2.0 * gain.default * gain.scale),)
    inputs, outputs = flown[0]
    path = written(tmp_path / "flight.ulg", [(replace(inputs, tuning=tuning), outputs)])
    was = ulog.parameter(gain.name, gain.default)
    path.write_bytes(path.read_bytes().replace(was, ulog.parameter(gain.name, 2.0 * gain.default)))
    program, log = flight_software(CHOICE, to_plan=False), open_flight(path)
    found = replay(log, program, lambda done, total: None)
    assert compare_definitions(log, program, found)[0] == ()


LAMBDA = "planner.walls.lambda_"
FORMAT = b"vehicle_local_position:uint64_t timestamp;float x;float y;"


@pytest.mark.parametrize(
    ("was", "becomes", "told"),
    [
        (
            ulog.parameter(LAMBDA, flat(flight_config(body="points"))[LAMBDA]),
            ulog.parameter(LAMBDA, 9.9),
            f"parameter {LAMBDA} is 0.35 here and was 9.9",
        ),
        (
            ulog.parameter("MAV_TYPE", 2),
            ulog.parameter("MAV_TYPE", 1),
            "parameter MAV_TYPE is 2 here and was 1",
        ),
        (
            ulog.parameter("MAV_SYS_ID", 1),
            b"",
            "parameter MAV_SYS_ID is 1 here and was unknown",
        ),
        (
            ulog.parameter("MAV_SYS_ID", 1),
            ulog.parameter("MAV_SYS_ID", 1) + ulog.parameter("OF_NO_USE", 1),
            "parameter OF_NO_USE is unknown here and was 1",
        ),
        (
            ulog.information("ver_data_format", 2),
            ulog.information("ver_data_format", 1),
            "information ver_data_format is 2 here and was 1",
        ),
        (FORMAT, FORMAT.replace(b"x;float y", b"y;float x"),
         "the fields of vehicle_local_position are named otherwise here"),
        (ulog.opening(1_000_000), ulog.opening(7),
         "the first tick was at 1000000 us, and the log says 7 us"),
    ],
    ids=["number", "fact", "missing", "more", "information", "fields", "begin"],
)  # fmt: skip
def test_what_other_tools_show_is_compared_too(
    was: bytes,
    becomes: bytes,
    told: str,
    flown: list[tuple[TickInputs, TickOutputs]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    content = path.read_bytes()
    assert content.count(was) == 1
    said, found = verified(path, content.replace(was, becomes), capsys)
    assert f"note: {told}\n" in said
    assert found["other_definitions"] == [told]


@pytest.mark.parametrize(
    "again",
    [ulog.information("controller", "hc"), ulog.parameter(LAMBDA, 9.9)],
    ids=["information", "parameter"],
)
def test_a_fact_that_is_there_twice_is_damage_for_tools_show_either(
    again: bytes,
    flown: list[tuple[TickInputs, TickOutputs]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    path.write_bytes(path.read_bytes() + again)
    assert main([str(path), "--verify"]) == 2
    assert "is there twice" in capsys.readouterr().err


def test_messages_that_no_flight_writes_are_named_as_not_compared(
    flown: list[tuple[TickInputs, TickOutputs]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    default = ulog.message(ulog.DEFAULT_PARAMETER, b"\x01" + ulog.parameter(LAMBDA, 9.9)[3:])
    _, found = verified(path, path.read_bytes() + default, capsys)
    assert found["not_compared"][-1] == "messages of kind Q"


def test_a_log_cut_behind_any_block_does_not_reach_the_end_of_the_flight(
    flown: list[tuple[TickInputs, TickOutputs]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    whole, marks, at = path.read_bytes(), list[int](), 0
    while (at := whole.find(ulog.sync(), at)) >= 0:
        at += len(ulog.sync())
        marks.append(at)
    assert marks[-1] == len(whole)
    assert len(marks) > 2
    assert ULog(str(path)).msg_info_dict["ticks"] == len(flown)
    for end in marks[:-1]:
        said, found = verified(path, whole[:end], capsys)
        assert not found["whole"]
        assert found["ticks"] < len(flown)
        assert "; the log does not say that it ends there: it was cut, or an older" in said
        assert main([str(path)]) == 0
        assert "remark          the log does not say that it ends" in capsys.readouterr().out
        assert read_flight(path).cut
    # And with an end that is not its own.
    said, found = verified(path, whole[: marks[0]] + ulog.information("ticks", 7), capsys)
    assert f"note: information ticks is {found['ticks']} here and was 7" in said


def head_of(topic: str) -> bytes:
    return ulog.data_head(topics.NUMBERS[topic], topics.BY_NAME[topic])


def test_a_tick_that_fails_now_is_a_difference(
    flown: list[tuple[TickInputs, TickOutputs]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def failing(state: object, inputs: TickInputs) -> tuple[object, TickOutputs]:
        raise ArithmeticError("no such thing")

    path = written(tmp_path / "flight.ulg", flown)
    program = replace(flight_software(CHOICE, to_plan=False), control=failing)
    found = replay(open_flight(path), program, lambda done, total: None).difference
    assert found is not None
    assert (found.tick, found.field) == (0, "the tick")
    assert found.replayed == "ArithmeticError: no such thing"
    assert capsys.readouterr().err == ""


def test_a_log_without_a_record_the_tick_makes_names_the_record(
    flown: list[tuple[TickInputs, TickOutputs]], tmp_path: Path
) -> None:
    silent = [(inputs, replace(outputs, acks=())) for inputs, outputs in flown]
    found = replayed(written(tmp_path / "flight.ulg", silent)).difference
    assert found is not None
    assert (found.tick, found.field, found.replayed) == (0, "record", "vehicle_command_ack")


def test_behind_a_gap_nothing_is_compared(
    flown: list[tuple[TickInputs, TickOutputs]], tmp_path: Path
) -> None:
    path = written(tmp_path / "flight.ulg", flown)
    data, head = path.read_bytes(), head_of("sensor_frame")
    begin = -1
    for _ in range(101):
        begin = data.index(head, begin + 1)
    end = data.index(head, begin + 1)
    path.write_bytes(data[:begin] + ulog.dropout(2) + data[end:])
    assert replayed(path) == Replayed(100, None, 2)


def test_a_log_of_other_fields_is_refused_with_its_revision(tmp_path: Path) -> None:
    subject = LogSubject({"ver_sw": "0123abc"}, {}, {}, AIRFRAME)
    path = tmp_path / "flight.ulg"
    path.write_bytes(definitions(0, subject, "lockstep", '{"sensors":"other"}'))
    with pytest.raises(UlogError, match="has other fields than this build reads; it is of 0123abc"):
        open_flight(path)
    path.write_bytes(ulog.opening(0) + ulog.sync())
    with pytest.raises(UlogError, match="records no inputs"):
        open_flight(tmp_path)
