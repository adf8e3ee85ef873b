"""How far parts of the base move with its tilt, against the base's tube and the geometry."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.control.gains import TrackingTuning
from fsw.autopilot.control.part_tube import LoopOfParts, PartReach, part_reaches, towards
from fsw.autopilot.control.tube import WIND_COVERED, impulse_responses, tube
from fsw.autopilot.model.airframe import AIRFRAME, GRAVITY
from fsw.autopilot.model.body import Body, body_of
from fsw.autopilot.model.kinematics import body_axes
from fsw.autopilot.model.parts import ON_BASE, Part
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import Vec3

DT, PUSH, HOLD = 0.002, 0.8, 0.1
TUNING = TrackingTuning()
LOOP = LoopOfParts(AIRFRAME, TUNING, PUSH, HOLD, DT)
FULL = body_of("full", AIRFRAME)


def alone(at: Vec3) -> tuple[PartReach, ...]:
    return part_reaches(LOOP, Body("full", (Part("one", ON_BASE, at, 0.0),)))


def test_the_reach_of_a_place_at_or_below_the_origin_is_the_tube_of_base_or_end_effector() -> None:
    loop = tube(AIRFRAME, TUNING, 0.225, HOLD, DT)
    level = towards(alone((0.0, 0.0, 0.0)), (0.6, -0.8, 0.0))
    assert level.worst == pytest.approx(PUSH * loop.base + loop.base_wind - loop.wind_beyond)
    assert level.expected == pytest.approx(PUSH * loop.base_expected)
    below = towards(alone((0.0, 0.0, 0.225)), (-1.0, 0.0, 0.0))
    assert below.worst == pytest.approx(PUSH * loop.end_effector + loop.end_effector_wind)
    assert below.expected == pytest.approx(PUSH * loop.end_effector_expected)


SHARE = 1e-4  # of a push: a small tilt, where turning is linear


def turned(a: float) -> Array:
    """The rotation of a vehicle that tilts for an acceleration ``a`` along x."""
    b1, b3, _, _ = body_axes((a, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    return np.stack((b1, np.cross(b3, b1), b3), axis=1)


@cache
def after_a_push(wind: bool) -> tuple[Array, Array]:
    """How far it is off along x in every tick after a small push, and how it is turned."""
    states = SHARE * impulse_responses(AIRFRAME, TUNING, DT, wind=wind)[:, [0, 2]]
    off = np.zeros((len(states), 3))
    off[:, 0] = states[:, 0]
    return off, np.array([turned(a) for a in states[:, 1]])


@pytest.mark.parametrize("at", [(0.3, 0.0, 0.2), (-0.2, 0.0, 0.3), (0.46, 0.0, 0.0)])
@pytest.mark.parametrize("angle_deg", [0.0, 22.5, 60.0, 90.0])
def test_a_part_moves_as_the_tilted_body_carries_it(at: Vec3, angle_deg: float) -> None:
    """By rotating the body; turned round, the part is on the other side."""
    angle = math.radians(angle_deg)
    normal = np.array((math.cos(angle), 0.0, -math.sin(angle)))

    def worst(place: Vec3, *, wind: bool) -> float:
        off, rotations = after_a_push(wind)
        moved = off + rotations @ place - place
        return float(np.abs(moved @ normal).sum()) / SHARE

    most = max(
        PUSH * worst(place, wind=False) + WIND_COVERED * worst(place, wind=True)
        for place in (at, (-at[0], 0.0, at[2]))
    )
    found = towards(alone(at), (normal[0], normal[1], normal[2]))
    assert found.worst == pytest.approx(most, rel=1e-3)


@given(st.floats(0.0, 0.5 * math.pi), st.floats(0.0, 2.0 * math.pi))
def test_between_two_angles_the_reach_is_bounded_and_hardly_more(
    angle: float, heading: float
) -> None:
    reaches = part_reaches(LOOP, FULL)
    level = math.cos(angle)
    normal = (level * math.cos(heading), level * math.sin(heading), math.sin(angle))
    found = towards(reaches, normal)
    place = angle / (0.5 * math.pi) * (len(reaches) - 1)
    ends = [
        reaches[math.floor(place)].worst,
        reaches[min(math.ceil(place), len(reaches) - 1)].worst,
    ]
    assert min(ends) <= found.worst <= 1.003 * max(ends)


def test_feet_and_rotors_move_further_than_the_base() -> None:
    reaches = part_reaches(LOOP, FULL)
    base = alone((0.0, 0.0, 0.0))
    assert all(one.worst > other.worst for one, other in zip(reaches, base, strict=True))
    assert {reach.name for reach in reaches} == {"leg4_end", "rotors"}
    tilt = (PUSH * tube(AIRFRAME, TUNING, 0.225, HOLD, DT).acceleration) / GRAVITY
    assert reaches[-1].worst == pytest.approx(0.465 * tilt, rel=0.1), "upwards the rim's own way"
