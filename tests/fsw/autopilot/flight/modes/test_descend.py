"""A descent needs neither plan nor position, and ends where the ground carries."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.flight.modes.descend import Descend, Descent, forget_wind
from fsw.autopilot.flight.plan_exchange import nominal_at_rest
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.state import Aiding, LostSensor
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import Mode, SafeSet, StateEstimate, Vec3
from fsw.autopilot.tick_record import Observed
from tests.fsw.autopilot.flight.in_flight import CONFIG, GROUND_Z, flying, vehicle_at

DESCENT, MODE = Descent(CONFIG), Descend(CONFIG)
HIGH: Vec3 = (1.0, 2.0, -5.0)
HERE = vehicle_at(HIGH)
AIDED = Aiding()
BLIND = Aiding(unaided_us=10**6, velocity_sigma=0.5, height_sigma=9.0)
ON_ROTORS = Aiding(
    pose=Sensor.GNSS, lost=(LostSensor(Sensor.IMU, SensorFault.STALE, 0),), height_sigma=9.0
)
LOST = BLIND._replace(velocity_sigma=1.1)
NOTHING = BLIND._replace(position_sigma=9.0, lost=ON_ROTORS.lost)
LIMITS = CONFIG.limits


def descended(
    seconds: float, aiding: Aiding, v: Vec3, estimate: StateEstimate, place: Vec3 | None = None
) -> Vec3:
    """The velocity of the plan's state after some seconds from ``v``."""
    nominal = nominal_at_rest(estimate)._replace(v=v)
    for _ in range(round(seconds / 0.002)):
        nominal, _ = DESCENT.step(nominal, estimate, aiding, 1, place)
    return nominal.v


@pytest.mark.requirement("REQ-MODE-9")
@pytest.mark.parametrize(
    ("aiding", "height", "times"),
    [
        (AIDED, 5.0, 1.0),
        (AIDED, 0.9, 1.0),
        (BLIND, 5.0, 4.0),
        (BLIND, 0.9, 2.0),
        (ON_ROTORS, 5.0, 4.0),
    ],
)
def test_it_brakes_across_and_sinks_at_the_speed_of_landing_and_faster_in_a_hurry(
    aiding: Aiding, height: float, times: float
) -> None:
    here = vehicle_at((1.0, 2.0, GROUND_Z - height))
    vx, vy, vz = descended(4.0, aiding, (0.5, -0.3, -0.2), here)
    assert math.hypot(vx, vy) < 0.01
    assert vz == pytest.approx(times * LIMITS.land_speed, abs=1e-3)


def test_it_waits_for_a_vehicle_that_is_held_up() -> None:
    """Flown: held up by a zone for 14 s, it hit the ground at 3.8 m/s once that was gone."""
    nominal = nominal_at_rest(HERE)
    for _ in range(5000):
        nominal, _ = DESCENT.step(nominal, HERE, AIDED, 1)
    assert 0.1 < nominal.p[2] - HIGH[2] < 0.3
    assert nominal.v[2] == pytest.approx(LIMITS.land_speed, abs=1e-3)


@pytest.mark.drawn(3)
@pytest.mark.parametrize(
    ("height", "sigma", "speed"),
    [
        (5.0, 0.03, 1.5),
        (1.6, 0.03, 1.5),
        (0.9, 0.03, 1.21),
        (0.5, 0.03, 0.72),
        (0.35, 0.03, 0.5),
        (5.0, 1.2, 1.5),
        (2.0, 0.5, 1.0),  # it may be 0.5 m
        (0.9, 0.3, 0.5),
        (5.0, math.nan, 1.0),
    ],
)
def test_where_its_height_is_known_a_blind_vehicle_sinks_as_fast_as_it_can_brake(
    height: float, sigma: float, speed: float
) -> None:
    here = vehicle_at((1.0, 2.0, GROUND_Z - height))
    vz = descended(4.0, BLIND._replace(height_sigma=sigma), (0.0, 0.0, 0.0), here)[2]
    assert vz == pytest.approx(speed, abs=0.01)


