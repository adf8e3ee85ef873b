"""Each fault of each sensor on a recorded signal: outside its time nothing is changed."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from sitl.faults.active import Faults
from sitl.faults.keys import EXACT, KINDS, SENSORS, Fault, Kind, Unit, problem
from sitl.faults.signal import SignalFault
from sitl.sensors.barometer import PressureMeasurement
from sitl.sensors.channel import Measurement
from sitl.sensors.encoders import JointMeasurement
from sitl.sensors.exact import SensorReadings
from sitl.sensors.gnss import GnssMeasurement
from sitl.sensors.imu import ImuMeasurement
from sitl.sensors.magnetometer import MagneticMeasurement
from sitl.sensors.motion_capture import PoseMeasurement
from sitl.sensors.rangefinder import RangeMeasurement
from vehicles.vehicle_file import load_vehicle

FIRST, END, STEPS = 100, 400, 500
START_S, DURATION_S = 0.2, 0.6
SUITE = tuple(unit for unit in SENSORS if unit != "optical flow")
V3 = tuple[float, float, float]


def faults(*each: Fault, exact: bool = True) -> Faults:
    return Faults(each, 3, step_us=2000, full=(17.0,) * 4, joints=2, exact=exact)


def failing(unit: Unit, kind: Kind) -> Fault:
    return Fault(unit, kind, START_S, DURATION_S)


def wave(step: int, k: int) -> float:
    return math.sin(0.01 * step + k)


def vector(step: int, k: int) -> V3:
    return (wave(step, k), wave(step, k + 1), wave(step, k + 2))


def exact(step: int) -> SensorReadings:
    half = 0.1 * wave(step, 7)
    return SensorReadings(
        t_us=1_000_000 + 2000 * step,
        p_WB=vector(step, 0),
        v_WB=vector(step, 1),
        q_WB=(math.cos(half), 0.0, 0.0, math.sin(half)),
        w_WB_B=vector(step, 2),
        gyro_B=vector(step, 3),
        accel_B=vector(step, 4),
        q_arm=(wave(step, 5), wave(step, 6)),
        qd_arm=(wave(step, 8), wave(step, 9)),
        tau_arm=(0.1, 0.2),
    )


def arrived(step: int) -> tuple[Measurement, ...]:
    """Of slow sensors in every tenth step, of fast ones in each."""
    x = exact(step)
    slow: tuple[Measurement, ...] = (
        PoseMeasurement(x.t_us, x.p_WB, x.q_WB, 1e-6, 1e-6, 0, False),
        GnssMeasurement(x.t_us, x.p_WB, x.v_WB, 0.5, 0.8, False),
        PressureMeasurement(x.t_us, 101_000.0 + wave(step, 0)),
        MagneticMeasurement(x.t_us, vector(step, 1)),
        RangeMeasurement(x.t_us, 1.5 + wave(step, 2), 1e-4, 0.1, 10.0),
    )
    fast = (JointMeasurement(x.t_us, x.q_arm), ImuMeasurement(x.t_us, x.gyro_B, x.accel_B))
    return (*slow, *fast) if step % 10 == 0 else fast


def frames(fault: Fault) -> list[SensorReadings]:
    flight, sent = faults(fault), []
    for step in range(STEPS):
        sent.append(flight.frame(exact(step)) if flight.at(step) else exact(step))
    return sent


def suite(fault: Fault) -> list[tuple[Measurement, ...]]:
    flight, sent = faults(fault, exact=False), []
    for step in range(STEPS):
        t_us = exact(step).t_us
        sent.append(flight.suite(t_us, arrived(step)) if flight.at(step) else arrived(step))
    return sent


@pytest.mark.parametrize(("unit", "kind"), [(u, k) for u in EXACT for k in KINDS[u]])
def test_exact_states_are_spoilt_for_as_long_as_the_fault_lasts(unit: Unit, kind: Kind) -> None:
    sent = frames(failing(unit, kind))
    healthy = [exact(step) for step in range(STEPS)]
    assert sent[:FIRST] == healthy[:FIRST]
    assert sent[END:] == healthy[END:]
    assert any(a != b for a, b in zip(sent[FIRST:END], healthy[FIRST:END], strict=True))
    assert all(a.t_us == b.t_us for a, b in zip(sent, healthy, strict=True))


@pytest.mark.parametrize(("unit", "kind"), [(u, k) for u in SUITE for k in KINDS[u]])
def test_a_suite_is_spoilt_for_as_long_as_the_fault_lasts(unit: Unit, kind: Kind) -> None:
    sent = suite(failing(unit, kind))
    healthy = [arrived(step) for step in range(STEPS)]
    assert sent[:FIRST] == healthy[:FIRST]
    assert sent[END:] == healthy[END:]
    assert sent[FIRST:END] != healthy[FIRST:END]


@pytest.mark.parametrize("kind", KINDS["gyro"])
def test_a_fault_of_one_sensor_leaves_the_others_alone(kind: Kind) -> None:
    for step, sent in enumerate(suite(failing("gps", kind))):
        others = [one for one in sent if not isinstance(one, GnssMeasurement)]
        assert others == [one for one in arrived(step) if not isinstance(one, GnssMeasurement)]
    for step, frame in enumerate(frames(failing("gyro", kind))):
        assert frame._replace(gyro_B=exact(step).gyro_B) == exact(step)


def positions(sent: Sequence[tuple[Measurement, ...]]) -> list[tuple[int, GnssMeasurement]]:
    """Of satellites, with the step in which each arrived."""
    return [
        (step, one)
        for step, messages in enumerate(sent)
        for one in messages
        if isinstance(one, GnssMeasurement)
    ]


def test_a_sensor_that_is_off_says_nothing() -> None:
    assert not [step for step, _ in positions(suite(failing("gps", "off"))) if FIRST <= step < END]
    frame = frames(failing("gyro", "off"))[FIRST]
    assert all(math.isnan(rate) for rate in frame.gyro_B)


def test_a_stuck_sensor_repeats_its_value_with_new_stamps() -> None:
    within = [one for step, one in positions(suite(failing("gps", "stuck"))) if FIRST <= step < END]
    assert len({one.p_WB for one in within}) == 1
    assert len({one.t_us for one in within}) == len(within)


def test_a_delayed_message_keeps_the_stamp_of_its_measurement() -> None:
    within = positions(suite(failing("gps", "delayed")))
    late = [(step, one) for step, one in within if FIRST <= step < END]
    assert late
    assert all(exact(step).t_us - one.t_us == 200_000 for step, one in late)
    sent = frames(failing("gps", "delayed"))
    assert sent[FIRST + 50].p_WB == exact(FIRST).p_WB
    assert sent[FIRST + 150].p_WB == exact(FIRST + 50).p_WB


def test_a_slow_sensor_has_the_rate_that_is_given() -> None:
    slow = replace(failing("gps", "slow"), rate_hz=10.0)
    steps = [step for step, _ in positions(suite(slow)) if FIRST <= step < END]
    assert steps == [100, 150, 200, 250, 300, 350]
    assert len({frame.p_WB for frame in frames(slow)[FIRST:END]}) == 6


def test_an_intermittent_sensor_is_silent_for_its_share_of_the_time() -> None:
    often = replace(failing("gyro", "intermittent"), duration_s=0.0, share=0.3)
    flight, silent = faults(often), 0
    for step in range(5000):
        flight.at(step)
        silent += math.isnan(flight.frame(exact(step)).gyro_B[0])
    assert 0.15 * 5000 < silent < 0.45 * 5000


def test_a_wrong_sensor_is_off_by_the_same_and_by_as_much_as_is_asked() -> None:
    once = frames(failing("gps", "wrong"))
    twice = frames(replace(failing("gps", "wrong"), size=2.0))
    for step in range(FIRST, END):
        p = exact(step).p_WB
        off = [a - b for a, b in zip(once[step].p_WB, p, strict=True)]
        assert off == pytest.approx([1.0, -0.7, 0.5])
        assert [a - b for a, b in zip(twice[step].p_WB, p, strict=True)] == pytest.approx(
            [2.0 * value for value in off]
        )


def test_a_wrong_attitude_is_one_all_the_same() -> None:
    for kind in ("wrong", "garbage"):
        for frame in frames(failing("vio", kind)):
            assert math.hypot(*frame.q_WB) == pytest.approx(1.0)


def turn_of(frame: SensorReadings, step: int) -> tuple[float, V3]:
    """Angle [rad] and axis (3,) [1, W] by which a frame's attitude is turned from the true one."""
    (w, x, y, z), (a, b, c, d) = frame.q_WB, exact(step).q_WB
    # q * conjugate(true): the rotation of W.
    cos = w * a + x * b + y * c + z * d
    axis = (
        -w * b + x * a - y * d + z * c,
        -w * c + x * d + y * a - z * b,
        -w * d - x * c + y * b + z * a,
    )
    sin = math.hypot(*axis)
    unit = (axis[0] / sin, axis[1] / sin, axis[2] / sin) if sin else (0.0, 0.0, 0.0)
    return 2.0 * math.atan2(sin, cos), unit


