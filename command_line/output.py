"""Where results and complaints go."""

from __future__ import annotations

import codecs
import io
import json
import math
import os
import shlex
import shutil
import sys
import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, TextIO

from command_line.printable import printable

# What the field writes and not every terminal shows; other characters lose their accents.
_PLAIN: Final = {
    "×": "x", "–": "-", "—": "-", "−": "-", "…": "...", "✓": "+", "✗": "x", "→": "->", "°": " deg ",
    "ß": "ss",
    "≤": "<=", "≥": ">=", "±": "+/-", "λ": "lambda", "σ": "sigma", "μ": "u", "µ": "u", "·": "*",
}  # fmt: skip
_MAX_SENTENCE: Final = 1000  # characters


def print_anything() -> None:
    """Let standard output and error take every character, whatever the terminal's encoding.

    What it does not know becomes plain ASCII: a result must not be lost for a sign.
    """
    codecs.register_error("plain", _plain)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="plain")


def _plain(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start : error.end]
    return "".join(map(_plain_character, lost)), error.end


def _plain_character(character: str) -> str:
    known = _PLAIN.get(character)
    if known is not None:
        return known
    parts = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode("ascii")
    return parts or ("" if unicodedata.combining(character) else "?")


def console_beside(target: str | None) -> TextIO:
    """Where sentences go: standard error if standard output is the JSON's."""
    return sys.stderr if target == "-" else sys.stdout


def say(sentence: str, stream: TextIO | None = None) -> None:
    """Print one line that may hold text from outside; on standard output unless told otherwise."""
    # In one piece: a thread may print as well.
    print(printable(sentence) + "\n", end="", file=stream or sys.stdout, flush=True)


def listed(names: Sequence[str], most: int) -> str:
    """Names after each other, at most so many, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def print_error(program: str, sentence: object) -> None:
    """Print what is wrong in one line on standard error; of an OSError without its number.

    Raises:
        BrokenPipeError: It is what is wrong: the reader of the output has left, as `head` does,
            which is nothing to complain of. The program ends on it.
    """
    if isinstance(sentence, BrokenPipeError):
        raise sentence
    if isinstance(sentence, OSError) and sentence.strerror:
        where = "" if sentence.filename is None else f"{sentence.filename}: "
        sentence = f"{where}{sentence.strerror}"
    say(f"{program}: {_shortened(str(sentence))}", sys.stderr)


def _shortened(sentence: str) -> str:
    """The sentence without its middle if it is long: a name or value of a file may have 1 MB."""
    if len(sentence) <= _MAX_SENTENCE:
        return sentence
    return f"{sentence[: _MAX_SENTENCE // 2]}…{sentence[-_MAX_SENTENCE // 2 :]}"


def command_name(program: str = "pandion") -> str:
    """How this program is typed in the shell that started it: by its path where PATH has it not."""
    started = Path(sys.argv[0]) if sys.argv else Path()
    found = shutil.which(program)
    if started.name != program or (found is not None and Path(found).samefile(started)):
        return program
    return shlex.quote(os.path.relpath(started))


def json_text(value: Any, indent: int | None = None) -> str:
    """The value as JSON; what is not finite is null, for JSON knows no NaN."""
    separators = (",", ":") if indent is None else None
    try:
        return json.dumps(value, indent=indent, separators=separators, allow_nan=False)
    except ValueError:
        return json.dumps(_finite(value), indent=indent, separators=separators, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return value


def write_text(target: str | None, text: str) -> None:
    """Write to the file of that name, to standard output for ``-``, nowhere for None."""
    if target == "-":
        sys.stdout.write(text)
        sys.stdout.flush()
    elif target is not None:
        Path(target).write_text(text, encoding="utf-8")


def try_write(target: str | Path | None, text: str) -> list[str]:
    """Write to a target as ``write_text`` does; returns what could not be written, and why."""
    try:
        write_text(None if target is None else str(target), text)
    except BrokenPipeError:
        raise  # the reader has left
    except OSError as error:
        return [f"{'standard output' if target == '-' else target}: {error.strerror}"]
    return []


def written(program: str, *texts: tuple[str | Path | None, str]) -> bool:
    """Write each text to its target; False, and a sentence for each, where that cannot be done."""
    lost = [what for target, text in texts for what in try_write(target, text)]
    for what in lost:
        print_error(program, f"cannot write {what}")
    return not lost


def unwritable(error: Exception) -> str:
    """Why something could not be started, without the system's number of the error."""
    named = isinstance(error, OSError) and error.strerror and error.filename
    return f"cannot write {error.filename}: {error.strerror}" if named else str(error)  # type: ignore[attr-defined]


# Which extra a package is of that not everyone installs.
EXTRAS: Final = {
    "distributed": "campaign",
    "cmaes": "search",
    "matplotlib": "report",
    "plotly": "report",
    "mcap": "mcap",
    "pyarrow": "parquet",
    "textual": "top",
    "viser": "view",
    "gymnasium": "gym",
    "dask": "campaign",
}


def without(error: ModuleNotFoundError, extra: str) -> str:
    """What to install where an optional package is missing."""
    return f"the package {error.name} is missing; pip install {error.name} (of the extra {extra})"
