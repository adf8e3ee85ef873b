"""Steps of a simulator with sensors: what it measures is what the flight software reads."""

from __future__ import annotations

import math
import socket
from collections.abc import Iterator

import numpy as np
import pytest

from fsw.autopilot.measurements import (
    GnssSample,
    ImuSample,
    JointSample,
    MagneticSample,
    PoseSample,
    PressureSample,
    RangeSample,
    Sample,
)
from fsw.autopilot.signals import Origin, SensorFrame
from fsw.link.inbox import Inbox
from fsw.link.sim_link import SimLink
from fsw.link.vehicle_link import Pacing
from fsw.link.wire.decode_sensors import SampleDecoder
from fsw.runtime.clock import now_us
from messages import message_ids as ids
from messages.frames import FrameWriter, split
from sitl import earth
from sitl.link.encode import StepEncoder
from sitl.link.pilot_messages import SendCommand
from sitl.sensors.barometer import PressureMeasurement, standard_pressure
from sitl.sensors.channel import Measurement
from sitl.sensors.encoders import JointMeasurement
from sitl.sensors.gnss import GnssMeasurement, GnssSensor
from sitl.sensors.imu import ImuMeasurement
from sitl.sensors.keys import Gnss
from sitl.sensors.magnetometer import MagneticMeasurement
from sitl.sensors.motion_capture import PoseMeasurement
from sitl.sensors.rangefinder import RangeMeasurement
from tests.fsw.link.snapshots import FACTS, outputs_at
from tests.sitl.sensors.readings import HOVER, reading

NOW = 1_200_000
HIGH = earth.Place(47.397742, 8.545594, 488.0)
IMU = ImuMeasurement(NOW, (0.1, -0.2, 0.3), (0.5, -0.4, -9.7))
JOINTS = JointMeasurement(NOW - 2000, (-0.7, 1.4))
POSE = PoseMeasurement(
    NOW - 16_000,
    (1.0, -2.0, -1.2),
    (0.5, 0.5, -0.5, 0.5),
    (0.0005**2,) * 3,
    (1e-5, 2e-5, 3e-5),
    3,
    False,
)


def decoded(one: Measurement, origin: earth.Place = earth.DEFAULT_ORIGIN) -> list[Sample]:
    """What the flight software makes of one measurement's frame, the barrier's left out."""
    encoder = StepEncoder(lockstep=True, measured=True, origin=origin)
    first, *barrier = split(encoder.measured_datagrams(NOW, (one,), ())[1])
    assert [frame.message_id for frame in barrier] == [ids.HIL_SENSOR]
    inbox = Inbox(Origin(*origin))
    return SampleDecoder(inbox.locate, 2).samples([first])


def close(values: tuple[float, ...], size: float = 1e-6) -> object:
    """The values in single precision."""
    return pytest.approx(values, rel=size, abs=1e-9)


def test_a_pose_has_the_time_of_its_measurement_its_variance_and_its_resets() -> None:
    (sample,) = decoded(POSE)
    assert isinstance(sample, PoseSample)
    assert sample.time == pytest.approx(1.184)
    assert sample.position == close((1.0, -2.0, -1.2))
    assert sample.attitude == (0.5, 0.5, -0.5, 0.5)
    assert sample.position_variance == close((0.0005**2,) * 3)
    assert sample.attitude_variance == close((1e-5, 2e-5, 3e-5))
    assert sample.reset_counter == 3
    assert not sample.drifts
    (sample,) = decoded(POSE._replace(from_cameras_on_board=True))
    assert isinstance(sample, PoseSample)
    assert sample.drifts


def test_odometry_says_where_it_comes_from_and_that_it_knows_no_velocity() -> None:
    for one, kind in ((POSE, 6), (POSE._replace(from_cameras_on_board=True), 3)):
        encoder = StepEncoder(lockstep=True, measured=True)
        odometry, _ = split(encoder.measured_datagrams(NOW, (one,), ())[1])
        values = odometry.payload_values
        assert all(math.isnan(float(value)) for value in values[8:14])
        assert math.isnan(float(values[35]))  # the velocity's covariance
        assert values[59] == kind


