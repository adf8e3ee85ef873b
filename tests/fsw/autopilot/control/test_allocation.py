"""The mixer against the rotors' geometry, written out here from the drawing of the vehicle.

Further down against any geometry, where a linear program says what can be had.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import linprog

from fsw.autopilot.control.allocation import authority_left
from fsw.autopilot.model.actuator_health import ActuatorHealth, note_health
from fsw.autopilot.model.airframe import AIRFRAME, Airframe, airframe_of
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.tick_record import new_tick
from tests.fsw.records import allocated
from tests.vehicles.random_vehicles import random_vehicle
from vehicles.description import Rotor
from vehicles.vehicle_file import load_vehicle, vehicle_names

HOVER = 3.5 * 9.81
TOP = 2.0 * 3.5 * 9.81 / 4.0
YAW_LIMIT = 1.0

# Where each rotor sits (x forward, y right) and the sign of its drag about +z (down).
REAR, LEFT, FRONT, RIGHT = (-0.3, 0.0), (0.0, -0.3), (0.3, 0.0), (0.0, 0.3)
PLACES = np.array([REAR, LEFT, FRONT, RIGHT])
DRAG = 0.016 * np.array([1.0, -1.0, 1.0, -1.0])


def wrench(rotors: tuple[float, ...]) -> Array:
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
    rotors = allocated(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT)
    np.testing.assert_allclose(wrench(rotors), [roll, pitch, yaw, thrust], atol=1e-9)


wide = st.floats(-1e4, 1e4)


@given(wide, wide, wide, wide)
def test_no_rotor_leaves_its_limits_whatever_is_asked(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    for f in allocated(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT):
        assert -1e-9 <= f <= TOP + 1e-9


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0), st.floats(-100.0, 300.0))
def test_roll_and_pitch_are_kept_when_thrust_and_yaw_must_give_way(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    got = wrench(allocated(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT))
    np.testing.assert_allclose(got[:2], [roll, pitch], atol=1e-9)


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-1.0, 1.0), st.floats(0.0, 100.0))
def test_of_roll_and_pitch_that_are_too_much_each_pair_gives_all_it_can(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    got = wrench(allocated(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT))
    np.testing.assert_allclose(got[:2], np.clip([roll, pitch], -0.3 * TOP, 0.3 * TOP), atol=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(10.0, 60.0))
def test_yaw_spends_no_more_than_it_may(yaw: float, thrust: float) -> None:
    assume(abs(yaw) > 0.07)
    got = wrench(allocated(AIRFRAME, (0.0, 0.0, yaw), thrust, YAW_LIMIT))
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
    rotors = allocated(AIRFRAME, torque, HOVER, YAW_LIMIT)
    assert rotors[stronger] > HOVER / 4.0 > rotors[weaker]


def test_hover_is_shared_equally() -> None:
    hover = allocated(AIRFRAME, (0.0, 0.0, 0.0), HOVER, YAW_LIMIT)
    assert hover == pytest.approx((HOVER / 4.0,) * 4)


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0), st.floats(-20.0, 100.0))
def test_thrust_is_met_as_far_as_the_rotors_reach_whatever_yaw_asks(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    """A pair needs at least its own difference, and can give both rotors' most less that."""
    least = (abs(roll) + abs(pitch)) / 0.3
    got = wrench(allocated(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT))
    assert got[3] == pytest.approx(min(max(thrust, least), 4.0 * TOP - least), abs=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(0.0, 100.0))
