"""What others say, flown: nothing announced or streamed moves the vehicle where it must not.

A stranger's one message made a hovering vehicle hit the ground, or leave at 20 m/s, and a stream of
targets below the ground was flown into it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fsw.autopilot.parameters.flight_config import lowest_height
from fsw.autopilot.shapes.ball import ball, point
from fsw.autopilot.shapes.box import box
from fsw.autopilot.shapes.half_space import half_space, wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import (
    EndEffectorTarget,
    MessageSource,
    Mode,
    SafeSet,
    SafeSetAnnouncement,
    Severity,
    TickInputs,
    Vec3,
    Zone,
)
from sitl.simulation import START_US
from tests.closed_loop.harness import ARM, LAND, SET_MODE, Flight, command, hover

GOTO, RETURN = 192, 20
F32MAX = 3.4028234663852886e38
STRANGER = MessageSource(66, 6, "gcs", "127.0.0.1:5555")
REST: Vec3 = (0.0, 0.0, 0.0)


def hovering(*, force: bool = False, before: SafeSet | None = None) -> Flight:
    flight = Flight(replace(hover(), body="full"))
    if before is not None:
        tell(flight, before)
    flight.step(command(ARM, 1.0, 21196.0 if force else 0.0))
    return flight


def tell(flight: Flight, safe_set: SafeSet) -> None:
    """One message of a stranger's."""
    heard(flight, announced=(SafeSetAnnouncement(STRANGER, safe_set),))


def heard(flight: Flight, **received: object) -> None:
    """A step in which something was received."""
    sensors, samples = flight.closed.observe()
    plan = flight.closed.planner.take(sensors.t_us)
    inputs = TickInputs(sensors, plan, samples=samples)
    flight.step_with(replace(inputs, **received))  # type: ignore[arg-type]


def fastest(flight: Flight, seconds: float) -> float:
    most = 0.0
    for _ in range(round(seconds * 50)):
        flight.run(0.02)
        most = max(most, math.hypot(*flight.sim.truth().v_WB))
    return most


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-SAFE-7")
@pytest.mark.parametrize(
    "zone",
    [
        target_sphere((F32MAX,) * 3, F32MAX),
        target_sphere((5.0, 0.0, 0.0), 0.3),
        wall((-1.0, 0.0, 0.0), 10.0, 0.1),
        wall((-1.0, 0.0, 0.0), 1e30, 0.1),
        point((0.0, 0.0, -1.4), 50.0),
        point((0.0, 0.0, -50.0), 1e20),
        Zone(ball((3.0, 0.0, -1.4), 1.0), 0.1, velocity=(-15.0, 0.0, 0.0), t_us=START_US),
    ],
)
def test_one_announcement_of_a_stranger_does_not_move_a_hovering_vehicle(zone: Zone) -> None:
    flight = hovering()
    flight.run(1.0)
    begun = flight.sim.truth().p_WB
    tell(flight, SafeSet((zone,)))
    refusals = [text for text in flight.outputs.texts if "refused" in text.text]
    assert [text.severity for text in refusals] == [Severity.CRITICAL]
    assert flight.snapshot.safety.refusals == 1
    assert fastest(flight, 2.5) < 0.2
    assert math.dist(begun, flight.sim.truth().p_WB) < 0.2  # the arm hangs down, and moves it
    assert flight.mode is Mode.HOLD
    assert flight.snapshot.safe_set == SafeSet()


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-4")
def test_far_outside_the_vehicle_holds_and_then_lands_and_says_so() -> None:
    """Armed by force 10 m behind a wall."""
    flight = hovering(force=True, before=SafeSet((wall((-1.0, 0.0, 0.0), 10.0, 0.1),)))
    assert fastest(flight, 4.0) < 0.3
    assert flight.mode is Mode.HOLD
    assert any("too far outside to retreat" in text for text in flight.texts)
    flight.run(3.0)
    assert flight.mode is Mode.LAND
    assert fastest(flight, 8.0) < 0.5
    assert flight.mode is Mode.DISARMED


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-4")
def test_a_zone_that_runs_over_the_vehicle_drives_it_no_faster_than_setpoints() -> None:
    """Upright, a wall comes from behind at the largest speed; then one from above."""
    speed = Flight(hover()).config.surroundings.zone_speed
    most = Flight(hover()).config.steering.speed
    for normal, away in (((1.0, 0.0, 0.0), 1.5), ((0.0, 0.0, 1.0), 1.0)):
        flight = hovering()
        flight.run(1.0)
        p = flight.sim.truth().p_WB
        velocity = (speed * normal[0], speed * normal[1], speed * normal[2])
        offset = sum(map(float.__mul__, normal, p)) - away
        comes = Zone(half_space(normal, offset), 0.1, velocity=velocity, t_us=flight.sim.t_us)
        tell(flight, SafeSet((comes,)))
        assert flight.snapshot.safe_set == SafeSet((comes,)), flight.texts
        assert fastest(flight, 5.0) < 1.1 * most  # a run that touches the ground raises


