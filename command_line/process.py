"""How a process of ours reports its life, and how it is asked to end."""

from __future__ import annotations

import signal
import sys
import traceback
from collections.abc import Callable
from types import FrameType
from typing import Final, Protocol

from command_line.output import json_text, say
from command_line.parser import COULD_NOT_START

NOT_COMPLETED: Final = 1  # exit code


class CouldNotStart(Exception):
    """Why there is no flight, in one sentence."""


class Events(Protocol):
    """Progress on standard output."""

    def report(self, event: str, sentence: str, **details: object) -> None:
        """Report an event by its name, and to people by a sentence, empty if they need not know.

        The details are values that go with it, JSON types only.
        """
        ...


class TextEvents:
    """Sentences; all on standard error when standard output carries the result."""

    def __init__(self, to_stderr: bool = False) -> None:
        self._out = sys.stderr if to_stderr else sys.stdout

    def report(self, event: str, sentence: str, **details: object) -> None:
        """See :class:`Events`."""
        if sentence:
            wrong = event in ("error", "unwritten")
            say(sentence, sys.stderr if wrong else self._out)


class JsonEvents:
    """One JSON object a line, for the program that asked."""

    def report(self, event: str, sentence: str, **details: object) -> None:
        """See :class:`Events`."""
        # In one piece: a thread may report as well.
        line = json_text({"event": event, "message": sentence, **details}) + "\n"
        print(line, end="", flush=True)


def events_of(how: str, *, to_stderr: bool = False) -> Events:
    """What ``--events`` asks for, ``text`` or ``json``; text goes to standard error on request."""
    return JsonEvents() if how == "json" else TextEvents(to_stderr)


class StopRequest:
    """Becomes true on SIGINT or SIGTERM, so that a loop can end between two steps."""

    def __init__(self) -> None:
        self.requested = False

    def listen(self) -> None:
        """Take over both signals; for what SIGINT does until then see ``interrupts.py``."""
        signal.signal(signal.SIGINT, self._request)
        signal.signal(signal.SIGTERM, self._request)

    def _request(self, number: int, frame: FrameType | None) -> None:
        self.requested = True


def run_reported(
    name: str, events: Events, refusals: tuple[type[Exception], ...], work: Callable[[], int]
) -> int:
    """Do the work of a process and return its exit code; what ends it early is reported.

    An exception of the ``refusals``, too, says in one sentence why there is no flight.
    """
    refusals = (CouldNotStart, *refusals)
    try:
        return work()
    except refusals as error:
        events.report("error", f"{name}: {error}")
        return COULD_NOT_START
    except KeyboardInterrupt:
        events.report("error", f"{name}: interrupted before the flight began")
    except BrokenPipeError:
        pass  # the reader of the events is gone
    except Exception as error:
        traceback.print_exc()
        events.report("error", f"{name}: internal error, {type(error).__name__}: {error}")
    return NOT_COMPLETED