@pytest.mark.parametrize(
    ("kind", "axis"), [("turning", (0.0, 0.0, 1.0)), ("tilting", (1.0, 0.0, 0.0))]
)
@pytest.mark.parametrize("unit", ["vio", "attitude"])
def test_a_frame_that_turns_takes_the_positions_along_unless_it_is_the_attitude_alone(
    unit: Unit, kind: Kind, axis: V3
) -> None:
    sent = frames(replace(failing(unit, kind), size=5.0))
    for step in range(FIRST + 1, END, 37):
        angle, about = turn_of(sent[step], step)
        assert angle == pytest.approx(math.radians(5.0) * 0.002 * (step - FIRST))
        assert about == pytest.approx(axis)
        p, true = sent[step].p_WB, exact(step).p_WB
        assert math.hypot(*p) == pytest.approx(math.hypot(*true))
        along = sum(a * (b - c) for a, b, c in zip(axis, p, true, strict=True))
        assert along == pytest.approx(0.0)
        assert (p == true) == (unit == "attitude")


def test_unstated_noise_of_poses_has_the_deviation_that_is_asked_for_in_mm() -> None:
    sent = frames(replace(failing("vio", "noisy"), size=3.0))
    off = [
        a - b
        for step in range(FIRST, END)
        for a, b in zip(sent[step].p_WB, exact(step).p_WB, strict=True)
    ]
    assert statistics.pstdev(off) == pytest.approx(0.003, rel=0.1)
    assert statistics.mean(off) == pytest.approx(0.0, abs=0.0005)
    assert all(sent[step].q_WB == exact(step).q_WB for step in range(FIRST, END))


