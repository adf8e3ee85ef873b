"""MAVSDK flies the vehicle; the tests of this file are one flight, in their order."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import pytest
from mavsdk import System
from mavsdk.plugins.action import Action
from mavsdk.plugins.offboard import (
    Offboard,
    OffboardError,
    PositionGlobalYaw,
    PositionNedYaw,
    VelocityNedYaw,
)
from mavsdk.plugins.telemetry import Telemetry

from tests.interop.mavsdk_client import connected, eventually
from tests.interop.vehicle import FAST, Vehicle

PACING = FAST
METRES_PER_DEGREE = 111_319.5  # of latitude


@pytest.fixture(scope="module")
def system(vehicle: Vehicle) -> Iterator[System]:
    with connected(vehicle.api_port) as system:
        telemetry = Telemetry(system)
        assert eventually(telemetry.health_all_ok), telemetry.health()
        yield system


@pytest.fixture(scope="module")
def telemetry(system: System) -> Telemetry:
    return Telemetry(system)


@pytest.fixture(scope="module")
def action(system: System) -> Action:
    return Action(system)


def mode_is(telemetry: Telemetry, *names: str) -> bool:
    return eventually(lambda: telemetry.flight_mode().name in names)


def near(telemetry: Telemetry, *place: float, within: float = 0.2) -> bool:
    """Whether it comes to a place in local NED [m]."""

    def there() -> bool:
        p = telemetry.position_velocity_ned().position
        return math.dist((p.north_m, p.east_m, p.down_m), place) < within

    return eventually(there, 20.0)


def down(telemetry: Telemetry) -> float:
    return float(telemetry.position_velocity_ned().position.down_m)


@pytest.mark.long
def test_a_takeoff_before_arming_is_remembered_for_a_while(
    action: Action, telemetry: Telemetry
) -> None:
    action.takeoff()
    assert mode_is(telemetry, "TAKEOFF")
    assert not telemetry.armed()
    assert mode_is(telemetry, "HOLD"), "ten seconds of the vehicle's later"


def test_it_arms_and_takes_off(action: Action, telemetry: Telemetry) -> None:
    action.set_takeoff_altitude(1.5)
    assert action.get_takeoff_altitude() == pytest.approx(1.5)
    action.arm()
    assert eventually(telemetry.armed)
    begin = down(telemetry)
    action.takeoff()
    action.takeoff()
    assert mode_is(telemetry, "TAKEOFF", "HOLD")
    assert eventually(telemetry.in_air)
    assert eventually(lambda: abs(down(telemetry) - (begin - 1.5)) < 0.15, 20.0)
    assert mode_is(telemetry, "HOLD")


def test_it_goes_to_a_place_on_earth(action: Action, telemetry: Telemetry) -> None:
    here, start = telemetry.position(), telemetry.position_velocity_ned().position
    north = here.latitude_deg + 1.0 / METRES_PER_DEGREE
    action.goto_location(north, here.longitude_deg, here.absolute_altitude_m + 0.5, 0.0)
    assert near(telemetry, start.north_m + 1.0, start.east_m, start.down_m - 0.5)


def test_offboard_without_a_setpoint_is_refused(system: System) -> None:
    with pytest.raises(OffboardError):
        Offboard(system).start()


def test_offboard_flies_positions_and_velocities(system: System, telemetry: Telemetry) -> None:
    offboard = Offboard(system)
    offboard.set_position_ned(PositionNedYaw(0.0, 0.5, -2.0, 0.0))
    offboard.start()
    assert mode_is(telemetry, "OFFBOARD")
    assert near(telemetry, 0.0, 0.5, -2.0)
    offboard.set_velocity_ned(VelocityNedYaw(0.0, -0.5, 0.0, 0.0))
    assert eventually(lambda: telemetry.velocity_ned().east_m_s < -0.4)
    offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -1.5, 0.0))
    assert near(telemetry, 0.0, 0.0, -1.5)
    offboard.stop()
    assert mode_is(telemetry, "HOLD")


@pytest.mark.parametrize("above", ["REL_HOME", "AMSL"])
def test_offboard_flies_to_a_place_on_earth(
    system: System, telemetry: Telemetry, above: str
) -> None:
    """SET_POSITION_TARGET_GLOBAL_INT in frames 6 and 5."""
    offboard, home = Offboard(system), telemetry.home()
    height = {"REL_HOME": 1.5, "AMSL": home.absolute_altitude_m + 1.5}[above]
    north = home.latitude_deg + 0.5 / METRES_PER_DEGREE
    kind = PositionGlobalYaw.AltitudeType[above]
    offboard.set_position_global(PositionGlobalYaw(north, home.longitude_deg, height, 0.0, kind))
    offboard.start()
    assert mode_is(telemetry, "OFFBOARD")
    assert eventually(lambda: abs(telemetry.position().relative_altitude_m - 1.5) < 0.1)
    assert eventually(lambda: abs(telemetry.position().latitude_deg - north) < 1e-6)
    offboard.stop()
    assert mode_is(telemetry, "HOLD")


def test_it_returns_and_lands(action: Action, telemetry: Telemetry) -> None:
    action.return_to_launch()
    assert mode_is(telemetry, "RETURN_TO_LAUNCH", "LAND")
    action.land()
    assert eventually(lambda: telemetry.landed_state().name == "ON_GROUND", 30.0)
    assert eventually(lambda: not telemetry.armed())
    assert not telemetry.in_air()


def test_an_order_to_arm_by_force_disarms(action: Action, telemetry: Telemetry) -> None:
    """MAVSDK's arm_force() sends the number that forces a disarm; the vehicle does as it says."""
    time.sleep(0.5)  # after touch-down it settles for a moment
    action.arm()
    assert eventually(telemetry.armed)
    action.arm_force()
    assert eventually(lambda: not telemetry.armed())
