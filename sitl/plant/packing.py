"""Numbers in one block of memory with names, which numba reads as it reads a named tuple.

Handing over ten arrays would cost more than a plant step.
"""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar, cast

import numpy as np

T = TypeVar("T")


def pack_params(numbers: T) -> T:
    """A record with the fields of a named tuple or dataclass, of arrays and of others of its kind.

    A number that is added to a field's class is in the record, and in the kernels, by its name.
    """
    packed = np.zeros(1, _layout(numbers))
    _fill(packed[0], numbers)
    return cast(T, packed.view(np.recarray)[0])


def _fields(numbers: Any) -> dict[str, Any]:
    if dataclasses.is_dataclass(numbers):
        return {field.name: getattr(numbers, field.name) for field in dataclasses.fields(numbers)}
    return numbers._asdict() if hasattr(numbers, "_asdict") else {}


def _layout(numbers: Any) -> np.dtype[Any]:
    parts = [
        (name, _layout(part))
        if _fields(part)
        else (name, np.int64 if isinstance(part, int) else np.float64, np.shape(part))
        for name, part in _fields(numbers).items()
    ]
    return np.dtype((np.record, parts))


def _fill(record: Any, numbers: Any) -> None:
    for name, part in _fields(numbers).items():
        if _fields(part):
            _fill(record[name], part)
        else:
            record[name] = part
