"""JSON that somebody else may have written: bounded, with finite numbers and no name twice."""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path
from typing import Any, Final, NoReturn

from command_line.bounded_file import read_bounded
from command_line.toml_tables import SHOWN, shown

MAX_DEPTH: Final = 16  # of arrays and objects in each other; what we write has 5
_LARGEST: Final = 1 << 64  # of an integer


class JsonError(ValueError):
    """What is wrong with a text or a file, as the end of a sentence that begins with its name."""


def read_json(path: Path, most: int) -> dict[str, Any]:
    """The object in a file of at most ``most`` bytes.

    Raises:
        JsonError: As of :func:`json_object`; or it is no regular file, or longer.
        FileNotFoundError: There is none.
    """
    try:
        content = read_bounded(path, most)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise JsonError(f"cannot be read: {error.strerror}") from None
    return json_object(content)


def json_object(text: str | bytes, *, not_finite: bool = False) -> dict[str, Any]:
    """The object that a text is.

    With ``not_finite`` a number may be NaN, Infinity or -Infinity, as Python writes those.

    Raises:
        JsonError: It is no JSON, no object, nested too deeply, or has a value that JSON does not
            have: NaN, a number beyond a double or 64 bits, a text that is no Unicode; or a name is
            twice in one object.
    """
    try:
        found = json.loads(  # noqa: TID251
            text,
            object_pairs_hook=unrepeated,
            parse_constant=float if not_finite else _no_number,
            parse_float=_finite,
            parse_int=_in_range,
        )
    except JsonError:
        raise
    except RecursionError:
        raise _too_deep() from None
    except ValueError as error:
        raise JsonError(f"is not JSON: {error}") from None
    if not isinstance(found, dict):
        raise JsonError("must be a JSON object")
    _check(found)
    return found


def unrepeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The object of these pairs: what ``json.loads`` is to call for each, as its hook for pairs.

    Without it the last of several values of a name counts, and other readers take the first.

    Raises:
        JsonError: A name is there twice.
    """
    found = dict(pairs)
    if len(found) < len(pairs):
        counts = Counter(name for name, _ in pairs)
        name = next(name for name, times in counts.items() if times > 1)
        raise JsonError(f"has {shown(name)} {counts[name]} times in one object: leave one")
    return found


def json_numbers(text: str | bytes) -> dict[str, float]:
    """The numbers by name that a text is; true and false count as 1 and 0.

    Raises:
        JsonError: As of :func:`json_object`, or a value is no number.
    """
    found = json_object(text)
    for name, value in found.items():
        if not isinstance(value, int | float):
            raise JsonError(f"has a wrong value: {name[:SHOWN]} must be a number")
    return found


def _check(found: dict[str, Any]) -> None:
    """Level by level, so that depth costs no stack."""
    level: list[Any] = [found]
    for _ in range(MAX_DEPTH):
        inner: list[Any] = []
        for one in level:
            parts = one if isinstance(one, list) else [*one, *one.values()]
            for part in parts:
                if isinstance(part, list | dict):
                    inner.append(part)
                elif isinstance(part, str) and not _is_unicode(part):
                    raise JsonError("has a text that is not Unicode")
        if not inner:
            return
        level = inner
    raise _too_deep()


def _is_unicode(text: str) -> bool:
    if text.isascii():
        return True
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:  # half of a pair, as "\ud800" makes it
        return False
    return True


def _too_deep() -> JsonError:
    return JsonError(f"is nested too deeply: must be at most {MAX_DEPTH} levels")


def _no_number(name: str) -> NoReturn:
    raise JsonError(f"holds {name}: every number must be finite")


def _finite(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise JsonError(f"holds {digits[:20]}: every number must be finite")
    return value


def _in_range(digits: str) -> int:
    if len(digits) > 20 or not -_LARGEST < int(digits) < _LARGEST:
        raise JsonError(f"holds {digits[:20]}…: an integer must have at most 64 bits")
    return int(digits)
