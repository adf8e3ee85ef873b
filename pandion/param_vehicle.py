"""The parameters of a running vehicle, over its link."""

from __future__ import annotations

import math
import re
import select
import time
from typing import Final, cast

from fsw.autopilot.parameters.param_type import field_of, nearest_decimal, value_of
from fsw.link.endpoints import open_endpoint
from messages import message_ids as ids
from messages import status_text
from messages.addresses import LinkAddress, address_text
from messages.frames import Frame, FrameWriter, Losses
from sitl.earth import Place

_SYSTEM, _COMPONENT = 254, 190  # of no ground station in use
_VEHICLE: Final = (1, 1)
_NO_INDEX: Final = 0xFFFF
_BY_NAME: Final = -1  # in place of an index
_GCS, _NO_AUTOPILOT, _ACTIVE, _VERSION = 6, 8, 4, 3
_TRIES: Final = 3
_LOOK_S: Final = 0.05
_NAME: Final = re.compile(r"[A-Za-z0-9_]{1,16}")
_MOST: Final = 4096  # parameters; PX4 has some 1,500
_QUIET_S: Final = 0.3  # a list that pauses this long has lost something
_LONGEST_S: Final = 60.0  # of one list; a slow radio needs about this time for the most parameters


class NoAnswer(Exception):
    """The vehicle is silent or answers nonsense, in one sentence."""


class ParameterRefused(Exception):
    """The vehicle's reason."""


