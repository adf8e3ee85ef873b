"""What is written is what pyulog reads, which knows nothing of this code."""

from __future__ import annotations

import io
from pathlib import Path
from struct import pack

import pytest
from pyulog import ULog

from messages import ulog
from messages.ulog import Field, Topic
from messages.ulog_reader import UlogError, columns, open_log, unpacker

EVERY_TYPE = Topic(
    "every_type",
    "",
    "",
    (
        Field("a_bool", "bool"),
        Field("small", "int8_t"),
        Field("large", "uint64_t"),
        Field("real", "double"),
        Field("three", "float", 3),
        Field("text", "char", 8),
        Field("port", "uint16_t"),
    ),
)
ROWS = [
    (1_000_000, True, -7, 1 << 60, 0.1, 1.0, 2.0, 3.0, b"walls", 4560),
    (1_002_000, False, 7, 0, -0.1, 4.0, 5.0, 6.0, b"", 1),
]


def written() -> bytes:
    head = ulog.data_head(3, EVERY_TYPE)
    records = [head + unpacker(EVERY_TYPE).pack(*row) for row in ROWS]
    return b"".join(
        (
            ulog.opening(1_000_000),
            ulog.information("sys_name", "Pandion ü"),
            ulog.information("seed", 5),
            ulog.format_of(EVERY_TYPE),
            ulog.parameter("planner.horizon", 5),
            ulog.parameter("airframe.mass", 3.5),
            ulog.parameter("too.large", 1 << 40),
            ulog.subscription(3, EVERY_TYPE),
            records[0],
            ulog.logged_text(4, 1_000_500, "beware"),
            ulog.tagged_text(3, 7, 1_000_600, "it died"),
            ulog.dropout(20),
            ulog.sync(),
            records[1],
        )
    )


def test_pyulog_reads_every_type_back() -> None:
    log = ULog(io.BytesIO(written()))
    assert not log.file_corruption
    assert log.start_timestamp == 1_000_000
    assert log.msg_info_dict == {"sys_name": "Pandion ü", "seed": 5}
    assert log.initial_parameters == {
        "planner.horizon": 5, "airframe.mass": 3.5, "too.large": float(1 << 40),
    }  # fmt: skip
    (data,) = log.data_list
    assert data.name == "every_type"
    assert data.data["timestamp"].tolist() == [1_000_000, 1_002_000]
    assert data.data["a_bool"].tolist() == [1, 0]
    assert data.data["small"].tolist() == [-7, 7]
    assert data.data["large"].tolist() == [1 << 60, 0]
    assert data.data["real"].tolist() == [0.1, -0.1]
    assert data.data["three[1]"].tolist() == [2.0, 5.0]
    assert bytes(data.data[f"text[{k}]"][0] for k in range(5)) == b"walls"
    assert data.data["port"].tolist() == [4560, 1]
    (text,) = log.logged_messages
    assert (text.message, text.timestamp, text.log_level_str()) == ("beware", 1_000_500, "WARNING")
    (tagged,) = log.logged_messages_tagged[7]
    assert (tagged.message, tagged.timestamp, tagged.log_level_str()) == (
        "it died", 1_000_600, "ERROR",
    )  # fmt: skip
    assert [dropout.duration for dropout in log.dropouts] == [20]


def test_our_reader_reads_the_same(tmp_path: Path) -> None:
    path = tmp_path / "some.ulg"
    path.write_bytes(written())
    log = open_log(path)
    assert log.information == {"sys_name": "Pandion ü", "seed": 5}
    assert log.parameters["airframe.mass"] == 3.5
    records = list(log.records())
    data = [record for record in records if record.kind == ulog.DATA]
    reported = [text for one in records if (text := ulog.text_of(one.kind, one.body)) is not None]
    assert reported == [(4, 1_000_500, "beware"), (3, 1_000_600, "it died")]
    topic = log.topics[3]
    assert columns(topic) == (
        "timestamp", "a_bool", "small", "large", "real", "three[0]", "three[1]", "three[2]",
        "text", "port",
    )  # fmt: skip
    rows = [unpacker(topic).unpack(record.body) for record in data]
    assert [row[:8] for row in rows] == [row[:8] for row in ROWS]
    assert rows[0][8] == b"walls\0\0\0"
    assert log.whole


@pytest.mark.parametrize("cut", [1, 10, 30, 38])
def test_a_file_cut_anywhere_is_read_up_to_there(cut: int, tmp_path: Path) -> None:
    path = tmp_path / "cut.ulg"
    path.write_bytes(written()[:-cut])
    log = open_log(path)
    assert sum(record.kind == ulog.DATA for record in log.records()) == 1
    assert not log.whole
    (data,) = ULog(str(path)).data_list
    assert len(data.data["timestamp"]) == 1


@pytest.mark.parametrize(
    "content", [b"", b"ULog", b"PK\x03\x04" + bytes(100), ulog.MAGIC + pack("<Q", 0)[:4]]
)
def test_what_is_no_log_is_refused_in_one_sentence(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.ulg"
    path.write_bytes(content)
    with pytest.raises(UlogError, match=r"other\.ulg is not a ULog file"):
        open_log(path)
    with pytest.raises(UlogError, match="cannot read"):
        open_log(tmp_path / "none.ulg")
