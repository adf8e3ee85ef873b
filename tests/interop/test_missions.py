"""MAVSDK's mission plugins against the vehicle, over real UDP."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from mavsdk import System
from mavsdk.plugins.action import Action
from mavsdk.plugins.geofence import Geofence
from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.mission_raw import MissionItem as RawItem
from mavsdk.plugins.mission_raw import MissionRaw, MissionRawError
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry

from tests.interop.mavsdk_client import connected, eventually
from tests.interop.vehicle import FAST, Vehicle

PACING = FAST
METRE = 360.0 / (2.0 * math.pi * 6_371_000.0)  # degrees of latitude


@pytest.fixture(scope="module")
def system(vehicle: Vehicle) -> Iterator[System]:
    with connected(vehicle.api_port) as system:
        # MAVSDK sends a heartbeat a second, and the vehicle's seconds are faster than that.
        Param(system).set_param_int("NAV_DLL_ACT", 0)
        yield system
        Param(system).set_param_int("NAV_DLL_ACT", 2)


def waypoint(system: System, north: float, height: float, **more: object) -> MissionItem:
    telemetry = Telemetry(system)
    assert eventually(lambda: math.isfinite(telemetry.home().latitude_deg))
    home = telemetry.home()
    return MissionItem(
        latitude_deg=home.latitude_deg + north * METRE,
        longitude_deg=home.longitude_deg,
        relative_altitude_m=height,
        **more,
    )


def polygon(corners: tuple[tuple[float, float], ...]) -> list[RawItem]:
    return [
        RawItem(
            k, 1, 5001, 0, 1, float(len(corners)), 0.0, 0.0, 0.0,
            round(1e4 * north), round(1e4 * east), 0.0, 1,
        )
        for k, (north, east) in enumerate(corners)
    ]  # fmt: skip


def wire(items: list[RawItem]) -> list[tuple[object, ...]]:
    return [
        (i.seq, i.frame, i.command, i.param1, i.param2, i.x, i.y, i.z, i.mission_type)
        for i in items
    ]


def test_fence_and_rally_points_come_back_as_they_went(system: System) -> None:
    raw = MissionRaw(system)
    niche = polygon(((1.0, 1.0), (1.0, -1.0), (-9.0, -1.0), (-9.0, 1.0)))
    raw.upload_geofence(niche)
    assert wire(raw.download_geofence()) == wire(niche)
    rally = [RawItem(0, 1, 5100, 0, 1, 0.0, 0.0, 0.0, 0.0, -30_000, 0, -2.0, 2)]
    raw.upload_rally_points(rally)
    assert wire(raw.download_rallypoints()) == wire(rally)
    with pytest.raises(MissionRawError):
        raw.upload_geofence(polygon(((0.0, 0.0), (4.0, 0.0), (1.0, 1.0), (0.0, 4.0))))
    assert wire(raw.download_geofence()) == wire(niche)
    Geofence(system).clear_geofence()
    assert raw.download_geofence() == []


def test_a_heading_that_is_not_given_stays_not_given(system: System) -> None:
    raw = MissionRaw(system)
    item = RawItem(0, 1, 16, 1, 1, 0.0, 0.0, 0.0, float("nan"), 5_000, 0, -1.5, 0)
    raw.upload_mission([item])
    (back,) = raw.download_mission()
    assert math.isnan(back.param4)
    raw.clear_mission()
    assert raw.download_mission() == []


@pytest.mark.long
def test_a_mission_is_uploaded_flown_and_told_of(system: System) -> None:
    mission, action, telemetry = Mission(system), Action(system), Telemetry(system)
    takeoff = MissionItem.VehicleAction.TAKEOFF
    plan = MissionPlan(
        [
            waypoint(system, 0.0, 0.8, vehicle_action=takeoff),
            waypoint(system, 0.6, 0.9, speed_m_s=0.2, loiter_time_s=1.0),
            waypoint(system, 0.0, 0.8, is_fly_through=True),
        ]
    )
    mission.upload_mission(plan)
    assert len(mission.download_mission().mission_items) == 3
    heard: list[tuple[int, int]] = []
    handle = mission.subscribe_mission_progress(lambda p, _: heard.append((p.current, p.total)))
    action.arm()
    mission.start_mission()
    assert eventually(lambda: telemetry.flight_mode().name == "MISSION")
    assert eventually(lambda: any(current == 1 for current, _ in heard), 60.0)
    mission.pause_mission()
    assert eventually(lambda: telemetry.flight_mode().name == "HOLD")
    mission.start_mission()
    assert eventually(lambda: bool(mission.is_mission_finished()), 90.0), heard
    assert eventually(lambda: (3, 3) in heard), heard
    mission.unsubscribe_mission_progress(handle)
    assert eventually(lambda: telemetry.flight_mode().name == "HOLD")
    mission.clear_mission()
    action.land()
    assert eventually(lambda: not telemetry.armed(), 60.0)
