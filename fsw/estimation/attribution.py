"""Whether the pose or the inertial unit is wrong, where they contradict each other by little.

Poses are compared with what the inertial unit makes of the last ones, so that a unit which is off
by a constant and poses that run away look alike. After a while the filter shows what it takes to
make both agree: other biases. A third witness says whether the unit's readings have changed by
them. Of the gyro it is how quickly its readings changed: no vehicle begins to turn within 2 ms. Of
the accelerometer it is the rotors' model: thrust over mass is what a multirotor feels.

A step of the gyro opens a dispute before anything contradicts: the filter takes it for a bias that
may have moved (``error_state.advance``), and what is measured then need not be refused.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from fsw.estimation.error_state import BA, BG, FORCE, IMU_CAPACITY, LOST, NO_FORCE
from fsw.estimation.imu import STEPS_APART
from fsw.estimation.sensor_fault import Sensor
from fsw.geometry.vectors import add_scaled, dot, norm, subtract
from fsw.signals import Vec3

_SETTLED: Final = 0.2  # s after the last pose that was refused, until biases are known anew
_LATEST: Final = 0.7  # s after the first one, when it is said who was wrong
_HOLDS: Final = 2.0  # s after the last one, for which that is the answer to the next one too
_STEPPED: Final = 1.0  # s, for which a step of the gyro is remembered
_SIGMAS: Final = 3.0  # of a bias, and
_LEAST_RATE: Final = 0.03  # rad/s, that it has moved at least
_LEAST_FORCE: Final = 0.05  # m/s^2
# What the witness must have seen: more than half of how the bias has moved, and more than this of
# a force, because gusts, the arm and what is wrong with the mass make as much.
_HALF: Final = 0.5
_SEEN_FORCE: Final = 0.3  # m/s^2
_NONE: Final[Vec3] = (0.0, 0.0, 0.0)


class Biases(NamedTuple):
    """What the filter takes the inertial unit to be off by, and how well it knows that."""

    force: Vec3  # m/s^2, FRD
    rate: Vec3  # rad/s, FRD
    force_sigma: float  # m/s^2, standard deviation on the axis on which it is least known
    rate_sigma: float  # rad/s


class Witness(NamedTuple):
    """By how much the readings have changed with nothing on the vehicle that explains it."""

    force: Vec3 = _NONE  # m/s^2, FRD, the mean of some readings
    rate: Vec3 = _NONE  # rad/s, FRD
    readings: int = 0  # of the accelerometer


class Dispute(NamedTuple):
    """Poses that contradict the inertial unit by little, or a gyro that has stepped."""

    since: float  # s, of the tick in which the first of them was refused, or of the step
    last: float  # s, the same of the last one
    refused: int  # how many were; none yet where a step of the gyro has opened it
    turned: bool  # whether the attitude of the first one contradicted
    before: Biases  # when it began
    witness: Witness | None = None  # not asked yet
    wrong: Sensor | None = None  # not known yet

    def is_over(self, now: float) -> bool:
        """Whether the next contradiction is another one, at ``now`` [s]."""
        return now - self.last > _HOLDS

    def is_due(self, now: float) -> bool:
        """Whether it can be said at ``now`` [s] who is wrong.

        After a step of the gyro at any time: its bias is free to move. A single pose that was
        refused moves no bias at once: the filter knows them too well.
        """
        settled = self.refused > 1 and now - self.last >= _SETTLED
        return self.refused == 0 or settled or now - self.since >= _LATEST


def contradicted(dispute: Dispute | None, now: float, x: Any, *, turned: bool) -> Dispute:
    """The dispute after one more pose was refused at ``now`` [s] by a filter's record ``x`` [SI].

    Its attitude contradicts if it is ``turned``.
    """
    if dispute is None:
        return Dispute(now, now, 1, turned, biases(x))
    if dispute.refused == 0:
        return dispute._replace(since=now, last=now, refused=1, turned=turned, witness=None)
    return dispute._replace(last=now, refused=dispute.refused + 1)


def stepped(dispute: Dispute | None, x: Any) -> Dispute:
    """The ``dispute`` after the newest step of the gyro, of a filter's record ``x`` [SI].

    Steps that follow each other are one. Where poses contradict already, it is theirs.
    """
    at = float(x["stepped"])
    if dispute is not None and (dispute.refused or at <= dispute.last):
        return dispute
    if dispute is None or at - dispute.last > STEPS_APART:
        return Dispute(at, at, 0, True, biases(x), witness(x, at))
    return dispute._replace(last=at, witness=witness(x, at))


def biases(x: Any) -> Biases:
    """Those of a filter's record ``x`` [SI]."""
    M = x["covariance"]
    return Biases(
        tuple(x["accel_bias"].tolist()),
        tuple(x["gyro_bias"].tolist()),
        math.sqrt(max(M[k, k] for k in range(BA, BA + 3))),
        math.sqrt(max(M[k, k] for k in range(BG, BG + 3))),
    )


def witness(x: Any, now: float) -> Witness:
    """What is known when a dispute begins, of a filter's record ``x`` [SI] at ``now`` [s]."""
    recent = now - float(x["stepped"]) <= _STEPPED
    return Witness(rate=tuple(x["step"].tolist())) if recent else Witness()


def felt(seen: Witness, x: Any, before: Biases, model: Vec3) -> Witness:
    """What is ``seen`` [SI] with the newest reading in a filter's record ``x`` [SI].

    A mean of many readings has less of gusts and of what rotors shake. Biases ``before`` [SI] are
    those that nobody contradicted. The ``model`` [SI, FRD] is that of ``imu.add_imu``: its last
    entry is thrust over mass, or 0 where it is not known.
    """
    row = x["imu"][(int(x["end"]) - 1) % IMU_CAPACITY].tolist()
    if int(row[LOST]) & NO_FORCE or not model[2] > 0.0:
        return seen
    readings = seen.readings + 1
    felt_now = row[FORCE], row[FORCE + 1], row[FORCE + 2] + model[2]
    change = subtract(subtract(felt_now, before.force), seen.force)
    return seen._replace(force=add_scaled(seen.force, change, 1.0 / readings), readings=readings)


def wrong(dispute: Dispute, now: Biases) -> Sensor:
    """Who is wrong by the witness of a ``dispute``, when biases are as they are ``now`` [SI].

    The inertial unit, if its readings have changed as its biases have; the pose otherwise.
    """
    seen, before = dispute.witness, dispute.before
    if seen is None:
        return Sensor.POSE
    least_rate = _LEAST_RATE + _SIGMAS * now.rate_sigma
    if _explains(seen.rate, before.rate, now.rate, least_rate, 0.0):
        return Sensor.IMU
    least_force = _LEAST_FORCE + _SIGMAS * now.force_sigma
    forced = _explains(seen.force, before.force, now.force, least_force, _SEEN_FORCE)
    # An accelerometer that is wrong turns no attitude.
    return Sensor.IMU if forced and not dispute.turned else Sensor.POSE


def _explains(seen: Vec3, before: Vec3, now: Vec3, least_moved: float, least_seen: float) -> bool:
    """Whether what was ``seen`` is nearer to how a bias has moved than to nothing."""
    moved = subtract(now, before)
    size = norm(moved)
    if not size > least_moved:
        return False
    return dot(seen, moved) / size > max(_HALF * size, least_seen)
