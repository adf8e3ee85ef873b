"""What a ground station's buttons do, flown: take-off before arming, orbit, a place to look at."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest

from fsw.autopilot.geometry.geodesy import to_global
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.battery import charge_of
from fsw.autopilot.model.body import body_of, hull_reach
from fsw.autopilot.parameters.flight_config import FlightConfig, FlightLimits, flight_config
from fsw.autopilot.shapes.vertical_cylinder import column
from fsw.autopilot.signals import (
    BatteryState,
    BatteryWarning,
    Command,
    MessageSource,
    MissionUpdate,
    Mode,
    MotionSetpoint,
    SafeSet,
)
from fsw.link.services.mission_store import Kind, MissionStore, Site, Upload
from fsw.link.wire.fence_items import CIRCLE_INCLUSION
from fsw.link.wire.mission_items import DENIED as DENIED_MISSION
from fsw.link.wire.mission_items import MissionItem, read_step
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import ARM, SET_MODE, TAKEOFF, Flight, command, hover, on_the_ground

NAN = math.nan
GOTO, ORBIT, ROI, ROI_NONE, SPEED, MISSION_START = 192, 34, 195, 197, 178, 300
ACCEPTED, LATER, DENIED = 0, 1, 2


def as_int(number: int, frame: int, *params: float) -> Command:
    return command(number, *params, frame=frame)


def hovering(**changes: object) -> Flight:
    flight = Flight(hover(), **changes)  # type: ignore[arg-type]
    flight.step(command(ARM, 1.0))
    flight.run(0.5)
    assert flight.mode is Mode.HOLD
    return flight


def limits(**changes: object) -> FlightConfig:
    config = flight_config(body="points")
    return replace(config, limits=replace(config.limits, **changes))  # type: ignore[arg-type]


def standing(flight: Flight) -> Flight:
    flight.run(0.2)
    return flight


def test_a_takeoff_before_arming_is_flown_on_arming() -> None:
    """QGroundControl sends it disarmed, and arms when it has been accepted."""
    flight = standing(Flight(on_the_ground()))
    amsl = flight.config.origin.altitude + 1.32  # a metre above where the body is
    flight.step(command(TAKEOFF, -1.0, 0.0, 0.0, NAN, NAN, NAN, amsl))
    assert flight.results[-1] == (TAKEOFF, ACCEPTED)
    assert flight.mode is Mode.DISARMED
    assert flight.snapshot.intended_mode is Mode.TAKEOFF
    flight.run(1.0)
    flight.step(command(ARM, 1.0))
    assert flight.mode is Mode.TAKEOFF
    flight.run(5.0)
    assert flight.mode is Mode.HOLD
    assert -flight.sim.truth().p_WB[2] == pytest.approx(1.32, abs=0.05)
    assert flight.snapshot.intended_mode is Mode.HOLD, "flown once"


def test_a_takeoff_that_nobody_arms_for_is_forgotten_and_told_so() -> None:
    flight = standing(Flight(on_the_ground(), config=limits(takeoff_wait_us=2_000_000)))
    flight.step(command(TAKEOFF))
    flight.run(1.9)
    assert flight.snapshot.intended_mode is Mode.TAKEOFF
    flight.run(0.3)
    assert flight.snapshot.intended_mode is Mode.HOLD
    assert sum("takeoff cancelled" in text for text in flight.texts) == 1
    flight.step(command(ARM, 1.0))
    flight.run(2.0)
    assert flight.mode is Mode.HOLD
    assert -flight.sim.truth().p_WB[2] < 0.4, "armed, and still on the ground"


def test_offboard_can_be_chosen_before_arming_and_not_without_set_points() -> None:
    flight = standing(Flight(on_the_ground()))
    flight.step(command(SET_MODE, 1.0, 6.0, 0.0))
    assert flight.results[-1] == (SET_MODE, LATER)
    flight.streamed = {"motion": MotionSetpoint(False, (0.0, 0.0, -1.2))}
    flight.run(0.2)
    flight.step(command(SET_MODE, 1.0, 6.0, 0.0))
    assert flight.snapshot.intended_mode is Mode.OFFBOARD
    flight.step(command(ARM, 1.0))
    flight.run(4.0)
    assert flight.mode is Mode.OFFBOARD
    assert -flight.sim.truth().p_WB[2] == pytest.approx(1.2, abs=0.05)
    second = standing(Flight(on_the_ground()))
    second.streamed = {"motion": MotionSetpoint(False, (0.0, 0.0, -1.2))}
    second.run(0.2)
    second.step(command(SET_MODE, 1.0, 6.0, 0.0))
    second.streamed = {}
    second.run(0.7)
    assert second.snapshot.intended_mode is Mode.HOLD
    assert any("offboard cancelled" in text for text in second.texts)


def item(
    number: int, *params: float, x: float = 0.0, y: float = 0.0, z: float = 0.0
) -> MissionItem:
    p = (*params, *(0.0,) * (4 - len(params)))
    return MissionItem(number, 1, (p[0], p[1], p[2], p[3]), round(1e4 * x), round(1e4 * y), z)


def uploaded(*items: MissionItem) -> MissionUpdate:
    steps = [read_step(one, lambda a, b, c: (a, b, c)) for one in items]
    return MissionUpdate(steps=tuple(steps), current=0)  # type: ignore[arg-type]


@pytest.mark.long
def test_a_mission_that_is_started_disarmed_arms_and_flies() -> None:
    flight = standing(Flight(on_the_ground()))
    flight.upload = uploaded(item(22, 0.0, 0.0, 0.0, NAN, z=-1.2))
    flight.run(0.1)
    flight.step(command(MISSION_START, 0.0, 0.0))
    assert flight.results[-1] == (MISSION_START, ACCEPTED)
    assert flight.mode is Mode.MISSION
    flight.run(12.0)
    assert -flight.sim.truth().p_WB[2] == pytest.approx(1.2, abs=0.15)


@pytest.mark.long
@pytest.mark.parametrize("radius", [2.0, -2.0])
def test_an_orbit_is_flown_round_its_centre_with_the_nose_to_it(radius: float) -> None:
    flight = hovering()
    x, y, z = 2.0, 1.0, -1.8
    latitude, longitude, altitude = to_global(flight.config.origin, (x, y, z))
    flight.step(as_int(ORBIT, 0, radius, NAN, 0.0, NAN, latitude, longitude, altitude))
    assert flight.results[-1] == (ORBIT, ACCEPTED)
    assert flight.mode is Mode.ORBIT
    assert flight.snapshot.orbit is not None
    flight.run(22.0)
    places = []
    for _ in range(16):
        flight.run(1.0)
        truth = flight.sim.truth()
        places.append(truth.p_WB)
        assert math.dist(truth.p_WB[:2], (x, y)) == pytest.approx(2.0, abs=0.1)
        assert truth.p_WB[2] == pytest.approx(z, abs=0.05)
        bearing = math.atan2(y - truth.p_WB[1], x - truth.p_WB[0])
        assert math.cos(flight.snapshot.estimate.yaw - bearing) > math.cos(0.15)
    angles = [math.atan2(p[1] - y, p[0] - x) for p in places]
    turned = sum(math.remainder(b - a, 2 * math.pi) for a, b in itertools.pairwise(angles))
    assert math.copysign(1.0, turned) == math.copysign(1.0, radius)
    assert abs(turned) > math.pi
    flight.step(command(SET_MODE, 1.0, 4.0, 3.0))
    flight.run(3.0)
    assert flight.mode is Mode.HOLD
    assert math.hypot(*flight.sim.truth().v_WB) < 0.02
    assert flight.snapshot.orbit is None


def test_an_orbit_that_reaches_behind_a_wall_is_refused() -> None:
    flight = Flight(replace(hover(), walls=load_scenario("walls").walls))
    flight.step(command(ARM, 1.0))
    flight.run(0.5)
    flight.step(as_int(ORBIT, 1, 3.0, NAN, 0.0, NAN, 0.0, 0.0, -1.4))
    assert flight.results[-1] == (ORBIT, DENIED)
    assert any("too close to zone 1 of the safe set" in text for text in flight.texts)
    assert flight.mode is Mode.HOLD


@pytest.mark.long
def test_a_place_is_looked_at_on_the_way_and_left_again() -> None:
    flight = hovering()
    place = (0.0, 6.0, 0.0)
    latitude, longitude, _ = to_global(flight.config.origin, place)
    flight.step(as_int(ROI, 0, NAN, NAN, NAN, NAN, latitude, longitude, NAN))
    assert flight.results[-1] == (ROI, ACCEPTED)
    flight.run(14.0)
    assert flight.snapshot.estimate.yaw == pytest.approx(math.pi / 2, abs=0.06)
    flight.step(as_int(GOTO, 1, -1.0, 1.0, 0.0, NAN, 3.0, 0.0, -1.4))
    flight.run(12.0)
    expected = math.atan2(6.0 - 0.0, -3.0)
    assert flight.snapshot.estimate.yaw == pytest.approx(expected, abs=0.06)
    flight.step(as_int(ROI_NONE, 0, NAN, NAN, NAN, NAN, -214.7483648, -214.7483648, NAN))
    assert flight.results[-1] == (ROI_NONE, ACCEPTED)
    flight.step(as_int(GOTO, 1, -1.0, 1.0, 0.0, NAN, 0.0, 0.0, -1.4))
    flight.run(6.0)
    assert flight.snapshot.estimate.yaw == pytest.approx(expected, abs=0.06), "and stays"


@pytest.mark.long
def test_a_mission_looks_at_a_place_until_it_is_told_not_to() -> None:
    flight = Flight(hover())
    flight.upload = uploaded(
        item(195, x=2.0, y=4.0),
        item(16, 0.0, 0.0, 0.0, NAN, x=2.0, z=-1.2),
        item(197),
        item(16, 0.0, 0.0, 0.0, 0.0, x=0.0, z=-1.2),
    )
    flight.step(command(ARM, 1.0))
    flight.step(command(MISSION_START, 0.0, 0.0))
    flight.run(16.0)
    yaws = []
    while flight.mode is Mode.MISSION and len(yaws) < 60:
        flight.run(0.5)
        yaws.append(flight.snapshot.estimate.yaw)
    assert flight.mode is Mode.HOLD
    assert max(yaws) == pytest.approx(math.pi / 2, abs=0.06)
    assert yaws[-1] == pytest.approx(0.0, abs=0.1), "the heading that the last item asks for"


@pytest.mark.long
def test_the_speed_of_a_goto_can_be_changed() -> None:
    def distance(speed: float) -> float:
        flight = hovering()
        flight.step(command(SPEED, 1.0, speed, -1.0))
        assert flight.results[-1] == (SPEED, ACCEPTED)
        begin = flight.sim.truth().p_WB
        flight.step(as_int(GOTO, 1, -1.0, 1.0, 0.0, NAN, 20.0, 0.0, -1.4))
        flight.run(4.0)
        return math.dist(begin, flight.sim.truth().p_WB)

    slow, fast = distance(0.3), distance(1.4)
    assert slow == pytest.approx(0.3 * 4.0, abs=0.3)
    assert fast > 3.0 * slow
    flight = hovering()
    flight.step(command(SPEED, 1.0, 12.0, -1.0))
    assert flight.results[-1] == (SPEED, DENIED)
    assert any("speed unchanged" in text for text in flight.texts)


@pytest.mark.long
def test_a_return_waits_at_its_descent_height_before_it_lands() -> None:
    config = limits(return_height=2.5, return_descent=1.2, return_wait=3.0)
    flight = standing(Flight(on_the_ground(), config=config))
    flight.step(command(TAKEOFF))
    flight.step(command(ARM, 1.0))
    flight.run(4.0)
    flight.step(as_int(GOTO, 1, -1.0, 1.0, 0.0, NAN, 1.5, 0.0, -1.4))
    flight.run(5.0)
    flight.step(command(20))
    heights, home = [], flight.snapshot.home
    assert home is not None
    while flight.mode is Mode.RETURN and len(heights) < 60:
        flight.run(0.5)
        heights.append(home.p[2] - flight.sim.truth().p_WB[2])
    assert max(heights) == pytest.approx(2.5, abs=0.1)
    assert heights[-1] == pytest.approx(1.2, abs=0.1)
    waiting = [height for height in heights[-6:] if height == pytest.approx(1.2, abs=0.1)]
    assert len(waiting) == 6, "three seconds"
    assert flight.mode is Mode.LAND


@pytest.mark.long
def test_a_return_that_is_not_to_land_holds_over_home() -> None:
    flight = standing(Flight(on_the_ground(), config=limits(return_wait=-1.0)))
    flight.step(command(TAKEOFF))
    flight.step(command(ARM, 1.0))
    flight.run(4.0)
    flight.step(command(20))
    flight.until(Mode.HOLD, 10.0)
    flight.run(1.0)
    assert flight.modes[-2:] == [Mode.RETURN, Mode.HOLD]


@pytest.mark.parametrize(
    ("action", "mode"),
    [
        (0, Mode.HOLD),
        pytest.param(1, Mode.HOLD, marks=pytest.mark.long),
        (2, Mode.RETURN),
        pytest.param(3, Mode.LAND, marks=pytest.mark.long),
    ],
)
def test_a_lost_ground_station_is_acted_upon_as_the_parameter_says(action: int, mode: Mode) -> None:
    config = limits(station_timeout_us=1_000_000, station_loss_action=action, failsafe_delay_us=0)
    flight = hovering(config=config)
    flight.streamed = {"ground_station_heard": True}
    flight.run(0.5)
    flight.streamed = {}
    flight.run(1.2)
    assert flight.mode is mode
    assert (flight.snapshot.failsafe_from is Mode.HOLD) is (action != 0)
    assert any("failsafe: no ground station" in text for text in flight.texts) is (action != 0)
    if action == 2:
        flight.step(command(SET_MODE, 1.0, 4.0, 3.0))
        assert flight.snapshot.failsafe_from is None, "the pilot has taken it back"


@pytest.mark.drawn(1)
@pytest.mark.parametrize(("action", "mode"), [(3, Mode.RETURN), (4, Mode.LAND), (5, Mode.HOLD)])
def test_lost_set_points_are_acted_upon_as_the_parameter_says(action: int, mode: Mode) -> None:
    flight = hovering(config=limits(setpoint_loss_action=action))
    flight.streamed = {"motion": MotionSetpoint(False, (0.0, 0.0, -1.4))}
    flight.run(0.2)
    flight.step(command(SET_MODE, 1.0, 6.0, 0.0))
    flight.run(0.5)
    flight.streamed = {}
    flight.run(0.7)
    assert flight.mode is mode
    assert flight.snapshot.failsafe_from is Mode.OFFBOARD


@pytest.mark.parametrize(
    ("action", "remaining", "mode"),
    [
        (0, 0.04, Mode.HOLD),
        (2, 0.15, Mode.HOLD),
        (2, 0.08, Mode.LAND),
        (3, 0.08, Mode.RETURN),
        (3, 0.04, Mode.LAND),
    ],
)
def test_a_battery_that_runs_low_is_told_once_a_level_and_acted_upon(
    action: int, remaining: float, mode: Mode
) -> None:
    config = limits(low_battery_action=action, failsafe_delay_us=0, flight_time_action=1)
    flight = hovering(config=config)
    flight.state = replace(flight.state, battery=BatteryState(14.0, 20.0, 9.0, remaining))
    # The model counts what was consumed: 10 A h less that.
    drawn = replace(flight.state.battery, consumed=10.0 * (1.0 - remaining))
    flight.state = replace(flight.state, battery=drawn)
    flight.run(1.0)
    assert flight.mode is mode
    assert sum("battery" in text and "% left" in text for text in flight.texts) == 1
    assert flight.snapshot.battery.charge is charge_of(remaining, (0.2, 0.1, 0.05))


@pytest.mark.requirement("REQ-BAT-1")
def test_the_levels_of_the_battery() -> None:
    levels = (0.2, 0.1, 0.05)
    found = [charge_of(share, levels) for share in (1.0, 0.2, 0.19, 0.1, 0.09, 0.05, 0.04, NAN)]
    assert found == [one for one in BatteryWarning for _ in range(2)]
    assert FlightLimits().battery_low > FlightLimits().battery_critical


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-6")
def test_a_goto_beyond_an_exclusion_stops_before_it() -> None:
    flight = hovering()
    cylinder = column((1.5, 0.0), 0.5)
    flight.upload = MissionUpdate(fence=SafeSet((cylinder,)))
    flight.step(as_int(GOTO, 1, -1.0, 1.0, 0.0, NAN, 4.0, 0.02, -1.4))
    least = math.inf
    for _ in range(100):
        flight.run(0.1)
        estimate = flight.sim.truth()
        least = min(least, math.dist(estimate.p_WB[:2], (1.5, 0.0)))
    rotors = hull_reach(body_of("full", AIRFRAME), (-1.0, 0.0, 0.0))
    assert 0.5 < least - rotors < 0.75
    assert flight.snapshot.constraints.margins
    assert min(flight.snapshot.constraints.margins) > 0.0
    flight.step(as_int(GOTO, 1, -1.0, 1.0, 0.0, NAN, 1.4, 0.0, -3.0))
    assert flight.results[-1] == (GOTO, DENIED), "above it is as much behind the fence as beside"


def _through_the_store(
    flight: Flight, store: MissionStore, radius: float, sender: MessageSource
) -> Upload:
    """A fence around the origin goes the way of an upload."""
    circle = MissionItem(CIRCLE_INCLUSION, 1, (radius, 0.0, 0.0, 0.0), 0, 0, -1.2)
    upload = store.offer({Kind.FENCE: ((circle,), (None,))}, sender)
    flight.upload = store.take_update()
    store.settle(flight.step().upload_taken)
    return upload


@pytest.mark.requirement("REQ-SAFE-9")
def test_a_fence_that_is_not_in_force_is_neither_acknowledged_nor_owned() -> None:
    """A stranger's fence, too close to stop before, kept the operator's out for the flight."""
    stranger = MessageSource(66, 6, "gcs", "127.0.0.1:6666")
    operator = MessageSource(255, 190, "gcs", "127.0.0.1:14550")
    flight = hovering()
    store = MissionStore(Site(lambda a, b, c: (a, b, c), lambda: 0.1))
    flight.step(as_int(GOTO, 1, 1.5, 1.0, 0.0, NAN, -8.0, 0.0, -1.4))
    flight.run(3.0)
    ahead = math.hypot(*flight.sim.truth().p_WB[:2])
    assert math.hypot(*flight.sim.truth().v_WB) > 1.0
    theirs = _through_the_store(flight, store, ahead + 0.8, stranger)
    assert theirs.result == DENIED_MISSION
    refused = "fence of 66/6 (gcs 127.0.0.1:6666) refused: the vehicle could not stop before"
    assert any(text.startswith(refused) for text in flight.texts)
    assert (store.items[Kind.FENCE], store.ids[Kind.FENCE]) == ((), 0)
    assert flight.state.mission.fence == SafeSet()
    flight.run(5.0)
    for radius in (12.0, 20.0):
        assert _through_the_store(flight, store, radius, operator).result == 0
        assert flight.state.mission.fence.zones
        assert flight.state.mission.fence_owner == operator
