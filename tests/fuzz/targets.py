"""Every reader of files and of datagrams, as a function of bytes that raises on a finding only.

A reader's own refusal is no finding; any other exception is one.
"""

from __future__ import annotations

import json
import struct
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import fastcrc

from docs.pages.messages import heard
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.parameters.control_choice import choice_of
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.link.endpoints import LinkError
from fsw.link.inbox import Inbox
from fsw.link.signing.key_file import KeyFile
from fsw.link.sim_link import SimLink
from fsw.link.telemetry.streams import STREAMS
from fsw.runtime.assembly import flight_software
from fsw.runtime.clock import now_us
from fsw.storage import parameter_file as storage
from messages import dialect, ulog
from messages import message_ids as ids
from messages.frames import cut
from messages.message_ids import SYSTEM_ID
from messages.ulog_reader import UlogError, open_log
from pandion.flight_replay import fact, other_numbers, replay
from pandion.log_summary import summary
from pandion.logged_ticks import open_flight
from pandion.report import write_report
from sitl.link.decode import read_reply
from sitl.link.encode import StepEncoder
from sitl.link.failures import Answer
from sitl.scenario_file import PACKAGED, ScenarioError, parse_scenario
from sitl.scenario_validation import check
from tests.fsw.link.ground import station_socket, whole_vehicle
from tests.fsw.link.snapshots import FACTS
from tests.messages.test_ulog import written
from tests.replay import recorded
from tests.view import flights
from tests.view.test_telemetry import a_log
from vehicles.vehicle_file import load_vehicle
from view.log_flight import LogFlight
from view.tlog_flight import TlogFlight

Try = Callable[[bytes], None]
_MAX_FRAMES = 8
_INPUT = struct.pack("<H", flights.NUMBERS["tick_input"])  # begins each of its records
_STATION = 255  # MAVLink system
# What a simulator reads of a vehicle; the controls come last in a datagram.
_REPLIES = (
    ids.COMMAND_LONG,
    ids.COMMAND_ACK,
    ids.STATUSTEXT,
    ids.HEARTBEAT,
    ids.HIL_ACTUATOR_CONTROLS,
)


def _scenario(stack: ExitStack) -> Try:
    def attempt(data: bytes) -> None:
        with suppress(ScenarioError, UnicodeDecodeError):  # the latter is told by ``load_scenario``
            check(parse_scenario(data.decode("utf-8"), "fuzzed"))

    return attempt


def _parameters(stack: ExitStack) -> Try:
    def attempt(data: bytes) -> None:
        loaded = storage.parse(data.decode("utf-8", "replace"))
        again = storage.parse(storage.as_params(loaded.values))
        assert again.values == loaded.values
        assert not again.complaints

    return attempt


_LATEST = 1 << 47  # of a signing time


def _key(stack: ExitStack) -> Try:
    path = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "key.json"

    def attempt(data: bytes) -> None:
        path.write_bytes(data)
        path.chmod(0o600)
        file = KeyFile(path)
        with suppress(LinkError):
            file.read(_LATEST)
        file.close()

    return attempt


def _flight_log(stack: ExitStack) -> Try:
    path = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "flight.ulg"

    def attempt(data: bytes) -> None:
        path.write_bytes(data)
        with suppress(UlogError):
            summary(open_log(path), lambda done, total: None)

    return attempt


def _datagrams(stack: ExitStack) -> Try:
    def attempt(data: bytes) -> None:
        for frame, raw in cut(data):
            assert raw in data
            assert frame.message_id in dialect.mavlink_map

    return attempt


def _valid_frames(
    data: bytes, listened: tuple[int, ...], sender: int = _STATION
) -> Iterator[bytes]:
    """Frames with right checksums: an index into ``listened``, a length, a payload, and so on."""
    at = 0
    for sequence in range(_MAX_FRAMES):
        if at + 2 > len(data):
            return
        message_id, size = listened[data[at] % len(listened)], data[at + 1]
        message = dialect.mavlink_map[message_id]
        payload = data[at + 2 : at + 2 + min(size, message.unpacker.size)] or b"\0"
        at += 2 + len(payload)
        body = struct.pack("<BBBBBB", len(payload), 0, 0, sequence, sender, 190)
        body += message_id.to_bytes(3, "little") + payload
        checksum = fastcrc.crc16.mcrf4xx(body + bytes([message.crc_extra]))
        yield b"\xfd" + body + checksum.to_bytes(2, "little")


