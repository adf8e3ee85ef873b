"""What tests need of MAVSDK."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk, System

from tests.waiting import becomes

CONNECT_S = 120.0  # the first start of the vehicle compiles


@contextlib.contextmanager
def connected(port: int) -> Iterator[System]:
    """The vehicle that announces itself on a port."""
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        assert sdk.add_any_connection(f"udpin://127.0.0.1:{port}").name == "SUCCESS"
        system = sdk.first_autopilot(CONNECT_S)
        assert system is not None, "no vehicle was discovered"
        yield system
    finally:
        sdk.destroy()


def eventually(true: Callable[[], bool], patience_s: float = 30.0) -> bool:
    """Whether something becomes true."""
    return becomes(true, patience_s)


def finished(begin: Callable[..., None], *arguments: object, patience_s: float = 30.0) -> str:
    """Wait for an operation that reports progress; returns the name of its result."""
    done, results = threading.Event(), []

    def heard(result: Any, _data: Any, _user: Any) -> None:
        if result.name != "NEXT":
            results.append(result.name)
            done.set()

    begin(*arguments, heard)
    assert done.wait(patience_s), "no result"
    return str(results[0])


def seconds(action: Callable[[], object]) -> float:
    """How long something takes [s]."""
    begin = time.monotonic()
    action()
    return time.monotonic() - begin