def test_satellites_arrive_within_the_digits_of_the_message() -> None:
    said = GnssMeasurement(
        NOW - 110_000, (120.0, -80.0, -7.5), (1.234, -0.5, 0.02), 0.0085, 0.015, True
    )
    (sample,) = decoded(said, HIGH)
    assert isinstance(sample, GnssSample)
    assert sample.time == pytest.approx(1.09)
    # 1e-7 deg of latitude are 11 mm, of altitude 1 mm are told.
    assert np.abs(np.subtract(sample.position, said.p_WB)).max() <= 0.006
    assert sample.position[2] == pytest.approx(-7.5, abs=6e-4)
    assert sample.velocity == pytest.approx(said.v_WB, abs=0.0051)
    # Whole centimetres, and never better than it is.
    assert sample.position_variance == pytest.approx((1e-4, 1e-4, 4e-4))


@pytest.mark.parametrize(("fix", "known"), [(0, False), (2, False), (3, True), (6, True)])
def test_a_receiver_says_whether_it_has_a_fix_and_how_many_satellites_it_sees(
    fix: int, known: bool
) -> None:
    values = (NOW, 473977420, 85455940, 0, 100, 100, 0, 0, 0, 0, 0, fix, 9, 0, 0)
    (frame,) = split(FrameWriter(1, 200).frame(ids.HIL_GPS, *values))
    (sample,) = SampleDecoder(Inbox().locate, 2).samples([frame])
    assert isinstance(sample, GnssSample)
    assert (sample.fix_type, sample.satellites, sample.has_fix) == (fix, 9, known)


@pytest.mark.parametrize(("rtk", "fix"), [(True, 6), (False, 3)])
def test_what_a_receiver_rounds_the_message_does_not_round_again(rtk: bool, fix: int) -> None:
    """So a flight in process has the digits of one over the link."""
    keys = Gnss(rate_hz=10.0, horizontal_m=0.2, vertical_m=0.3, velocity_m_s=0.3, rtk=rtk)
    sensor = GnssSensor(keys, np.random.default_rng(3), HIGH.latitude)
    for _ in range(100):
        said = sensor.measure(reading(), HOVER, NOW - 110_000, False)
        (sample,) = decoded(said, HIGH)
        assert isinstance(sample, GnssSample)
        np.testing.assert_allclose(sample.position, said.p_WB, atol=2e-5)
        np.testing.assert_allclose(sample.velocity, said.v_WB, atol=1e-9)
        assert (sample.fix_type, sample.satellites) == (said.fix_type, said.satellites)
        assert sample.fix_type == fix


def test_pressure_arrives_as_a_height_above_the_origin() -> None:
    said = PressureMeasurement(NOW - 10_000, standard_pressure(488.0 + 3.0))
    (sample,) = decoded(said, HIGH)
    assert isinstance(sample, PressureSample)
    assert sample.time == pytest.approx(1.19)
    assert sample.altitude == pytest.approx(3.0, abs=0.01)
    assert sample.variance == 0.0, "not stated: the parameter of the filter counts"


def test_field_distance_and_joints_arrive() -> None:
    (field,) = decoded(MagneticMeasurement(NOW - 4000, (0.21, -0.01, 0.43)))
    assert isinstance(field, MagneticSample)
    assert (field.time, field.field) == (pytest.approx(1.196), close((0.21, -0.01, 0.43)))
    (distance,) = decoded(RangeMeasurement(NOW - 20_000, 1.23, 0.0006, 0.05, 40.0))
    assert distance == RangeSample(pytest.approx(1.18), pytest.approx(1.23), pytest.approx(0.0006))
    (joints,) = decoded(JOINTS)
    assert isinstance(joints, JointSample)
    assert (joints.time, joints.angles) == (pytest.approx(1.198), close((-0.7, 1.4)))


