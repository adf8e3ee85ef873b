"""On the ground, in the air, or neither; and whether a landing has reached the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.estimation.faults.sensor_fault import Health, SensorFault
from fsw.autopilot.estimation.fusion_memory import at_start
from fsw.autopilot.flight.land_detector import (
    feel_ground,
    height_above_ground,
    is_aloft,
    longest_range,
    may_be_low,
    standing_unclear,
    stands,
    with_range,
)
from fsw.autopilot.flight.state import AIDED, Aiding, Damage, LostSensor, first_state
from fsw.autopilot.measurements import RangeSample, Sensor
from fsw.autopilot.signals import ActuatorReport, Mode, Vec3
from tests.fsw.autopilot.flight.in_flight import GROUND_Z, flying, limits, vehicle_at
from tests.fsw.records import changed, with_record

CONFIG = limits(landed_height=0.1, airborne_height=0.3, landed_speed=0.05, landed_time_us=500_000)
STILL: Vec3 = (0.0, 0.0, 0.0)
NO_IMU = (LostSensor(Sensor.IMU, SensorFault.STALE, 0),)


def at(height: float, v: Vec3 = STILL) -> tuple[bool, bool, bool]:
    estimate = vehicle_at((5.0, -7.0, GROUND_Z - height), v)
    assert height_above_ground(CONFIG, estimate) == pytest.approx(height)
    low = may_be_low(CONFIG, first_state(CONFIG.airframe), estimate)
    return low, stands(CONFIG, estimate), standing_unclear(CONFIG, estimate)


@pytest.mark.requirement("REQ-ARM-5")
@pytest.mark.parametrize(
    ("height", "low", "standing", "unclear"),
    [
        (-0.5, True, True, False),
        (0.0, True, True, False),
        (0.09, True, True, False),
        (0.11, False, False, True),
        (0.29, False, False, True),
        (0.31, False, False, False),
        (20.0, False, False, False),
    ],
)
def test_at_rest_the_height_decides(
    height: float, low: bool, standing: bool, unclear: bool
) -> None:
    assert at(height) == (low, standing, unclear)


@pytest.mark.requirement("REQ-ARM-5")
@given(st.tuples(*[st.floats(-0.2, 0.2)] * 3))
def test_low_and_moving_is_unclear_whatever_the_direction(v: Vec3) -> None:
    slow = v[0] ** 2 + v[1] ** 2 + v[2] ** 2 < 0.05**2
    assert at(0.0, v) == (True, slow, not slow)


def test_at_a_limit_itself_it_is_not_low_and_no_longer_unclear() -> None:
    coarse = limits(landed_height=0.25, airborne_height=0.5, landed_speed=0.5)
    coarse = replace(coarse, airframe=replace(coarse.airframe, leg_length=0.5))
    assert not may_be_low(coarse, first_state(CONFIG.airframe), vehicle_at((0.0, 0.0, -0.75)))
    assert not standing_unclear(coarse, vehicle_at((0.0, 0.0, -1.0)))
    assert not stands(coarse, vehicle_at((0.0, 0.0, -0.5), (0.0, 0.5, 0.0)))


# ---------------------------------------------------------------- touch-down

TICK_US, BLIND = 2_000, Aiding(unaided_us=10**7, height_sigma=9.0)
WEIGHT = CONFIG.airframe.mass * 9.81


def seen(distance: float, age_s: float = 0.05) -> RangeSample:
    return RangeSample(2.0 - age_s, distance + CONFIG.airframe.leg_length, 0.01**2)


def kept(sample: RangeSample | None) -> tuple[RangeSample, ...]:
    """What is kept of the rangefinder after a sample, if there was one."""
    return () if sample is None else (sample,)


@pytest.mark.parametrize(
    ("height", "sigma", "sample", "low"),
    [
        (0.4, 0.0, None, False),
        (0.4, 0.11, None, True),  # as far as it knows
        (0.4, 0.09, None, False),
        (0.4, 0.0, seen(0.0), True),  # the rangefinder knows better
        (0.0, 0.0, seen(0.2), False),
        (0.0, 0.5, seen(0.2), False),
        (0.0, 0.0, seen(0.12), True),
        (0.4, 0.0, seen(0.0, age_s=0.4), False),  # it did
        (0.0, 0.0, seen(5.0, age_s=-1.0), True),
    ],
)
def test_the_rangefinder_says_whether_the_ground_is_near_else_the_estimate(
    height: float, sigma: float, sample: RangeSample | None, low: bool
) -> None:
    state = replace(flying(Mode.LAND, ranges=kept(sample)), aiding=Aiding(height_sigma=sigma))
    estimate = vehicle_at((0.0, 0.0, GROUND_Z - height), t_us=2_000_000)
    assert may_be_low(CONFIG, state, estimate) is low


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("height", "sigma", "sample", "landed"),
    [
        (0.05, 0.02, None, True),
        (0.15, 0.02, None, False),
        (0.05, 0.2, None, False),  # nobody knows how high it is
        (0.15, 0.02, seen(0.15), False),
        (0.3, 0.1, seen(0.05), True),
        (0.5, 0.1, seen(0.05), False),  # one of them is wrong
        (0.05, 0.02, seen(0.2), False),
    ],
)
def test_on_readings_in_doubt_rotors_stop_close_above_the_ground(
    height: float, sigma: float, sample: RangeSample | None, landed: bool
) -> None:
    """The force of the ground was taken for a climb: for 5 s the vehicle hopped, or it fell over.

    Sound readings carry it down to the ground, but where a rotor does not obey: what the legs felt
    was taken for its thrust, and the others ran on until the battery was empty.
    """
    state = flying(Mode.DESCEND, ranges=kept(sample))
    carries = changed(state.record, rotors=(0.25 * WEIGHT,) * 4)
    estimate = vehicle_at((0.0, 0.0, GROUND_Z - height), t_us=2_000_000)
    for aiding in (Aiding(), Aiding(lost=NO_IMU), Aiding(disputed_us=1)):
        in_doubt = replace(state, record=carries, aiding=aiding._replace(height_sigma=sigma))
        found = feel_ground(CONFIG, in_doubt, estimate)
        # What is estimated by sensors that contradict each other may be wrong as well.
        known = aiding.lost or (aiding.disputed_us and sample)
        assert found[1] is (landed and bool(known))
    disobeys = Damage(report=ActuatorReport(rotor=3, disobeys=True))
    aiding = Aiding(height_sigma=sigma)
    in_doubt = replace(state, record=carries, aiding=aiding, damage=disobeys)
    assert feel_ground(CONFIG, in_doubt, estimate)[1] is landed


@pytest.mark.parametrize(
    ("height", "sigma", "sample", "disputed_us", "aloft"),
    [
        (0.11, 0.0, None, 0, True),
        (0.09, 0.0, None, 0, False),
        (0.4, 0.11, None, 0, False),  # as far as it knows: in dead reckoning it may have landed
        (0.4, 0.09, None, 0, True),
        (0.0, 0.5, seen(0.2), 0, True),  # the rangefinder knows better
        (2.0, 0.7, seen(0.05), 0, False),
        (2.0, 0.0, seen(0.05), 20_000, False),  # the estimate may be what is wrong
        (2.0, 0.0, seen(0.05), 0, True),  # nobody says so: noise of it blinded the law
        (2.0, 0.0, seen(0.05, age_s=0.6), 20_000, True),
    ],
)
def test_legs_that_may_touch_the_ground_are_not_aloft(
    height: float, sigma: float, sample: RangeSample | None, disputed_us: int, aloft: bool
) -> None:
    estimate = vehicle_at((0.0, 0.0, GROUND_Z - height), t_us=2_000_000)
    state = flying(ranges=kept(sample))
    state = replace(state, aiding=Aiding(height_sigma=sigma, disputed_us=disputed_us))
    state = with_record(state, state_estimate=estimate)
    legs = CONFIG.airframe.leg_length
    assert is_aloft(state, 2.0, legs, oldest=0.5) is aloft
    assert not is_aloft(with_record(state, has_estimate=0), 2.0, legs, oldest=0.5)


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("fault", "close"),
    [(SensorFault.STUCK, True), (SensorFault.JUMP, True), (SensorFault.NOISY, False)],
)
def test_a_rangefinder_that_is_known_to_be_wrong_does_not_say_how_high_it_is(
    fault: SensorFault, close: bool
) -> None:
    """Stuck at 2 m it kept rotors running on the ground, without a gyro, until the vehicle fell."""
    health = Health(Sensor.RANGEFINDER).with_fault(fault, 1.99)
    fusion = replace(at_start(2), health=(health,))
    low = vehicle_at((0.0, 0.0, GROUND_Z - 0.05), t_us=2_000_000)
    state = replace(flying(Mode.DESCEND, ranges=(seen(2.0),)), fusion=fusion)
    state = replace(state, aiding=Aiding(height_sigma=0.04, lost=NO_IMU))
    assert feel_ground(CONFIG, state, low)[1] is close
    stuck = fault is SensorFault.STUCK
    assert may_be_low(CONFIG, state, low) is stuck
    legs = CONFIG.airframe.leg_length
    assert is_aloft(with_record(state, state_estimate=low), 2.0, legs, oldest=0.5) is not stuck


@pytest.mark.requirement("REQ-EST-13")
def test_without_an_inertial_unit_rotors_stop_by_the_last_two_distances() -> None:
    """By the longest of 0.1 s they stopped so late that the legs carried, and the vehicle fell."""
    state = flying(Mode.DESCEND)
    for k, height in enumerate((0.15, 0.14, 0.09, 0.08)):
        sample = replace(seen(height), time=1.92 + 0.02 * k)
        state = replace(state, vehicle=with_range(state.vehicle, sample))
    longest = longest_range(state.vehicle)
    assert longest is not None
    assert longest.distance == seen(0.15).distance
    low = vehicle_at((0.0, 0.0, GROUND_Z - 0.08), t_us=2_000_000)
    state = replace(state, aiding=Aiding(height_sigma=2.0, lost=NO_IMU))
    assert feel_ground(CONFIG, state, low)[1]


def test_distances_that_are_noise_do_not_say_that_the_ground_is_near() -> None:
    """At 50 a second and 1.2 m above the ground, with a deviation of a metre, two often did."""
    vehicle, random, short = flying().vehicle, np.random.default_rng(1), 0
    for k in range(500):
        distance = float(1.2 + random.standard_normal())
        vehicle = with_range(vehicle, RangeSample(0.02 * k, distance, 0.01**2))
        longest = longest_range(vehicle)
        assert longest is not None
        short += longest.distance < 0.42
    assert short <= 2
    assert len(vehicle.ranges) <= 6


def test_a_distance_that_is_too_short_counts_once_a_second_one_says_so() -> None:
    vehicle, distances = flying(Mode.LAND).vehicle, (1.0, 0.1, 0.9, 0.2, 0.2, 0.8)
    used = []
    for k, distance in enumerate(distances):
        vehicle = with_range(vehicle, RangeSample(0.1 * k, distance, 0.01**2))
        longest = longest_range(vehicle)
        assert longest is not None
        used.append((longest.time, longest.distance))
    times = [0.1 * k for k in range(6)]
    assert used == list(zip(times, (1.0, 1.0, 0.9, 0.9, 0.2, 0.8), strict=True))
    vehicle = with_range(vehicle, RangeSample(2.0, 0.1, 0.01**2))
    assert longest_range(vehicle) == RangeSample(2.0, 0.1, 0.01**2), (
        "the last one is of another time"
    )


def landed_after(
    share: float,
    velocity: float = 0.0,
    fall: float = 0.0,
    height: float = 0.0,
    aiding: Aiding = AIDED,
) -> float | None:
    """Time [s] until the ground is felt, within 4 s.

    By rotors that give a ``share`` [1] of the weight until loops open. The estimate's ``velocity``
    [m/s] is a constant, and once loops are open it gains a ``fall`` [m/s^2].
    """
    state = replace(flying(Mode.LAND, moved_us=TICK_US), aiding=aiding)
    rotors = (0.25 * share * WEIGHT,) * 4
    v = velocity
    for k in range(1, 2000):
        open_ = state.vehicle.unloaded is not None
        v = v + fall * 1e-6 * TICK_US if open_ else velocity
        state = replace(state, record=changed(state.record, rotors=() if open_ else rotors))
        here = vehicle_at((0.0, 0.0, GROUND_Z - height), (0.0, 0.0, v), k * TICK_US)
        state, landed = feel_ground(CONFIG, state, here)
        if landed:
            return 1e-6 * (k - 1) * TICK_US
    return None


@pytest.mark.requirement("REQ-MODE-9")
def test_the_ground_is_felt_when_rotors_do_not_carry_and_nothing_falls() -> None:
    assert landed_after(0.65) == pytest.approx(0.5, abs=0.003)
    assert landed_after(0.75) is None, "so light a vehicle flies"


@pytest.mark.long
@pytest.mark.requirement("REQ-MODE-9")
@given(
    wrong=st.floats(-3.0, 3.0),
    velocity=st.floats(-3.0, 3.0),
    height=st.floats(-1.0, 10.0),
    blind=st.booleans(),
    share=st.floats(0.0, 1.0),
)
def test_no_accelerometer_that_is_wrong_by_3_m_s2_stops_the_rotors_in_the_air(
    wrong: float, velocity: float, height: float, blind: bool, share: float
) -> None:
    aiding = BLIND if blind else AIDED
    assert landed_after(share, velocity, 9.81 + wrong, height, aiding) is None
    if share < 0.69:
        took = landed_after(share, velocity, wrong, height, aiding)
        assert took is not None, "and on the ground it stops them"
        assert took < 1.5


def test_where_height_or_velocity_speak_against_the_ground_it_takes_longer() -> None:
    for doubted in ({"height": 1.0}, {"velocity": 0.2}, {"height": 9.0, "velocity": 0.2}):
        assert landed_after(0.5, **doubted) == pytest.approx(1.4, abs=0.003)
    assert landed_after(0.5, height=9.0, velocity=0.2, aiding=BLIND) == pytest.approx(
        0.5, abs=0.003
    )


def test_a_vehicle_that_falls_flies_on_with_a_plan_from_where_it_is() -> None:
    estimate = vehicle_at((0.0, 0.0, GROUND_Z), (0.0, 0.0, 0.9), 2_000_000)
    state = flying(Mode.LAND, unloaded=(1_900_000, 0.0), moved_us=0)
    after, landed = feel_ground(CONFIG, state, estimate)
    assert not landed
    assert after.vehicle.unloaded is None
    assert after.vehicle.moved_us == estimate.t_us
    assert after.plan_state is not None
    assert after.plan_state.p == estimate.p_WB
    assert after.plan.running is None
