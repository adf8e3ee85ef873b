"""SIGINT before there is a flight to end; imported before anything that takes its time."""

from __future__ import annotations

import signal


def end_at_once() -> None:
    """Let SIGINT end the process as SIGTERM does, until ``StopRequest.listen`` takes both over.

    In the middle of an import an exception would be a traceback of a hundred lines, or, in a
    callback of a library, be passed over. A process that was started to ignore SIGINT ignores it.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
