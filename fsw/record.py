"""Records: the fast loop's state as one array of numbers, for kernels, tests and the log alike.

A record is declared once, as a class. Its annotations are the layout of the array that kernels are
handed, and what mypy checks, in laws and in their callers:

    class Joint(Record):
        momentum: PerJoint  # N m s
        angle_limit: float  # rad

A kernel takes the array and its laws take the one entry in it, annotated with the class; Python
takes the class itself, over the same memory. So a law can be stepped through as it stands. How one
is written: docs/concepts/records.md.

Arrays for joints and rotors have room for ``JOINTS`` and ``ROTORS``: vehicles with fewer leave the
rest at zero, and all share one layout and one machine code.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Annotated, Any, ClassVar, Final, Self, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from fsw.compiled import IN_PYTHON

JOINTS: Final = 6  # of an arm, at most
ROTORS: Final = 8  # at most
ANGLE_LIMITS: Final = 2 * JOINTS  # of joints and of sums of them, at most

Floats = NDArray[np.float64]
Two = Annotated[Floats, 2]
Three = Annotated[Floats, 3]
Four = Annotated[Floats, 4]
Six = Annotated[Floats, 6]
Nine = Annotated[Floats, 9]  # a rotation, row by row
PerJoint = Annotated[Floats, JOINTS]
PerRotor = Annotated[Floats, ROTORS]


def padded(values: tuple[float, ...], size: int) -> tuple[float, ...]:
    """``values`` (n,) and zeros behind them (size,) [any]: of one length for every vehicle."""
    return values + _ZEROS[size - len(values)]


def padded_rows(rows: Iterable[tuple[float, ...]], size: int) -> tuple[float, ...]:
    """The numbers of ``rows`` [any] one after the other, zeros behind them (size,) [any]."""
    return padded(tuple([number for row in rows for number in row]), size)


_ZEROS: Final = tuple([(0.0,) * count for count in range(ANGLE_LIMITS * JOINTS + 1)])


def per_joint(joints: int) -> str:
    """The format of an array for joints, as ``struct`` has it, of a vehicle with so many."""
    return f"{joints}d{_NUMBER * (JOINTS - joints)}x"


_NUMBER: Final = 8  # bytes, of whole numbers and of others
_NUMBERS, _ARRAY = -1, -2  # views of a whole record


class Record:
    """Numbers with names; a subclass's annotations are float, int, an array as above or a Record.

    Fields are read and written like attributes. An array or record that is assigned is copied.
    """

    dtype: ClassVar[np.dtype[Any]] = np.dtype([])
    size: ClassVar[int] = 0  # numbers in it

    def __init_subclass__(cls) -> None:
        layout: list[Any] = []
        at = 0
        for name, kind in get_type_hints(cls, include_extras=True).items():
            if get_origin(kind) is ClassVar:
                continue
            field = _field(kind, at)
            layout.append((name, field.dtype))
            setattr(cls, name, field)
            at += field.count
        cls.dtype, cls.size = np.dtype(layout, align=True), at
        assert cls.dtype.itemsize == at * _NUMBER

    def __init__(self, memory: Any = None) -> None:
        """Of zeros, or over ``memory`` of as many numbers, which it then shares."""
        self.memory = bytearray(self.size * _NUMBER) if memory is None else memory
        self._views: dict[Any, Any] = {}  # of the whole, and of arrays and records in it

    @classmethod
    def place(cls, *names: str) -> int:
        """Where a field is, by its name and those of the records around it [byte]."""
        at, layout = 0, cls.dtype
        for name in names:
            assert layout.fields is not None
            layout, offset = layout.fields[name][:2]
            at += offset
        return at

    @property
    def numbers(self) -> Floats:
        """All numbers one after the other (size,) [SI]."""
        views = self._views
        if _NUMBERS not in views:
            views[_NUMBERS] = np.frombuffer(self.memory)
        numbers: Floats = views[_NUMBERS]
        return numbers

    @property
    def array(self) -> NDArray[Any]:
        """The array of one record (1,), for a kernel."""
        if IN_PYTHON:
            return self  # type: ignore[return-value]
        views = self._views
        if _ARRAY not in views:
            views[_ARRAY] = np.ndarray(1, self.dtype, self.memory)
        array: NDArray[Any] = views[_ARRAY]
        return array

    def __getitem__(self, one: int) -> Self:
        """What a kernel that is run as Python takes from the array."""
        assert one == 0
        return self

    def copy(self) -> Self:
        """Another one with the same numbers."""
        return type(self)(bytearray(self.memory))

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and bytes(self.memory) == bytes(other.memory)

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (bytearray(self.memory),)

    def __repr__(self) -> str:
        fields = ", ".join(f"{name}={getattr(self, name)!r}" for name in self.dtype.names or ())
        return f"{type(self).__name__}({fields})"


class _Number:
    """A field of one number."""

    dtype: Any = np.float64
    count = 1
    code = struct.Struct("<d")

    def __init__(self, at: int) -> None:
        self._at = at

    def __get__(self, record: Record | None, kind: Any = None) -> Any:
        if record is None:
            return self
        return self.code.unpack_from(record.memory, self._at * _NUMBER)[0]

    def __set__(self, record: Record, value: float) -> None:
        self.code.pack_into(record.memory, self._at * _NUMBER, value)


class _Whole(_Number):
    """A field of one whole number."""

    dtype = np.int64
    code = struct.Struct("<q")


class _Several(_Number):
    """A field of an array, or of a record in the record."""

    def __init__(self, at: int, count: int, kind: type[Record] | None) -> None:
        super().__init__(at)
        self.count, self._kind = count, kind
        self.dtype = (np.float64, (count,)) if kind is None else kind.dtype

    def __get__(self, record: Record | None, kind: Any = None) -> Any:
        if record is None:
            return self
        views = record._views
        if self._at not in views:
            end = self._at + self.count
            if self._kind is None:
                views[self._at] = record.numbers[self._at : end]
            else:
                part = memoryview(record.memory).cast("B")[self._at * _NUMBER : end * _NUMBER]
                views[self._at] = self._kind(part)
        return views[self._at]

    def __set__(self, record: Record, value: Any) -> None:
        if self._kind is not None:
            value = value.numbers
        record.numbers[self._at : self._at + self.count] = value


def _field(kind: Any, at: int) -> _Number:
    if kind is float:
        return _Number(at)
    if kind is int:
        return _Whole(at)
    if isinstance(kind, type) and issubclass(kind, Record):
        return _Several(at, kind.size, kind)
    return _Several(at, get_args(kind)[1], None)
