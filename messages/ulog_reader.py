"""Reads ULog files, as far as this project writes them; what it does not know is passed over."""

from __future__ import annotations

import mmap
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from struct import Struct, unpack_from
from typing import Final, NamedTuple

from command_line.bounded_file import open_regular
from messages import ulog
from messages.ulog import Field, Topic

_HEADER: Final = Struct("<Hc")
_KEY = re.compile(r"(?P<type>\w+)(?:\[(?P<count>\d{1,5})\])? (?P<name>\S+)")
_NAME = re.compile(r"\w+", re.ASCII)  # of a topic; it also names a file of an export
_MOST_BYTES: Final = 65533  # of a record behind its number
_TEXT_HEADS: Final = {ulog.TEXT: 9, ulog.TAGGED: 11}  # bytes: severity, tag and time
_DAMAGE = (ValueError, IndexError, KeyError, struct.error)  # what a wrong byte leads to


class UlogError(Exception):
    """A file that is no log, in one sentence."""


class Record(NamedTuple):
    """One message of the data section."""

    kind: bytes
    number: int  # of the subscription; -1 where it is no data
    body: bytes  # behind the number


@dataclass(slots=True)
class UlogFile:
    """An open log; what stands before the data is read at once, the data while iterating."""

    path: Path
    t_us: int
    information: dict[str, str | int] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    formats: dict[str, Topic] = field(default_factory=dict)
    topics: dict[int, Topic] = field(default_factory=dict)  # by number; grows while iterating
    size: int = 0
    at: int = 0  # bytes read so far
    whole: bool = True  # False once the end turned out to be cut
    _lengths: dict[int, int] = field(default_factory=dict)  # of the records, by number

    def records(self) -> Iterator[Record]:
        """Every message behind the definitions, in file order.

        Raises:
            UlogError: A message cannot be what was written. A file that was cut is read up to
                there.
        """
        begin = self.at
        try:
            for kind, body in self._messages():
                if kind == ulog.SUBSCRIPTION:
                    self._subscribe(unpack_from("<H", body, 1)[0], body[3:].decode("ascii"))
                else:
                    record = _record(kind, body)
                    self._check(record, len(record.body))
                    yield record
                begin = self.at
            self._check_rest(begin)
        except _DAMAGE as problem:
            raise UlogError(f"{self.path} is damaged at byte {begin}: {problem}") from None

    def _subscribe(self, number: int, name: str) -> None:
        if number in self.topics or name not in self.formats:
            raise ValueError(f"topic {name!r} was not declared, or its number is taken")
        topic = self.formats[name]
        self._lengths[number] = unpacker(topic).size
        self.topics[number] = topic

    def _check(self, record: Record, length: int) -> None:
        if record.kind not in ulog.AMONG_DATA:
            raise ValueError(f"{record.kind!r} is no kind of message among data")
        if record.kind == ulog.DATA and length != self._lengths.get(record.number):
            raise ValueError(f"a record of topic {record.number} has {length} bytes")
        if length < _TEXT_HEADS.get(record.kind, 0):
            raise ValueError(f"a text has {length} bytes")

    def _check_rest(self, begin: int) -> None:
        """Distinguish a last message that was cut from one whose length is wrong."""
        with open_regular(self.path) as file:
            file.seek(begin)
            rest = file.read(_HEADER.size + 2)
        if len(rest) == _HEADER.size + 2:
            length, kind = _HEADER.unpack_from(rest)
            record = _record(kind, rest[_HEADER.size :])
            self._check(record, length - 2 if kind == ulog.DATA else length)

    def read_definitions(self) -> None:
        """Read up to the first message that is none.

        Raises:
            UlogError: There is none.
        """
        for kind, body in self._messages():
            if kind == ulog.FORMAT:
                topic = _topic(body.decode("ascii"))
                self.formats[topic.name] = topic
            elif kind in (ulog.INFO, ulog.PARAMETER):
                self._note(kind, body)
            elif kind != ulog.FLAGS:
                self.at -= _HEADER.size + len(body)
                return
        raise UlogError(f"{self.path} ends before its data begin")

    def _note(self, kind: bytes, body: bytes) -> None:
        size = body[0]
        declared = _field(body[1 : 1 + size].decode("ascii"))
        rest = body[1 + size :]
        if declared.type == "char":
            self.information[declared.name] = rest.decode()
            return
        value = unpack_from("<" + declared.code, rest)[0]
        if kind == ulog.PARAMETER:
            self.parameters[declared.name] = value
        else:
            self.information[declared.name] = value

    def _messages(self) -> Iterator[tuple[bytes, bytes]]:
        with (
            open_regular(self.path) as file,
            mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ) as data,
        ):
            self.size = len(data)
            while self.at + _HEADER.size <= self.size:
                length, kind = _HEADER.unpack_from(data, self.at)
                begin = self.at + _HEADER.size
                if begin + length > self.size:
                    break
                self.at = begin + length
                yield kind, data[begin : self.at]
            self.whole = self.at == self.size


def open_log(path: Path) -> UlogFile:
    """Open a log and read what stands before its data.

    Raises:
        UlogError: The file cannot be read or is no ULog.
    """
    try:
        with open_regular(path) as file:
            head = file.read(16)
    except OSError as error:
        raise UlogError(f"cannot read {path}: {error.strerror}") from None
    if len(head) < 16 or head[:7] != ulog.MAGIC[:7]:
        raise UlogError(f"{path} is not a ULog file")
    log = UlogFile(path, unpack_from("<Q", head, 8)[0], at=16)
    try:
        log.read_definitions()
    except _DAMAGE as problem:
        raise UlogError(f"{path} is damaged before its data begin: {problem}") from None
    return log


def split(records: bytes) -> Iterator[Record]:
    """The records in a piece of a data section."""
    at = 0
    while at < len(records):
        length, kind = _HEADER.unpack_from(records, at)
        at += _HEADER.size + length
        yield _record(kind, records[at - length : at])


def unpacker(topic: Topic) -> Struct:
    """How one record of a topic is taken apart; see :func:`columns` for the names."""
    return Struct("<" + topic.codes)


def columns(topic: Topic) -> tuple[str, ...]:
    """A name for each value of a record: ``name``, or ``name[0]``, ``name[1]``, … of an array."""
    names: list[str] = []
    for part in topic.all_fields:
        single = part.values == 1
        names += [part.name] if single else [f"{part.name}[{k}]" for k in range(part.count)]
    return tuple(names)


def _record(kind: bytes, body: bytes) -> Record:
    if kind == ulog.DATA:
        return Record(kind, body[0] | body[1] << 8, body[2:])
    return Record(kind, -1, body)


def _topic(text: str) -> Topic:
    name, _, fields = text.partition(":")
    if _NAME.fullmatch(name) is None:
        raise ValueError(f"{name!r} names no topic")
    _, *declared = (_field(part) for part in fields.split(";") if part)
    topic = Topic(name, "", "", tuple(declared))
    if struct.calcsize("<" + topic.codes) > _MOST_BYTES:
        raise ValueError(f"{name} has records of more than {_MOST_BYTES} bytes")
    return topic


def _field(text: str) -> Field:
    match = _KEY.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} declares no field")
    return Field(match["name"], match["type"], int(match["count"] or 0))
