"""Parameters in files: QGroundControl's ``.params`` and MAVProxy's ``.parm``.

Both are text, one parameter a line, and both are read wherever a file is read. What cannot be
used is passed over with a sentence; what was in a file before it is overwritten for the first
time is kept beside it, if any of it had to be passed over. A flight keeps the vehicle's file and a
record of the run.
"""

from __future__ import annotations

import codecs
import contextlib
import math
import os
import shutil
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from command_line.bounded_file import read_bounded
from command_line.values import plain_float
from fsw.autopilot.parameters.contradictions import agreed
from fsw.autopilot.parameters.facts import ALIASES, FACT_BY_NAME
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.param_type import as_text, field_of, nearest_decimal
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.storage.parameter_store import ParameterStore

VEHICLE: Final = 1  # MAVLink system of the vehicle
COMPONENT: Final = 1  # and its autopilot's component

_MAX_BYTES: Final = 1024 * 1024  # a file of all parameters has 12 kB
# How the files of Windows' editors begin, and what is behind it.
_MARKS: Final = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
_MAX_COMPLAINTS: Final = 20  # sentences; of the rest the number

_HEAD: Final = """\
# Onboard parameters for Vehicle 1
#
# Stack: Pandion
# Vehicle: Multi-Rotor
#
# Vehicle-Id Component-Id Name Value Type
"""


@dataclass(frozen=True, slots=True)
class Loaded:
    """What a file says."""

    values: dict[str, float]  # by name, each within its range
    complaints: tuple[str, ...]  # a sentence for each line of no use, of many for the first ones
    unusable: int = 0  # lines of no use


def parse(text: str) -> Loaded:
    """Read either format; a later line for the same parameter wins."""
    values: dict[str, float] = {}
    complaints, unusable = list[str](), 0
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            found = _entry(words)
        except ValueError as error:
            unusable += 1
            if unusable <= _MAX_COMPLAINTS:
                complaints.append(f"line {number} is passed over: {error}")
        else:
            values.update(found)
    if unusable > _MAX_COMPLAINTS:
        complaints.append(f"{unusable - _MAX_COMPLAINTS} more lines are passed over")
    return Loaded(values, tuple(complaints), unusable)


def load(path: Path) -> Loaded:
    """Read a file; ``OSError`` if it cannot be, or is too long for one of parameters."""
    data = read_bounded(path, _MAX_BYTES)
    encoding = next((name for mark, name in _MARKS.items() if data.startswith(mark)), "utf-8")
    # What is no text shows as lines of no use, not as an error.
    return parse(data.decode(encoding, "replace"))


def as_params(values: Mapping[str, float]) -> str:
    """The text of a ``.params`` file."""
    lines = [
        f"{VEHICLE}\t{COMPONENT}\t{name}\t{as_text(value)}\t{field_of(value)[1]}\n"
        for name, value in sorted(values.items())
    ]
    return _HEAD + "".join(lines)


def as_parm(values: Mapping[str, float]) -> str:
    """The text of a ``.parm`` file."""
    return "".join(f"{name:<16s} {as_text(values[name])}\n" for name in sorted(values))


def save(path: Path, values: Mapping[str, float]) -> None:
    """Write a file, atomically: a concurrent reader finds the old one.

    ``.parm`` makes it MAVProxy's format, anything else QGroundControl's. A symbolic link stays one:
    what it leads to is written.

    Raises:
        OSError: It cannot be written; the old one is untouched.
    """
    text = as_parm(values) if path.suffix == ".parm" else as_params(values)
    path = Path(os.path.realpath(path))
    handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(temporary).unlink()
        raise
    directory = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)


class ParameterFile:
    """Takes over what was kept at the start of a flight, and writes after each change.

    The vehicle's file holds what differs from the configuration, so that a better default reaches
    a vehicle on which it was never changed; the record holds everything, to say what flew.
    """

    def __init__(self, path: Path | None, record: Path, config: FlightConfig) -> None:
        """Read the vehicle's file; without one changes end with the flight.

        Nothing is made of it yet: what is of no use is refused before a minute of compiling.

        Raises:
            ValueError: What was kept contradicts itself, in this ``config`` of the start.
            OSError: It cannot be read or written.
        """
        loaded = load(path) if path is not None and path.exists() else Loaded({}, ())
        self.complaints = loaded.complaints  # about lines of the file
        self.restored = 0  # values that are not the default
        self._kept, self._path, self.record = loaded.values, path, record
        self._spoilt = bool(loaded.complaints)  # whether part of the file was of no use
        self._store = ParameterStore(config, partial(agreed, config))
        self._store.restore(self._kept)
        if path is not None:
            with tempfile.TemporaryFile(dir=Path(os.path.realpath(path)).parent):
                pass  # as it is written
        self._executor: ThreadPoolExecutor | None = None

    def restore(self, store: ParameterStore) -> None:
        """Let a store that has not flown yet take over what was kept; writes both files."""
        self._store = store
        self.restored = store.restore(self._kept)
        self._save(store.values)

    def start(self) -> None:
        """Allow changes; begins a thread, so processes are to be forked before.

        Call it before the loop's thread asks for a priority, which a new thread would inherit.
        """
        self._executor = ThreadPoolExecutor(1, "parameters")
        self._executor.submit(int).result()  # the thread begins with the first call
        self._store.open(self._executor, self._save)

    def close(self) -> None:
        """Finish writing."""
        if self._executor is not None:
            self._executor.shutdown()

    def _save(self, values: Mapping[str, float]) -> None:
        """Write both files; where the vehicle's cannot be written, the old one is untouched."""
        if self._path is not None:
            if self._spoilt:
                shutil.copy2(self._path, self._path.with_name(f"{self._path.name}.old"))
                self._spoilt = False
            defaults = self._store.defaults
            save(self._path, {n: v for n, v in values.items() if v != defaults[n]})
        save(self.record, values)


def _entry(words: list[str]) -> dict[str, float]:
    """The parameter of a line and its value; none where it cannot be changed."""
    if len(words) == 5:
        vehicle, component, name, number, _ = words
        if (vehicle, component) != (str(VEHICLE), str(COMPONENT)):
            raise ValueError(f"it is for component {vehicle}/{component}")
    elif len(words) == 2:
        name, number = words
    else:
        raise ValueError("it is not a parameter")
    parameter, fact = BY_NAME.get(ALIASES.get(name, name)), FACT_BY_NAME.get(name)
    if parameter is None and fact is None:
        raise ValueError(f"{name[:40]} is unknown")
    value = plain_float(number)
    if math.isnan(value):
        raise ValueError(f"{number[:40]} is not a number")
    if parameter is None:
        assert fact is not None
        # A file that a ground station saved holds them as well, and they say nothing new.
        stated = value if callable(fact.value) else fact.value
        if nearest_decimal(value) != nearest_decimal(stated):
            raise ValueError(f"{name} is read only and {as_text(stated)} here")
        return {}
    refusal = parameter.refusal(value)
    if refusal is not None:
        raise ValueError(refusal)
    return {parameter.name: parameter.kept(value)}