class ParameterClient:
    """Asks one vehicle; a context manager."""

    def __init__(
        self, vehicle: LinkAddress, patience_s: float = 1.0, *, local_port: int = 0
    ) -> None:
        """Open a link, of UDP from a ``local_port``; each answer is waited for, three times."""
        self._where = address_text(vehicle)
        self._known: dict[str, float] = {}  # values that have come, for their types
        self._patience_s = patience_s
        self._writer = FrameWriter(_SYSTEM, _COMPONENT)
        self._endpoint, self._peer = open_endpoint(
            vehicle, lambda: time.monotonic_ns() // 1000, local_port
        )
        self._losses = Losses()
        self._waiting: list[Frame] = []  # frames that were not looked at yet

    def __enter__(self) -> ParameterClient:
        return self

    def __exit__(self, *_: object) -> None:
        self._endpoint.close()

    def read_all(self) -> dict[str, float]:
        """Every parameter, by name.

        Raises:
            NoAnswer: Nothing came, not all of it, or no list of parameters.
        """
        values: dict[int, tuple[str, float]] = {}
        count = 1
        for _ in range(_TRIES):
            if not values:
                self._send(ids.PARAM_REQUEST_LIST, *_VEHICLE)
            else:
                for index in set(range(count)) - set(values):
                    self._send(ids.PARAM_REQUEST_READ, index, *_VEHICLE, b"")
            at_most = time.monotonic() + _LONGEST_S
            until = time.monotonic() + self._patience_s
            while len(values) < count and (left_s := until - time.monotonic()) > 0.0:
                frame = self._hear((ids.PARAM_VALUE,), left_s)
                if frame is None:
                    break
                field, count, index, name, type_ = cast(
                    "tuple[float, int, int, bytes, int]", frame.payload_values
                )
                if index == _NO_INDEX:
                    continue  # a checksum of them all, which PX4 and Pandion send first
                self._check(count, index, _text(name))
                if index not in values:  # who repeats itself is not waited for again
                    until = min(time.monotonic() + _QUIET_S, at_most)
                values[index] = (_text(name), _value(field, type_))
            if len(values) == count:
                self._known = dict(values.values())
                return dict(self._known)
        missing = "nothing" if not values else f"{len(values)} of {count} parameters"
        raise NoAnswer(f"{missing} came from the vehicle at {self._where}")

    def read(self, name: str) -> float:
        """One parameter [its unit].

        Raises:
            NoAnswer: The vehicle is silent.
            ParameterRefused: It has no such parameter.
        """
        request = ids.PARAM_REQUEST_READ, _BY_NAME, *_VEHICLE, name.encode()
        return self._ask(name, *request)[0]

    def write(self, name: str, value: float) -> None:
        """Change one parameter to ``value`` [the parameter's unit].

        Raises:
            ParameterRefused: The vehicle's reason.
            NoAnswer: The vehicle is silent.
        """
        if name not in self._known:
            self.read(name)
        # In the vehicle's type; a value that this cannot hold is the vehicle's to refuse.
        whole = isinstance(self._known[name], int) and float(value).is_integer()
        value = int(value) if whole else nearest_decimal(value)
        field, type_ = field_of(value)
        held, texts = self._ask(name, ids.PARAM_SET, field, *_VEHICLE, name.encode(), type_)
        if held != value:
            raise ParameterRefused("; ".join(texts) or f"the vehicle leaves {name} at {held:g}")

    def _ask(
        self, name: str, message_id: int, *values: float | bytes
    ) -> tuple[float, tuple[str, ...]]:
        """Read or set until a value comes back; that and the status texts meanwhile."""
        said: list[Frame] = []  # status texts
        for _ in range(_TRIES):
            self._send(message_id, *values)
            until = time.monotonic() + self._patience_s
            while (left_s := until - time.monotonic()) > 0.0:
                frame = self._hear((ids.PARAM_VALUE, ids.PARAM_ERROR, ids.STATUSTEXT), left_s)
                if frame is None:
                    break
                if frame.message_id == ids.STATUSTEXT:
                    said.append(frame)
                elif frame.message_id == ids.PARAM_VALUE:
                    field, _, _, named, type_ = cast(
                        "tuple[float, int, int, bytes, int]", frame.payload_values
                    )
                    if _text(named) == name:
                        self._known[name] = _value(field, type_)
                        return self._known[name], status_text.joined(said)
                elif _text(cast(bytes, frame.payload_values[3])) == name and not said:
                    raise ParameterRefused(f"the vehicle has no parameter {name}")
        raise NoAnswer(f"no answer from the vehicle at {self._where}")

    def _check(self, count: int, index: int, name: str) -> None:
        """Refuse a list that is none: its names go to terminals and into files."""
        if not index < count <= _MOST:
            raise NoAnswer(
                f"the vehicle at {self._where} announces parameter {index} of {count}: "
                f"there must be at most {_MOST}"
            )
        if not _NAME.fullmatch(name):
            raise NoAnswer(
                f"the vehicle at {self._where} names a parameter {name!r}: "
                "must be 1 to 16 letters, digits or _"
            )

    def set_origin(self, origin: Place) -> None:
        """Say where on Earth the local frame begins, as SET_GPS_GLOBAL_ORIGIN."""
        at = (round(1e7 * origin.latitude), round(1e7 * origin.longitude))
        self._send(ids.SET_GPS_GLOBAL_ORIGIN, *at, round(1e3 * origin.altitude), 1, 0)

    def _send(self, message_id: int, *values: float | bytes) -> None:
        beat = self._writer.frame(ids.HEARTBEAT, 0, _GCS, _NO_AUTOPILOT, 0, _ACTIVE, _VERSION)
        self._endpoint.send(beat + self._writer.frame(message_id, *values), self._peer)

    def _hear(self, wanted: tuple[int, ...], patience_s: float) -> Frame | None:
        """The next frame of the vehicle with one of these ids; None after the patience."""
        until = time.monotonic() + patience_s
        left_s = patience_s
        while True:
            while self._waiting:
                frame = self._waiting.pop(0)
                if frame.message_id in wanted and (frame.system_id, frame.component_id) == _VEHICLE:
                    return frame
            if left_s <= 0.0:  # a stream may never pause
                return None
            left_s = until - time.monotonic()
            received = self._endpoint.receive_waiting()
            if received is None:
                # A stream is looked after meanwhile.
                select.select((self._endpoint,), (), (), max(min(left_s, _LOOK_S), 0.0))
            elif received[1] == self._peer:
                self._waiting = [one for one, _ in self._endpoint.cut(received[0], self._losses)]


def _value(field: float, type_: int) -> float:
    """What a PARAM_VALUE says; NaN in a type that nobody sends."""
    value = value_of(field, type_)
    return math.nan if value is None else value


def _text(padded: bytes) -> str:
    return padded.partition(b"\0")[0].decode(errors="replace")
