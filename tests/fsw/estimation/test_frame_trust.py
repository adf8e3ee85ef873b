"""What of an exact frame is believed, and what stands in for the rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fsw.estimation.estimator import estimate_state
from fsw.estimation.frame_trust import FrameTrust, believed
from fsw.estimation.sensor_fault import Sensor, SensorFault
from fsw.signals import SensorFrame, StateEstimate, Vec3

TICK = 0.002
NAN = math.nan


def frame(k: int, **changes: Any) -> SensorFrame:
    """Tick k of a vehicle that turns about its vertical, drifts north and climbs ever faster."""
    t = TICK * k
    yaw = 0.4 * t
    found = SensorFrame(
        t_us=1_000_000 + 2_000 * k,
        p_WB=(0.3 * t, 0.0, -1.0 - 0.25 * t * t),
        v_WB=(0.3, 0.0, -0.5 * t),
        q_WB=(math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)),
        gyro_B=(1e-7 * math.sin(50.0 * t), 0.0, 0.4),
        accel_B=(0.0, 0.0, -9.80665 - 0.5),
        q_arm=(0.1 * t, 0.2),
        qd_arm=(0.1, 1e-7 * math.cos(50.0 * t)),
    )
    return replace(found, **changes)


def flown(
    ticks: int, spoil: Callable[[int, SensorFrame], SensorFrame]
) -> tuple[FrameTrust, StateEstimate, list[FrameTrust]]:
    estimate = estimate_state(frame(0))
    assert estimate is not None
    trust, history = FrameTrust(), []
    for k in range(1, ticks):
        trust, estimate = believed(trust, spoil(k, frame(k)), estimate, lambda: (0.0, 0.0))
        history.append(trust)
    return trust, estimate, history


def apart(estimate: StateEstimate, k: int) -> float:
    return math.dist(estimate.p_WB, frame(k).p_WB)


def test_a_good_frame_is_taken_as_it_is() -> None:
    trust, estimate, _ = flown(50, lambda _, s: s)
    assert estimate == estimate_state(frame(49))
    assert not trust.doubted


NOTHING: Vec3 = (NAN, NAN, NAN)
ONCE: list[tuple[dict[str, Any], Sensor, SensorFault]] = [
    ({"v_WB": (1e6, 0.0, 0.0)}, Sensor.POSE, SensorFault.IMPLAUSIBLE),
    ({"v_WB": (0.3, 1e30, 0.0)}, Sensor.POSE, SensorFault.IMPLAUSIBLE),
    ({"v_WB": (0.3, 5.0, 0.0)}, Sensor.POSE, SensorFault.JUMP),
    ({"p_WB": (0.5, 0.0, -1.0)}, Sensor.POSE, SensorFault.JUMP),
    ({"p_WB": NOTHING}, Sensor.POSE, SensorFault.IMPLAUSIBLE),
    ({"q_WB": (math.cos(0.7), math.sin(0.7), 0.0, 0.0)}, Sensor.POSE, SensorFault.JUMP),
    ({"q_WB": (0.0, 0.0, 0.0, 0.0)}, Sensor.POSE, SensorFault.IMPLAUSIBLE),
    ({"gyro_B": (20.0, 0.0, 0.0)}, Sensor.IMU, SensorFault.JUMP),
    ({"gyro_B": (math.inf, 0.0, 0.0)}, Sensor.IMU, SensorFault.IMPLAUSIBLE),
    ({"q_arm": (1.0, 0.2)}, Sensor.ENCODERS, SensorFault.JUMP),
    ({"qd_arm": (NAN, 0.0)}, Sensor.ENCODERS, SensorFault.IMPLAUSIBLE),
]


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize(("lie", "sensor", "fault"), ONCE)
def test_one_frame_that_lies_is_not_believed_and_named(
    lie: dict[str, Any], sensor: Sensor, fault: SensorFault
) -> None:
    _, estimate, history = flown(23, lambda k, s: replace(s, **lie) if k == 20 else s)
    ((named, part),) = history[19].faults()
    assert (named, part.fault, part.unused) == (sensor, fault, 1)
    assert part.since_us == frame(20).t_us
    assert not history[20].doubted, "the next frame is believed"
    assert estimate == estimate_state(frame(22))


def test_bad_frames_are_reported_once_and_again_after_ten_seconds() -> None:
    estimate = estimate_state(frame(0))
    assert estimate is not None
    trust, said = FrameTrust(), []
    for k in range(1, 5_300):
        bad = k in (20, 40, 41, 5_100)
        now = frame(k, gyro_B=NOTHING) if bad else frame(k)
        trust, estimate = believed(trust, now, estimate, lambda: (0.0, 0.0))
        trust, sentences = trust.reported(now.t_us)
        said += [(k, text) for text in sentences]
    assert said == [(20, "IMU says what cannot be"), (5_100, "IMU says what cannot be")]


@pytest.mark.requirement("REQ-EST-3")
@pytest.mark.parametrize("lie", [{"p_WB": NOTHING}, "frozen"])
def test_without_a_pose_the_inertial_unit_carries_on(lie: Any) -> None:
    def spoil(k: int, s: SensorFrame) -> SensorFrame:
        if k < 20:
            return s
        if lie == "frozen":
            old = frame(20)
            return replace(s, p_WB=old.p_WB, v_WB=old.v_WB, q_WB=old.q_WB)
        return replace(s, **lie)

    trust, estimate, _ = flown(520, spoil)
    assert trust.faults()[0][0] is Sensor.POSE
    assert apart(estimate, 519) < 0.002
    assert estimate.yaw == pytest.approx(0.4 * TICK * 519, abs=1e-3)
    now_us = frame(519).t_us
    assert 0.05 < trust.position_sigma(now_us) < 0.2
    assert trust.attitude_sigma(now_us) < 0.02


def test_without_anything_the_attitude_is_soon_unknown() -> None:
    def spoil(k: int, s: SensorFrame) -> SensorFrame:
        return replace(s, p_WB=NOTHING, gyro_B=NOTHING) if k >= 20 else s

    trust, estimate, _ = flown(220, spoil)
    assert trust.attitude_sigma(frame(219).t_us) == pytest.approx(0.4, rel=0.05)
    assert math.isfinite(sum(estimate.p_WB))
    assert estimate.t_us == frame(219).t_us, "telemetry goes by it"


@pytest.mark.parametrize("what", ["frozen", "lost"])
def test_without_an_inertial_unit_rates_follow_from_the_pose(what: str) -> None:
    old = frame(20)

    def spoil(k: int, s: SensorFrame) -> SensorFrame:
        if k < 20:
            return s
        if what == "lost":
            return replace(s, gyro_B=NOTHING)
        # As if it had stopped before the vehicle began to turn.
        return replace(s, gyro_B=(0.0, 0.0, 0.0), accel_B=old.accel_B)

    trust, estimate, _ = flown(300, spoil)
    assert trust.faults()[0][0] is Sensor.IMU
    assert estimate.w_WB_B[2] == pytest.approx(0.4, abs=0.01)
    assert estimate.specific_force == pytest.approx(9.80665 + 0.5, abs=0.05)
    assert apart(estimate, 299) == 0.0


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize(
    ("held", "sensor"),
    [
        (("p_WB", "v_WB"), Sensor.POSE),
        (("p_WB", "v_WB", "q_WB"), Sensor.POSE),
        ((0,), Sensor.ENCODERS),
        ((1,), Sensor.ENCODERS),
        (("q_arm", "qd_arm"), Sensor.ENCODERS),
    ],
    ids=["place", "pose", "encoder 1", "encoder 2", "encoders"],
)
def test_a_part_of_a_sensor_that_is_stuck_is_not_believed(
    held: tuple[str | int, ...], sensor: Sensor
) -> None:
    """An attitude that turns on, or the other joint, does not make a reading new."""

    def moving(k: int, **changes: Any) -> SensorFrame:
        t = TICK * k
        return frame(k, q_arm=(0.1 * t, 0.2 - 0.2 * t), qd_arm=(0.1, -0.2), **changes)

    def spoilt(k: int, _: SensorFrame) -> SensorFrame:
        last, now = moving(min(k, 20)), moving(k)
        changes: dict[str, Any] = {}
        for part in held:
            if isinstance(part, str):
                changes[part] = getattr(last, part)
            else:
                for name in ("q_arm", "qd_arm"):
                    new = list(changes.get(name, getattr(now, name)))
                    new[part] = getattr(last, name)[part]
                    changes[name] = tuple(new)
        return replace(now, **changes)

    _, estimate, history = flown(60, spoilt)
    assert not any(trust.doubted for trust in history[:19])
    for trust in history[26:]:
        ((found, part),) = trust.faults()
        assert (found, part.fault) == (sensor, SensorFault.STUCK)
    assert apart(estimate, 59) < 1e-3
    assert estimate.q_arm == pytest.approx(moving(59).q_arm, abs=0.03)


def test_a_vehicle_that_lies_still_is_no_stuck_sensor() -> None:
    still = frame(3, qd_arm=(0.0, 0.0))
    estimate = estimate_state(still)
    assert estimate is not None
    trust = FrameTrust()
    for k in range(20):
        again = replace(still, t_us=still.t_us + 2_000 * k)
        trust, estimate = believed(trust, again, estimate, lambda: (0.0, 0.0))
        assert not trust.doubted


def test_a_pose_that_stays_where_it_jumped_to_is_the_truth_after_a_while() -> None:
    def spoil(k: int, s: SensorFrame) -> SensorFrame:
        x, y, z = s.p_WB
        return replace(s, p_WB=(x, y + 0.4, z)) if k >= 20 else s

    _, estimate, history = flown(140, spoil)
    assert estimate.p_WB[1] == pytest.approx(0.4)
    believed_at = next(k for k, one in enumerate(history, start=1) if k > 20 and not one.doubted)
    assert believed_at == 120
    assert history[believed_at - 1].returned_us == 200_000
    assert history[believed_at].returned_us == 0


@pytest.mark.requirement("REQ-EST-1")
def test_what_cannot_be_is_never_the_truth() -> None:
    trust, _, _ = flown(400, lambda k, s: replace(s, v_WB=(1e3, 0.0, 0.0)) if k >= 20 else s)
    assert trust.pose.unused == 380


def test_frames_that_were_missing_are_no_jump() -> None:
    estimate = estimate_state(frame(0))
    assert estimate is not None
    for gap in (50, 250):
        trust, found = believed(FrameTrust(), frame(gap), estimate, lambda: (0.0, 0.0))
        assert not trust.doubted
        assert found == estimate_state(frame(gap))


def swaying(k: int, **changes: Any) -> SensorFrame:
    """Tick k of a vehicle that sways east and rolls by it, one reading in the noise of the next."""
    t, w, reach = TICK * k, 4.0, 0.1
    a_y = -reach * w * w * math.sin(w * t)
    roll = math.atan2(a_y, 9.81)
    turning = (
        math.atan2(-reach * w * w * math.sin(w * (t + 1e-4)), 9.81)
        - math.atan2(-reach * w * w * math.sin(w * (t - 1e-4)), 9.81)
    ) / 2e-4
    found = SensorFrame(
        t_us=1_000_000 + 2_000 * k,
        p_WB=(0.0, reach * math.sin(w * t), -1.0),
        v_WB=(0.0, reach * w * math.cos(w * t), 0.0),
        q_WB=(math.cos(0.5 * roll), math.sin(0.5 * roll), 0.0, 0.0),
        gyro_B=(turning, 0.0, 0.0),
        accel_B=(0.0, 0.0, -math.hypot(a_y, 9.81)),
        q_arm=(0.1 * t, 0.2),
        qd_arm=(0.1, 1e-7 * math.cos(50.0 * t)),
    )
    return replace(found, **changes)


def swayed(
    ticks: int, spoil: Callable[[int, SensorFrame], SensorFrame]
) -> tuple[list[FrameTrust], list[StateEstimate]]:
    estimate = estimate_state(swaying(0))
    assert estimate is not None
    trust, history, estimates = FrameTrust(), [], []
    for k in range(1, ticks):
        trust, estimate = believed(trust, spoil(k, swaying(k)), estimate, lambda: (0.0, 0.0))
        history.append(trust)
        estimates.append(estimate)
    return history, estimates


def test_a_vehicle_that_sways_agrees_with_itself() -> None:
    history, _ = swayed(500, lambda _, s: s)
    assert not any(one.doubted for one in history)


FROM = 250
LIES: list[tuple[Callable[[int, SensorFrame], SensorFrame], SensorFault]] = [
    (lambda k, s: replace(s, gyro_B=swaying(FROM).gyro_B), SensorFault.STUCK),
    (lambda k, s: replace(s, accel_B=swaying(FROM).accel_B), SensorFault.STUCK),
    (lambda k, s: replace(s, gyro_B=(s.gyro_B[0] + 0.5, -0.3, 0.2)), SensorFault.DISAGREES),
    (lambda k, s: replace(s, accel_B=(1.0, -1.0, s.accel_B[2] + 2.0)), SensorFault.DISAGREES),
]


@pytest.mark.parametrize(("lie", "fault"), LIES, ids=["gyro", "force", "gyro off", "force off"])
def test_half_an_inertial_unit_that_fails_is_found_and_the_pose_stands_in(
    lie: Callable[[int, SensorFrame], SensorFrame], fault: SensorFault
) -> None:
    history, estimates = swayed(500, lambda k, s: lie(k, s) if k >= FROM else s)
    found = next(k for k, one in enumerate(history, start=1) if one.doubted)
    ((sensor, part),) = history[found - 1].faults()
    assert (sensor, part.fault) == (Sensor.IMU, fault)
    assert found - FROM < 100, "within 0.2 s"
    assert history[-1].inertial.unused > 0
    assert estimates[-1].w_WB_B[0] == pytest.approx(swaying(499).gyro_B[0], abs=0.1)


@pytest.mark.parametrize(
    ("quiet", "blamed"), [(3000, Sensor.IMU), (100, Sensor.POSE)], ids=["long ago", "lately"]
)
def test_a_pose_that_failed_once_is_blamed_for_some_seconds_and_no_longer(
    quiet: int, blamed: Sensor
) -> None:
    """It is no number for one frame, and a gyro is wrong after so many ``quiet`` ones."""

    def spoil(k: int, s: SensorFrame) -> SensorFrame:
        if k == 20:
            return replace(s, v_WB=(NAN, 0.0, 0.0))
        return replace(s, gyro_B=(s.gyro_B[0] + 0.5, -0.3, 0.2)) if k > 20 + quiet else s

    history, _ = swayed(20 + quiet + 120, spoil)
    assert not any(one.doubted for one in history[20 : 20 + quiet])
    assert history[-1].faults()[0][0] is blamed


@pytest.mark.parametrize("what", ["pose", "gyro", "arm"])
def test_garbage_is_never_the_truth(what: str) -> None:
    random = np.random.default_rng(2)

    def garbage(k: int, s: SensorFrame) -> SensorFrame:
        if k < FROM:
            return s
        a, b, c = random.uniform(-10.0, 10.0, 3).tolist()
        if what == "pose":
            return replace(s, p_WB=(10.0 * a, 10.0 * b, 10.0 * c))
        return replace(s, gyro_B=(a, b, c)) if what == "gyro" else replace(s, q_arm=(0.3 * a, b))

    history, estimates = swayed(1000, garbage)
    place = {"pose": 0, "gyro": 1, "arm": 2}[what]
    believed_again = [(one.pose, one.inertial, one.joints)[place] for one in history[FROM + 5 :]]
    assert all(part.unused for part in believed_again)
    assert math.dist(estimates[-1].p_WB, swaying(999).p_WB) < 0.05


def test_after_places_that_are_no_numbers_one_far_off_is_not_believed_at_once() -> None:
    """The rest of the frame is good, and steady; the place comes back 30 m away."""

    def spoil(k: int, s: SensorFrame) -> SensorFrame:
        x, y, z = s.p_WB
        if FROM <= k < FROM + 110:
            return replace(s, p_WB=(NAN, y, z))
        return replace(s, p_WB=(x + 30.0, y, z)) if k >= FROM + 110 else s

    history, estimates = swayed(FROM + 300, spoil)
    back = FROM + 109  # the first place that is a number
    assert all(one.pose.unused for one in history[back : back + 99])
    assert all(math.dist(one.p_WB, (0.0, 0.0, -1.0)) < 0.5 for one in estimates[: back + 99])
    assert not history[back + 99].pose.unused, "what stays is the truth, after a while"


def test_a_pose_that_is_late_is_found_and_the_inertial_unit_leads_on() -> None:
    """As a fault begins: it stops, and then goes on from there."""
    late = 100

    def spoil(k: int, s: SensorFrame) -> SensorFrame:
        if k < FROM:
            return s
        old = swaying(max(FROM, k - late))
        return replace(s, p_WB=old.p_WB, v_WB=old.v_WB, q_WB=old.q_WB)

    history, estimates = swayed(900, spoil)
    apart = [math.dist(one.p_WB, swaying(k).p_WB) for k, one in enumerate(estimates, start=1)]
    doubted = [one.pose.fault is SensorFault.DISAGREES for one in history]
    assert np.mean(doubted[FROM + 200 :]) > 0.2
    led = [far for far, odd in zip(apart, doubted, strict=True) if odd]
    assert max(led) < 0.07, "where it was late when it came back, and no farther"


def test_a_pose_that_repeats_itself_for_long_is_worth_a_sentence() -> None:
    estimate = estimate_state(swaying(0))
    assert estimate is not None
    trust, said, old = FrameTrust(), [], swaying(20)
    for k in range(1, 200):
        s = swaying(k)
        if k > 20:
            s = replace(s, p_WB=old.p_WB, v_WB=old.v_WB, q_WB=old.q_WB)
        trust, estimate = believed(trust, s, estimate, lambda: (0.0, 0.0))
        trust, sentences = trust.reported(s.t_us)
        said += [(k, text) for text in sentences]
    assert said == [(70, "pose is stuck at one reading")]
