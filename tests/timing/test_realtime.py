"""What is asked of Linux, and what is said where it refuses."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from fsw.link.wire import encode_dialect
from fsw.runtime import realtime
from fsw.runtime.process import settle_memory
from fsw.runtime.rates import RATE_GROUPS
from tests.fsw.link.snapshots import CONTEXT, outputs_at


def test_what_is_refused_is_named_and_nothing_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError("not you")

    class Refusing:
        def mlockall(self, flags: int) -> int:
            return -1

        def munlockall(self) -> int:
            return -1

        def prctl(self, *_: int) -> int:
            return -1

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(realtime.ctypes, "CDLL", lambda _: Refusing())
    assert realtime.claim_real_time(50) == ("real-time scheduling", "locked memory")
    realtime.release_real_time()


def test_what_is_granted_is_in_force() -> None:
    """In a process of its own, for this one has other tests to run."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        settle_memory()
        refused = realtime.claim_real_time(realtime.TICK_PRIORITY)
        slack = Path("/proc/self/timerslack_ns").read_text().strip()
        os.write(writing, f"{','.join(refused)}|{realtime.scheduler()}|{slack}".encode())
        os._exit(0)
    os.waitpid(child, 0)
    refused, scheduler, slack = os.read(reading, 200).decode().split("|")
    os.close(reading)
    os.close(writing)
    granted = "real-time scheduling" not in refused
    assert scheduler == ("SCHED_FIFO 50" if granted else "SCHED_OTHER")
    assert slack in ("0", "1")


def test_no_thread_is_left_behind_that_could_hold_the_interpreter() -> None:
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        waiting = threading.Event()
        helper = threading.Thread(target=waiting.wait, daemon=True)
        helper.start()
        refused = realtime.claim_real_time(realtime.TICK_PRIORITY)
        realtime.rank_threads()
        assert helper.native_id is not None
        policy = os.sched_getscheduler(helper.native_id)
        lower = os.sched_getparam(helper.native_id).sched_priority < realtime.TICK_PRIORITY
        realtime.release_real_time()
        after = os.sched_getscheduler(helper.native_id)
        os.write(writing, f"{','.join(refused)}|{policy}|{lower}|{after}".encode())
        os._exit(0)
    os.waitpid(child, 0)
    refused, policy, lower, after = os.read(reading, 200).decode().split("|")
    os.close(reading)
    os.close(writing)
    granted = "real-time scheduling" not in refused
    assert int(policy) == (os.SCHED_FIFO if granted else os.SCHED_OTHER)
    assert lower == "True"
    assert int(after) == os.SCHED_OTHER


def test_every_group_s_timing_says_which_group_it_is() -> None:
    snapshot = outputs_at(2_000_000).snapshot
    for group in RATE_GROUPS:
        encode = getattr(encode_dialect, f"{group.name}_timing")
        values = encode(snapshot, CONTEXT)
        assert values[-1] == group.number
        assert values[4] == group.period_us
