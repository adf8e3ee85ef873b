"""Cells of the matrix with processes: what breaks is a row, and what a station hears is noted."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from fsw.autopilot.signals import Mode
from messages import dialect
from pandion import fault_on_link
from pandion.fault_on_link import LinkCell
from pandion.fault_station import Station
from pandion.supervisor import Flown
from studies.fault_matrix.expectations import expectations
from studies.fault_matrix.flights import SITUATIONS
from tests.waiting import becomes

ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED
HOLD, LAND = (4 << 16) + (3 << 24), (4 << 16) + (6 << 24)  # PX4's numbers


def test_a_cell_that_breaks_is_a_row_that_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_cell: LinkCell, _folder: Path) -> None:
        raise ValueError("no such port")

    monkeypatch.setattr(fault_on_link, "_fly", broken)
    row = LinkCell("hold", expectations()["disk-full"], 0).row()
    assert row.error
    assert row.problem == "ValueError: no such port"


@pytest.mark.parametrize("mode", SITUATIONS)
def test_a_station_knows_how_to_ask_for_each_mode(mode: str) -> None:
    """Its thread would else end, and the cell be taken for a silent vehicle."""
    station = Station(mode)
    station.start()
    station.close()


def test_the_force_on_the_tool_is_read_from_the_simulators_result() -> None:
    uses = {"panel": {"force_max_n": 12.0, "force_bound_n": 10.0}}
    for touches, share in ((uses, 1.2), ({}, 0.0)):
        flown = Flown(results={"sitl": {"touches": touches}})
        assert fault_on_link._seen("press", flown, [], 0.0, 1.0).force_share == share


def test_a_vehicle_that_has_landed_is_disarmed_and_in_no_mode_of_its_own() -> None:
    station = Station("land")
    vehicle: Any = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    station.start()
    try:
        for base_mode, custom_mode in ((ARMED, HOLD), (ARMED, LAND), (0, HOLD)):
            before = len(station.noted)
            beat = vehicle.heartbeat_encode(2, 12, base_mode, custom_mode, 4)
            station._socket.sendto(beat.pack(vehicle), ("127.0.0.1", station.port))
            assert becomes(lambda before=before: len(station.noted) > before, 5.0)
    finally:
        station.close()
    assert [one.mode for one in station.noted] == [Mode.HOLD, Mode.LAND, Mode.DISARMED]
    assert all(one.at_s <= time.monotonic() for one in station.noted)