def test_a_frozen_sensor_is_where_it_was_and_repeats_nothing() -> None:
    sent = frames(failing("vio", "frozen"))[FIRST:END]
    assert len({frame.p_WB for frame in sent}) == len({frame.q_WB for frame in sent}) == len(sent)
    for frame in sent:
        assert frame.p_WB == pytest.approx(exact(FIRST).p_WB, abs=1e-4)
        assert frame.q_WB == pytest.approx(exact(FIRST).q_WB, abs=1e-3)


def test_what_wanders_forgets_itself_in_the_time_that_is_asked_for() -> None:
    steps, forgets = 20_000, 0.05
    fault = SignalFault[SensorReadings](
        replace(failing("vio", "wandering"), size=4.0, forgets_s=forgets), np.random.default_rng(1)
    )
    reading, off = exact(0), []
    for step in range(steps):
        said = fault.read(2000 * step, reading)
        assert said is not None
        off.append([a - b for a, b in zip(said.p_WB, reading.p_WB, strict=True)])
    x = np.array(off)
    assert x.std() == pytest.approx(0.004, rel=0.1)
    lag = round(forgets / 0.002)
    assert (x[lag:] * x[:-lag]).mean() / x.var() == pytest.approx(math.exp(-1.0), abs=0.1)
    assert said.q_WB == reading.q_WB


