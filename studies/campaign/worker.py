"""What a process does that flies: one flight after the other, each within a time limit."""

from __future__ import annotations

import ctypes
import faulthandler
import pickle
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from fsw.runtime.process import pin_numerics_to_one_thread
from studies.campaign.identity import Identity, identity
from studies.campaign.ports import Flight

TIME_LIMIT_S: Final = 3600.0  # of a flight, if nothing else is said
_TO_END_S: Final = 10.0  # beyond the limit, for Python to end the flight; then the process ends
_ONE: Final = threading.Lock()  # a flight at a time, whatever threads a worker was given


class TimeLimitError(BaseException):
    """Ends a flight that takes too long; not an Exception, which a flight would answer itself."""


def fly_one(flight: Flight[Any], limit_s: float, *, hard: bool = True) -> Any:
    """The row of a flight that may take ``limit_s`` of this machine's time [s].

    Where Python cannot end it, a ``hard`` limit ends the process.
    """
    if hard:
        faulthandler.dump_traceback_later(limit_s + _TO_END_S, exit=True)
    try:
        with _limited(limit_s):
            return flight.row()
    except TimeLimitError:
        return flight.broken(f"it took longer than {limit_s:g} s")
    except Exception as error:
        return flight.broken(f"{type(error).__name__}: {error}")
    finally:
        if hard:
            faulthandler.cancel_dump_traceback_later()


@contextmanager
def _limited(limit_s: float) -> Iterator[None]:
    """Raise TimeLimitError in this thread after a time [s], as soon as it executes Python."""
    thread, lock, over = threading.get_ident(), threading.Lock(), threading.Event()

    def end() -> None:
        with lock:
            if not over.is_set():
                ctypes.pythonapi.PyThreadState_SetAsyncExc(
                    ctypes.c_ulong(thread), ctypes.py_object(TimeLimitError)
                )

    timer = threading.Timer(limit_s, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with lock:
            over.set()
        timer.cancel()


def fly_packed(code: str, packages: str, packed: bytes, limit_s: float) -> tuple[str, bytes, float]:
    """Fly pickled flights, each in at most ``limit_s`` of this machine's time [s].

    Returns why it may not, because code or packages are others than these; the pickled rows; and
    how long it took all together [s]. Only types that every version knows.
    """
    wrong = Identity(code, packages).differs(identity())
    if wrong:
        return wrong, b"", 0.0
    began_s = time.monotonic()
    with _ONE:
        rows = tuple(fly_one(flight, limit_s) for flight in pickle.loads(packed))
    return "", pickle.dumps(rows), time.monotonic() - began_s


def dask_setup(worker: Any) -> None:
    """What Dask calls in a worker of ours before its first task: SIGINT is for its parent."""
    pin_numerics_to_one_thread()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
