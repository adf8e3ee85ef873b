"""Progress on standard output: sentences for people, JSON lines for programs."""

from __future__ import annotations

import json
import sys
from typing import Final

_ERRORS: Final = ("error", "unwritten")  # events that go to standard error


class Events:
    """Reports what happens to the process, in the form of ``--events``."""

    def __init__(self, form: str) -> None:
        self._json = form == "json"

    def report(self, event: str, sentence: str, **details: object) -> None:
        """Report one event.

        Args:
            event: Its name, for programs.
            sentence: The same for people.
            **details: Values that go with it, JSON types only.
        """
        if self._json:
            print(json.dumps({"event": event, "message": sentence, **details}), flush=True)
        else:
            print(sentence, file=sys.stderr if event in _ERRORS else sys.stdout, flush=True)
