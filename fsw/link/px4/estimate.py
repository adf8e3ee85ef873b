"""PX4's estimate as a frame of readings: what it sends at several rates, moved on to one instant.

ATTITUDE_QUATERNION comes 250 times a second and says when the frame is; ODOMETRY comes half as
often, so its position and velocity are moved on to that instant by what the vehicle's lean says of
its acceleration. PX4 says in which frame the velocity is: in the world's (what it sends) or in the
body's. Taken for the other one it flies well until the yaw turns.

The vehicle's time is PX4's, as its messages are stamped; after a restart of PX4, whose time then
begins anew, it goes on. TIMESYNC is answered, and asked: half of a round trip is how long a message
is under way, which is part of the delay that plans count on.
"""

from __future__ import annotations

import math
from typing import Final, cast

from fsw.autopilot.geometry.rotation import matrix_from_quaternion, rotate, yaw_of
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.signals import JointVector, SensorFrame, Vec3, Vec4
from fsw.link.px4.messages import CompanionWriter, vector, velocity_frame
from fsw.link.wire.decode import Numbers

OLDEST_US: Final = 100_000  # a position that is older is none
_NO_VECTOR: Final = (math.nan, math.nan, math.nan)
ASK_US: Final = 1_000_000
_KEPT: Final = 32
_BACK_US: Final = 300_000  # a stamp that is so much behind is of another start
_UPRIGHT: Final = 0.5  # least cosine of the tilt for which the lean says what accelerates it


class Px4Estimate:
    """The newest that PX4 has said of itself."""

    def __init__(self) -> None:
        self.t_us = -1  # of the newest attitude, PX4's time
        self.resets = 0  # of the estimate, that it has told of
        self._reset_counter: int | None = None
        self._odometry_us = -1
        self._p: Vec3 = _NO_VECTOR
        self._v: Vec3 = _NO_VECTOR  # NED
        self._q: Vec4 = (math.nan,) * 4
        self._w: Vec3 = _NO_VECTOR

    @property
    def age_us(self) -> int:
        """How much older the newest position is than the newest attitude; -1: there is none."""
        return self.t_us - self._odometry_us if self._odometry_us >= 0 else -1

    @property
    def yaw(self) -> float:
        """Of the newest attitude [rad]."""
        return yaw_of(matrix_from_quaternion(self._q))

    def forget(self) -> None:
        """PX4 has started anew, and so has its time."""
        self.__init__()  # type: ignore[misc]

    def take_odometry(self, values: Numbers) -> bool:
        """Believe an ODOMETRY; False where it is in a frame that has no meaning here."""
        q = cast(Vec4, tuple(values[4:8]))
        v, frame = vector(values, 8), velocity_frame(values)
        if not frame:
            return False
        counter = int(values[58])
        if self._reset_counter is not None and counter != self._reset_counter:
            self.resets += 1
        self._reset_counter = counter
        self._odometry_us, self._p = int(values[0]), vector(values, 1)
        self._v = rotate(matrix_from_quaternion(q), v) if frame == "body" else v
        return True

    def take_attitude(self, values: Numbers) -> bool:
        """Believe an ATTITUDE_QUATERNION; False where it is no newer than the last."""
        t_us = 1000 * int(values[0])
        if t_us <= self.t_us:
            return False
        self.t_us, self._q, self._w = t_us, cast(Vec4, tuple(values[1:5])), vector(values, 5)
        return True

    def frame(self, ahead_us: int, q_arm: JointVector, qd_arm: JointVector) -> SensorFrame:
        """Readings of now, the newest attitude's instant, ``ahead_us`` [us] later by our time.

        Position and velocity are no numbers where they are too old.
        """
        R = matrix_from_quaternion(self._q)
        # Vertically in balance, as far as is known.
        force = GRAVITY / max(R[8], _UPRIGHT)
        a = -force * R[2], -force * R[5], 0.0
        age_us = self.age_us
        p, v = _NO_VECTOR, _NO_VECTOR
        if -OLDEST_US < age_us < OLDEST_US and self._odometry_us >= 0:
            age = 1e-6 * age_us
            p = _moved(self._p, self._v, a, age)
            v = _moved(self._v, a, (0.0, 0.0, 0.0), age)
        t_us = self.t_us + ahead_us
        return SensorFrame(t_us, p, v, self._q, self._w, (0.0, 0.0, -force), q_arm, qd_arm)


class Px4Clock:
    """Stamps of one PX4."""

    def __init__(self) -> None:
        self.ahead_us = 0  # of the vehicle's time over PX4's
        self.restarts = 0
        self._newest_us = 0  # vehicle's time
        self._stamp_us = 0  # PX4's
        self._trips_us: list[int] = []

    def take(self, stamp_us: int) -> bool:
        """Take a stamp of PX4 [us]; whether PX4 has started anew since the last one.

        Vehicle's time goes on where PX4's begins anew, or has stood still while PX4 was silent.
        """
        again = stamp_us < self._stamp_us - _BACK_US
        self.restarts += again
        self._stamp_us = stamp_us
        behind_us = self._newest_us - (stamp_us + self.ahead_us)
        if behind_us > _BACK_US or (again and behind_us > 0):
            self.ahead_us += behind_us + 1
        self._newest_us = max(self._newest_us, stamp_us + self.ahead_us)
        return again

    def passed(self, t_us: int) -> None:
        """Vehicle's time [us] has gone on without a stamp: PX4 is silent."""
        self._newest_us = max(self._newest_us, t_us)

    def answer(self, answered_ns: int, sent_ns: int, now_us: int, writer: CompanionWriter) -> bytes:
        """What a TIMESYNC of PX4 is answered, at ``now_us`` [us] of ours; nothing to an answer."""
        if answered_ns == 0:
            return writer.time_sync(1000 * now_us, sent_ns)
        trip_us = now_us - sent_ns // 1000
        if 0 <= trip_us < ASK_US:
            self._trips_us = [*self._trips_us[-_KEPT + 1 :], trip_us]
        return b""

    @property
    def round_trip_us(self) -> int | None:
        """Of late, the median; None: PX4 has not answered yet."""
        trips = sorted(self._trips_us)
        return trips[len(trips) // 2] if trips else None


def _moved(p: Vec3, v: Vec3, a: Vec3, seconds: float) -> Vec3:
    """``p`` [SI] after some ``seconds`` [s] of ``v`` and half of ``a``, its derivatives [SI]."""
    t, half = seconds, 0.5 * seconds * seconds
    return (
        p[0] + t * v[0] + half * a[0],
        p[1] + t * v[1] + half * a[1],
        p[2] + t * v[2] + half * a[2],
    )
