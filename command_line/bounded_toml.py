"""TOML that somebody else may have written: keys of bounded depth, so that time is bounded too."""

from __future__ import annotations

import re
import tomllib
from typing import Any, Final

MOST_PARTS: Final = 16  # of a dotted key; what we write has 2
# The library keeps every beginning of a dotted key: 100,000 parts would take tens of gigabytes. A
# chain in a text or a comment counts as well. A part begins where no part goes on: so it is linear.
_PART: Final = r"""(?:(?<![\w-])[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
_CHAIN: Final = re.compile(rf"(?:{_PART}[ \t]*+\.[ \t]*+){{{MOST_PARTS}}}")


class TomlError(ValueError):
    """What is wrong with a text, as the end of a sentence that begins with its name."""


def toml_table(text: str) -> dict[str, Any]:
    """The table that a text is.

    Raises:
        TomlError: It is no TOML, or nested too deeply.
    """
    if _CHAIN.search(text) is not None:
        raise TomlError(f"nested too deeply: a key must have at most {MOST_PARTS} parts")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise TomlError("nested too deeply") from None
    except ValueError as error:  # TOMLDecodeError, or an integer of thousands of digits
        raise TomlError(f"not TOML: {error}") from None
