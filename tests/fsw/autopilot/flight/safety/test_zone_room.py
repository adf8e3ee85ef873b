"""The room and the speed that a zone may take: never more than setpoints have, never the ground."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.flight.safety.safe_set import SafeSetCheck
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.safety.zone_room import ZoneRoom, is_deep
from fsw.autopilot.parameters.flight_config import lowest_height
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.shapes.half_space import half_space, wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import EndEffectorTarget, SafeSet, StateEstimate, Vec3, Zone
from tests.fsw.autopilot.flight.in_flight import CONFIG, vehicle_at

CHECK, ROOMS = SafeSetCheck(CONFIG), ZoneRoom(CONFIG)
WALLS, SPEED = CONFIG.planner.walls, CONFIG.steering.speed
REST = stand_off(WALLS)
HERE: Vec3 = (0.0, 0.0, -3.0)
STILL: Vec3 = (0.0, 0.0, 0.0)


def limited(
    zone: Zone,
    estimate: StateEstimate,
    target: EndEffectorTarget | None = None,
    room: ZoneRoom = ROOMS,
) -> tuple[InflatedSafeSet, float]:
    """The set that is kept, and the margin that it leaves."""
    kept = InflatedSafeSet().of(SafeSet((zone,)))
    report = CHECK.margins(kept, estimate, target)
    found = room.limit(kept, report, estimate, target)
    after = CHECK.margins(InflatedSafeSet().of(found.safe_set), estimate, target)
    margins = CHECK.margins(found, estimate, target).margins
    assert margins == report.margins, "what is reported is of the set in force"
    return found, min(after.margins)


def demanded(margin: float, comes: float) -> float:
    """The speed [m/s] that the barrier asks for."""
    return WALLS.lambda_ - WALLS.approach_speed(margin) + comes


@pytest.mark.requirement("REQ-SAFE-4")
@given(st.floats(-0.99, 0.4), st.floats(0.0, 3.0))
def test_no_zone_asks_for_more_than_the_largest_speed_of_setpoints(
    margin: float, comes: float
) -> None:
    """North of a wall that comes north."""
    shape = half_space((1.0, 0.0, 0.0), -margin)
    zone = Zone(shape, 0.0, velocity=(comes, 0.0, 0.0) if comes else STILL, t_us=0)
    found, left = limited(zone, vehicle_at(HERE))
    (kept,) = found.safe_set.zones
    assert demanded(left, kept.velocity[0]) <= SPEED + 1e-6
    slow = comes <= SPEED - WALLS.lambda_
    if demanded(margin, comes) < 0.0 or (slow and demanded(margin, comes) < SPEED - 1e-6):
        assert found.safe_set.zones == (zone,), "it asks for no more as it is"


@pytest.mark.requirement("REQ-SAFE-4")
@pytest.mark.parametrize(
    "zone",
    [
        wall((-1.0, 0.0, 0.0), 10.0, 0.1),
        Zone(ball((0.5, 0.0, -3.0), 3.0), 0.1, velocity=(0.5, 0.0, 0.0)),
        target_sphere((5.0, 0.0, 0.0), 0.3),
    ],
)
def test_from_deeper_than_its_room_the_vehicle_may_stay_where_it_is(zone: Zone) -> None:
    target = EndEffectorTarget(0, (0.0, 0.0, -2.775), (0.5, 0.0, 0.0), STILL)
    found, left = limited(zone, vehicle_at(HERE), target)
    rest = REST if zone.clearance else stand_off(CONFIG.planner.workspace)
    assert left > rest + 0.3
    assert found.safe_set.zones[0].velocity == STILL
    assert is_deep(CHECK.margins(found, vehicle_at(HERE), target))
    assert not is_deep(CHECK.margins(InflatedSafeSet().of(SafeSet()), vehicle_at(HERE), None))


def test_a_ceiling_pushes_no_lower_than_the_lowest_height_of_references() -> None:
    lowest = lowest_height(CONFIG)
    ceiling = Zone(half_space((0.0, 0.0, 1.0), 0.0), 0.0)  # free below
    for height, room in ((2.0, None), (lowest + 0.05, 0.05), (lowest, 0.0), (0.4, 0.4 - lowest)):
        above = replace(ceiling, shape=half_space((0.0, 0.0, 1.0), -height + 0.1))
        found, left = limited(above, vehicle_at((0.0, 0.0, -height)))
        if room is None:
            assert found.safe_set.zones == (above,)
        else:
            assert REST - left == pytest.approx(room)
    # What sinks is braked first.
    above = replace(ceiling, shape=half_space((0.0, 0.0, 1.0), -lowest - 0.3 + 0.1))
    _, left = limited(above, vehicle_at((0.0, 0.0, -lowest - 0.3), (0.0, 0.0, 1.0)))
    assert left > REST


def test_controllers_that_are_flown_for_comparison_keep_every_zone_as_it_is() -> None:
    far = wall((-1.0, 0.0, 0.0), 10.0, 0.1)
    for config in (replace(CONFIG, soft=True), replace(CONFIG, controller="sc")):
        found, _ = limited(far, vehicle_at(HERE), room=ZoneRoom(config))
        assert found.safe_set.zones == (far,)


def test_what_was_given_is_taken_back_once_there_is_room() -> None:
    far = wall((-1.0, 0.0, 0.0), 10.0, 0.1)
    found, _ = limited(far, vehicle_at(HERE))
    assert found.given[0] == pytest.approx(10.1 + REST + 0.5)
    assert found.beyond == (-found.given[0],)
    assert found.whole.given == ()
    assert found.whole.safe_set == SafeSet((far,))
