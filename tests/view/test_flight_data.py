"""Tests of the reader that gives a log as arrays."""

from pathlib import Path

import numpy as np
import pytest

from messages import ulog
from messages.ulog import Topic
from view.flight_data import UlogError, read_flight

PLACE, INPUT = ulog.declared("""
place | - | -
  double[3] p: m
  char[8] mode

tick_input | - | -
  char[24] field
  uint16_t part, parts
  char[4] text
""")


def record(number: int, topic: Topic, *values: object) -> bytes:
    import struct

    return ulog.data_head(number, topic) + struct.pack("<" + topic.codes, *values)


def write(path: Path, *data: bytes) -> Path:
    definitions = [ulog.format_of(PLACE), ulog.format_of(INPUT), ulog.information("seed", 3)]
    begin = ulog.opening(0) + b"".join(definitions)
    begin += ulog.subscription(0, PLACE) + ulog.subscription(1, INPUT)
    path.write_bytes(begin + b"".join(data))
    return path


def test_records_become_columns_in_order_of_time(tmp_path: Path) -> None:
    path = write(
        tmp_path / "flight.ulg",
        record(0, PLACE, 2_000_000, 1.0, 2.0, 3.0, b"hold"),
        record(0, PLACE, 1_000_000, 4.0, 5.0, 6.0, b"land"),
        ulog.logged_text(4, 1_500_000, "low"),
    )
    data = read_flight(path)
    table = data.tables["place"]
    np.testing.assert_array_equal(table.t, [1.0, 2.0])
    np.testing.assert_array_equal(table["p"], [[4.0, 5.0, 6.0], [1.0, 2.0, 3.0]])
    assert table["mode"].tolist() == [b"land", b"hold"]
    assert (data.begin, data.end, data.texts[0].text) == (1.0, 2.0, "low")
    assert data.information["seed"] == 3


def test_a_long_input_is_one_text_again(tmp_path: Path) -> None:
    path = write(
        tmp_path / "flight.ulg",
        record(0, PLACE, 1, 0.0, 0.0, 0.0, b""),
        record(1, INPUT, 1_000_000, b"stale_us", 0, 2, b"1234"),
        record(1, INPUT, 1_000_000, b"stale_us", 1, 2, b"5"),
    )
    assert read_flight(path).decoded("stale_us") == [(1.0, 12345)]


def test_a_log_without_a_record_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UlogError, match="holds no record"):
        read_flight(write(tmp_path / "flight.ulg", ulog.message(ulog.SYNC, ulog.SYNC_BYTES)))


def test_what_lies_beside_the_log_is_read_as_far_as_it_can(tmp_path: Path) -> None:
    path = write(tmp_path / "flight.ulg", record(0, PLACE, 1, 0.0, 0.0, 0.0, b""))
    (tmp_path / "result.json").write_text('{"min_margin_m": 0.25}')
    (tmp_path / "sitl.json").write_text("{")
    assert read_flight(path.parent).beside == {"result": {"min_margin_m": 0.25}}