def _ground_link(stack: ExitStack) -> Try:
    vehicle = stack.enter_context(
        whole_vehicle(Path(stack.enter_context(tempfile.TemporaryDirectory())))
    )
    listened = tuple(sorted(heard() - {ids.SETUP_SIGNING}))  # a key would shut everything out
    tries = 0

    def attempt(data: bytes) -> None:
        nonlocal tries
        for frame in _valid_frames(data, listened):
            vehicle.polled(frame)
        tries += 1
        if tries % 20 == 0:
            vehicle.fly(1)
        vehicle.inbox.take()
        vehicle.recorded.clear()
        assert vehicle.link.dispatch.failures == 0
        assert vehicle.link.outbox.encode_failures == 0

    return attempt


def _simulator_link(stack: ExitStack) -> Try:
    simulator = stack.enter_context(station_socket())
    inbox = Inbox()
    link = SimLink(simulator.getsockname(), inbox, FACTS, now_us)
    stack.callback(link.close)
    link.announce()
    _, vehicle = simulator.recvfrom(2048)
    listened = (
        *(ids.HEARTBEAT, ids.HIL_SENSOR, ids.HIL_GPS, ids.ODOMETRY, ids.DISTANCE_SENSOR),
        *(ids.ARM_JOINT_STATE, ids.JOINT_ENCODERS, ids.COMMAND_LONG),
    )

    def attempt(data: bytes) -> None:
        simulator.sendto(b"".join(_valid_frames(data, listened)) or data, vehicle)
        link.newest()
        inbox.take()
        link.notices.clear()

    return attempt


def _vehicle_replies(stack: ExitStack) -> Try:
    encoder, done = StepEncoder(lockstep=True), Answer(0, "fault injected")

    def attempt(data: bytes) -> None:
        reply = read_reply(b"".join(_valid_frames(data, _REPLIES)) or data, load_vehicle("paper"))
        for one in () if reply is None else reply.injections:
            encoder.answer(one, done)

    return attempt


def _tlog(stack: ExitStack) -> Try:
    path = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "flight.tlog"
    told = tuple(sorted({stream.message_id for stream in STREAMS} | {ids.OBSTACLE_SHAPE}))

    def attempt(data: bytes) -> None:
        frames = list(_valid_frames(data, told, SYSTEM_ID))
        path.write_bytes(b"".join(bytes(8) + frame for frame in frames) or data)
        with suppress(UlogError):
            flight = TlogFlight(path, AIRFRAME)
            flight.scene(flight.end)
            flight.region()
            flight.curves()
            flight.reference()

    return attempt


def _messages(log: bytes) -> list[tuple[bytes, bytes]]:
    """Kind and body of each message behind the header of a log."""
    found, at = [], 16
    while at < len(log):
        length, kind = struct.unpack_from("<Hc", log, at)
        found.append((kind, log[at + 3 : at + 3 + length]))
        at += 3 + length
    return found


def _edited(log: bytes, data: bytes) -> bytes:
    """A log with one of its definitions, or a record, as the data say, and records after it.

    Of a log whose every byte may change, hardly any that changes is still read beyond its head.
    """
    if len(data) < 2:
        return log
    messages = _messages(log)
    named = [k for k, (kind, _) in enumerate(messages) if kind in (ulog.INFO, ulog.FORMAT)]
    records = [k for k, (kind, _) in enumerate(messages) if kind == ulog.DATA]
    what, which, rest = data[0] % 4, data[1], data[2:]
    if what == 0:  # the value of an information, or the fields of a topic
        at = named[which % len(named)]
        kind, body = messages[at]
        if kind == ulog.FORMAT:
            messages[at] = kind, body.partition(b":")[0] + b":uint64_t timestamp;" + rest
        else:
            name = body[1 : 1 + body[0]].decode("ascii").partition(" ")[2]
            key = f"char[{len(rest)}] {name}".encode("ascii")
            messages[at] = kind, bytes([len(key)]) + key + rest
    elif what == 1:  # the value of an input, in one piece
        inputs = [k for k in records if messages[k][1][:2] == _INPUT]
        at = inputs[which % len(inputs)]
        kind, body = messages[at]
        size = flights.topics.TEXT_SIZE
        messages[at] = kind, body[: -size - 2] + b"\x00\x01" + rest[:size].ljust(size, b"\0")
    elif what == 2:  # bytes of a record
        at = records[which % len(records)]
        kind, body = messages[at]
        messages[at] = kind, body[:2] + (rest + body[2 + len(rest) :])[: len(body) - 2]
    else:
        return log + (rest if which % 2 else ulog.message(ulog.SUBSCRIPTION, rest))
    return log[:16] + b"".join(ulog.message(*one) for one in messages)