def test_an_inertial_unit_that_is_late_arrives_with_its_own_time() -> None:
    (sample,) = decoded(IMU._replace(t_us=NOW - 2000))
    assert sample == ImuSample(pytest.approx(1.198), close(IMU.accel_B), close(IMU.gyro_B))


def test_a_distance_that_looks_ahead_is_no_height() -> None:
    writer = FrameWriter(1, 200)
    for orientation, count in ((25, 1), (0, 0)):
        values = (1200, 5, 4000, 123, 0, 0, orientation, 6, 0.0, 0.0, *(0.0,) * 4, 0)
        (frame,) = split(writer.frame(ids.DISTANCE_SENSOR, *values))
        assert len(SampleDecoder(Inbox().locate, 2).samples([frame])) == count


def test_odometry_in_another_frame_is_no_sample() -> None:
    encoder = StepEncoder(lockstep=True, measured=True)
    odometry, _ = split(encoder.measured_datagrams(NOW, (POSE,), ())[1])
    values = list(odometry.payload_values)
    values[56] = 20  # MAV_FRAME_LOCAL_FRD
    moved = odometry._replace(payload_values=tuple(values))
    assert SampleDecoder(Inbox().locate, 2).samples([moved]) == []


class Wire:
    """A simulator's socket and the link under test."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.5)
        self.inbox = Inbox()
        self.link = SimLink(self.socket.getsockname(), self.inbox, FACTS, now_us)
        self.link.announce()
        self.socket.connect(self.socket.recvfrom(2048)[1])
        self.encoder = StepEncoder(lockstep=True, measured=True)
        self.socket.send(self.encoder.heartbeat() + self.datagram(NOW - 2000, ()))
        assert self.link.wait_for_step() is not None
        self.inbox.take()

    def datagram(self, t_us: int, measurements: tuple[Measurement, ...]) -> bytes:
        return self.encoder.measured_datagrams(t_us, measurements, ())[1]

    def step(self, t_us: int, *measurements: Measurement) -> SensorFrame | None:
        self.socket.send(self.datagram(t_us, measurements))
        return self.link.wait_for_step()


@pytest.fixture
def wire() -> Iterator[Wire]:
    made = Wire()
    yield made
    made.link.close()
    made.socket.close()


def test_the_heartbeat_says_that_sensors_measure_and_in_which_pace(wire: Wire) -> None:
    assert wire.link.measured
    assert wire.link.pacing is Pacing.LOCKSTEP
    for lockstep in (False, True):
        (frame,) = split(StepEncoder(lockstep=lockstep, measured=True).heartbeat())
        assert frame.payload_values[0] == 2 + lockstep


def test_samples_come_in_their_order_and_the_state_is_not_told(wire: Wire) -> None:
    got = wire.step(NOW, POSE, JOINTS, IMU)
    assert got is not None
    assert got.t_us == NOW
    assert got.gyro_B == close(IMU.gyro_B)  # for the vibration meter
    told = (*got.p_WB, *got.v_WB, *got.q_WB, *got.q_arm, *got.qd_arm)
    assert all(math.isnan(value) for value in told)
    assert [type(one) for one in wire.inbox.take().samples] == [PoseSample, JointSample, ImuSample]


def test_the_short_way_and_the_long_way_read_the_same(wire: Wire) -> None:
    wire.step(NOW, JOINTS, IMU)
    short = wire.inbox.take_inputs(SENSORS, None, None, None).samples
    later = IMU._replace(t_us=NOW + 2000)
    wire.step(NOW + 2000, POSE, JOINTS, later)
    _, joints, inertial = wire.inbox.take_inputs(SENSORS, None, None, None).samples
    assert isinstance(inertial, ImuSample)
    assert short == (joints, ImuSample(1e-6 * NOW, inertial.acceleration, inertial.rate))


SENSORS = SensorFrame(NOW, (0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3,
                      (0.0,) * 2, (0.0,) * 2)  # fmt: skip


def test_a_step_without_any_measurement_is_a_tick_all_the_same(wire: Wire) -> None:
    got = wire.step(NOW)
    assert got is not None
    assert got.t_us == NOW
    assert all(math.isnan(value) for value in (*got.gyro_B, *got.accel_B))
    assert wire.inbox.take().samples == []


def test_a_fields_of_a_compass_are_not_read_as_an_inertial_units(wire: Wire) -> None:
    """A barrier that another simulator fills with a magnetometer alone."""
    frame = wire.encoder._measured._joints[2](NOW, 0.1, 0.2)
    fields = (0.0,) * 6, (0.2, 0.0, 0.4), (0.0,) * 4
    values = [value for part in fields for value in part]
    barrier = FrameWriter(1, 200).frame(ids.HIL_SENSOR, NOW, *values, 0x1C0, 0)
    wire.socket.send(frame + barrier)
    assert wire.link.wait_for_step() is not None
    assert [type(one) for one in wire.inbox.take().samples] == [JointSample, MagneticSample]


def test_a_repeated_step_brings_its_samples_once_and_gets_the_same_answer(wire: Wire) -> None:
    assert wire.step(NOW, POSE, JOINTS, IMU) is not None
    wire.link.send_actuators(NOW, outputs_at(NOW))
    answer = wire.socket.recv(2048)
    assert wire.step(NOW, POSE, JOINTS, IMU) is None
    assert wire.socket.recv(2048) == answer
    assert len(wire.inbox.take().samples) == 3


def test_samples_of_several_steps_wait_for_one_tick_and_the_oldest_go_first(wire: Wire) -> None:
    for k in range(300):
        t_us = NOW + 2000 * k
        wire.step(t_us, JOINTS._replace(t_us=t_us), IMU._replace(t_us=t_us))
    samples = wire.inbox.take_inputs(SENSORS, None, None, None).samples
    assert len(samples) == 512
    assert samples[-1].time == pytest.approx(1e-6 * (NOW + 2000 * 299))
    assert wire.inbox.refused == 88


def test_what_has_no_room_in_a_step_goes_ahead_of_it_and_arrives_in_order(wire: Wire) -> None:
    times = range(NOW - 100_000, NOW + 1, 2000)
    said = [IMU._replace(t_us=t_us) for t_us in times]
    encoder, opening = wire.encoder, wire.encoder.heartbeat()
    ahead, step = encoder.measured_datagrams(NOW, (*said[:-1], POSE, said[-1]), (), opening)
    assert len(ahead) > 1
    for datagram in (*ahead, step):
        assert len(datagram) <= 1400
        wire.socket.send(datagram)
    released = [wire.link.wait_for_step() for _ in (*ahead, step)]
    assert released[:-1] == [None] * len(ahead)
    assert released[-1] is not None
    samples = wire.inbox.take().samples
    assert [one.time for one in samples if isinstance(one, ImuSample)] == [1e-6 * t for t in times]
    assert len(samples) == len(said) + 1


def test_commands_come_with_measured_steps_too(wire: Wire) -> None:
    nan = math.nan
    arm = SendCommand(400, (1.0, nan, nan, nan, nan, nan, nan))
    wire.socket.send(wire.encoder.measured_datagrams(NOW, (JOINTS, IMU), (arm,))[1])
    assert wire.link.wait_for_step() is not None
    assert len(wire.inbox.take().commands) == 1


def test_a_ground_station_cannot_send_measurements() -> None:
    inbox = Inbox()
    encoder = StepEncoder(lockstep=True, measured=True)
    for frame in split(encoder.measured_datagrams(NOW, (POSE, JOINTS, IMU), ())[1]):
        inbox.accept(frame)
    assert inbox.take().samples == []


def test_the_two_projections_agree_where_a_vehicle_flies() -> None:
    origin = earth.Place(-33.9, 151.2, 20.0)
    inbox = Inbox(Origin(*origin))
    for p in ((0.0, 0.0, 0.0), (900.0, -450.0, -30.0), (-3.0, 999.0, 5.0)):
        assert inbox.locate(*earth.place_of(origin, p)) == pytest.approx(p, abs=1e-6)
