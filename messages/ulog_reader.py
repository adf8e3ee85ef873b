"""Reads ULog files, those of PX4 too; what it does not know is passed over.

A type that is the name of another format is taken apart into its fields, padding is left out, and
a topic that was subscribed to more than once has its instance behind its name, from 1 on.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from struct import Struct, unpack_from
from typing import Any, Final, NamedTuple

from command_line.bounded_file import open_regular
from messages import ulog
from messages.ulog import Field, Topic

_HEADER: Final = Struct("<Hc")
_KEY = re.compile(r"(?P<type>\w+)(?:\[(?P<count>\d{1,5})\])? (?P<name>\S+)")
_NAME = re.compile(r"\w+", re.ASCII)  # of a topic; it also names a file of an export
_MAX_BYTES: Final = 65533  # of a record behind its number
_TEXT_HEADS: Final = {ulog.TEXT: 9, ulog.TAGGED: 11}  # bytes: severity, tag and time
_DEEPEST: Final = 8  # types inside one another
# Characters of the names of all values together, dots and places in arrays among them: a short file
# can declare gigabytes of them. Logs of PX4 have some 100,000.
_MAX_NAMES: Final = 1 << 22
_PLACE: Final = len(".[12345]")  # what a name may have besides that of its field
_APPENDED: Final = 1  # bit of the flags: data was appended behind the end
_SYSTEM: Final = "Pandion"  # who wrote a log, unless it says so itself
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
    kinds: set[bytes] = field(default_factory=set)  # of the messages read so far
    unknown: dict[str, int] = field(default_factory=dict)  # kinds passed over, and how often
    _declared: dict[str, tuple[Field, ...]] = field(default_factory=dict)  # as they stand there
    _flattened: dict[str, tuple[Field, ...]] = field(default_factory=dict)  # without nested types
    _room: int = _MAX_NAMES  # characters of names that may still be declared
    # Bytes of the records by topic and by number, without and with padding at their end.
    _sizes: dict[str, tuple[int, int]] = field(default_factory=dict)
    _lengths: dict[int, tuple[int, int]] = field(default_factory=dict)
    _joints: list[int] = field(default_factory=list)  # where data were appended

    @property
    def system(self) -> str:
        """Who wrote the log."""
        return str(self.information.get("sys_name", _SYSTEM))

    @property
    def is_ours(self) -> bool:
        """Whether this project wrote the log; the topics of others may have our names."""
        return self.system.startswith(_SYSTEM)

    @property
    def _says_it_is_ours(self) -> bool:
        return self.is_ours and "sys_name" in self.information

    @property
    def cut(self) -> str:
        """What a log that was read lacks at its end, behind "the log"; empty: nothing."""
        if not self.whole:
            return "was cut"
        # Ours says at its end how long it is, which a whole block before it does not.
        if self.is_ours and "inputs" in self.information and ulog.TICKS not in self.information:
            return "does not say that it ends there: it was cut, or an older version wrote it"
        return ""

    def records(self) -> Iterator[Record]:
        """Every message behind the definitions that is no information, in file order.

        Raises:
            UlogError: A message cannot be what was written. A file that was cut is read up to
                there.
        """
        begin = self.at
        try:
            for kind, body in self._messages():
                if kind == ulog.SUBSCRIPTION:
                    number = unpack_from("<H", body, 1)[0]
                    self._subscribe(body[0], number, body[3:].decode("ascii"))
                elif kind == ulog.REMOVAL:
                    number = unpack_from("<H", body)[0]
                    self.topics.pop(number, None)
                    self._lengths.pop(number, None)
                elif kind in (ulog.INFO, ulog.PARAMETER):
                    self._note(kind, body)
                elif self._is_passed_over(kind):
                    self._pass_over(kind)
                else:
                    record = _record(kind, body)
                    self._check(record, len(record.body))
                    yield self._unpadded(record)
                begin = self.at
            self._check_rest(begin)
        except _DAMAGE as problem:
            raise UlogError(f"{self.path} is damaged at byte {begin}: {problem}") from None

    @staticmethod
    def _is_new(kind: bytes) -> bool:
        """Whether a later version of the format may have such messages, which are to be ignored."""
        return b"A" <= kind <= b"Z" and kind not in ulog.BEFORE_DATA | ulog.AMONG_DATA

    def _is_passed_over(self, kind: bytes) -> bool:
        """In what says that it is ours such a kind is damage: a replay needs every record."""
        return self._is_new(kind) and not self._says_it_is_ours

    def _pass_over(self, kind: bytes) -> None:
        self.unknown[kind.decode()] = self.unknown.get(kind.decode(), 0) + 1

    def _subscribe(self, instance: int, number: int, name: str) -> None:
        if number in self.topics or name not in self._declared:
            raise ValueError(f"topic {name!r} was not declared, or its number is taken")
        if name not in self.formats:
            raise ValueError(f"the records of {name!r} do not begin with a time")
        topic = self.formats[name]
        if instance:
            topic = replace(topic, name=f"{name}_{instance}")
        self._lengths[number] = self._sizes[name]
        self.topics[number] = topic

    def _check(self, record: Record, length: int) -> None:
        if record.kind not in ulog.AMONG_DATA and not self._is_passed_over(record.kind):
            raise ValueError(f"{record.kind!r} is no kind of message among data")
        if record.kind == ulog.DATA and length not in self._lengths.get(record.number, ()):
            raise ValueError(f"a record of topic {record.number} has {length} bytes")
        if length < _TEXT_HEADS.get(record.kind, 0):
            raise ValueError(f"a text has {length} bytes")

    def _unpadded(self, record: Record) -> Record:
        """The record without padding at its end, which may or may not be there."""
        if record.kind != ulog.DATA or len(record.body) == self._lengths[record.number][0]:
            return record
        return record._replace(body=record.body[: self._lengths[record.number][0]])

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
                self._declare(body.decode("ascii"))
            elif kind == ulog.FLAGS:
                self._read_flags(body)
            elif kind in (ulog.INFO, ulog.PARAMETER):
                self._note(kind, body)
            elif self._is_new(kind):
                self._pass_over(kind)
            elif kind not in ulog.BEFORE_DATA:
                self.at -= _HEADER.size + len(body)
                self._complete()
                return
        raise UlogError(f"{self.path} ends before its data begin")

    def _declare(self, text: str) -> None:
        name, _, fields = text.partition(":")
        if _NAME.fullmatch(name) is None:
            raise ValueError(f"{name!r} names no topic")
        self._declared[name] = tuple(_field(part) for part in fields.split(";") if part)

    def _complete(self) -> None:
        """Make topics of the formats; those without a time are parts of others."""
        if any(not self._is_passed_over(kind.encode()) for kind in self.unknown):
            raise ValueError(f"{', '.join(self.unknown)} is no kind of message among definitions")
        for name in self._declared:
            fields = list(self._flat(name, 0))
            whole = struct.calcsize("<" + "".join(one.code for one in fields))
            if not fields or (fields[0].name, fields[0].type) != ("timestamp", "uint64_t"):
                continue
            if whole > _MAX_BYTES:
                raise ValueError(f"{name} has records of more than {_MAX_BYTES} bytes")
            while fields[-1].is_padding:
                fields.pop()
            self.formats[name] = topic = Topic(name, "", "", tuple(fields[1:]))
            self._sizes[name] = (unpacker(topic).size, whole)

    def _flat(self, name: str, depth: int) -> tuple[Field, ...]:
        """Fields of the format's own types; those of another format by a dotted name."""
        if depth > _DEEPEST:
            raise ValueError(f"types are nested more than {_DEEPEST} deep")
        if name in self._flattened:
            return self._flattened[name]
        fields: list[Field] = []
        for one in self._declared[name]:
            if one.is_own:
                self._take(one, max(one.values, 1), 0)
                fields.append(one)
            elif one.type not in self._declared:
                raise ValueError(f"{one.name} has the unknown type {one.type!r}")
            else:
                fields += self._nested(one, self._flat(one.type, depth + 1))
        self._flattened[name] = tuple(fields)
        return self._flattened[name]

    def _nested(self, one: Field, inner: tuple[Field, ...]) -> Iterator[Field]:
        """The fields of a field of another format, or of its array."""
        names = sum(max(part.values, 1) * (len(part.name) + _PLACE) for part in inner)
        values = sum(max(part.values, 1) for part in inner)
        times = one.count or 1
        self._take(one, times * max(values, 1), times * names)
        for k in range(times):
            where = f"{one.name}[{k}]" if one.count else one.name
            for part in inner:
                yield replace(part, name=f"{where}.{part.name}")

    def _take(self, one: Field, values: int, names: int) -> None:
        """Take room for the names of so many values, which have ``names`` characters behind it."""
        self._room -= values * (len(one.name) + _PLACE) + names
        if self._room < 0:
            raise ValueError(f"too many fields: the names have more than {_MAX_NAMES} characters")

    def _read_flags(self, body: bytes) -> None:
        """Note where data were appended, perhaps into the middle of a message that was cut."""
        if any(body[8:16]) and (body[8] & ~_APPENDED or any(body[9:16])):
            raise ValueError("it has features that this build does not know")
        if body[8] & _APPENDED:
            self._joints = [at for at in unpack_from("<3Q", body, 16) if at]

    def _note(self, kind: bytes, body: bytes) -> None:
        size = body[0]
        declared = _field(body[1 : 1 + size].decode("ascii"))
        rest = body[1 + size :]
        kept: dict[str, Any] = self.parameters if kind == ulog.PARAMETER else self.information
        if self._says_it_is_ours and declared.name in kept:
            raise ValueError(f"{declared.name} is there twice")  # tools would show either
        if declared.type == "char":
            self.information[declared.name] = rest.decode("utf-8", "replace")
        elif declared.is_own:
            kept[declared.name] = unpack_from("<" + declared.code, rest)[0]

    def _messages(self) -> Iterator[tuple[bytes, bytes]]:
        with open_regular(self.path) as file:
            # Not mapped into memory: a file that is cut meanwhile would end the process.
            self.size = os.fstat(file.fileno()).st_size
            file.seek(self.at)
            while len(head := file.read(_HEADER.size)) == _HEADER.size:
                length, kind = _HEADER.unpack(head)
                end = self.at + _HEADER.size + length
                joint = next((at for at in self._joints if self.at < at), self.size)
                if end > joint < self.size:
                    self.at = file.seek(joint)  # the message was cut when data were appended
                    continue
                if end > self.size or len(body := file.read(length)) < length:
                    break
                self.at = end
                self.kinds.add(kind)
                yield kind, body
            self.whole = self.at == self.size


