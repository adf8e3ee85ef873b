"""What an option's word may be: each returns a parser that refuses with what is allowed."""

from __future__ import annotations

import math
import re
from argparse import ArgumentTypeError
from collections.abc import Callable, Mapping
from pathlib import Path

from command_line.parser import unknown_name
from command_line.toml_tables import shown

LONGEST_S = 1e9
LARGEST_SEED = (1 << 63) - 1
_WHOLE = re.compile(f"[0-9]{{1,{len(str(LARGEST_SEED))}}}")


def whole(least: int = 0, most: int = LARGEST_SEED) -> Callable[[str], int]:
    """A whole number from ``least`` to ``most``."""

    def parse(text: str) -> int:
        if not _WHOLE.fullmatch(text) or not least <= int(text) <= most:
            raise ArgumentTypeError(f"{shown(text)} is not a whole number from {least} to {most}")
        return int(text)

    return parse


def number(least: float, most: float, unit: str) -> Callable[[str], float]:
    """A number from ``least`` to ``most``, both in the ``unit`` that the sentence names [unit]."""

    def parse(text: str) -> float:
        value = plain_float(text)
        if not least <= value <= most:
            allowed = f"a number from {least:g} to {most:g} {unit}".rstrip()
            raise ArgumentTypeError(f"{shown(text)} is not {allowed}")
        return value

    return parse


def seconds(text: str) -> float:
    """A time that is more than nothing [s]."""
    value = plain_float(text)
    if not 0.0 < value <= LONGEST_S:
        raise ArgumentTypeError(f"{shown(text)} is not a positive number of seconds, such as 20")
    return value


def one_of(what: str, *names: str, old: Mapping[str, str] | None = None) -> Callable[[str], str]:
    """One of these names; ``old`` maps names of earlier releases to today's."""

    def parse(text: str) -> str:
        name = (old or {}).get(text, text)
        if name not in names:
            hint = unknown_name(what, f"'{text}'", names)
            known = "" if "known:" in hint else f" (known: {', '.join(names)})"
            raise ArgumentTypeError(hint + known)
        return name

    parse.names = names  # type: ignore[attr-defined]  # for a shell that completes them
    return parse


def known(*names: str) -> Callable[[str], str]:
    """Any word; a shell offers these names."""

    def parse(text: str) -> str:
        return text

    parse.names = names  # type: ignore[attr-defined]
    return parse


def path(text: str) -> Path:
    """A file or folder, there or not."""
    if not text:
        raise ArgumentTypeError("'' is no name: give that of a file or folder")
    try:
        Path(text).stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:  # such as a name of more than 255 bytes
        why = error.strerror if isinstance(error, OSError) else error
        raise ArgumentTypeError(f"{shown(text)} cannot be the name of a file: {why}") from None
    return Path(text)


def output_file(text: str) -> str:
    """A file that can be made, or ``-`` for standard output."""
    path(text)
    if text != "-" and Path(text).is_dir():
        raise ArgumentTypeError(f"cannot write {text}: it is a directory")
    if text != "-" and not Path(text).parent.is_dir():
        raise ArgumentTypeError(f"cannot write {text}: its directory does not exist")
    return text


def existing_file(text: str) -> Path:
    """A file that is there."""
    found = path(text)
    if not found.is_file():
        raise ArgumentTypeError(f"there is no file {text}")
    return found


def plain_float(text: str) -> float:
    """A number of plain digits, with none of the ``_`` that Python has among them; else NaN."""
    try:
        return float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        return math.nan


def place(text: str) -> tuple[float, float, float]:
    """Read LATITUDE,LONGITUDE,ALTITUDE in degrees and metres.

    Raises:
        ValueError: It is no place.
    """
    numbers = [plain_float(word) for word in text.split(",")]
    if len(numbers) != 3 or any(map(math.isnan, numbers)):
        raise ValueError(f"origin '{text}' is not LATITUDE,LONGITUDE,ALTITUDE")
    latitude, longitude, altitude = numbers
    # At the poles there is no north.
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0 and -500.0 <= altitude <= 9000.0):
        raise ValueError(
            f"origin '{text}' is out of range: latitude -89 to 89, longitude -180 to 180 degrees, "
            "altitude -500 to 9000 m"
        )
    return latitude, longitude, altitude
