"""Places and heights in every frame that is supported."""

from __future__ import annotations

import math
from functools import partial

import pytest

from fsw.autopilot.flight.commands.handlers import Decision, decide
from fsw.autopilot.flight.setpoints.generator import PositionGoal
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.geometry.geodesy import to_global, to_local
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import (
    CommandRequest,
    CommandResult,
    Home,
    Mode,
    MotionSetpoint,
    Origin,
    SafeSet,
    Vec3,
)
from fsw.link.wire.decode_commands import command as read_command
from tests.fsw.autopilot.flight.asked import FLIGHT_MODES, ask
from tests.fsw.autopilot.flight.contexts import STANDING, having

ACCEPTED, DENIED = CommandResult.ACCEPTED, CommandResult.DENIED
TEMPORARILY_REJECTED = CommandResult.TEMPORARILY_REJECTED
NAN = math.nan
ORIGIN = Origin(48.0, 11.0, 500.0)
HOME = Home((3.0, 4.0, -0.32), 0.0)
HERE = (1.0, 2.0, -5.0)
HOVERING = having(STANDING, mode=Mode.HOLD, landed=False, p_WB=HERE, home=HOME)
GOTO, SET_HOME, SET_ACTUATOR, MAY_SWITCH = 192, 179, 187, 1.0


def decided(
    x: float,
    y: float,
    z: float,
    frame: int | None,
    *first: float,
    command: int = GOTO,
    context: Situation = HOVERING,
) -> Decision:
    """On a command that names a place in parameters 5 to 7."""
    p = (*first, *(NAN,) * (4 - len(first)))
    request = CommandRequest(command, (p[0], p[1], p[2], p[3], x, y, z), 255, 190, 0, frame)
    return decide(read_command(request, partial(to_local, ORIGIN)), context, FLIGHT_MODES)


def place(decision: Decision) -> Vec3:
    assert decision.goal is not None, decision.reason
    assert decision.goal.motion.p is not None
    return decision.goal.motion.p


@pytest.mark.parametrize(
    ("frame", "z"), [(None, 510.0), (0, 510.0), (5, 510.0), (3, 9.68), (6, 9.68), (1, -10.0)]
)
def test_a_height_is_the_same_in_every_frame(frame: int | None, z: float) -> None:
    assert place(decided(NAN, NAN, z, frame)) == pytest.approx((1.0, 2.0, -10.0))


@pytest.mark.parametrize("frame", [2, 4, 7, 8, 10, 11, 12, 99])
def test_a_frame_that_is_not_supported_is_refused_by_number(frame: int) -> None:
    refused = decided(0.0, 0.0, 1.0, frame)
    assert refused.result == DENIED
    assert f"frame {frame} " in refused.reason


@pytest.mark.parametrize("frame", [None, 0, 5])
def test_a_place_on_earth_is_where_the_projection_says(frame: int | None) -> None:
    latitude, longitude, altitude = to_global(ORIGIN, (20.0, -30.0, -7.0))
    assert place(decided(latitude, longitude, altitude, frame)) == pytest.approx(
        (20.0, -30.0, -7.0), abs=1e-6
    )


def test_what_is_left_open_stays_as_it_is() -> None:
    assert place(decided(NAN, NAN, NAN, 0)) == HERE
    assert place(decided(NAN, NAN, 508.0, 0)) == (1.0, 2.0, -8.0)
    assert place(decided(7.0, 8.0, NAN, 1)) == (7.0, 8.0, -5.0)


@pytest.mark.parametrize(
    ("x", "y", "z", "frame"),
    [
        (NAN, 11.0, 505.0, 0),
        (math.inf, 11.0, 505.0, 0),
        (91.0, 11.0, 505.0, 0),
        (48.0, 181.0, 505.0, 0),
        (47.0, 11.0, 505.0, 0),  # 111 km away
        (2000.0, 0.0, -5.0, 1),
        (0.0, 0.0, math.inf, 1),
    ],
)
def test_a_place_of_no_use_is_refused(x: float, y: float, z: float, frame: int) -> None:
    decision = decided(x, y, z, frame, NAN, MAY_SWITCH)
    assert decision.result == DENIED
    assert decision.reason


