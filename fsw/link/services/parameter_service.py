"""The parameter protocol: list, read and set; values are INT32 or REAL32, as PX4 types them.

A list is paced, so that no tick sends more than a datagram of it. A set is answered with the value
that holds when it has been decided: the new one, or the old one after a text that says why. A
read that comes before that waits for it. A change is reported on every link. A value of another
type is taken where the parameter's type has it exactly.

Source: https://mavlink.io/en/services/parameter.html
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Final, cast

from fsw.autopilot.parameters.facts import ALIASES, FACT_BY_NAME, REPEATED
from fsw.autopilot.parameters.param_type import (
    as_bytes,
    as_text,
    field_of,
    nearest_decimal,
    value_of,
)
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.signals import CommandRequest, CommandResult, Severity, StatusText
from fsw.link.services.service import LinkService, Outcome
from fsw.link.wire.outgoing import Outgoing, ServiceOutput
from fsw.storage.parameter_store import ParameterStore
from messages import message_ids as ids
from messages.frames import Frame

BURST: Final = 10  # values at once: one datagram
_BURST_EVERY_US: Final = 20_000  # 500 values a second
_UINT32: Final = 5  # MAV_PARAM_TYPE
_NO_INDEX: Final = 0xFFFF
_BY_NAME: Final = -1  # in place of an index
# MAV_PARAM_ERROR
_DOES_NOT_EXIST, _OUT_OF_RANGE, _READ_ONLY, _TYPE_UNSUPPORTED, _TYPE_MISMATCH = 1, 2, 5, 6, 7
_PREFLIGHT_STORAGE: Final = 245  # MAV_CMD
_LOAD, _SAVE, _RESET = 0.0, 1.0, 2.0  # its first parameter
_HASH: Final = "_HASH_CHECK"  # what QGroundControl asks for, to see whether it knows all values
_Peer = tuple[int, int]  # system and component
# In the order of their index on the wire, which is that of their names: clients sort so too.
_NAMES: Final = tuple(sorted([*BY_NAME, *FACT_BY_NAME]))
_COUNT: Final = len(_NAMES)
_INDEX: Final = {name: index for index, name in enumerate(_NAMES)}


class ParameterService(LinkService):
    """Parameters on one link."""

    message_ids = frozenset({ids.PARAM_REQUEST_READ, ids.PARAM_REQUEST_LIST, ids.PARAM_SET})
    commands = frozenset({_PREFLIGHT_STORAGE})

    def __init__(self, store: ParameterStore) -> None:
        """Listen to a store that all links share."""
        self._store = store
        self._news = store.listen()
        self._next = _COUNT  # index of the next one to list
        self._awaited: dict[str, None] = {}  # read while a change of them is under way
        self._burst_us = 0
        self._hashed: Mapping[str, float] | None = None  # the values that have this hash:
        self._hash_bits = 0.0

    def handle(self, frame: Frame, t_us: int) -> Sequence[ServiceOutput]:
        """Answer a read, start a list, or pass a set request on."""
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

    def carry_out(self, request: CommandRequest, t_us: int, armed: bool) -> Outcome:
        """PREFLIGHT_STORAGE: a change is stored when it is made, so only a reset is to be done."""
        if armed:
            return CommandResult.TEMPORARILY_REJECTED, "parameters not stored: the vehicle is armed"
        wish = request.params[0]
        if wish == _RESET:
            refusal = self._store.reset(self._news)
            if refusal is not None:
                return CommandResult.TEMPORARILY_REJECTED, refusal
            return CommandResult.ACCEPTED, "parameters reset to the values of the start"
        if wish in (_LOAD, _SAVE):
            return CommandResult.ACCEPTED, ""
        known = "0 load, 1 save or 2 reset"
        return CommandResult.DENIED, f"parameters not stored: param1 = {wish:g} must be {known}"

    def poll(self, t_us: int) -> Sequence[ServiceOutput]:
        """Report what has changed, and continue a list."""
        news = self._news
        if self._next == _COUNT and not news.changed and not news.texts and not self._awaited:
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
        for name in [name for name in self._awaited if not self._is_changing(name)]:
            del self._awaited[name]
            answers.append(self._value(_INDEX[name]))
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
        if not wanted < _COUNT:
            return (_error(index, name, _DOES_NOT_EXIST, asker),)
        if self._is_changing(_NAMES[wanted]):
            self._awaited[_NAMES[wanted]] = None
            return ()
        return (self._value(wanted),)

    def _is_changing(self, name: str) -> bool:
        return self._store.is_changing(ALIASES.get(name, name))

    def _set(self, name: str, field: float, type_: int, asker: _Peer) -> Sequence[ServiceOutput]:
        if name == _HASH:
            self._next = _COUNT  # QGroundControl's word that it needs no list
            return ()
        if name not in _INDEX:
            return (_error(_BY_NAME, name, _DOES_NOT_EXIST, asker),)
        value = value_of(field, type_)
        ours = ALIASES.get(name, name)
        parameter = BY_NAME.get(ours)
        if parameter is None:
            return self._set_fact(name, value, asker)
        error, why = _OUT_OF_RANGE, None
        if value is None:
            error, why = _TYPE_UNSUPPORTED, f"type {type_} is not supported, use 6 or 9"
        elif isinstance(value, int) != parameter.integer and not parameter.has_type_of(value):
            kind = "an INT32" if parameter.integer else "a REAL32"
            error, why = _TYPE_MISMATCH, f"{name} is {kind}, {as_text(value)} is refused"
        else:
            why = self._store.change(ours, value, self._news)
        if why is None:
            return ()
        self._news.changed[ours] = None
        if name != ours:
            why = f"{name} is {ours} here: {why}"
        return (StatusText(Severity.WARNING, why), _error(_INDEX[name], name, error, asker))

    def _set_fact(self, name: str, value: float | None, asker: _Peer) -> Sequence[ServiceOutput]:
        """Agree with who sets what is so, and tell anybody else why it is."""
        kept = self._value(_INDEX[name])
        if value == nearest_decimal(self._read_value(name)):
            return (kept,)
        why = f"{name} is read only: {FACT_BY_NAME[name].meaning}"
        error = _error(_INDEX[name], name, _READ_ONLY, asker)
        return (StatusText(Severity.WARNING, why), kept, error)

    def _value(self, index: int) -> Outgoing:
        name = _NAMES[index]
        field, type_ = field_of(self._read_value(name))
        return Outgoing(ids.PARAM_VALUE, (field, _COUNT, index, name.encode(), type_))

    def _read_value(self, name: str) -> float:
        fact, store = FACT_BY_NAME.get(name), self._store
        return store.values[name] if fact is None else fact.read(store.values, store.airframe)

    def _hash(self) -> Outgoing:
        """CRC-32 over names and values in order, nothing inverted; its bits in place of a float."""
        if self._hashed is not self._store.values:  # it takes as long as 20 answers
            self._hashed, state = self._store.values, 0xFFFFFFFF
            for name in _NAMES:
                state = zlib.crc32(name.encode() + as_bytes(self._read_value(name)), state)
            (self._hash_bits,) = struct.unpack("<f", struct.pack("<I", state ^ 0xFFFFFFFF))
        values = (self._hash_bits, _COUNT, _NO_INDEX, _HASH.encode(), _UINT32)
        return Outgoing(ids.PARAM_VALUE, values)


def _error(index: int, name: str, error: int, asker: _Peer) -> Outgoing:
    return Outgoing(ids.PARAM_ERROR, (index, *asker, name.encode(errors="replace"), error))


def _name(text: bytes) -> str:
    return text.partition(b"\0")[0].decode("ascii", errors="replace")
