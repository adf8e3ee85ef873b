"""What a flight log holds, in a few lines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from messages import ulog
from messages.ulog_reader import UlogFile

_FACTS = (
    "ver_sw",
    "scenario",
    "scenario_digest",
    "seed",
    "vehicle",
    "pacing",
    "controller",
    "inner",
    "robustness",
    "solver",
)
_SHOWN_RECORDS = 10_000


def summary(log: UlogFile, progress: Callable[[int, int], None]) -> dict[str, Any]:
    """Facts, length, records of each topic and status texts."""
    counts: Counter[str] = Counter()
    texts: list[str] = []
    first_us = last_us = lost_ms = 0
    for k, record in enumerate(log.records()):
        if record.kind == ulog.DATA:
            counts[log.topics[record.number].name] += 1
            last_us = max(last_us, int.from_bytes(record.body[:8], "little"))
            first_us = first_us or last_us
        elif (reported := ulog.text_of(record.kind, record.body)) is not None:
            _, t_us, text = reported
            texts.append(f"{1e-6 * t_us:9.3f} s  {text}")
        elif record.kind == ulog.DROPOUT:
            lost_ms += int.from_bytes(record.body, "little")
        if k % _SHOWN_RECORDS == 0:
            progress(log.at, log.size)
    return {
        "log": str(log.path),
        **{name: log.information[name] for name in _FACTS if name in log.information},
        "duration_s": 1e-6 * (last_us - first_us),
        "bytes": log.size,
        "whole": not log.cut,
        **({"remark": f"the log {log.cut}"} if log.cut else {}),
        "lost_ms": lost_ms,
        "parameters": len(log.parameters),
        "topics": dict(counts),
        "texts": texts,
    }
