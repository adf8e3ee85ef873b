"""Progress on standard output: sentences for people, JSON lines for the program that asked."""

from __future__ import annotations

import json
import sys
from typing import Protocol


class Events(Protocol):
    """Where the life of the process is reported."""

    def report(self, event: str, sentence: str, **details: object) -> None:
        """Tell one thing that happened.

        Args:
            event: Its name, for programs.
            sentence: The same for people.
            **details: Values that go with it, JSON types only.
        """
        ...


class TextEvents:
    """Sentences, errors on standard error."""

    def report(self, event: str, sentence: str, **details: object) -> None:
        """See :class:`Events`."""
        wrong = event in ("error", "unwritten")
        print(sentence, file=sys.stderr if wrong else sys.stdout, flush=True)


class JsonEvents:
    """One JSON object a line."""

    def report(self, event: str, sentence: str, **details: object) -> None:
        """See :class:`Events`."""
        print(json.dumps({"event": event, "message": sentence, **details}), flush=True)


def events(form: str) -> Events:
    """The reporter for ``--events``."""
    return JsonEvents() if form == "json" else TextEvents()
