"""Logs as PX4 writes them, read as pyulog reads them: every topic, field and last value."""

from __future__ import annotations

import math
import os
import struct
from pathlib import Path
from typing import Any

import pytest
from pyulog import ULog

from messages import ulog
from messages.ulog_reader import UlogError, columns, open_log, unpacker


def message(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<Hc", len(body), kind) + body


def declare(text: str) -> bytes:
    return message(b"F", text.encode())


def subscribe(name: str, number: int = 0, instance: int = 0) -> bytes:
    return message(b"A", struct.pack("<BH", instance, number) + name.encode())


def data(number: int, layout: str, *values: float) -> bytes:
    return message(b"D", struct.pack("<H" + layout, number, *values))


def key(kind: bytes, declared: str, value: bytes, before: bytes = b"") -> bytes:
    return message(kind, before + bytes([len(declared)]) + declared.encode() + value)


def log_of(body: bytes, flags: bytes = bytes(40)) -> bytes:
    return b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1) + message(b"B", flags) + body


PLAIN = declare("foo:uint64_t timestamp;float x;") + subscribe("foo")
ROW = data(0, "Qf", 5, 1.5)
LATER = message(b"Z", b"of a version to come")
CASES = {
    "plain": PLAIN + ROW,
    "a type inside another": declare("esc_report:uint64_t timestamp;int32_t rpm;")
    + declare("esc_status:uint64_t timestamp;esc_report[2] esc;uint8_t count;")
    + subscribe("esc_status")
    + data(0, "QQiQiB", 5, 5, 100, 5, 200, 2),
    "a type without a time inside another": declare("point:float[3] xyz;float w;")
    + declare("path:uint64_t timestamp;point p;point[2] more;")
    + subscribe("path")
    + data(0, "Q12f", 5, *(0.5 * k for k in range(12))),
    "padding at the end": declare("foo:uint64_t timestamp;float x;uint8_t[4] _padding0;")
    + subscribe("foo")
    + ROW,
    "padding in the middle": declare(
        "foo:uint64_t timestamp;bool b;uint8_t[3] _padding0;float x;uint8_t[4] _padding1;"
    )
    + subscribe("foo")
    + data(0, "Q?3xf", 5, True, 1.5),
    "defaults before formats": key(b"Q", "float MPC_X", struct.pack("<f", 1.0), b"\1")
    + PLAIN
    + ROW,
    "a format without a time that nobody uses": declare("odd:float x;") + PLAIN + ROW,
    "information in pieces": key(b"M", "char[3] sys_x", b"abc", b"\0") + PLAIN + ROW,
    "defaults among the data": PLAIN
    + key(b"Q", "float MPC_X", struct.pack("<f", 1.0), b"\1")
    + key(b"M", "char[3] sys_x", b"abc", b"\0")
    + ROW,
    "instances": PLAIN
    + subscribe("foo", 1, 1)
    + subscribe("foo", 7, 3)
    + ROW
    + data(1, "Qf", 6, 9.5)
    + data(7, "Qf", 7, 2.5),
}


def test_messages_of_a_later_version_are_ignored_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "later.ulg"
    foreign = LATER + key(b"I", "char[3] sys_name", b"PX4") + PLAIN + ROW + LATER + ROW
    path.write_bytes(log_of(foreign + LATER[:-2]))
    assert len(read(path)["foo"]) == 2
    log = open_log(path)
    assert sum(record.kind == ulog.DATA for record in log.records()) == 2
    assert log.unknown == {"Z": 2}
    assert not log.whole


def read(path: Path) -> dict[str, list[dict[str, Any]]]:
    log, rows = open_log(path), dict[str, list[dict[str, Any]]]()
    for record in log.records():
        if record.kind == ulog.DATA:
            topic = log.topics[record.number]
            values = unpacker(topic).unpack(record.body)
            named = dict(zip(columns(topic), values, strict=True))
            rows.setdefault(topic.name, []).append(named)
    return rows


