"""Where a vehicle retreats to: clear of every zone with all of it, and no farther than needed."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.flight.safety.retreat import retreat_place
from fsw.autopilot.flight.safety.safe_set import SafeSetCheck
from fsw.autopilot.flight.safety.safety_watch import SafetyWatch
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.state import first_state
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.shapes.box import box
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import SafeSet, Vec2, Vec3, Zone
from tests.fsw.autopilot.flight.in_flight import CONFIG, vehicle_at

CHECK = SafeSetCheck(replace(CONFIG, planner=replace(CONFIG.planner, body="points")))
ROOM = stand_off(CONFIG.planner.walls)
AHEAD = wall((-1.0, 0.0, 0.0), -1.0, 0.1)


def retreated(zones: tuple[Zone, ...], p: Vec3, q_arm: Vec2 = (0.0, 0.0)) -> Vec3:
    return retreat_place(CONFIG, SafeSet(zones), vehicle_at(p)._replace(q_arm=q_arm), ROOM)


@pytest.mark.requirement("REQ-SAFE-4")
def test_off_a_wall_it_goes_straight_along_the_normal() -> None:
    x, y, z = retreated((AHEAD,), (0.92, 0.3, -1.0))
    assert (x, y, z) == pytest.approx((0.9 - ROOM, 0.3, -1.0))


def test_an_arm_that_is_stretched_out_is_taken_along() -> None:
    x, _, _ = retreated((AHEAD,), (0.8, 0.3, -1.0), (1.0, 0.5))
    reach = 0.15 * math.sin(1.0) + 0.15 * math.sin(1.5)
    assert x == pytest.approx(0.9 - ROOM - reach)


def test_where_it_is_clear_it_stays() -> None:
    assert retreated((AHEAD,), (0.1, 0.3, -1.0)) == (0.1, 0.3, -1.0)
    sphere = target_sphere((0.0, 0.0, -0.225), 0.075)
    assert retreated((sphere,), (0.1, 0.3, -1.0)) == (0.1, 0.3, -1.0)


def test_from_deep_inside_it_goes_a_step() -> None:
    p = retreated((wall((-1.0, 0.0, 0.0), 5.0, 0.1),), (0.0, 0.0, -1.0))
    assert p == pytest.approx((-1.0, 0.0, -1.0))


def test_between_walls_too_close_it_goes_to_their_middle() -> None:
    back = wall((1.0, 0.0, 0.0), 0.7, 0.1)
    x, _, _ = retreated((AHEAD, back), (0.92, 0.0, -1.0))
    assert 0.7 < x < 1.0
    assert abs(x - 0.85) <= 0.5 * ROOM + 1e-3


@pytest.mark.requirement("REQ-SAFE-4")
@given(
    st.tuples(*[st.floats(-0.4, 0.4)] * 3),
    st.tuples(st.floats(-1.0, 1.0), st.floats(-0.5, 0.5)),
    st.sampled_from(
        [
            (AHEAD,),
            (Zone(ball((0.1, 0.0, -2.0), 0.2), 0.1),),
            (Zone(box((0.0, 0.1, -1.7), (0.3, 0.2, 0.1)), 0.1), AHEAD),
            (AHEAD, wall((0.0, 1.0, 0.0), 0.2, 0.1)),
        ]
    ),
)
def test_there_nothing_of_the_vehicle_is_too_close(
    aside: Vec3, q_arm: Vec2, zones: tuple[Zone, ...]
) -> None:
    start = (aside[0], aside[1], -2.0 + aside[2])
    place = retreated(zones, start, q_arm)
    if math.dist(place, start) > 0.999:
        return
    there = vehicle_at(place)._replace(q_arm=q_arm)
    found = CHECK.margins(InflatedSafeSet().of(SafeSet(zones)), there, None)
    margins = found.margins
    assert min(margins) >= ROOM - 2e-3
    assert first_state(CONFIG.airframe).safety == SafetyWatch(CONFIG, CHECK.loop_tube).breach(
        first_state(CONFIG.airframe).safety, there, found, len(zones), flies=True
    )
