"""Types of parameters, and their values in the field of a MAVLink message, which is a float.

A value that is an ``int`` is an INT32, any other a REAL32. An integer is sent bytewise, as PX4
sends it: its bits stand where those of the float would. The decimal nearest to a REAL32 is the
number everybody means: 0.1 is sent as 0.100000001490116, and comes back as 0.1, so that file, wire
and flight agree.

Source: https://mavlink.io/en/services/parameter.html
"""

from __future__ import annotations

import struct
from typing import Final

import numpy as np

INT32, REAL32 = 6, 9  # MAV_PARAM_TYPE
# Others that fit the field: mavros sends a bool as UINT8, and PX4 its checksum as UINT32.
_BYTEWISE: Final = {1: "<B", 2: "<b", 3: "<H", 4: "<h", 5: "<I", INT32: "<i"}


def nearest_decimal(value: float) -> float:
    """The shortest decimal with the REAL32 of ``value`` [any unit]; NaN and infinity stay."""
    with np.errstate(over="ignore"):
        return float(str(np.float32(value)))


def as_text(value: float) -> str:
    """``value`` [any unit] as text, without an exponent where that is short."""
    if isinstance(value, int):
        return str(value)
    return f"{nearest_decimal(value):.9g}"


def type_name(value: float) -> str:
    """The type of a ``value`` [any unit], as PX4's documentation names it."""
    return "INT32" if isinstance(value, int) else "FLOAT"


def as_bytes(value: float) -> bytes:
    """The four bytes of a ``value`` [any unit]: the field of a message, and part of a checksum."""
    return struct.pack("<i" if isinstance(value, int) else "<f", value)


def field_of(value: float) -> tuple[float, int]:
    """The field of a message for a ``value`` [any unit], and its MAV_PARAM_TYPE."""
    if not isinstance(value, int):
        return value, REAL32
    (bits,) = struct.unpack("<f", as_bytes(value))
    return bits, INT32


def value_of(field: float, type_: int) -> float | None:
    """The value of a ``field`` [any unit] of a MAV_PARAM_TYPE; None if that has more bytes."""
    if type_ == REAL32:
        return nearest_decimal(field)
    code = _BYTEWISE.get(type_)
    if code is None:
        return None
    (value,) = struct.unpack_from(code, struct.pack("<f", field))
    return int(value)
