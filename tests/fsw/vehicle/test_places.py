"""Places and heights in every frame that is supported."""

from __future__ import annotations

import math

import pytest

from fsw.geometry.geodesy import to_global
from fsw.signals import CommandRequest, Home, Mode, Origin, PointObstacle, SafeSet, Wall
from fsw.vehicle.commands import decide
from fsw.vehicle.modes import Event
from fsw.vehicle.places import Refused, height_of, place_of
from fsw.vehicle.situation import ACCEPTED, DENIED, TEMPORARILY_REJECTED, Decision, Goto, Situation

NAN = math.nan
ORIGIN = Origin(48.0, 11.0, 500.0)
HOME = Home((3.0, 4.0, -0.32), 0.0)
HERE = (1.0, 2.0, -5.0)
HOVERING = Situation(
    Mode.HOLD, landed=False, estimate_valid=True, targets_ahead=False, position=HERE,
    origin=ORIGIN, home=HOME,
)  # fmt: skip


def asked(
    x: float, y: float, z: float, frame: int | None, command: int = 192, *first: float
) -> CommandRequest:
    p = (*first, *(NAN,) * (4 - len(first)))
    return CommandRequest(command, (p[0], p[1], p[2], p[3], x, y, z), 255, 190, 0, frame)


@pytest.mark.parametrize(
    ("frame", "z"), [(None, 510.0), (0, 510.0), (5, 510.0), (3, 9.68), (6, 9.68), (1, -10.0)]
)
def test_a_height_is_the_same_in_every_frame(frame: int | None, z: float) -> None:
    assert height_of(asked(NAN, NAN, z, frame), ORIGIN, HOME) == pytest.approx(10.0)


@pytest.mark.parametrize("frame", [2, 4, 7, 8, 10, 11, 12, 99])
def test_a_frame_that_is_not_supported_is_refused_by_number(frame: int) -> None:
    refused = height_of(asked(0.0, 0.0, 1.0, frame), ORIGIN, HOME)
    assert isinstance(refused, Refused)
    assert str(frame) in refused.reason


@pytest.mark.parametrize("frame", [None, 0, 5])
def test_a_place_on_earth_is_where_the_projection_says(frame: int | None) -> None:
    latitude, longitude, altitude = to_global(ORIGIN, (20.0, -30.0, -7.0))
    place = place_of(asked(latitude, longitude, altitude, frame), ORIGIN, HOME, HERE)
    assert place == pytest.approx((20.0, -30.0, -7.0), abs=1e-6)


def test_what_is_left_open_stays_as_it_is() -> None:
    assert place_of(asked(NAN, NAN, NAN, 0), ORIGIN, HOME, HERE) == HERE
    assert place_of(asked(NAN, NAN, 508.0, 0), ORIGIN, HOME, HERE) == (1.0, 2.0, -8.0)
    assert place_of(asked(7.0, 8.0, NAN, 1), ORIGIN, HOME, HERE) == (7.0, 8.0, -5.0)


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
    assert isinstance(place_of(asked(x, y, z, frame), ORIGIN, HOME, HERE), Refused)
    decision = decide(asked(x, y, z, frame, 192, NAN, 1.0), HOVERING)
    assert decision.result == DENIED
    assert decision.reason


def test_a_goto_carries_its_place_speed_and_heading() -> None:
    decision = decide(asked(7.0, 8.0, -3.0, 1, 192, 0.5, 1.0, 0.0, 1.25), HOVERING)
    assert decision.result == ACCEPTED
    assert decision.goto == Goto((7.0, 8.0, -3.0), 1.25, 0.5)
    usual = decide(asked(7.0, 8.0, -3.0, 1, 192, -1.0, 1.0), HOVERING)
    assert usual.goto == Goto((7.0, 8.0, -3.0), None, None)


def test_a_goto_out_of_another_mode_must_ask_for_the_change() -> None:
    from dataclasses import replace

    offboard = replace(HOVERING, mode=Mode.OFFBOARD)
    assert decide(asked(7.0, 8.0, -3.0, 1), offboard).result == TEMPORARILY_REJECTED
    decision = decide(asked(7.0, 8.0, -3.0, 1, 192, NAN, 1.0), offboard)
    assert (decision.result, decision.event) == (ACCEPTED, Event.HOLD)
    on_ground = replace(HOVERING, landed=True)
    assert "ground" in decide(asked(7.0, 8.0, -3.0, 1), on_ground).reason


def test_a_goto_into_a_wall_or_the_ground_is_refused() -> None:
    from dataclasses import replace

    walled = replace(HOVERING, safe_set=SafeSet((Wall((-1.0, 0.0, 0.0), -10.0, 0.5),)))
    assert decide(asked(9.0, 0.0, -3.0, 1), walled).result == ACCEPTED
    for x, z, word in ((9.6, -3.0, "wall"), (30.0, -3.0, "wall"), (5.0, -0.2, "too low")):
        decision = decide(asked(x, 0.0, z, 1), walled)
        assert decision.result == DENIED
        assert word in decision.reason


def test_a_goto_too_close_to_a_point_is_refused() -> None:
    from dataclasses import replace

    branch = PointObstacle((9.0, 0.0, -3.0), 0.5)
    near = replace(HOVERING, safe_set=SafeSet(obstacles=(branch,)))
    assert decide(asked(9.0, 0.6, -3.0, 1), near).result == ACCEPTED
    decision = decide(asked(9.0, 0.4, -3.0, 1), near)
    assert decision.result == DENIED
    assert "obstacle 1" in decision.reason


def test_home_is_set_here_or_at_a_place() -> None:
    assert decide(asked(NAN, NAN, NAN, None, 179, 1.0), HOVERING) == Decision(
        ACCEPTED, home=Home(HERE, 0.0)
    )
    latitude, longitude, altitude = to_global(ORIGIN, (5.0, 6.0, -1.0))
    home = decide(asked(latitude, longitude, altitude, 5, 179, 0.0), HOVERING).home
    assert home is not None
    assert home.p == pytest.approx((5.0, 6.0, -1.0), abs=1e-6)
    assert decide(asked(NAN, NAN, 3.0, 5, 179, 0.0), HOVERING).result == DENIED


@pytest.mark.parametrize(
    ("values", "joints"),
    [
        ((0.5, -0.5), (math.pi / 6, -math.pi / 4)),
        ((NAN, 0.5), (0.0, math.pi / 4)),
        ((1.0, -1.0), (math.pi / 3, -math.pi / 2)),
    ],
)
def test_actuators_are_the_joints(values: tuple[float, float], joints: tuple[float, float]) -> None:
    request = CommandRequest(187, (*values, NAN, NAN, NAN, NAN, 0.0), 255, 190)
    assert decide(request, HOVERING).joints == pytest.approx(joints)


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
    decision = decide(CommandRequest(187, values, 255, 190), HOVERING)
    assert (decision.result, decision.joints) == (DENIED, None)
    assert decision.reason