@pytest.mark.requirement("REQ-EST-5")
@pytest.mark.parametrize(
    ("aiding", "height", "speed"),
    [
        (NOTHING, 0.1, 0.5),
        (NOTHING, -0.1, 1.0),  # for a second at 1 m/s^2
        (BLIND, -0.1, 0.5),  # the accelerometer feels the ground
        (ON_ROTORS, -0.1, 0.5),  # satellites know the height, but for what lasts
        (NOTHING._replace(height_sigma=0.3), -0.1, 0.5),
    ],
)
def test_what_feels_nothing_sinks_ever_faster_from_where_the_ground_should_be(
    aiding: Aiding, height: float, speed: float
) -> None:
    """By the rotors' model alone it hung in the air at 0.5 m/s, and rose."""
    here = vehicle_at((1.0, 2.0, GROUND_Z - height))
    vz = descended(1.0, aiding, (0.0, 0.0, 0.0), here)[2]
    assert vz == pytest.approx(speed, abs=0.05)


@pytest.mark.requirement("REQ-EST-5")
@pytest.mark.parametrize(
    ("aiding", "height", "ends"),
    [
        (NOTHING, -0.9, False),
        (NOTHING, -1.1, True),
        (NOTHING._replace(gyro_lost=True), 0.05, False),
        (NOTHING._replace(gyro_lost=True), -0.05, True),  # what legs carry looks like a tilt
        (BLIND, -1.1, False),
    ],
)
def test_rotors_of_what_feels_nothing_stop_below_the_ground(
    aiding: Aiding, height: float, ends: bool
) -> None:
    state = replace(flying(Mode.DESCEND), aiding=aiding)
    _, result = MODE.update(state, vehicle_at((1.0, 2.0, GROUND_Z - height)))
    assert (result.next_mode is Mode.DISARMED) is ends


@pytest.mark.requirement("REQ-EST-5")
@pytest.mark.parametrize(
    ("aiding", "far", "speed"),
    [
        (BLIND, 2.0, 1.0),
        (BLIND, 0.2, 0.3),  # it comes to rest there
        (BLIND._replace(velocity_sigma=0.75), 2.0, 0.5),  # the less sure, the slower
        (BLIND._replace(velocity_sigma=0.999), 2.0, 0.0),
        (AIDED, 2.0, 0.0),  # the place is held
    ],
)
def test_a_blind_vehicle_draws_back_to_a_place_while_it_knows_its_speed(
    aiding: Aiding, far: float, speed: float
) -> None:
    place = (HIGH[0] + 0.6 * far, HIGH[1] - 0.8 * far, -1.0)
    vx, vy, _ = descended(4.0, aiding, (0.3, 0.3, 0.0), HERE, place)
    assert (vx, vy) == pytest.approx((0.6 * speed, -0.8 * speed), abs=0.01)


@pytest.mark.requirement("REQ-EST-5")
@pytest.mark.parametrize("sigma", [0.03, 0.6])  # it sinks at 1.5 m/s or at 0.5 m/s
@pytest.mark.parametrize("height", [0.4, 0.9, 1.4, 4.0])
def test_a_blind_vehicle_that_draws_back_is_at_rest_across_as_its_legs_touch(
    height: float, sigma: float
) -> None:
    """It drew back at 1.1 m/s as it touched down, and fell over."""
    aiding = BLIND._replace(height_sigma=sigma)
    nominal = nominal_at_rest(vehicle_at((0.0, 0.0, GROUND_Z - height)))._replace(v=(0.5, 0, 0.3))
    fastest = 0.0
    while nominal.p[2] < GROUND_Z:
        here = vehicle_at(nominal.p, nominal.v)
        nominal, _ = DESCENT.step(nominal, here, aiding, 1, (99.0, 0.0, 0.0))
        fastest = max(fastest, nominal.v[0])
    assert abs(nominal.v[0]) < 0.05
    assert fastest > 0.9 or height < 2.0, "it draws back while there is time"


