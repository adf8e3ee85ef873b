"""Flights that several tests look at: each is flown once."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest

import pandion

BRIEF_S = 0.8


@pytest.fixture(scope="session")
def flown() -> Callable[[str], pandion.Result]:
    """The flight of ``walls`` with a suite of sensors, with its log."""

    @cache
    def fly(suite: str) -> pandion.Result:
        return pandion.fly("walls", seed=3, sensors=suite, duration_s=BRIEF_S)

    return fly
