"""Whether pose and inertial unit of exact frames say the same of how the vehicle moves."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from fsw.compiled import compilable
from fsw.estimation.sensor_fault import Sensor, SensorFault
from fsw.geometry.vectors import norm
from fsw.signals import Vec3

# Changes of the pose are compared with the inertial unit over so many frames. Poses that are noisy
# by 5 mrad and 20 mm/s are still within this.
WINDOW_FRAMES: Final = 25
_TURN_APART: Final = 0.02  # rad
_SPEED_APART: Final = 0.07  # m/s
# What is constant to the last bit, and the pose shows a change from one window to the next.
_TURN_SEEN: Final = 1e-8  # rad
_SPEED_SEEN: Final = 1e-6  # m/s
_BAD: Final = 2  # windows in a row until a sensor is doubted
_GOOD_AGAIN: Final = 5  # until it is believed again; twice as many each time
_MOST_GOOD: Final = 100
PROBATION_US: Final = 5_000_000  # of a pose that was not used, or was away for long
_NO_SUM: Final[Vec3] = (0.0, 0.0, 0.0)


class Window(NamedTuple):
    """Sums over some frames."""

    frames: int = 0
    turn: Vec3 = _NO_SUM  # rad, of the pose, FRD, minus that of the gyro
    speed: Vec3 = _NO_SUM  # m/s, NED, of the pose minus that of the accelerometer
    same_rate: int = 0  # frames with the gyro's last reading
    same_force: int = 0  # the same of the accelerometer


EMPTY_WINDOW: Final = Window()


class Agreement(NamedTuple):
    """Whether pose and inertial unit say the same of how the vehicle moves.

    A gyro that disagrees alone is wrong, an accelerometer as well; where both do the pose is, and
    so it is where it has failed lately.
    """

    turn: int = 0  # windows in a row in which the gyro disagreed
    speed: int = 0  # the same of the accelerometer
    good: int = 0  # windows in a row in which neither did
    doubted: Sensor | None = None
    fault: SensorFault = SensorFault.NONE
    again: int = _GOOD_AGAIN  # good windows that it takes to be believed
    # When the pose was not used last; -1: never, or the inertial unit failed since.
    pose_failed_us: int = -1
    last: Window | None = None

    def after(self, window: Window, now_us: int) -> Agreement:
        """The judgement after a whole window, at ``now_us`` [us]."""
        turn, speed = norm(window.turn), norm(window.speed)
        last = window if self.last is None else self.last
        still = window.same_rate >= WINDOW_FRAMES and math.dist(window.turn, last.turn) > _TURN_SEEN
        held = (
            window.same_force >= WINDOW_FRAMES and math.dist(window.speed, last.speed) > _SPEED_SEEN
        )
        turns = self.turn + 1 if still or not turn < _TURN_APART else 0
        speeds = self.speed + 1 if held or not speed < _SPEED_APART else 0
        good = 0 if turns or speeds else self.good + 1
        after = self._replace(turn=turns, speed=speeds, good=good, last=window)
        if still or held:
            return after._doubting(Sensor.IMU, SensorFault.STUCK)
        if max(turns, speeds) >= _BAD:
            lately = self.pose_failed_us >= 0 and now_us - self.pose_failed_us <= PROBATION_US
            of_pose = lately or min(turns, speeds) >= _BAD
            sensor = Sensor.POSE if of_pose else Sensor.IMU
            return after._doubting(sensor, SensorFault.DISAGREES)
        if self.doubted is not None and good >= self.again:
            again = min(2 * self.again, _MOST_GOOD)
            return Agreement(again=again, pose_failed_us=self.pose_failed_us, last=window)
        return after

    def after_calm(self, windows: int, last: Window) -> Agreement:
        """``after`` some ``windows`` of which ``is_calm`` is true, the ``last`` of them given."""
        return self._replace(turn=0, speed=0, good=self.good + windows, last=last)

    def without_pose(self) -> Agreement:
        """The judgement after a pose has been found to be late."""
        return self._replace(good=0)._doubting(Sensor.POSE, SensorFault.DISAGREES)

    def _doubting(self, sensor: Sensor, fault: SensorFault) -> Agreement:
        if self.doubted is not None:
            return self
        return self._replace(doubted=sensor, fault=fault)


AGREED: Final = Agreement()


@compilable
def is_calm(frames: int, turn: Vec3, speed: Vec3, same_rate: int, same_force: int) -> bool:
    """Whether neither sensor disagrees in a window of these sums, nor could be stuck.

    ``turn`` [rad, FRD], ``speed`` [m/s, NED].
    """
    near = norm(turn) < _TURN_APART and norm(speed) < _SPEED_APART
    return near and same_rate < frames and same_force < frames
