"""Real-time requests to Linux, and the warnings where they are refused."""

from __future__ import annotations

import gc
import json
import mmap
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fsw.link.wire import encode_dialect
from fsw.runtime import process as realtime
from fsw.runtime.process import settle_memory
from fsw.runtime.rate_groups import RATE_GROUPS
from messages.block_file import BlockFile
from tests.fsw.link.snapshots import CONTEXT, outputs_at
from tests.waiting import wait_for


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


def found_in_a_child(look: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What a function finds in a process of its own, for this one has other tests to run."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(writing, json.dumps(look()).encode())
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        found: dict[str, Any] = json.load(pipe)
    return found


def test_what_is_granted_is_in_force() -> None:
    def look() -> dict[str, Any]:
        refused = realtime.claim_real_time(realtime.TICK_PRIORITY)
        slack = Path("/proc/self/timerslack_ns").read_text().strip()
        return {"refused": refused, "scheduler": realtime.scheduler(), "slack": slack}

    found = found_in_a_child(look)
    granted = "real-time scheduling" not in found["refused"]
    assert found["scheduler"] == ("SCHED_FIFO 50" if granted else "SCHED_OTHER")
    assert found["slack"] in ("0", "1")


def test_memory_of_now_and_of_later_is_locked_each_page_from_its_first_use() -> None:
    later_kb = 32 * 1024

    def look() -> dict[str, Any]:
        refused = realtime.claim_real_time(realtime.TICK_PRIORITY)
        now = memory_kb()
        later = mmap.mmap(-1, 1024 * later_kb)
        unused = memory_kb()
        later.close()
        realtime.release_real_time()
        return {"refused": refused, "now": now, "unused": unused, "after": memory_kb()}

    found = found_in_a_child(look)
    if "locked memory" in found["refused"]:
        pytest.skip("this user may not lock memory")
    now, unused = found["now"], found["unused"]
    assert now["VmLck"] > 0.5 * now["VmRSS"]
    assert unused["VmLck"] - now["VmLck"] >= later_kb
    assert unused["VmRSS"] - now["VmRSS"] < later_kb / 2
    assert found["after"]["VmLck"] == 0


def memory_kb() -> dict[str, int]:
    """Of this process: locked, and resident."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return {
        name: int(value.split()[0])
        for name, _, value in (line.partition(":") for line in lines)
        if name in ("VmLck", "VmRSS")
    }


def test_a_settled_process_collects_no_garbage_and_looks_at_nothing_it_was_built_of() -> None:
    def look() -> dict[str, Any]:
        gc.enable()
        settle_memory()
        return {
            "enabled": gc.isenabled(),
            "frozen": gc.get_freeze_count(),
            "seen": len(gc.get_objects()),
        }

    found = found_in_a_child(look)
    assert not found["enabled"]
    assert found["frozen"] > 10_000
    assert found["seen"] < 1_000


def test_no_thread_is_left_behind_that_could_hold_the_interpreter() -> None:
    def look() -> dict[str, Any]:
        helper = threading.Thread(target=threading.Event().wait, daemon=True)
        helper.start()
        refused = realtime.claim_real_time(realtime.TICK_PRIORITY)
        realtime.rank_threads()
        assert helper.native_id is not None
        policy = os.sched_getscheduler(helper.native_id)
        lower = os.sched_getparam(helper.native_id).sched_priority < realtime.TICK_PRIORITY
        realtime.release_real_time()
        after = os.sched_getscheduler(helper.native_id)
        return {"refused": refused, "policy": policy, "lower": lower, "after": after}

    found = found_in_a_child(look)
    granted = "real-time scheduling" not in found["refused"]
    assert found["policy"] == (os.SCHED_FIFO if granted else os.SCHED_OTHER)
    assert found["lower"]
    assert found["after"] == os.SCHED_OTHER


def test_a_log_s_thread_leaves_its_rank_to_the_loop(tmp_path: Path) -> None:
    def look() -> dict[str, Any]:
        refused = realtime.claim_real_time(realtime.TICK_PRIORITY)
        log = BlockFile(tmp_path / "log")
        log.start_thread()
        log.put(b"a block")
        (thread,) = (one for one in threading.enumerate() if one is not threading.main_thread())
        wait_for(lambda: log.size)
        assert thread.native_id is not None
        return {"refused": refused, "policy": os.sched_getscheduler(thread.native_id)}

    found = found_in_a_child(look)
    granted = "real-time scheduling" not in found["refused"]
    assert found["policy"] == (os.SCHED_FIFO if granted else os.SCHED_OTHER)


def test_every_group_s_timing_says_which_group_it_is() -> None:
    snapshot = outputs_at(2_000_000).snapshot
    for group in RATE_GROUPS:
        encode = encode_dialect.loop_timing(group.number)
        values = encode(snapshot, CONTEXT)
        assert values[-1] == group.number
        assert values[4] == group.period_us
