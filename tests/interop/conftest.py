"""Tests share vehicles and clients: to start them takes longer than to ask."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fsw.link.files.vehicle_files import MARK
from tests.interop.vehicle import Vehicle, parameter_file, standing_vehicle

EARLIER = random.Random(4).randbytes(90 * 1000)  # of the size that ends with a full LOG_DATA


@pytest.fixture(scope="package")
def stand(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Callable[[tuple[str, ...]], Vehicle]]:
    """Gives the vehicle that stands already if its pacing is the wanted one, else another."""
    standing: dict[tuple[str, ...], Vehicle] = {}
    with contextlib.ExitStack() as running:

        def stand(pacing: tuple[str, ...]) -> Vehicle:
            if pacing not in standing:
                running.close()
                standing.clear()
                folder = tmp_path_factory.mktemp("runs")
                earlier = folder / "earlier"
                earlier.mkdir()
                (earlier / "flight.tlog").write_bytes(EARLIER)
                (earlier / MARK).write_bytes(bytes(parameter_file(folder)))  # of this vehicle
                standing[pacing] = running.enter_context(standing_vehicle(folder, *pacing))
            return standing[pacing]

        yield stand


@pytest.fixture(scope="module")
def vehicle(stand: Callable[[tuple[str, ...]], Vehicle], request: pytest.FixtureRequest) -> Vehicle:
    """A vehicle on the ground; the file's PACING says how fast it lives."""
    return stand(request.module.PACING)


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