def is_ulog(path: Path) -> bool:
    """Whether a file can be read and begins as a ULog."""
    try:
        return _begins_a_log(_head(path))
    except OSError:
        return False


def _head(path: Path) -> bytes:
    with open_regular(path) as file:
        return file.read(16)


def _begins_a_log(head: bytes) -> bool:
    return len(head) == 16 and head[:7] == ulog.MAGIC[:7]


def open_log(path: Path) -> UlogFile:
    """Open a log and read what stands before its data.

    Raises:
        UlogError: The file cannot be read or is no ULog.
    """
    try:
        head = _head(path)
    except OSError as error:
        raise UlogError(f"cannot read {path}: {error.strerror}") from None
    if not _begins_a_log(head):
        of_link = "; `pandion view` shows telemetry logs" if path.suffix.lower() == ".tlog" else ""
        raise UlogError(f"{path} is not a ULog file{of_link}")
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
        if part.is_padding:
            continue
        names += [part.name] if single else [f"{part.name}[{k}]" for k in range(part.count)]
    return tuple(names)


def _record(kind: bytes, body: bytes) -> Record:
    if kind == ulog.DATA:
        return Record(kind, body[0] | body[1] << 8, body[2:])
    return Record(kind, -1, body)


def _field(text: str) -> Field:
    match = _KEY.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} declares no field")
    return Field(match["name"], match["type"], int(match["count"] or 0))