def test_a_goto_carries_its_place_speed_and_heading() -> None:
    decision = decided(7.0, 8.0, -3.0, 1, 0.5, MAY_SWITCH, 0.0, 1.25)
    assert decision.result == ACCEPTED
    motion = MotionSetpoint(False, (7.0, 8.0, -3.0), yaw=1.25)
    assert decision.goal == PositionGoal(motion, speed=0.5)
    usual = decided(7.0, 8.0, -3.0, 1, -1.0, MAY_SWITCH)
    assert usual.goal == PositionGoal(MotionSetpoint(False, (7.0, 8.0, -3.0)))


def test_a_goto_out_of_another_mode_must_ask_for_the_change() -> None:
    offboard = having(HOVERING, mode=Mode.OFFBOARD)
    assert decided(7.0, 8.0, -3.0, 1, context=offboard).result == TEMPORARILY_REJECTED
    decision = decided(7.0, 8.0, -3.0, 1, NAN, MAY_SWITCH, context=offboard)
    assert (decision.result, decision.mode) == (ACCEPTED, Mode.HOLD)
    on_ground = having(HOVERING, landed=True)
    assert "ground" in decided(7.0, 8.0, -3.0, 1, context=on_ground).reason


def test_a_goto_into_a_wall_or_the_ground_is_refused() -> None:
    walled = having(HOVERING, safe_set=SafeSet((wall((-1.0, 0.0, 0.0), -10.0, 0.5),)))
    assert decided(9.0, 0.0, -3.0, 1, context=walled).result == ACCEPTED
    for x, z, word in ((9.6, -3.0, "zone 1"), (30.0, -3.0, "zone 1"), (5.0, -0.2, "too low")):
        decision = decided(x, 0.0, z, 1, context=walled)
        assert decision.result == DENIED
        assert word in decision.reason


def test_a_goto_too_close_to_a_point_is_refused() -> None:
    branch = point((9.0, 0.0, -3.0), 0.5)
    near = having(HOVERING, safe_set=SafeSet((branch,)))
    assert decided(9.0, 0.6, -3.0, 1, context=near).result == ACCEPTED
    decision = decided(9.0, 0.4, -3.0, 1, context=near)
    assert decision.result == DENIED
    assert "zone 1" in decision.reason


def test_a_zone_is_named_by_its_own_number_though_one_before_it_has_no_place() -> None:
    zones = target_sphere((0.0, 0.0, -0.2), 0.5), point((9.0, 0.0, -3.0), 0.5)
    near = having(HOVERING, safe_set=SafeSet(zones))
    assert "zone 2" in decided(9.0, 0.4, -3.0, 1, context=near).reason


def test_home_is_set_here_or_at_a_place() -> None:
    here = decided(NAN, NAN, NAN, None, 1.0, command=SET_HOME)
    told = "home set by 255/190: 1.0 m north 2.0 m east, 5.0 m above the origin"
    assert here == Decision(ACCEPTED, told, home=Home(HERE, 0.0))
    latitude, longitude, altitude = to_global(ORIGIN, (5.0, 6.0, -1.0))
    home = decided(latitude, longitude, altitude, 5, 0.0, command=SET_HOME).home
    assert home is not None
    assert home.p == pytest.approx((5.0, 6.0, -1.0), abs=1e-6)
    assert decided(NAN, NAN, 3.0, 5, 0.0, command=SET_HOME).result == DENIED


@pytest.mark.parametrize(
    ("values", "joints"),
    [
        ((0.5, -0.5), (math.pi / 6, -math.pi / 4)),
        ((NAN, 0.5), (0.0, math.pi / 4)),
        ((1.0, -1.0), (math.pi / 3, -math.pi / 2)),
    ],
)
def test_actuators_are_the_joints(values: tuple[float, float], joints: tuple[float, float]) -> None:
    assert ask(HOVERING, SET_ACTUATOR, *values, NAN, NAN, NAN, NAN, 0.0).joints == pytest.approx(
        joints
    )


@pytest.mark.parametrize(
    "values",
    [
        (1.1, NAN, NAN, NAN, NAN, NAN, 0.0),
        (math.inf, NAN, NAN, NAN, NAN, NAN, 0.0),
        (1.0, 1.0, NAN, NAN, NAN, NAN, 0.0),  # together beyond their limit
        (0.0, 0.0, 0.5, NAN, NAN, NAN, 0.0),
        (0.0, 0.0, NAN, NAN, NAN, NAN, 1.0),
    ],
)
def test_an_actuator_that_is_none_or_out_of_range_is_refused(
    values: tuple[float, float, float, float, float, float, float],
) -> None:
    decision = ask(HOVERING, SET_ACTUATOR, *values)
    assert (decision.result, decision.joints) == (DENIED, None)
    assert decision.reason
