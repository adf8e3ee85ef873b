"""What uploaded items mean, and with which result the others are refused."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.signals import MissionAction, MissionStep, Vec3, Vec4
from fsw.link.wire import mission_items as items
from fsw.link.wire.mission_items import BadItem, MissionItem, read_rally, read_step
from messages import dialect

NAN = math.nan
GLOBAL, LOCAL, RELATIVE, MISSION = 5, 1, 6, 2


def locate(latitude: float, longitude: float, altitude: float) -> Vec3:
    """A flat Earth whose origin is at 47 N, 8 E, 400 m."""
    return (latitude - 47.0) * 111_000.0, (longitude - 8.0) * 76_000.0, 400.0 - altitude


def item(
    command: int,
    frame: int = LOCAL,
    params: Vec4 = (0.0, 0.0, 0.0, NAN),
    place: tuple[int, int, float] = (10_000, -20_000, -1.5),
    autocontinue: int = 1,
) -> MissionItem:
    return MissionItem(command, frame, params, *place, autocontinue)


def step(given: MissionItem) -> MissionStep:
    return read_step(given, locate)


def refused(given: MissionItem) -> BadItem:
    with pytest.raises(BadItem) as refused:
        read_step(given, locate)
    assert refused.value.reason
    return refused.value


def test_a_waypoint_in_the_local_frame_is_north_east_down_in_tenths_of_millimetres() -> None:
    read = step(item(dialect.MAV_CMD_NAV_WAYPOINT, params=(3.0, 0.25, 0.0, 90.0)))
    assert read.action is MissionAction.GO
    assert read.position == (1.0, -2.0, -1.5)
    assert (read.hold_s, read.acceptance) == (3.0, 0.25)
    assert read.yaw == pytest.approx(math.pi / 2.0)
    assert not read.above_home
    assert not read.stop_after


def test_altitudes_count_from_home_or_from_the_sea() -> None:
    place = (470_001_000, 80_002_000, 2.0)
    above_home = step(item(dialect.MAV_CMD_NAV_WAYPOINT, RELATIVE, place=place))
    assert above_home.position == pytest.approx((11.1, 15.2, -2.0), abs=0.01)
    assert above_home.above_home
    sea = step(item(dialect.MAV_CMD_NAV_WAYPOINT, GLOBAL, place=(*place[:2], 402.0)))
    assert sea.position == pytest.approx((11.1, 15.2, -2.0), abs=0.01)
    assert not sea.above_home


def test_no_heading_keeps_the_heading_and_no_acceptance_is_the_usual_one() -> None:
    read = step(item(dialect.MAV_CMD_NAV_WAYPOINT))
    assert read.yaw is None
    assert read.acceptance == items.USUAL_ACCEPTANCE


def test_nan_where_it_is_not_used_is_normal() -> None:
    assert step(item(dialect.MAV_CMD_NAV_WAYPOINT, params=(0.0, 0.0, NAN, NAN))).position
    assert step(
        item(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, MISSION, (NAN, NAN, NAN, NAN), (0, 0, NAN))
    )
    assert step(item(dialect.MAV_CMD_NAV_TAKEOFF, params=(NAN, NAN, NAN, NAN)))
    assert step(item(dialect.MAV_CMD_DO_CHANGE_SPEED, MISSION, (1.0, 0.2, -1.0, NAN), (0, 0, NAN)))


@pytest.mark.parametrize(
    ("given", "result"),
    [
        (item(dialect.MAV_CMD_NAV_WAYPOINT, params=(NAN, 0.0, 0.0, 0.0)), 6),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, params=(-1.0, 0.0, 0.0, 0.0)), 6),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, params=(0.0, NAN, 0.0, 0.0)), 7),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, place=(items.NO_PLACE, items.NO_PLACE, -1.0)), 10),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, place=(100_000_000, 0, -1.0)), 10),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, place=(0, 100_000_000, -1.0)), 11),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, place=(0, 0, NAN)), 12),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, place=(0, 0, 1.0)), 12),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, RELATIVE, place=(470_000_000, 80_000_000, -1.0)), 12),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, RELATIVE, place=(0, 0, 1.0)), 10),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, frame=4), 2),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, frame=MISSION), 2),
        (item(dialect.MAV_CMD_NAV_TAKEOFF, place=(0, 0, NAN)), 12),
        (item(dialect.MAV_CMD_NAV_DELAY, MISSION, (-1.0, 0.0, 0.0, 0.0)), 6),
        (item(dialect.MAV_CMD_NAV_LOITER_TIME, params=(NAN, 0.0, 0.0, NAN)), 6),
        (item(dialect.MAV_CMD_DO_CHANGE_SPEED, MISSION, (2.0, 0.2, 0.0, 0.0)), 6),
        (item(dialect.MAV_CMD_DO_CHANGE_SPEED, MISSION, (1.0, 0.0, 0.0, 0.0)), 7),
        (item(dialect.MAV_CMD_DO_CHANGE_SPEED, MISSION, (1.0, NAN, 0.0, 0.0)), 7),
        (item(dialect.MAV_CMD_DO_CHANGE_SPEED, MISSION, (1.0, 21.0, 0.0, 0.0)), 7),
        (item(82), 3),
        (item(5001), 3),
    ],
)
def test_what_is_of_no_use_is_refused_with_its_own_result(given: MissionItem, result: int) -> None:
    assert refused(given).result == result


def test_a_landing_without_a_place_is_right_here() -> None:
    here = (items.NO_PLACE, items.NO_PLACE, 0.0)
    assert step(item(dialect.MAV_CMD_NAV_LAND, RELATIVE, place=here)).position is None
    there = step(item(dialect.MAV_CMD_NAV_LAND, place=(10_000, 0, 0.0)))
    assert there.position == (1.0, 0.0, 0.0)


def test_without_autocontinue_the_vehicle_stops_after_the_item() -> None:
    assert step(item(dialect.MAV_CMD_NAV_WAYPOINT, autocontinue=0)).stop_after


def test_loitering_is_staying() -> None:
    assert step(item(dialect.MAV_CMD_NAV_LOITER_TIME, params=(7.0, 0.0, 0.0, NAN))).hold_s == 7.0
    assert step(item(dialect.MAV_CMD_NAV_LOITER_UNLIM)).hold_s == math.inf


@pytest.mark.parametrize("nowhere", [(0, 0), (items.NO_PLACE, items.NO_PLACE)])
@pytest.mark.parametrize("frame", [RELATIVE, GLOBAL])
def test_an_item_without_a_place_stays_where_the_vehicle_is(
    nowhere: tuple[int, int], frame: int
) -> None:
    """MAVSDK and Mission Planner write 0, 0 where they mean no place."""
    place = (*nowhere, 401.5 if frame == GLOBAL else 1.5)
    landing = step(item(dialect.MAV_CMD_NAV_LAND, frame, place=place))
    assert (landing.action, landing.position) == (MissionAction.LAND, None)
    for command in (
        dialect.MAV_CMD_NAV_LOITER_UNLIM,
        dialect.MAV_CMD_NAV_LOITER_TIME,
        dialect.MAV_CMD_NAV_LOITER_TO_ALT,
    ):
        loiter = step(item(command, frame, place=place))
        assert loiter.here
        assert loiter.position == (0.0, 0.0, -1.5)
    wrong = refused(item(dialect.MAV_CMD_NAV_WAYPOINT, frame, place=place))
    assert (wrong.result, "place" in wrong.reason) == (10, True)
    assert "5" not in wrong.reason, "no distance to a place that was not meant"


def test_zero_zero_is_a_place_in_the_local_frame_and_where_the_origin_is_near() -> None:
    assert step(item(dialect.MAV_CMD_NAV_LAND, LOCAL, place=(0, 0, 0.0))).position == (
        0.0,
        0.0,
        0.0,
    )

    def at_zero(latitude: float, longitude: float, altitude: float) -> Vec3:
        return latitude * 111_000.0, longitude * 111_000.0, -altitude

    landing = read_step(item(dialect.MAV_CMD_NAV_LAND, RELATIVE, place=(0, 0, 0.0)), at_zero)
    assert landing.position == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("radius", "flown"), [(3.0, 3.0), (-2.5, -2.5), (0.0, 2.0), (NAN, 2.0)])
def test_turns_about_a_place_are_a_circle(radius: float, flown: float) -> None:
    circle = step(item(dialect.MAV_CMD_NAV_LOITER_TURNS, params=(2.0, 1.0, radius, 1.0)))
    assert circle.action is MissionAction.CIRCLE
    assert (circle.turns, circle.radius, circle.yaw) == (2.0, flown, None)
    assert circle.position == (1.0, -2.0, -1.5)
    for turns, size in ((0.0, 2.0), (-1.0, 2.0), (NAN, 2.0), (1e9, 2.0), (1.0, 0.1), (1.0, 1e9)):
        wrong = refused(item(dialect.MAV_CMD_NAV_LOITER_TURNS, params=(turns, 0.0, size, 0.0)))
        assert wrong.result == 5


def test_a_jump_names_an_item_and_how_often() -> None:
    jump = step(item(dialect.MAV_CMD_DO_JUMP, MISSION, (3.0, 2.0, 0.0, 0.0)))
    assert (jump.action, jump.target, jump.repeats) == (MissionAction.JUMP, 3, 2)
    assert step(item(dialect.MAV_CMD_DO_JUMP, MISSION, (0.0, -1.0, NAN, NAN))).repeats == -1
    for number, wrong in ((6, (-1.0, 1.0)), (6, (NAN, 1.0)), (6, (0.5, 1.0)), (7, (0.0, 1e9)),
                          (7, (0.0, NAN)), (7, (0.0, -2.0)), (7, (0.0, 0.5))):  # fmt: skip
        assert refused(item(dialect.MAV_CMD_DO_JUMP, MISSION, (*wrong, 0.0, 0.0))).result == number


@pytest.mark.parametrize("command", sorted(items.SKIPPED))
def test_an_item_of_a_camera_is_skipped_whatever_it_says(command: int) -> None:
    skipped = step(item(command, MISSION, (NAN, 7.0, -1.0, NAN), (0, 0, NAN)))
    assert skipped == MissionStep(MissionAction.SKIP)


def test_a_push_has_a_force_and_a_time_and_a_gripper_grabs_or_releases() -> None:
    read = step(item(dialect.MAV_CMD_WAYPOINT_USER_1, params=(5.0, 3.0, 0.0, NAN)))
    assert read.action is MissionAction.PUSH
    assert (read.position, read.force, read.press_s) == ((1.0, -2.0, -1.5), 5.0, 3.0)
    assert (read.hold_s, read.yaw) == (0.0, None)
    for number, wrong in ((1, (0.0, 3.0)), (1, (201.0, 3.0)), (1, (NAN, 3.0)), (2, (5.0, -1.0)),
                          (2, (5.0, NAN))):  # fmt: skip
        push = item(dialect.MAV_CMD_WAYPOINT_USER_1, params=(*wrong, 0.0, NAN))
        assert refused(push).result == items.INVALID_PARAM1 + number - 1
    for wish, action in ((0.0, MissionAction.RELEASE), (1.0, MissionAction.GRIP)):
        assert (
            step(item(dialect.MAV_CMD_DO_GRIPPER, MISSION, (1.0, wish, NAN, NAN))).action is action
        )
    assert refused(item(dialect.MAV_CMD_DO_GRIPPER, MISSION, (1.0, 2.0, NAN, NAN))).result == 7


def test_an_item_that_a_mission_relies_on_is_refused_by_its_name() -> None:
    wrong = refused(item(208, MISSION, (2.0, 0.0, NAN, NAN)))
    assert (wrong.result, wrong.reason) == (3, "DO_PARACHUTE: this vehicle has no parachute")
    wrong = refused(item(82, MISSION, (0.0, 0.0, NAN, NAN)))
    assert wrong.reason.startswith("NAV_SPLINE_WAYPOINT: it is not one of")
    wrong = refused(item(9999, MISSION, (0.0, 0.0, NAN, NAN)))
    assert wrong.reason.startswith("command 9999: it is not one of")


def test_a_rally_point_is_a_place_and_nothing_else() -> None:
    rally = item(dialect.MAV_CMD_NAV_RALLY_POINT, 3, place=(470_001_000, 80_000_000, 5.0))
    assert read_rally(rally, locate) == pytest.approx((11.1, 0.0), abs=0.01)
    with pytest.raises(BadItem) as wrong:
        read_rally(item(dialect.MAV_CMD_NAV_WAYPOINT), locate)
    assert wrong.value.result == 3


@pytest.mark.parametrize("degrees", [math.inf, -math.inf, 721.0, 1e30])
def test_a_heading_that_is_none_is_refused(degrees: float) -> None:
    wrong = refused(item(dialect.MAV_CMD_NAV_WAYPOINT, params=(0.0, 0.0, 0.0, degrees)))
    assert (wrong.result, "heading" in wrong.reason) == (items.INVALID_PARAM1 + 3, True)
