"""Exact frames of which a part is no number or out of range: what is left stands in for it.

The pose is carried on by the inertial unit, rates and specific force follow from the pose, joints
from their torques. What is a number and in range is believed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from fsw.autopilot.estimation.dead_reckoning import moved_on
from fsw.autopilot.estimation.estimator import FORCE_LIMIT, INERTIAL, JOINTS, POSE
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault, sentence
from fsw.autopilot.geometry.quaternion import conjugate, multiply, rotation_vector
from fsw.autopilot.geometry.rotation import quaternion_from_matrix
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.signals import JointVector, SensorFrame, StateEstimate, Vec3

_PARTS: Final = ((POSE, Sensor.POSE), (INERTIAL, Sensor.IMU), (JOINTS, Sensor.ENCODERS))
_RATE_SHARE: Final = 0.3  # of the newest rate from two poses
_QUIET_US: Final = 10_000_000  # with every frame complete, until a gap is worth a sentence again
# Errors of what stands in, standard deviations.
# m/s^2, of an accelerometer and the attitude that turns it: as the filter says with motion capture.
# Beside walls the estimate was off by 5 mm after 2 s.
_FORCE_ERROR: Final = 0.03
_BLIND_FORCE: Final = 5.0  # m/s^2, where there is none
_GYRO_ERROR: Final = 0.01  # rad/s
_BLIND_RATE: Final = 1.0  # rad/s


class Gap(NamedTuple):
    """Frames without one of their parts."""

    since_us: int = -1  # the first one of those in a row; -1: the part is there
    last_us: int = -_QUIET_US  # the last one

    def seconds(self, now_us: int) -> float:
        """How long it has lasted at ``now_us`` [us]; 0: there is none."""
        return 0.0 if self.since_us < 0 else 1e-6 * (now_us - self.since_us)


class Dropout(NamedTuple):
    """What is missing in exact frames, carried from frame to frame."""

    pose: Gap = Gap()
    inertial: Gap = Gap()
    joints: Gap = Gap()

    @property
    def lost(self) -> tuple[tuple[Sensor, Gap], ...]:
        """Sensors that are missing, in the order of the parts."""
        return tuple([(s, gap) for (_, s), gap in zip(_PARTS, self, strict=True) if gap[0] >= 0])

    def after(self, missing: int, now_us: int) -> tuple[Dropout, list[str]]:
        """What is known after a frame without these parts, and what there is to say of it."""
        gaps, sentences = [], []
        for (part, sensor), (since_us, last_us) in zip(_PARTS, self, strict=True):
            if not missing & part:
                gaps.append(Gap(-1, last_us))
                continue
            if now_us - last_us >= _QUIET_US:
                sentences.append(sentence(sensor, SensorFault.IMPLAUSIBLE))
            gaps.append(Gap(since_us if since_us >= 0 else now_us, now_us))
        return Dropout(*gaps), sentences

    def sigmas(self, now_us: int) -> Vec3:
        """Standard deviations of position [m], velocity [m/s] and attitude [rad] at ``now_us``."""
        t = self.pose.seconds(now_us)
        blind = min(t, self.inertial.seconds(now_us))
        return (
            0.5 * (_FORCE_ERROR * t * t + _BLIND_FORCE * blind * blind),
            _FORCE_ERROR * t + _BLIND_FORCE * blind,
            _GYRO_ERROR * t + _BLIND_RATE * blind,
        )


def filled(
    missing: int,
    s: SensorFrame,
    read: StateEstimate,
    x: StateEstimate,
    arm_acceleration: Callable[[], JointVector],
) -> StateEstimate:
    """The state ``read`` from a frame ``s``, what is ``missing`` carried on from an estimate ``x``.

    ``arm_acceleration`` tells what the torques make of the joints [rad/s^2], where it is needed.
    """
    dt = min(max(1e-6 * (s.t_us - x.t_us), 0.0), 1.0)
    w, force, felt = read.w_WB_B, read.specific_force, s.accel_B
    if missing & INERTIAL:
        w, force, felt = x.w_WB_B, x.specific_force, (0.0, 0.0, -x.specific_force)
        if not missing & POSE and dt > 0.0:
            w, force = _from_poses(read, x, dt)
    elif not all(abs(one) < FORCE_LIMIT for one in felt):
        felt = (0.0, 0.0, -force)
    found = moved_on(x._replace(w_WB_B=w, specific_force=force), dt, felt)._replace(t_us=s.t_us)
    if not missing & POSE:
        found = found._replace(p_WB=read.p_WB, v_WB=read.v_WB, R_WB=read.R_WB, yaw=read.yaw)
    if not missing & JOINTS:
        return found._replace(q_arm=read.q_arm, qd_arm=read.qd_arm)
    pairs = zip(x.qd_arm, arm_acceleration(), strict=True)
    return found._replace(qd_arm=tuple([rate + dt * a for rate, a in pairs]))


def _from_poses(new: StateEstimate, x: StateEstimate, dt: float) -> tuple[Vec3, float]:
    """Rate and specific force, smoothed, from how the pose has changed in ``dt`` [s]."""
    q0, q, R = quaternion_from_matrix(x.R_WB), quaternion_from_matrix(new.R_WB), new.R_WB
    turn = rotation_vector(multiply(conjugate(q0), q))
    wx, wy, wz = [w + _RATE_SHARE * (t / dt - w) for w, t in zip(x.w_WB_B, turn, strict=True)]
    ax, ay, az = [(a - b) / dt for a, b in zip(new.v_WB, x.v_WB, strict=True)]
    force = -(R[2] * ax + R[5] * ay + R[8] * (az - GRAVITY))
    return (wx, wy, wz), x.specific_force + _RATE_SHARE * (force - x.specific_force)
