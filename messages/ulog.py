"""The ULog file format: topics, and the bytes of each kind of message.

A file is a header, then messages of (size, type, body): definitions first (formats, information,
parameters), then subscriptions and data. Everything is little-endian and packed without gaps, so
a whole message can be appended with one write, and a file that ends in the middle of one is still
readable up to there.

Source: ULog file format, https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from struct import Struct, calcsize, pack
from typing import Final

MAGIC: Final = b"ULog\x01\x12\x35\x01"  # the last byte is the version
SYNC_BYTES: Final = bytes([0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12])

FLAGS, FORMAT, INFO, PARAMETER = b"B", b"F", b"I", b"P"
MULTI_INFO, DEFAULT_PARAMETER, REMOVAL = b"M", b"Q", b"R"
SUBSCRIPTION, DATA, TEXT, TAGGED, SYNC, DROPOUT = b"A", b"D", b"L", b"C", b"S", b"O"
# What may stand before the data, and among them; of the last three nothing is written here.
BEFORE_DATA: Final = frozenset((FLAGS, FORMAT, INFO, PARAMETER, MULTI_INFO, DEFAULT_PARAMETER))
AMONG_DATA: Final = frozenset(
    (SUBSCRIPTION, DATA, TEXT, TAGGED, SYNC, DROPOUT, INFO, PARAMETER)
    + (MULTI_INFO, DEFAULT_PARAMETER, REMOVAL)
)
TICKS: Final = "ticks"  # information behind the last tick of a flight log of ours: how many it has
PADDING: Final = "_padding"  # how names of fields begin that hold nothing

_CODES: Final = {
    "uint8_t": "B", "int8_t": "b", "uint16_t": "H", "int16_t": "h", "uint32_t": "I",
    "int32_t": "i", "uint64_t": "Q", "int64_t": "q", "float": "f", "double": "d", "bool": "?",
    "char": "s",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a topic."""

    name: str
    type: str  # C type as the format names it
    count: int = 0  # elements of an array, 0 for a single value; characters of a text
    note: str = ""  # unit, frame, meaning; for the documentation only
    per: str = ""  # "rotor" or "joint": the array is as long as the vehicle has of these

    @property
    def declared(self) -> str:
        """As it stands in a format message."""
        array = f"[{self.count}]" if self.count else ""
        return f"{self.type}{array} {self.name}"

    @property
    def is_own(self) -> bool:
        """Whether the type is one of the format's own, not the name of another topic."""
        return self.type in _CODES

    @property
    def is_padding(self) -> bool:
        """Whether it only fills a record up, as PX4 does to align fields."""
        return self.name.rpartition(".")[2].startswith(PADDING)

    @property
    def code(self) -> str:
        """As :mod:`struct` packs it.

        Raises:
            ValueError: The type is none of the format's own.
        """
        if self.type not in _CODES:
            raise ValueError(f"{self.name} has the unknown type {self.type!r}")
        if self.is_padding:
            return f"{calcsize(f'<{self.count or 1}{_CODES[self.type]}')}x"
        return f"{self.count or ''}{_CODES[self.type]}"

    @property
    def values(self) -> int:
        """How many values :mod:`struct` takes for it."""
        if self.is_padding:
            return 0
        return 1 if self.type == "char" else self.count or 1


@dataclass(frozen=True, slots=True)
class Topic:
    """A named record; every one begins with its time."""

    name: str
    about: str
    when: str  # how often it is written; for the documentation only
    fields: tuple[Field, ...]  # behind the time stamp

    def sized(self, **counts: int) -> Topic:
        """The topic of a vehicle that has so many of each thing that fields are ``per``."""
        fields = [replace(one, count=counts.get(one.per, one.count)) for one in self.fields]
        return replace(self, fields=tuple(fields))

    @property
    def all_fields(self) -> tuple[Field, ...]:
        """The fields with the time stamp [us]."""
        return (Field("timestamp", "uint64_t"), *self.fields)

    @property
    def codes(self) -> str:
        """How :mod:`struct` packs one record, without the byte order."""
        return "".join(field.code for field in self.all_fields)