@pytest.mark.parametrize("body", CASES.values(), ids=CASES)
def test_it_is_read_as_pyulog_reads_it(body: bytes, tmp_path: Path) -> None:
    path = tmp_path / "px4.ulg"
    path.write_bytes(log_of(body))
    ours, theirs = read(path), ULog(str(path))
    assert not theirs.file_corruption
    assert len(ours) == len(theirs.data_list) > 0
    for dataset in theirs.data_list:
        name = f"{dataset.name}_{dataset.multi_id}" if dataset.multi_id else dataset.name
        assert len(ours[name]) == len(dataset.data["timestamp"])
        fields = {field for field in dataset.data if "_padding" not in field}
        assert set(ours[name][-1]) == fields
        for field in fields:
            values = dataset.data[field]
            assert math.isclose(ours[name][-1][field], values[-1])


def test_data_that_were_appended_into_a_cut_message_are_read(tmp_path: Path) -> None:
    first = log_of(PLAIN + ROW)
    cut = first + data(0, "Qf", 6, 2.5)[:-3]
    flags = bytearray(40)
    flags[8] = 1
    flags[16:24] = struct.pack("<Q", len(cut))
    path = tmp_path / "appended.ulg"
    path.write_bytes(log_of(PLAIN + ROW, bytes(flags)) + cut[len(first) :] + data(0, "Qf", 9, 4.5))
    assert [row["x"] for row in read(path)["foo"]] == [1.5, 4.5]


def test_a_log_that_is_cut_while_it_is_read_is_read_up_to_there(tmp_path: Path) -> None:
    path = tmp_path / "cut.ulg"
    path.write_bytes(log_of(PLAIN + 10_000 * ROW))
    log = open_log(path)
    records = log.records()
    next(records)
    os.truncate(path, 200)
    assert sum(1 for _ in records) < 10_000
    assert not log.whole


def test_a_subscription_may_end_and_its_number_be_given_again(tmp_path: Path) -> None:
    path = tmp_path / "removed.ulg"
    bar = declare("bar:uint64_t timestamp;double y;")
    again = message(b"R", struct.pack("<H", 0)) + subscribe("bar") + data(0, "Qd", 6, 0.25)
    path.write_bytes(log_of(bar + PLAIN + ROW + again))
    assert read(path) == {
        "foo": [{"timestamp": 5, "x": 1.5}],
        "bar": [{"timestamp": 6, "y": 0.25}],
    }


@pytest.mark.parametrize(
    ("body", "flags", "why"),
    [
        (declare("foo:uint64_t timestamp;nix x;") + subscribe("foo"), 0, "unknown type 'nix'"),
        (declare("foo:uint64_t timestamp;foo x;") + subscribe("foo"), 0, "nested more than"),
        (declare("foo:float x;") + subscribe("foo") + data(0, "f", 1.0), 0, "begin with a time"),
        (PLAIN + ROW, 2, "features that this build does not know"),
        (
            declare("a:uint64_t timestamp;b[60000] x;") + declare("b:float[60000] y;")
            + subscribe("a"), 0, "more than",
        ),
        (
            b"".join(declare(f"t{k}:uint64_t timestamp;t{k + 1}[99] x;") for k in range(7))
            + declare("t7:float x;") + subscribe("t0"), 0, "too many fields",
        ),
        # Megabytes of names out of kilobytes: of many siblings, of a long name, of a long array.
        (
            declare("a:" + "char a;" * 1000) + declare("b:uint64_t timestamp;" + "a a;" * 1000)
            + subscribe("b"), 0, "too many fields",
        ),
        (
            declare(f"a:char {'n' * 1000};") + declare("b:uint64_t timestamp;a[5000] a;")
            + subscribe("b"), 0, "too many fields",
        ),
        (
            declare(f"a:uint64_t timestamp;uint8_t[5000] {'n' * 1000};") + subscribe("a"),
            0, "too many fields",
        ),
        (PLAIN + ROW + message(b"R", struct.pack("<H", 0)) + ROW, 0, "topic 0 has 12 bytes"),
        (PLAIN + ROW + bytes(40), 0, "no kind of message"),
        (key(b"I", "char[7] sys_name", b"Pandion") + PLAIN + LATER, 0, "no kind of message"),
        (LATER + key(b"I", "char[7] sys_name", b"Pandion") + PLAIN, 0, "among definitions"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_said_in_a_sentence(
    body: bytes, flags: int, why: str, tmp_path: Path
) -> None:
    path = tmp_path / "wrong.ulg"
    set_flags = bytearray(40)
    set_flags[8] = flags
    path.write_bytes(log_of(body, bytes(set_flags)))
    with pytest.raises(UlogError, match=why):
        read(path)
