"""Where ``make interop`` has put other people's clients."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def environment_of(client: str) -> Path:
    """The folder of a client; skips the test where there is none."""
    place = os.environ.get("PANDION_INTEROP")
    if place is None:
        pytest.skip("run by make interop")
    return Path(place, client).absolute()
