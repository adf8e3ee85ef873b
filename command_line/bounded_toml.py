"""TOML that somebody else may have written: bounded keys and integers, so that time is too."""

from __future__ import annotations

import re
import tomllib
from typing import Any, Final

from command_line.toml_tables import SHOWN, shown

MAX_PARTS: Final = 16  # of a dotted key; what we write has 2
_MAX_KEY: Final = 128  # characters of a part; sentences name it
_LARGEST: Final = 1 << 64  # of an integer, as in JSON
_MAX_COMPLAINT: Final = 240  # characters that the library may say
# The library keeps every beginning of a dotted key: 100,000 parts would take tens of gigabytes. So
# keys are counted first, token by token as the library reads them: no character is looked at more
# often than the pattern has alternatives, whatever the quotes around it.
_KEY: Final = r"""(?:[\w-]++|"(?!"")(?:[^"\\\n]|\\[^\n])*+"|'(?!'')[^'\n]*+')"""
_DOT: Final = r"[ \t]*+\.[ \t]*+"
_TOKEN: Final = re.compile(
    rf"(?P<long>{_KEY}(?:{_DOT}{_KEY}){{{MAX_PARTS}}})"
    rf"|{_KEY}(?:{_DOT}{_KEY})*+"
    r'|"""(?:[^"\\]|\\.|"(?!""))*+"{3,5}'
    r"|'''(?:[^']|'(?!''))*+'{3,5}"
    r"|\#[^\n]*+"
    r"""|[^\w\-"'#]++"""
    r"""|(?P<open>["'])""",
    re.DOTALL,
)


class TomlError(ValueError):
    """What is wrong with a text, as the end of a sentence that begins with its name."""


def toml_table(text: str) -> dict[str, Any]:
    """The table that a text is.

    Raises:
        TomlError: It is no TOML, nested too deeply, or has too long a key or too large an integer.
    """
    for token in _TOKEN.finditer(text):
        if token.lastgroup == "open":
            break  # a string without an end: the library reads no further either
        if token.lastgroup == "long":
            raise TomlError(f"nested too deeply: a key must have at most {MAX_PARTS} parts")
    try:
        found = tomllib.loads(text)
    except RecursionError:
        raise TomlError("nested too deeply") from None
    except tomllib.TOMLDecodeError as error:
        said = str(error)  # which may name a key, and says at its end where it is
        if len(said) > _MAX_COMPLAINT:
            said = f"{said[:SHOWN]}…{said[-SHOWN:]}"
        raise TomlError(f"not TOML: {said}") from None
    except ValueError:  # the library converts no integer of thousands of digits
        raise _too_large("an integer of thousands of digits") from None
    _check(found)
    return found


def _check(found: dict[str, Any]) -> None:
    """Refuse keys and integers beyond bounds, at any depth."""
    left: list[tuple[str, Any]] = [("", found)]
    while left:
        path, value = left.pop()
        if isinstance(value, dict):
            for key, part in value.items():
                if len(key) > _MAX_KEY:
                    raise TomlError(
                        f"beyond bounds: {shown(key)}: a key must have at most {_MAX_KEY} "
                        f"characters, and this has {len(key)}"
                    )
                left.append((f"{path}.{key}" if path else key, part))
        elif isinstance(value, list):
            left += ((f"{path}[{k}]", part) for k, part in enumerate(value))
        elif isinstance(value, int) and not -_LARGEST < value < _LARGEST:
            raise _too_large(f"{path[:SHOWN]} = {shown(value)}")


def _too_large(what: str) -> TomlError:
    return TomlError(f"beyond bounds: {what}: an integer must have at most 64 bits")