def test_yaw_takes_the_whole_of_what_roll_pitch_and_thrust_leave(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    """No other split of the same thrust between the pairs is nearer to the yaw that is asked."""
    got = wrench(allocated(AIRFRAME, (roll, pitch, yaw), thrust, YAW_LIMIT))
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
    rotors = allocated(AIRFRAME, (roll, pitch, 0.0), thrust, YAW_LIMIT, health)
    assert max(np.array(rotors) / np.array(effect)) <= TOP + 1e-9
    np.testing.assert_allclose(wrench(rotors)[:2], [roll, pitch], atol=1e-9)
    assert wrench(rotors)[3] == pytest.approx(thrust)


@pytest.mark.parametrize("rotor", range(4))
def test_a_rotor_that_does_not_obey_is_left_where_it_is_and_yaw_is_given_up(rotor: int) -> None:
    gives = 6.0
    fixed = tuple(gives if k == rotor else 0.0 for k in range(4))
    most = tuple(gives if k == rotor else math.inf for k in range(4))
    health = ActuatorHealth(least=fixed, most=most)  # type: ignore[arg-type]
    rotors = allocated(AIRFRAME, (0.4, -0.5, 0.0), HOVER, YAW_LIMIT, health)
    assert rotors[rotor] == pytest.approx(gives)
    got = wrench(rotors)
    np.testing.assert_allclose([got[0], got[1], got[3]], [0.4, -0.5, HOVER], atol=1e-9)
    assert abs(got[2]) > 0.01


@pytest.mark.parametrize("rotor", range(4))
def test_what_is_left_of_a_torque_is_what_rotors_can_give_about_hover(rotor: int) -> None:
    def left(effect: float = 1.0, least: float = 0.0, most: float = math.inf) -> float:
        before, r = (1.0,) * rotor, new_tick(3.5, 4, 2)
        noughts, free = (0.0,) * rotor, (math.inf,) * rotor
        known = ActuatorHealth((*before, effect), (*noughts, least), (*free, most))
        note_health(r.health, known)
        return authority_left(r, AIRFRAME)

    assert left() == 1.0
    assert left(least=6.0, most=6.0) == pytest.approx(0.5)  # two rotors turn it about each axis
    assert left(most=0.0) == pytest.approx(0.5)
    shares = [left(effect=share) for share in (0.5, 0.6, 0.75, 0.9)]
    assert shares == pytest.approx([0.5, 0.6, 0.75, 0.9])


@pytest.mark.parametrize("name", vehicle_names())
def test_a_sound_vehicle_has_all_its_torque_whatever_its_rotors(name: str) -> None:
    assert authority_left(new_tick(3.5, 4, 2), airframe_of(load_vehicle(name))) == 1.0


def ring(random: np.random.Generator, rotors: int, tilt: float) -> tuple[Rotor, ...]:
    return random_vehicle(random, 2, rotors, tilt).rotors


def any_airframe(random: np.random.Generator, rotors: int, tilt: float) -> Airframe:
    return airframe_of(replace(load_vehicle("paper"), rotors=ring(random, rotors, tilt)))


@pytest.mark.drawn(4)
@pytest.mark.parametrize("failed", [False, True], ids=["sound", "one fails"])
@pytest.mark.parametrize("rotors", range(4, 9))
def test_of_any_layout_yaw_goes_first_then_thrust_and_roll_and_pitch_are_kept(
    rotors: int, failed: bool
) -> None:
    """What can be had on the pseudoinverse's line is had: of thrust all, of yaw what it leaves."""
    random = np.random.default_rng(10 * rotors + failed)
    for _ in range(40):
        airframe = any_airframe(random, rotors, float(random.uniform(0.0, 0.3)))
        top, n = airframe.weakest_thrust, rotors
        least, most = [0.0] * n, [math.inf] * n
        stuck = int(random.integers(n)) if failed else -1
        if failed:
            least[stuck] = most[stuck] = float(random.uniform(0.0, 0.5)) * top
        health = ActuatorHealth((1.0,) * n, tuple(least), tuple(most))
        effect = np.array(airframe.wrench).reshape(-1, 6)[:n, [3, 4, 2, 5]].T * [
            [1],
            [1],
            [-1],
            [1],
        ]
        free = [i for i in range(n) if i != stuck]
        inverse = np.linalg.pinv(effect[:, free], rcond=1e-4)
        rest = effect[:, [stuck]] @ [least[stuck]] if failed else np.zeros(4)
        hover = airframe.mass * 9.81
        wish = random.uniform([-2.0, -2.0, 0.2 * hover, -0.5], [2.0, 2.0, 1.8 * hover, 0.5])
        f = np.array(allocated(airframe, (*wish[:2], wish[3]), wish[2], 1e9, health))
        assert (f >= np.array(least) - 1e-9).all()
        assert (f <= np.minimum(top, most) + 1e-9).all()
        # f = c + a T + b y: the program asks for the nearest thrust, then for the nearest yaw.
        asked = wish - rest
        c = inverse[:, :2] @ asked[:2]
        if np.linalg.matrix_rank(effect[:, free], tol=1e-4) < 4:
            continue  # the test below
        lift = nearest(c, inverse[:, 2:], (0.0, top), asked[2:], 0)
        if lift is None:
            continue
        got = np.linalg.lstsq(inverse, f[free], rcond=None)[0]
        np.testing.assert_allclose(got[:2], asked[:2], atol=1e-7)
        assert got[2] == pytest.approx(lift, abs=1e-6)
        yaw = nearest(c + inverse[:, 2] * lift, inverse[:, 3:], (-1e-7, top + 1e-7), asked[3:], 0)
        assert got[3] == pytest.approx(yaw, abs=1e-5)


def nearest(
    c: Array, directions: Array, limits: tuple[float, float], wish: Array, which: int
) -> float | None:
    """The entry nearest to its wish of all x with ``c + directions x`` within limits."""
    count = directions.shape[1]
    # Unknown: x and the distance of the one from its wish.
    cost = np.append(np.zeros(count), 1.0)
    rows = np.column_stack((directions, np.zeros(len(c))))
    off = np.zeros((2, count + 1))
    off[:, which], off[:, -1] = (1.0, -1.0), -1.0
    found = linprog(
        cost,
        np.vstack((rows, -rows, off)),
        np.concatenate((limits[1] - c, c - limits[0], (wish[which], -wish[which]))),
        bounds=[(None, None)] * (count + 1),
    )
    return float(found.x[which]) if found.success else None


@pytest.mark.drawn(1)
@pytest.mark.parametrize("rotors", range(4, 9))
def test_of_any_layout_roll_and_pitch_that_are_too_much_are_cut_by_no_more_than_they_must(
    rotors: int,
) -> None:
    """Each to what can be had without the other, then both by one share."""
    random = np.random.default_rng(rotors)
    for _ in range(40):
        airframe = any_airframe(random, rotors, float(random.uniform(0.0, 0.3)))
        shares = np.array(airframe.share).reshape(-1, 4)[:rotors]
        top, hover = airframe.weakest_thrust, airframe.mass * 9.81
        wish = random.uniform([-40.0, -40.0], [40.0, 40.0])
        f = np.array(allocated(airframe, (*wish, float(random.uniform(-0.5, 0.5))), hover, 1e9))
        axes = [[wish[0], 0.0], [0.0, wish[1]]]
        alone = np.array([largest_share(shares, axis, top) for axis in axes]) * wish
        expected = largest_share(shares, alone, top) * alone
        got = np.linalg.lstsq(shares, f, rcond=None)[0]
        np.testing.assert_allclose(got[:2], expected, atol=1e-6)


def largest_share(shares: Array, turn: Array | list[float], top: float) -> float:
    """Of a roll and pitch, with any thrust and yaw, that no rotor's limits forbid."""
    columns = np.column_stack((shares[:, :2] @ np.array(turn), shares[:, 2:]))
    found = linprog(
        [-1.0, 0.0, 0.0],
        np.vstack((columns, -columns)),
        np.concatenate((np.full(len(columns), top), np.zeros(len(columns)))),
        bounds=[(0.0, 1.0), (None, None), (None, None)],
    )
    return float(found.x[0])


@pytest.mark.parametrize("rotors", [4, 6, 8])
def test_a_level_ring_hovers_without_any_of_its_rotors(rotors: int) -> None:
    """Roll, pitch and thrust are as asked, of a quadrotor's as far as three rotors can."""
    random = np.random.default_rng(rotors)
    for lost in range(rotors):
        airframe = any_airframe(random, rotors, 0.0)
        none = tuple(0.0 if k == lost else math.inf for k in range(rotors))
        health = ActuatorHealth((1.0,) * rotors, (0.0,) * rotors, none)
        hover = 0.25 * rotors * airframe.weakest_thrust
        w = np.array(airframe.wrench).reshape(-1, 6)[:rotors]
        # Turned towards the lost rotor: it is the one opposite that must do it.
        roll, pitch = -0.2 * w[lost, 3:5] / np.linalg.norm(w[lost, 3:5])
        f = np.array(allocated(airframe, (float(roll), float(pitch), 0.0), hover, 1.0, health))
        assert f[lost] == 0.0
        np.testing.assert_allclose(w[:, 3].T @ f, roll, atol=1e-9)
        np.testing.assert_allclose(w[:, 4].T @ f, pitch, atol=1e-9)
        np.testing.assert_allclose(-w[:, 2].T @ f, hover, atol=1e-9)


def test_what_balances_a_surface_takes_nothing_from_what_yaw_may_spend() -> None:
    balanced = -0.12
    for asked in (-1.0, 0.0, 1.0):
        alone = wrench(allocated(AIRFRAME, (0.0, 0.0, asked), 33.0, YAW_LIMIT))
        beside = wrench(
            allocated(AIRFRAME, (0.0, 0.0, asked + balanced), 33.0, YAW_LIMIT, known=balanced)
        )
        assert beside[2] - alone[2] == pytest.approx(balanced)
