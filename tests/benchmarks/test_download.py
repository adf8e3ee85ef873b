"""`python -m benchmarks download`, short: every byte comes; how fast is the bench's to measure."""

from __future__ import annotations

import sys

import pytest

from benchmarks.download import MIN_MB_PER_S, Download, measure
from pandion.display import Display


@pytest.mark.long
def test_a_log_comes_byte_for_byte_both_ways() -> None:
    fetched = measure(300_001, Display(sys.stderr))
    assert [(each.way, each.size, each.identical) for each in fetched.downloads] == [
        ("LOG_DATA", 300_001, True),
        ("FTP burst", 300_001, True),
    ]
    assert fetched.logged_mb_per_s > 0.0
    assert fetched.inner["ticks"] > 1000


def test_a_log_that_is_late_or_wrong_does_not_pass() -> None:
    assert Download("", int(1e6 * MIN_MB_PER_S), 1.0, identical=True).passed
    assert not Download("", int(1e6 * MIN_MB_PER_S), 1.1, identical=True).passed
    assert not Download("", int(1e6 * MIN_MB_PER_S), 1.0, identical=False).passed