_USUAL: Final = {"rotor": 4, "joint": 2}  # of the paper's vehicle


def declared(text: str) -> tuple[Topic, ...]:
    """Topics as they are written down, much as PX4 does.

    A topic begins with a line ``name | about | when``. Each line of fields is indented,
    ``type name, name: note`` or ``type[size] name``, where a size may be ``rotor`` or ``joint``. A
    line that is indented further goes on with the one before it.
    """
    topics: list[Topic] = []
    for line in filter(None, re.sub(r"\n {4,}", " ", text).splitlines()):
        if not line.startswith(" "):
            name, about, when = line.split(" | ")
            topics.append(Topic(name, about, when, ()))
            continue
        kind, _, rest = line.strip().partition(" ")
        names, _, note = rest.partition(": ")
        type_, _, size = kind.removesuffix("]").partition("[")
        count, per = (_USUAL[size], size) if size in _USUAL else (int(size or 0), "")
        fields = (Field(one, type_, count, note, per) for one in names.split(", "))
        topics[-1] = replace(topics[-1], fields=(*topics[-1].fields, *fields))
    return tuple(topics)


def message(kind: bytes, body: bytes) -> bytes:
    """One message; its body has at most 65535 bytes."""
    return pack("<Hc", len(body), kind) + body


def opening(t_us: int) -> bytes:
    """Header of a file that begins at ``t_us``, and its flags, none of which is set."""
    return MAGIC + pack("<Q", t_us) + message(FLAGS, bytes(40))


def format_of(topic: Topic) -> bytes:
    """Declare a topic."""
    fields = ";".join(field.declared for field in topic.all_fields)
    return message(FORMAT, f"{topic.name}:{fields};".encode("ascii"))


def information(key: str, value: str | int) -> bytes:
    """One fact about the whole file."""
    if isinstance(value, str):
        text = value.encode()
        return message(INFO, _key(f"char[{len(text)}] {key}") + text)
    return message(INFO, _key(f"uint64_t {key}") + pack("<Q", value))


def parameter(key: str, value: float) -> bytes:
    """One parameter with a value [unit of the key], as a 32-bit integer or float."""
    if isinstance(value, int) and -(1 << 31) <= value < 1 << 31:
        return message(PARAMETER, _key(f"int32_t {key}") + pack("<i", value))
    return message(PARAMETER, _key(f"float {key}") + pack("<f", value))


def subscription(number: int, topic: Topic) -> bytes:
    """Say that data with this number are records of this topic."""
    return message(SUBSCRIPTION, pack("<BH", 0, number) + topic.name.encode("ascii"))


def data_head(number: int, topic: Topic) -> bytes:
    """The bytes before each record of a topic: size, type and number."""
    return pack("<HcH", Struct("<" + topic.codes).size + 2, DATA, number)


def logged_text(severity: int, t_us: int, text: str) -> bytes:
    """A sentence, with the severity of syslog and MAVLink, 0 to 7."""
    return message(TEXT, pack("<BQ", ord("0") + severity, t_us) + text.encode())


def tagged_text(severity: int, tag: int, t_us: int, text: str) -> bytes:
    """A sentence of a source that is not the vehicle's own voice."""
    return message(TAGGED, pack("<BHQ", ord("0") + severity, tag, t_us) + text.encode())


def text_of(kind: bytes, body: bytes) -> tuple[int, int, str] | None:
    """Severity, time and sentence of a text, tagged or not; None for what is no text."""
    if kind not in (TEXT, TAGGED):
        return None
    at = 1 if kind == TEXT else 3
    t_us = int.from_bytes(body[at : at + 8], "little")
    return body[0] - ord("0"), t_us, body[at + 8 :].decode("utf-8", "replace")


def sync() -> bytes:
    """A mark from which a reader of a damaged file can go on."""
    return message(SYNC, SYNC_BYTES)


def dropout(duration_ms: int) -> bytes:
    """Say that records of this length of time are missing here."""
    return message(DROPOUT, pack("<H", min(duration_ms, 0xFFFF)))


def _key(declared: str) -> bytes:
    text = declared.encode("ascii")
    return bytes([len(text)]) + text