def test_a_drift_grows_with_time_and_its_velocity_fits() -> None:
    sent = frames(replace(failing("gps", "drifting"), axis=1.0, size=-2.0))
    for step in range(FIRST, END):
        off = [a - b for a, b in zip(sent[step].p_WB, exact(step).p_WB, strict=True)]
        assert off == pytest.approx([-0.2 * 0.002 * (step - FIRST), 0.0, 0.0])
        v = [a - b for a, b in zip(sent[step].v_WB, exact(step).v_WB, strict=True)]
        assert v == pytest.approx([-0.2, 0.0, 0.0])


def test_one_axis_is_off_by_a_constant_of_either_sign_and_the_others_are_not() -> None:
    down = frames(replace(failing("accel", "wrong"), axis=3.0, size=-0.5))[FIRST]
    off = [a - b for a, b in zip(down.accel_B, exact(FIRST).accel_B, strict=True)]
    assert off == pytest.approx([0.0, 0.0, -1.0])
    one = frames(replace(failing("vio", "wrong"), axis=1.0))[FIRST]
    assert one.p_WB[1:] == exact(FIRST).p_WB[1:]
    assert one.q_WB == exact(FIRST).q_WB


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (Fault("encoder", "wrong", axis=1.0), "axis = 1: must be 0, because encoder has none"),
        (Fault("motor", "wrong", size=-1.0), "size = -1: must be at least 0 but of a sensor"),
        (Fault("attitude", "off"), 'kind = "off": a attitude can be "stuck"'),
        (Fault("gyro", "turning"), 'kind = "turning": a gyro can be "off"'),
    ],
)
def test_what_a_unit_cannot_be_is_refused(fault: Fault, sentence: str) -> None:
    found = problem(fault, EXACT, load_vehicle("paper"), exact=True)
    assert found is not None
    assert found.startswith(sentence)


def test_one_encoder_fails_and_the_other_does_not() -> None:
    second = replace(failing("encoder", "stuck"), instance=2.0)
    sent = frames(second)
    assert {frame.q_arm[1] for frame in sent[FIRST:END]} == {exact(FIRST).q_arm[1]}
    assert [frame.q_arm[0] for frame in sent] == [exact(step).q_arm[0] for step in range(STEPS)]


def test_faults_add_up_and_each_ends_for_itself() -> None:
    flight = faults(Fault("gyro", "off", 0.2, 0.2), Fault("gps", "wrong", 0.3, 0.4), exact=True)
    seen = []
    for step in (0, 120, 160, 260, 400):
        flight.at(step)
        seen.append([str(fault) for fault in flight.active])
    assert seen == [[], ["gyro off"], ["gyro off", "gps wrong"], ["gps wrong"], []]


def test_what_is_injected_ends_when_it_is_cleared() -> None:
    flight = faults()
    assert not flight.at(0)
    flight.inject(Fault("gyro", "off"), 10)
    flight.inject(Fault("gyro", "off"), 11)  # the same again changes nothing
    assert not flight.at(9)
    assert flight.at(10)
    assert flight.take_begun() == [Fault("gyro", "off")]
    flight.clear("accel", 0, 20)
    assert flight.at(20)
    flight.clear("gyro", 0, 21)
    assert not flight.at(21)
    assert flight.take_begun() == []


def test_a_clock_that_jumps_takes_stamps_along() -> None:
    ahead = Fault("clock", "jump", START_S, DURATION_S, jump_s=0.5)
    assert frames(ahead)[FIRST].t_us == exact(FIRST).t_us + 500_000
    assert frames(ahead)[END].t_us == exact(END).t_us
    sent = suite(ahead)[FIRST]
    assert {one.t_us for one in sent} == {exact(FIRST).t_us + 500_000}


def test_the_same_seed_gives_the_same_garbage() -> None:
    garbage = failing("gyro", "garbage")
    assert frames(garbage) == frames(garbage)