def streamed(flight: Flight, moved: Vec3, begin_s: float, end_s: float, lasts_s: float) -> float:
    """Targets ten times a second, still, and elsewhere for a while; the largest speed [m/s]."""
    at, most = (0.0, 0.0, -1.2), 0.0
    for k in range(round(lasts_s * 10)):
        t_s = 0.1 * k
        there = begin_s <= t_s < end_s
        p = (at[0] + moved[0], at[1] + moved[1], at[2] + moved[2]) if there else at
        heard(flight, targets=(EndEffectorTarget(flight.sim.t_us + 200_000, p, REST, REST),))
        if k == 1:
            flight.step(command(SET_MODE, 1.0, 4.0, 11.0))
        flight.run(0.096 if k == 1 else 0.098)
        most = max(most, math.hypot(*flight.sim.truth().v_WB))
    return most


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-SAFE-6")
@pytest.mark.parametrize(
    ("moved", "lasts_s"),
    [
        ((0.0, 0.0, 4.2), 90.0),
        ((0.0, 0.0, -10.0), 2.5),
        ((0.0, 0.0, -20.0), 4.0),
        ((30.0, -20.0, 0.0), 3.0),
    ],
)
def test_targets_below_the_ground_or_far_away_are_limited_and_told(
    moved: Vec3, lasts_s: float
) -> None:
    flight = hovering()
    fast = streamed(flight, moved, 2.0, 2.0 + lasts_s, 12.0)
    assert fast < 1.15 * flight.config.steering.speed
    assert any(text.startswith("reference limited: ") for text in flight.texts), flight.texts


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.RETURN, Mode.LAND])
def test_a_mode_whose_way_is_blocked_says_by_what(mode: Mode) -> None:
    """Flown: a return stood before a wall, and said nothing."""
    flight = hovering()
    flight.run(0.5)
    x, y, z = flight.sim.truth().p_WB
    if mode is Mode.LAND:
        in_the_way, order = box((x, y, -0.3), (1.0, 1.0, 0.3)), command(LAND)
    else:
        flight.step(command(GOTO, -1.0, 1.0, 0.0, math.nan, x - 3.0, y, z, frame=1))
        flight.run(8.0)
        in_the_way = box((x - 1.5, y, z), (0.1, 3.0, 3.0))
        order = command(RETURN)
        if mode is Mode.HOLD:
            order = command(GOTO, -1.0, 1.0, 0.0, math.nan, x, y, z, frame=1)
    zones = flight.state.mission.announced.zones
    tell(flight, SafeSet((*zones, Zone(in_the_way, 0.1))))
    flight.step(order)
    flight.run(16.0)
    assert flight.mode is mode
    said = [text for text in flight.texts if text.startswith("no progress: ")]
    assert said == [f"no progress: blocked by zone {len(zones) + 1} (box)"]


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-SAFE-6")
@pytest.mark.parametrize("number", [LAND, SET_MODE])
def test_a_mode_that_takes_over_from_targets_far_away_begins_at_the_vehicle(number: int) -> None:
    flight = hovering()
    streamed(flight, (0.0, 0.0, -30.0), 1.0, 9.0, 1.5)
    assert flight.mode is Mode.TRAJECTORY
    began = -flight.sim.truth().p_WB[2]
    flight.step(command(number, *((1.0, 4.0, 3.0) if number == SET_MODE else ())))
    assert fastest(flight, 4.0) < 1.15 * flight.config.steering.speed
    assert -flight.sim.truth().p_WB[2] < began + 1.5


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-4")
def test_a_ceiling_announced_lower_and_lower_holds_the_vehicle_above_the_ground() -> None:
    """Ten times a second, each time just above the vehicle, and coming down at 1 m/s."""
    flight = hovering()
    flight.run(1.0)
    for _ in range(45):
        offset = flight.sim.truth().p_WB[2] - 0.62
        ceiling = half_space((0.0, 0.0, 1.0), offset)
        down = Zone(ceiling, 0.1, velocity=(0.0, 0.0, 1.0), t_us=flight.sim.t_us)
        tell(flight, SafeSet((down,)))
        flight.run(0.098)
    assert -flight.sim.truth().p_WB[2] == pytest.approx(lowest_height(flight.config), abs=0.05)


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-4")
def test_a_landing_that_a_wall_runs_over_ends_upright() -> None:
    """It slid along the ground at 1.5 m/s, and tipped over."""
    flight = hovering()
    flight.run(1.0)
    flight.step(command(LAND))
    flight.run(3.0)
    comes = half_space((1.0, 0.0, 0.0), flight.sim.truth().p_WB[0] - 1.5)
    wall_on_the_move = Zone(comes, 0.1, velocity=(1.5, 0.0, 0.0), t_us=flight.sim.t_us)
    tell(flight, SafeSet((wall_on_the_move,)))
    flight.run(6.0)  # a run that tips over raises
    assert flight.mode is Mode.DISARMED
