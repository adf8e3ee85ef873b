"""The parameter protocol: list, read and set, every value a REAL32.

A list is paced, so that no tick sends more than a datagram of it. A set is answered with the value
that holds when it has been decided: the new one, or the old one after a text that says why. A
change is reported on every link.

Source: https://mavlink.io/en/services/parameter.html
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from typing import Final, cast

from fsw.link.wire import message_ids as ids
from fsw.link.wire.decode import for_this_vehicle
from fsw.link.wire.outgoing import Outgoing, ServiceOutput
from fsw.parameters.facts import FACT_BY_NAME, REPEATED
from fsw.parameters.registry import BY_NAME
from fsw.parameters.storage import REAL32
from fsw.parameters.store import ParameterStore
from fsw.signals import Severity, StatusText
from messages.frames import Frame

BURST: Final = 10  # values at once: one datagram
_BURST_EVERY_US: Final = 20_000  # 500 values a second
_UINT32: Final = 5  # MAV_PARAM_TYPE
_NO_INDEX: Final = 0xFFFF
_BY_NAME: Final = -1  # in place of an index
_DOES_NOT_EXIST, _OUT_OF_RANGE, _READ_ONLY = 1, 2, 5  # MAV_PARAM_ERROR
_HASH: Final = "_HASH_CHECK"  # what QGroundControl asks for, to see whether it knows all values
_Peer = tuple[int, int]  # system and component
# In the order of their index on the wire, which is that of their names: clients sort so too.
_NAMES: Final = tuple(sorted([*BY_NAME, *FACT_BY_NAME]))
_COUNT: Final = len(_NAMES)
_INDEX: Final = {name: index for index, name in enumerate(_NAMES)}


class ParameterService:
    """Parameters on one link."""

    message_ids = frozenset({ids.PARAM_REQUEST_READ, ids.PARAM_REQUEST_LIST, ids.PARAM_SET})

    def __init__(self, store: ParameterStore) -> None:
        """Listen to a store that all links share."""
        self._store = store
        self._news = store.listen()
        self._next = _COUNT  # index of the next one to list
        self._burst_us = 0

    def handle(self, frame: Frame, t_us: int) -> Sequence[ServiceOutput]:
        """Answer a read, start a list, or pass a set request on."""
        if not for_this_vehicle(frame):
            return ()
        asker = (frame.system_id, frame.component_id)
        if frame.message_id == ids.PARAM_REQUEST_LIST:
            self._next, self._burst_us = 0, t_us
            # First, as PX4 has it: a client that knows all values needs no list.
            return (self._hash(),)
        if frame.message_id == ids.PARAM_REQUEST_READ:
            index, _, _, text = cast("tuple[int, int, int, bytes]", frame.payload_values)
            return self._read(index, _name(text), asker)
        wanted = cast("tuple[float, int, int, bytes, int]", frame.payload_values)
        value, _, _, text, type_ = wanted
        return self._set(_name(text), value, type_, asker)

    def poll(self, t_us: int) -> Sequence[ServiceOutput]:
        """Report what has changed, and continue a list."""
        news = self._news
        if self._next == _COUNT and not news.changed and not news.texts:
            return ()
        answers: list[ServiceOutput] = []
        if news.texts:
            answers.append(StatusText(Severity.WARNING, news.texts.popleft()))
        while news.changed and len(answers) < BURST:
            name = next(iter(news.changed))
            del news.changed[name]
            answers.append(self._value(_INDEX[name]))
            if name in REPEATED:
                answers.append(self._value(_INDEX[REPEATED[name]]))
        if self._next < _COUNT and t_us >= self._burst_us:
            self._burst_us = t_us + _BURST_EVERY_US
            end = min(self._next + BURST, _COUNT)
            answers += [self._value(index) for index in range(self._next, end)]
            self._next = end
        return answers

    def _read(self, index: int, name: str, asker: _Peer) -> Sequence[ServiceOutput]:
        if index < 0 and name == _HASH:
            return (self._hash(),)
        wanted = _INDEX.get(name, _COUNT) if index < 0 else index
        if wanted < _COUNT:
            return (self._value(wanted),)
        return (_error(index, name, _DOES_NOT_EXIST, asker),)

    def _set(self, name: str, value: float, type_: int, asker: _Peer) -> Sequence[ServiceOutput]:
        if name == _HASH:
            self._next = _COUNT  # QGroundControl's word that it needs no list
            return ()
        if name in FACT_BY_NAME:
            kept, index = self._value(_INDEX[name]), _INDEX[name]
            if value == kept.values[0]:
                return (kept,)
            why = f"{name} is read only: {FACT_BY_NAME[name].meaning}"
            return (StatusText(Severity.WARNING, why), kept, _error(index, name, _READ_ONLY, asker))
        if name not in BY_NAME:
            return (_error(_BY_NAME, name, _DOES_NOT_EXIST, asker),)
        if type_ == REAL32:
            refusal = self._store.change(name, value, self._news)
        else:
            refusal = f"{name} is a REAL32, type {type_} is refused"
            self._news.changed[name] = None
        if refusal is None:
            return ()
        return (
            StatusText(Severity.WARNING, refusal),
            _error(_INDEX[name], name, _OUT_OF_RANGE, asker),
        )

    def _value(self, index: int) -> Outgoing:
        name = _NAMES[index]
        return Outgoing(
            ids.PARAM_VALUE, (self._read_value(name), _COUNT, index, name.encode(), REAL32)
        )

    def _read_value(self, name: str) -> float:
        fact, values = FACT_BY_NAME.get(name), self._store.values
        return values[name] if fact is None else fact.read(values)

    def _hash(self) -> Outgoing:
        """CRC-32 over names and values in order, nothing inverted; its bits in place of a float."""
        state = 0xFFFFFFFF
        for name in _NAMES:
            named = name.encode() + struct.pack("<f", self._read_value(name))
            state = zlib.crc32(named, state)
        (bits,) = struct.unpack("<f", struct.pack("<I", state ^ 0xFFFFFFFF))
        return Outgoing(ids.PARAM_VALUE, (bits, _COUNT, _NO_INDEX, _HASH.encode(), _UINT32))


def _error(index: int, name: str, error: int, asker: _Peer) -> Outgoing:
    return Outgoing(ids.PARAM_ERROR, (index, *asker, name.encode(errors="replace"), error))


def _name(text: bytes) -> str:
    return text.partition(b"\0")[0].decode("ascii", errors="replace")
