"""One vehicle and one client for all tests of a file: to start them takes longer than to ask."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.interop.vehicle import Vehicle, standing_vehicle

EARLIER = random.Random(4).randbytes(90 * 1000)  # of the size that ends with a full LOG_DATA


@pytest.fixture(scope="module")
def vehicle(
    tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Iterator[Vehicle]:
    """A vehicle on the ground; the file's PACING says how fast it lives."""
    folder = tmp_path_factory.mktemp("runs")
    earlier = folder / "earlier"
    earlier.mkdir()
    (earlier / "flight.tlog").write_bytes(EARLIER)
    with standing_vehicle(folder, *request.module.PACING) as vehicle:
        yield vehicle


@pytest.fixture
def earlier() -> bytes:
    """The log of a flight before this one."""
    return EARLIER


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Where to download to."""
    place = tmp_path / "downloads"
    place.mkdir()
    return place
