"""Settings for every test."""

import gc
import os
import signal
import tempfile
from collections import defaultdict

import pytest
from hypothesis import settings

from pandion.own_modules import put_first

# What a shell of ROS brings must not be taken for ours.
put_first()

# The same examples on every machine and in every run: a failure on one is a failure on all. No
# deadline per example, because the first one may compile a kernel or wait for a busy core.
settings.register_profile("reproducible", max_examples=25, derandomize=True, deadline=None)
# Those of make test-long: others in every run, and many more.
settings.register_profile("thorough", max_examples=1500, deadline=None, print_blob=True)
settings.load_profile(os.environ.get("PROPERTIES", "reproducible"))

# No test reads or writes what the user keeps, such as signing keys.
_STATE_HOME = tempfile.TemporaryDirectory(prefix="pandion-state-")
os.environ["XDG_STATE_HOME"] = _STATE_HOME.name

# pymavlink asks once, when it is imported first: without this it speaks MAVLink 1.
os.environ["MAVLINK20"] = "1"

# A shell has what it starts in the background ignore interrupts, and so would all that we start.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_finish() -> None:
    """Look for garbage seldom: what was imported is none, and looking takes 6 % of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 50, 50)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave of a test that is ``drawn`` so many parameters in ``make test``, evenly spread."""
    families: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        if item.get_closest_marker("drawn") is not None:
            families[item.nodeid.partition("[")[0]].append(item)
    for members in families.values():
        mark = members[0].get_closest_marker("drawn")
        assert mark is not None
        (count,) = mark.args
        kept = {k * len(members) // count for k in range(count)}
        for place, item in enumerate(members):
            if place not in kept:
                item.add_marker("long")
