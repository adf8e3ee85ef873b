"""MAVSDK lets a unit of the vehicle fail, sees it, and lets it work again."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from mavsdk import System
from mavsdk.plugins.action import Action, ActionError
from mavsdk.plugins.events import Events
from mavsdk.plugins.failure import Failure, FailureError, FailureType, FailureUnit
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry

from tests.interop.mavsdk_client import connected, eventually
from tests.interop.vehicle import FAST, Vehicle

PACING = FAST


@pytest.fixture(scope="module")
def system(vehicle: Vehicle) -> Iterator[System]:
    with connected(vehicle.api_port) as system:
        assert eventually(Telemetry(system).health_all_ok)
        yield system


def allowed(system: System) -> Failure:
    """Failures may be injected: the plugin is made after that, for it reads the parameter then."""
    Param(system).set_param_int("SYS_FAILURE_EN", 1)
    return Failure(system)


@pytest.mark.requirement("REQ-ARM-9")
def test_a_failure_needs_the_parameter(system: System) -> None:
    Param(system).set_param_int("SYS_FAILURE_EN", 0)
    with pytest.raises(FailureError) as refused:
        Failure(system).inject(FailureUnit.SENSOR_GYRO, FailureType.OFF, 0)
    # MAVSDK's own word, where it has read the parameter already, or the vehicle's.
    assert "DISABLED" in str(refused.value) or "DENIED" in str(refused.value)


def test_a_failure_is_injected_seen_and_ended(system: System) -> None:
    texts: list[str] = []
    telemetry, failure = Telemetry(system), allowed(system)
    telemetry.subscribe_status_text(lambda text, _: texts.append(text.text))
    failure.inject(FailureUnit.SENSOR_GYRO, FailureType.OFF, 0)
    assert eventually(lambda: "fault injected: gyro off" in texts), texts
    assert eventually(lambda: any("invalid" in text for text in texts)), texts
    failure.inject(FailureUnit.SENSOR_GYRO, FailureType.OK, 0)
    assert eventually(lambda: "fault ended: gyro off" in texts), texts
    assert eventually(telemetry.health_all_ok), telemetry.health()
    with pytest.raises(FailureError):
        failure.inject(FailureUnit.SYSTEM_RC_SIGNAL, FailureType.OFF, 0)
    assert eventually(lambda: any("no unit 104" in text for text in texts)), texts
    Param(system).set_param_int("SYS_FAILURE_EN", 0)


@pytest.mark.requirement("REQ-MODE-12")
def test_it_restarts_on_the_ground_and_takes_off_again(system: System) -> None:
    telemetry, action = Telemetry(system), Action(system)
    texts: list[str] = []
    heard = telemetry.subscribe_status_text(lambda text, _: texts.append(text.text))
    action.reboot()
    assert eventually(lambda: "flight software restarted" in texts), texts
    assert eventually(telemetry.health_all_ok), telemetry.health()
    with pytest.raises(ActionError):
        action.shutdown()
    action.arm()
    with pytest.raises(ActionError):
        action.reboot()
    assert eventually(lambda: any("disarm first" in text for text in texts)), texts
    action.disarm()
    telemetry.unsubscribe_status_text(heard)


@pytest.mark.long
def test_a_vehicle_that_lost_its_pose_acts_and_is_recovered(system: System) -> None:
    telemetry, action, failure = Telemetry(system), Action(system), allowed(system)
    announced, events = [], Events(system)  # their texts, as MAVSDK reads them in our document
    told = events.subscribe_events(lambda event, _: announced.append(event.message))
    action.set_takeoff_altitude(3.0)
    action.arm()
    action.takeoff()
    assert eventually(lambda: telemetry.position_velocity_ned().position.down_m < -3.0, 20.0)
    assert eventually(lambda: telemetry.flight_mode().name == "HOLD")
    failure.inject(FailureUnit.SENSOR_VIO, FailureType.OFF, 0)
    assert eventually(lambda: telemetry.flight_mode().name == "LAND")
    assert eventually(lambda: "no position measurement: dead reckoning" in announced), announced
    assert eventually(lambda: "position unknown: descending" in announced), announced
    failure.inject(FailureUnit.SENSOR_VIO, FailureType.OK, 0)
    assert eventually(lambda: "Over: no position measurement" in announced), announced
    assert eventually(telemetry.health_all_ok), telemetry.health()
    assert telemetry.in_air()
    action.hold()
    assert eventually(lambda: telemetry.flight_mode().name == "HOLD")
    action.land()
    assert eventually(lambda: telemetry.landed_state().name == "ON_GROUND", 40.0)
    assert eventually(lambda: not telemetry.armed())
    events.unsubscribe_events(told)
    Param(system).set_param_int("SYS_FAILURE_EN", 0)