def _replay(stack: ExitStack) -> Try:
    directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    log = recorded.written(directory / "whole.ulg", recorded.flight(0.02)).read_bytes()
    program = flight_software(recorded.CHOICE, to_plan=False)
    path = directory / "flight.ulg"

    def attempt(data: bytes) -> None:
        path.write_bytes(_edited(log, data))
        with suppress(UlogError):
            read = open_flight(path)
            with suppress(ValueError):  # a controller that this build does not have
                choice_of(lambda name: fact(read, name))
            other_numbers(read, program)
            replay(read, program, lambda done, total: None)

    return attempt


def _log_pages(stack: ExitStack) -> Try:
    directory = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "flight"
    path = flights.write_flight(directory, seconds=1) / "flight.ulg"
    log = path.read_bytes()

    def attempt(data: bytes) -> None:
        path.write_bytes(_edited(log, data))
        with suppress(UlogError):
            flight = LogFlight(path)
            flight.scene(flight.end)
            flight.region()
            flight.curves()
            flight.reference()
        with suppress(UlogError):
            write_report([path])

    return attempt


_VALUES: tuple[str, ...] = (
    *("null", "true", "0", "-1", "1e308", "NaN", "1e999", "9" * 30, '""', '"walls"', "[]", "{}"),
    *("[1, 2]", '{"a": 1}', '{"a": null}', "0.5", '"\\ud800"', "[" * 40 + "]" * 40),
)


def _places(value: object, above: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Of every value in objects in each other."""
    if not isinstance(value, dict):
        return [above] if above else []
    inner = [place for key, part in value.items() for place in _places(part, (*above, key))]
    return [*([above] if above else []), *inner]


def _with_values(text: str, data: bytes) -> str:
    """An object with values replaced: the place of each, and the value; or without the place."""
    for at in range(0, len(data) - 1, 2):
        value = json.loads(text)
        places = _places(value)
        if not places:
            return text
        *above, last = places[data[at] % len(places)]
        table = value
        for key in above:
            table = table[key]
        if data[at + 1] % (len(_VALUES) + 1) == len(_VALUES):
            del table[last]
        else:
            table[last] = "(here)"
        other = _VALUES[data[at + 1] % (len(_VALUES) + 1) - 1]
        text = json.dumps(value).replace('"(here)"', other)
        if "ud800" in other or other in ("NaN", "1e999"):
            return text  # what Python reads, but would not write again
    return text


def _results(stack: ExitStack) -> Try:
    directory = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "flight"
    flights.write_flight(directory, seconds=1)
    whole = {name: (directory / f"{name}.json").read_text() for name in ("result", "sitl", "fsw")}

    def attempt(data: bytes) -> None:
        for name, text in whole.items():
            (directory / f"{name}.json").write_text(text)
        if len(data) < 2:
            return
        name = list(whole)[data[0] % 3]
        if data[0] & 128:
            (directory / f"{name}.json").write_bytes(data[1:])
        else:
            (directory / f"{name}.json").write_text(_with_values(whole[name], data[1:]))
        LogFlight(directory)
        with suppress(UlogError):
            write_report([directory])

    return attempt


SET_UPS: dict[str, Callable[[ExitStack], Try]] = {
    "scenario": _scenario,
    "parameters": _parameters,
    "key": _key,
    "flight-log": _flight_log,
    "datagrams": _datagrams,
    "ground-link": _ground_link,
    "simulator-link": _simulator_link,
    "vehicle-replies": _vehicle_replies,
    "tlog": _tlog,
    "replay": _replay,
    "log-pages": _log_pages,
    "results": _results,
}


def seeds(name: str) -> list[bytes]:
    """Inputs that a reader likes, to begin with where nothing was kept yet."""
    if name == "scenario":
        return [path.read_bytes() for path in sorted(PACKAGED.glob("*.toml"))]
    if name == "parameters":
        values = {parameter.name: parameter.default for parameter in PARAMETERS[:20]}
        return [storage.as_params(values).encode(), storage.as_parm(values).encode()]
    if name == "key":
        return [b'{"key": "%s", "newest": 5}' % (b"0a" * 32)]
    if name == "flight-log":
        return [written()]
    if name == "datagrams":
        return list(_valid_frames(bytes(range(1, 255)), tuple(dialect.mavlink_map)))
    if name in ("replay", "log-pages"):
        return [bytes([what, which, *b'{"a": [1.5]}']) for what in range(4) for which in range(40)]
    if name == "results":
        return [
            *(
                bytes([k, place, value])
                for k in range(3)
                for place in range(9)
                for value in (0, 11)
            ),
            *(bytes([128 + k]) + b"[" * 2000 for k in range(3)),
            b"\x80[1, 2]",
        ]
    if name == "tlog":
        return [a_log(2)]
    return [bytes([k, 40, *range(40)]) for k in range(80)]
