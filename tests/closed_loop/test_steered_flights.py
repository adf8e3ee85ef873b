"""Goto, return, joints and home, flown; and what goes wrong around them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fsw.autopilot.geometry.geodesy import to_global
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import (
    Command,
    CommandResult,
    Mode,
    SafeSet,
    SafeSetAnnouncement,
    SensorFrame,
)
from sitl.scenario_file import load_scenario
from studies.flight.mission import SIMULATOR, safe_set
from tests.closed_loop.harness import (
    ARM,
    LAND,
    SET_MODE,
    TAKEOFF,
    Flight,
    command,
    hover,
    on_the_ground,
)  # fmt: skip

NAN = math.nan
RETURN, SET_ACTUATOR, GOTO, SET_HOME = 20, 187, 192, 179


def as_int(number: int, frame: int, *params: float) -> Command:
    return command(number, *params, frame=frame)


def up() -> Flight:
    flight = Flight(on_the_ground())
    flight.run(0.1)
    flight.step(command(ARM, 1.0))
    flight.step(command(TAKEOFF))
    flight.run(4.0)
    assert flight.mode is Mode.HOLD
    return flight


@pytest.mark.long
@pytest.mark.parametrize("below", [0.0, 4.0, 50.0])
def test_a_return_to_a_home_below_the_ground_ends_on_the_ground(below: float) -> None:
    flight = up()
    latitude, longitude, altitude = to_global(flight.config.origin, (0.5, 0.0, below))
    flight.step(as_int(SET_HOME, 5, 0.0, NAN, NAN, NAN, latitude, longitude, altitude))
    assert flight.results[-1] == (SET_HOME, CommandResult.ACCEPTED)
    flight.step(command(RETURN))
    flight.until(Mode.DISARMED, 20.0)
    assert flight.modes[-3:] == [Mode.RETURN, Mode.LAND, Mode.DISARMED]


@pytest.mark.long
def test_goto_a_place_on_earth_then_home_and_down() -> None:
    flight = up()
    latitude, longitude, altitude = to_global(flight.config.origin, (2.0, 1.0, -1.8))
    flight.step(as_int(GOTO, 5, -1.0, 1.0, 0.0, NAN, latitude, longitude, altitude))
    flight.run(7.0)
    assert flight.mode is Mode.HOLD
    assert math.dist(flight.sim.truth().p_WB, (2.0, 1.0, -1.8)) < 0.05
    flight.step(command(RETURN))
    assert flight.mode is Mode.RETURN
    flight.run(3.0)
    home = flight.snapshot.home
    assert home is not None
    risen = home.p[2] - flight.sim.truth().p_WB[2]
    assert risen == pytest.approx(flight.config.limits.return_height, abs=0.1)
    flight.until(Mode.DISARMED, 16.0)
    assert flight.modes[-3:] == [Mode.RETURN, Mode.LAND, Mode.DISARMED]
    assert math.dist(flight.sim.truth().p_WB, home.p) < 0.3
    assert flight.snapshot.failures == ()


@pytest.mark.long
def test_hold_breaks_off_the_way_to_a_place() -> None:
    flight = up()
    flight.step(as_int(GOTO, 1, -1.0, 1.0, 0.0, NAN, 20.0, 0.0, -2.0))
    flight.run(3.0)
    flight.step(command(SET_MODE, 1.0, 4.0, 3.0))
    flight.run(3.0)
    assert math.hypot(*flight.sim.truth().v_WB) < 0.02
    assert 1.0 < flight.sim.truth().p_WB[0] < 5.0


@pytest.mark.long
def test_the_joints_move_and_the_body_stays() -> None:
    flight = up()
    before = flight.sim.truth().p_WB
    flight.step(command(SET_ACTUATOR, 0.5, -0.5))
    flight.run(4.0)
    assert flight.sim.truth().q_arm == pytest.approx((math.pi / 6, -math.pi / 4), abs=0.05)
    assert math.dist(flight.sim.truth().p_WB, before) < 0.05


@pytest.mark.requirement("REQ-SAFE-6")
def test_a_goto_towards_a_wall_stops_before_it() -> None:
    walls = load_scenario("walls").walls
    flight = Flight(replace(hover(), walls=walls, body="points"))
    flight.step(command(ARM, 1.0))
    flight.step(as_int(GOTO, 1, 2.0, 1.0, 0.0, NAN, 0.89, 0.0, -1.4))
    flight.run(5.0)
    assert flight.sim.min_margin_m is not None
    assert 0.0 < flight.sim.min_margin_m < 0.1


@pytest.mark.long
def test_a_takeoff_that_is_sent_again_climbs_once() -> None:
    flight = up()
    height = flight.sim.truth().p_WB[2]
    flight.step(command(LAND))
    flight.run(0.2)
    flight.step(command(TAKEOFF, confirmation=1))
    assert flight.results[-1] != (TAKEOFF, 0), "the last command of this sender was another"
    second = Flight(on_the_ground())
    second.step(command(ARM, 1.0))
    for _ in range(5):
        second.step(command(TAKEOFF))
        second.run(0.05)
    second.run(4.0)
    assert [result for number, result in second.results if number == TAKEOFF] == [0] * 5
    assert second.sim.truth().p_WB[2] == pytest.approx(height, abs=0.05)


def test_a_takeoff_to_a_height_in_its_frame() -> None:
    flight = Flight(on_the_ground())
    flight.step(command(ARM, 1.0))
    flight.step(as_int(TAKEOFF, 6, NAN, NAN, NAN, NAN, NAN, NAN, 1.2))  # above home
    flight.run(4.5)
    home = flight.snapshot.home
    assert home is not None
    assert home.p[2] - flight.sim.truth().p_WB[2] == pytest.approx(1.2, abs=0.05)


@pytest.mark.requirement("REQ-LINK-1")
def test_a_ground_station_that_falls_silent_brings_the_vehicle_home() -> None:
    config = flight_config(body="points")
    limits = replace(config.limits, station_timeout_us=1_000_000, failsafe_delay_us=500_000)
    config = replace(config, limits=limits)
    flight = Flight(hover(), config=config)
    flight.step(command(ARM, 1.0))
    flight.run(2.0)
    assert flight.mode is Mode.HOLD, "no ground station was there, so none is missed"
    flight.streamed = {"ground_station_heard": True}
    flight.run(2.0)
    assert flight.mode is Mode.HOLD
    flight.streamed = {}
    flight.run(1.1)
    assert flight.mode is Mode.HOLD
    flight.run(0.6)
    assert flight.mode is Mode.RETURN
    assert any("no ground station" in text for text in flight.texts)


@pytest.mark.parametrize(("exceptions", "mode"), [(0, Mode.HOLD), (8, Mode.TRAJECTORY)])
def test_a_trajectory_goes_on_without_the_ground_station_where_that_is_excepted(
    exceptions: int, mode: Mode
) -> None:
    config = flight_config(body="points")
    limits = replace(
        config.limits, station_timeout_us=1_000_000, station_loss_exceptions=exceptions
    )
    config = replace(config, limits=limits)
    flight = Flight(load_scenario("workspace-calm"), config=config)
    flight.streamed = {"ground_station_heard": True}
    flight.follow()
    flight.run(0.2)
    flight.streamed = {}
    flight.run(2.0)
    assert flight.mode is mode


@pytest.mark.requirement("REQ-SAFE-7")
def test_a_safe_set_that_contradicts_itself_is_refused_in_flight_and_the_old_one_kept() -> None:
    scenario = load_scenario("walls-calm")
    flight = Flight(scenario)
    flight.follow()
    flight.run(0.5)
    tiny = SafeSet((target_sphere((0.0, 0.0, -0.225), 0.01),))
    flight.streamed = {"announced": (SafeSetAnnouncement(SIMULATOR, tiny),)}
    flight.run(0.5)
    assert flight.state.mission.safe_set == safe_set(scenario)
    assert sum("old one is kept" in text for text in flight.texts) == 1
    assert flight.mode is Mode.TRAJECTORY
    assert flight.snapshot.constraints.margins


def test_the_battery_empties_as_the_vehicle_flies() -> None:
    flight = up()
    battery = flight.snapshot.battery
    assert 0.98 < battery.remaining < 1.0
    assert 20.0 < battery.current < 60.0
    assert 15.0 < battery.voltage < 16.8


def test_what_keeps_it_from_arming_is_on_show() -> None:
    flight = Flight(on_the_ground())
    flight.run(0.3)
    assert flight.snapshot.arming.failed == ()
    tiny = SafeSet((target_sphere((0.0, 0.0, -0.225), 0.01),))
    flight.streamed = {"announced": (SafeSetAnnouncement(SIMULATOR, tiny),)}
    flight.run(0.3)
    assert flight.snapshot.arming.failed


@pytest.mark.long
def test_a_heading_is_reached_without_swinging_about_it() -> None:
    flight = Flight(hover())
    flight.step(command(ARM, 1.0))
    flight.step(as_int(GOTO, 1, -1.0, 1.0, 0.0, 1.5, 0.0, 0.0, -1.42))
    turned = []
    for _ in range(40):
        flight.run(0.5)
        turned.append(flight.snapshot.estimate.yaw)
    assert max(turned) < 1.56
    assert turned[26:] == pytest.approx([1.5] * 14, abs=0.04)


@pytest.mark.long
def test_a_vehicle_that_slides_when_it_comes_down_is_not_flown_against_the_ground() -> None:
    """It drifted on its legs, pushed by a loop that could not move it, until it tipped over."""

    def sliding(frame: SensorFrame) -> SensorFrame:
        vx, vy, vz = frame.v_WB
        return replace(frame, v_WB=(vx + 0.2, vy, vz)) if frame.p_WB[2] > -0.36 else frame

    flight = up()
    flight.spoil = sliding
    flight.step(command(LAND))
    flight.until(Mode.DISARMED, 12.0)
    assert not flight.snapshot.failures
    flight.step(command(ARM, 1.0))
    assert not flight.snapshot.armed, "while it still slides"


@pytest.mark.drawn(1)
@pytest.mark.parametrize("arm_deg", [(0.0, 30.0), (40.0, 45.0), (-30.0, 60.0)])
def test_the_fastest_landing_that_can_be_set_does_not_fight_the_ground(
    arm_deg: tuple[float, float],
) -> None:
    """It bounced at 0.6 m/s, never lay still, and loops and arm worked until it tipped over."""
    config = flight_config(body="points")
    config = replace(config, limits=replace(config.limits, land_speed=0.6))
    flight = Flight(hover(arm_deg), config=config)
    flight.step(command(ARM, 1.0))
    flight.run(1.0)
    flight.step(command(LAND))
    flight.run(1.4)
    felt_s = idle_s = None
    for k in range(400):
        flight.run(0.01)
        if felt_s is None and -flight.sim.truth().p_WB[2] < 0.33:
            felt_s = 0.01 * k
        if idle_s is None and flight.state.vehicle.unloaded is not None:
            idle_s = 0.01 * k
        if flight.mode is Mode.DISARMED:
            break
    assert flight.mode is Mode.DISARMED
    assert felt_s is not None
    assert idle_s is not None
    assert idle_s - felt_s < 0.35, "loops are open, and rotors idle"
    assert 0.01 * k - felt_s < 0.7
    flight.run(1.0)
    assert flight.snapshot.failures == ()
    assert flight.snapshot.estimate.R_WB[8] > math.cos(math.radians(5.0))