def test_a_vehicle_that_does_not_know_its_speed_is_level_though_it_has_a_place() -> None:
    adrift = vehicle_at(HIGH, (0.2, 0.0, 0.0))
    level, _ = DESCENT.step(nominal_at_rest(HERE), adrift, LOST, 1, (9.0, 9.0, 0.0))
    assert (level.v[:2], level.a[:2]) == ((0.2, 0.0), (0.0, 0.0))


@pytest.mark.requirement("REQ-EST-5")
def test_what_is_observed_by_a_speed_that_is_not_known_is_no_wind() -> None:
    assert DESCENT.stays_level(LOST)
    assert not DESCENT.stays_level(BLIND), "it knows its speed"
    assert not DESCENT.stays_level(LOST._replace(unaided_us=0)), "its place is measured"
    observed = Observed()
    observed.d[:], observed.known[:] = (2.0, -3.0, 1.5), (0.5, 0.0, 0.0)
    observed.disturbance_bias[:] = 0.3, -0.4
    forget_wind(observed, vehicle_at(HIGH, (0.2, -0.1, 0.7)))
    assert observed.d.tolist() == [0.5, 0.0, 1.5], "the surface stays, and what is down"
    assert observed.v[:2].tolist() == [0.2, -0.1]
    assert not observed.disturbance_bias.any()


@pytest.mark.requirement("REQ-EST-5")
def test_the_place_is_off_zones_by_as_much_as_their_clearances_have_grown() -> None:
    near = wall((0.0, 1.0, 0.0), 0.0, 0.3)
    grown = wall((0.0, 1.0, 0.0), 0.0, 1.0)
    estimate = vehicle_at((0.0, 0.9, -3.0))
    state = replace(
        flying(Mode.DESCEND),
        aiding=BLIND,
        kept=InflatedSafeSet(SafeSet((near,)), SafeSet((grown,))),
    )
    state = MODE.aim(state, estimate)
    goal = state.setpoint.goal
    assert goal is not None
    assert goal.motion.p is not None
    x, y, _ = goal.motion.p
    assert x == 0.0
    assert 1.05 < y < 1.9, "the clearance, the body and what a plan at rest keeps"
    found = MODE.aim(replace(state, aiding=AIDED), estimate)
    assert found.setpoint.goal is None, "there is a position again"
    assert MODE.aim(replace(state, kept=InflatedSafeSet()), estimate).setpoint.goal is None


@pytest.mark.requirement("REQ-EST-5")
def test_a_place_that_is_measured_is_held_and_one_that_is_not_is_not() -> None:
    nominal = nominal_at_rest(HERE)
    adrift = vehicle_at((1.3, 1.9, -5.0), (0.2, 0.0, 0.0))
    held, _ = DESCENT.step(nominal, adrift, AIDED, 1)
    assert held.p[:2] == (1.0, 2.0)
    free, _ = DESCENT.step(nominal, adrift, BLIND, 1)
    assert free.p[:2] == (1.3, 1.9)
    assert free.v[:2] == (0.0, 0.0), "it brakes"
    level, u = DESCENT.step(nominal, adrift, LOST, 1)
    assert (level.v[:2], level.a[:2]) == ((0.2, 0.0), (0.0, 0.0)), "nothing pulls it"
    assert max(map(abs, u.a[:2])) < 5.0


def test_missed_ticks_are_made_up_for() -> None:
    nominal = nominal_at_rest(HERE)
    three, _ = DESCENT.step(nominal, HERE, AIDED, 3)
    for _ in range(3):
        nominal, _ = DESCENT.step(nominal, HERE, AIDED, 1)
    assert nominal.p == pytest.approx(three.p)


@pytest.mark.requirement("REQ-MODE-9")
def test_it_ends_where_the_ground_carries() -> None:
    state = flying(Mode.DESCEND, unloaded=(0, 0.0))
    here = vehicle_at((0.0, 0.0, GROUND_Z), t_us=LIMITS.landed_time_us)
    after, result = MODE.update(state, here)
    assert result.next_mode is Mode.DISARMED
    assert after.vehicle.landed
    after, result = MODE.update(state, here._replace(v_WB=(0.0, 0.0, 4.0)))
    assert result.next_mode is None, "it falls"
