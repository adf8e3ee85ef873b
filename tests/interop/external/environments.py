"""Where ``make interop`` has put other people's clients."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

_PLACE = os.environ.get("PANDION_INTEROP")

only_where_installed = pytest.mark.skipif(_PLACE is None, reason="run by make interop")


def environment_of(client: str) -> Path:
    """The folder of a client."""
    assert _PLACE is not None
    return Path(_PLACE, client).absolute()
