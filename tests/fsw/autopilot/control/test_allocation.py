"""The mixer against the rotors' geometry, written out here from the drawing of the vehicle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fsw.autopilot.control.allocation import allocate
from fsw.autopilot.model.actuator_health import HEALTHY, ActuatorHealth, commanded_for
from fsw.autopilot.model.actuator_health import given as given_by
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import Vec4

HOVER = 3.5 * 9.81
TOP = 2.0 * 3.5 * 9.81 / 4.0
YAW_LIMIT = 1.0

# Where each rotor sits (x forward, y right) and the sign of its drag about +z (down).
REAR, LEFT, FRONT, RIGHT = (-0.3, 0.0), (0.0, -0.3), (0.3, 0.0), (0.0, 0.3)
PLACES = np.array([REAR, LEFT, FRONT, RIGHT])
DRAG = 0.016 * np.array([1.0, -1.0, 1.0, -1.0])


def wrench(rotors: Vec4) -> Array:
    """Roll, pitch and yaw torque and total thrust of thrusts that act along -z."""
    f = np.array(rotors)
    force = np.zeros((4, 3))
    force[:, 2] = -f
    arm = np.column_stack((PLACES, np.zeros(4)))
    torque = np.cross(arm, force).sum(axis=0)
    return np.array([torque[0], torque[1], DRAG @ f, f.sum()])


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-0.06, 0.06), st.floats(15.0, 50.0))
def test_an_achievable_wish_is_met_exactly(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    rotors = allocate(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT)
    np.testing.assert_allclose(wrench(rotors), [roll, pitch, yaw, thrust], atol=1e-9)


wide = st.floats(-1e4, 1e4)


@given(wide, wide, wide, wide)
def test_no_rotor_leaves_its_limits_whatever_is_asked(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    for f in allocate(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT):
        assert -1e-9 <= f <= TOP + 1e-9


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0), st.floats(-100.0, 300.0))
def test_roll_and_pitch_are_kept_when_thrust_and_yaw_must_give_way(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    got = wrench(allocate(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT))
    np.testing.assert_allclose(got[:2], [roll, pitch], atol=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(10.0, 60.0))
def test_yaw_spends_no_more_than_it_may(yaw: float, thrust: float) -> None:
    assume(abs(yaw) > 0.07)
    got = wrench(allocate(AIRFRAME, (0.0, 0.0, yaw), thrust, YAW_LIMIT))
    assert abs(got[2]) <= 4.0 * 0.016 * YAW_LIMIT + 1e-9
    assert got[2] * yaw > 0.0
    assert got[3] == pytest.approx(thrust)


@pytest.mark.parametrize(
    ("torque", "stronger", "weaker"),
    [
        ((0.0, 1.0, 0.0), 2, 0),  # nose up: front over rear
        ((0.0, -1.0, 0.0), 0, 2),
        ((1.0, 0.0, 0.0), 1, 3),  # right side down: left over right
        ((-1.0, 0.0, 0.0), 3, 1),
        ((0.0, 0.0, 0.05), 0, 1),  # clockwise from above: rear and front over left and right
        ((0.0, 0.0, -0.05), 1, 0),
    ],
)
def test_sign_of_every_rotor(
    torque: tuple[float, float, float], stronger: int, weaker: int
) -> None:
    rotors = allocate(AIRFRAME, torque, HOVER, YAW_LIMIT)
    assert rotors[stronger] > HOVER / 4.0 > rotors[weaker]


def test_hover_is_shared_equally() -> None:
    hover = allocate(AIRFRAME, (0.0, 0.0, 0.0), HOVER, YAW_LIMIT)
    assert hover == pytest.approx((HOVER / 4.0,) * 4)


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0), st.floats(-20.0, 100.0))
def test_thrust_is_met_as_far_as_the_rotors_reach_whatever_yaw_asks(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    """A pair needs at least its own difference, and can give both rotors' most less that."""
    least = (abs(roll) + abs(pitch)) / 0.3
    got = wrench(allocate(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT))
    assert got[3] == pytest.approx(min(max(thrust, least), 4.0 * TOP - least), abs=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(0.0, 100.0))
def test_yaw_takes_the_whole_of_what_roll_pitch_and_thrust_leave(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    """No other split of the same thrust between the pairs is nearer to the yaw that is asked."""
    got = wrench(allocate(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT))
    wish = max(-YAW_LIMIT, min(YAW_LIMIT, yaw / (4.0 * 0.016)))
    half, own, other = got[3] / 2.0, abs(pitch) / 0.6, abs(roll) / 0.6
    lowest, highest = max(own, half - (TOP - other)), min(TOP - own, half - other)
    along = max(lowest, min(highest, 0.5 * half + wish))
    assert got[2] == pytest.approx(0.016 * 2.0 * (2.0 * along - half), abs=1e-9)


@given(
    st.integers(0, 3),
    st.floats(0.3, 0.9),
    st.floats(-0.5, 0.5),
    st.floats(-0.5, 0.5),
    st.floats(20, 34),
)
def test_a_weak_rotor_stays_below_what_it_can_and_roll_and_pitch_are_kept(
    rotor: int, share: float, roll: float, pitch: float, thrust: float
) -> None:
    effect = tuple(share if k == rotor else 1.0 for k in range(4))
    health = ActuatorHealth(effectiveness=effect)  # type: ignore[arg-type]
    rotors = allocate(AIRFRAME, (roll, pitch, 0.0), thrust, YAW_LIMIT, health)
    assert max(np.array(rotors) / np.array(effect)) <= TOP + 1e-9
    np.testing.assert_allclose(wrench(rotors)[:2], [roll, pitch], atol=1e-9)
    assert wrench(rotors)[3] == pytest.approx(thrust)


@pytest.mark.parametrize("rotor", range(4))
def test_a_rotor_that_does_not_obey_is_left_where_it_is_and_yaw_is_given_up(rotor: int) -> None:
    gives = 6.0
    fixed = tuple(gives if k == rotor else 0.0 for k in range(4))
    most = tuple(gives if k == rotor else math.inf for k in range(4))
    health = ActuatorHealth(least=fixed, most=most)  # type: ignore[arg-type]
    rotors = allocate(AIRFRAME, (0.4, -0.5, 0.0), HOVER, YAW_LIMIT, health)
    assert rotors[rotor] == pytest.approx(gives)
    got = wrench(rotors)
    np.testing.assert_allclose([got[0], got[1], got[3]], [0.4, -0.5, HOVER], atol=1e-9)
    assert abs(got[2]) > 0.01


def test_of_sound_rotors_nothing_changes_to_the_last_bit() -> None:
    random = np.random.default_rng(5)
    for roll, pitch, yaw, thrust in random.uniform(-3.0, 40.0, (200, 4)):
        torque = (float(roll), float(pitch), float(yaw))
        sound = allocate(AIRFRAME, torque, float(thrust), YAW_LIMIT)
        assert commanded_for(HEALTHY, sound) == sound
        assert given_by(HEALTHY, sound) == sound
