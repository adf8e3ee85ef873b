"""TOML that somebody else may have written: keys of bounded depth, so that time is bounded too."""

from __future__ import annotations

import re
import tomllib
from typing import Any, Final

MAX_PARTS: Final = 16  # of a dotted key; what we write has 2
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
        TomlError: It is no TOML, or nested too deeply.
    """
    for token in _TOKEN.finditer(text):
        if token.lastgroup == "open":
            break  # a string without an end: the library reads no further either
        if token.lastgroup == "long":
            raise TomlError(f"nested too deeply: a key must have at most {MAX_PARTS} parts")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise TomlError("nested too deeply") from None
    except ValueError as error:  # TOMLDecodeError, or an integer of thousands of digits
        raise TomlError(f"not TOML: {error}") from None
