"""Progress on standard output: sentences for people, JSON lines for the program that asked."""

from __future__ import annotations

import json
import sys
from typing import Protocol


class Events(Protocol):
    """Where the life of the process is reported."""

    def report(self, event: str, sentence: str, **details: object) -> None:
        """Report an event by its name, and to people by a sentence, empty if they need not know.

        The details are values that go with it, JSON types only.
        """
        ...


class TextEvents:
    """Sentences; all on standard error when standard output carries the result."""

    def __init__(self, to_stderr: bool) -> None:
        self._out = sys.stderr if to_stderr else sys.stdout

    def report(self, event: str, sentence: str, **details: object) -> None:
        """See :class:`Events`."""
        if sentence:
            wrong = event in ("error", "unwritten")
            print(sentence, file=sys.stderr if wrong else self._out, flush=True)


class JsonEvents:
    """One JSON object a line."""

    def report(self, event: str, sentence: str, **details: object) -> None:
        """See :class:`Events`."""
        print(json.dumps({"event": event, "message": sentence, **details}), flush=True)
