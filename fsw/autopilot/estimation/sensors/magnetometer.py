r"""Magnetometer: the heading, but for the vehicle's own field, which stays and turns with it.

What a calibration leaves of the vehicle's own field is no noise: no number of readings takes it
away. Taken for noise, it averaged out: the filter was sure of the heading to a tenth of a degree
while that was off by three. It is considered (Schmidt): not estimated, but its covariance X with
the filter's error is carried on, and with the offset's variance B and a heading's slope J over it

.. math:: S = H P H^T + 2 H X J^T + J B J^T + R, \qquad K = (P H^T + X J^T) / S,

.. math:: P^+ = P - K S K^T, \qquad X^+ = X - K (H X + J B).

Any other measurement corrects X by I - K H. So P is the covariance of the error, offset included.

Source: S. F. Schmidt, Application of State-Space Methods to Navigation Problems, Advances in
Control Systems 3 (1966) 293; docs/decisions/0030-an-estimate-of-the-present.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from fsw.autopilot.estimation.error_state import ERRORS, FIELD, TH, Filter, Law, correct
from fsw.autopilot.estimation.faults.residuals import Aid
from fsw.autopilot.estimation.faults.sources import Source
from fsw.autopilot.estimation.fusion import clear
from fsw.autopilot.estimation.fusion_memory import NO_TURN, FusionMemory
from fsw.autopilot.estimation.sensors.base import (
    AidingSensor,
    LogField,
    LogTopic,
    Ratios,
    chi_square,
)
from fsw.autopilot.geometry.quaternion import turned
from fsw.autopilot.geometry.rotation import matrix_from_quaternion, rotate, wrap_angle
from fsw.autopilot.geometry.vectors import four, norm, three
from fsw.autopilot.measurements import MagneticSample, Sensor
from fsw.autopilot.signals import Vec3
from fsw.compiled import compilable, kernel, machine_code

_LEAST = 0.02  # Gauss across the vertical; less says nothing about the heading
_STRONGEST: Final = 5.0  # Gauss, ten times the Earth's
_STEADY: Final = 0.5  # s without a refused reading, until it is believed again


@dataclass(frozen=True, slots=True)
class MagnetometerTuning:
    """What a magnetometer is taken for."""

    noise: float = 0.01  # Gauss
    # What stays of each axis: 0.01 Gauss that a calibration leaves of hard iron, and 2 % of the
    # field's level part, 0.2 Gauss, of soft iron.
    offset: float = 0.011  # Gauss
    declination: float = math.radians(2.9)  # rad, at the default origin (World Magnetic Model 2020)
    gate: float = 5.0  # standard deviations; farther from what is expected is not fused


class Magnetometer(AidingSensor[MagneticSample, MagnetometerTuning]):
    """Of the field's strength and dip nothing is believed."""

    sensor = Sensor.MAGNETOMETER
    sample = MagneticSample
    measures = ("field",)
    at_rest = MagneticSample(0.0, (0.2, 0.0, 0.4))
    repeats = 10
    source = Source.COMPASS
    status_bit = 0x4
    ratios = (("heading",),)
    innovations = (("heading", 0, "rad, of the magnetometer"),)
    topic = LogTopic(
        "vehicle_magnetometer", "Magnetometer", (LogField("magnetometer_ga", "Gauss, body", 3),)
    )
    parameters = (
        ("EKF2_MAG_NOISE", "noise", "gauss", 0.001, 1.0,
         "Magnetometer: standard deviation of each axis"),
        ("EST_MAG_OFFSET", "offset", "gauss", 0.0, 0.2,
         "Magnetometer: standard deviation of what stays of each axis after a calibration"),
        ("EKF2_HDG_GATE", "gate", "SD", 1.0, 20.0, "Magnetometer: gate of the heading"),
        ("EKF2_MAG_DECL", "declination", "deg", -180.0, 180.0,
         "Magnetic declination, east positive", math.pi / 180.0),
    )  # fmt: skip

    def is_plausible(self, sample: MagneticSample) -> bool:
        """Not much stronger than the Earth's."""
        return 0.0 < norm(sample.field) < _STRONGEST

    def fuse(self, memory: FusionMemory, sample: MagneticSample, half: bool) -> Ratios:
        """As a heading."""
        # Garbage is within the gate now and then.
        believed = not any(
            one.kind is MagneticSample and sample.time - one.last < _STEADY for one in memory.runs
        )
        return (self.fuse_heading(memory.numbers, sample.time, sample.field, believed=believed),)

    def fuse_heading(self, x: Filter, time: float, field: Vec3, *, believed: bool) -> float:
        """Fuse the heading of a ``field`` [Gauss, FRD] of ``time`` [s]: chi-square over gate."""
        return fuse_heading(x, self.law, chi_square(self.tuning.gate, 1), time, field, believed)

    def aid(self, memory: FusionMemory, sample: MagneticSample) -> Aid:
        """The field."""
        return True, sample.time, sample.field, NO_TURN, self.tuning.noise, 0.0


@compilable
def heading_rows(x: Any, law: Any, field: Vec3, dt: float) -> bool:
    """The row of a magnetic ``field`` [Gauss, FRD]: its heading alone, ``dt`` [s] after the state.

    False where the field is too steep. Of the field's strength and dip nothing is believed.
    """
    clear(x, 1)
    w = three(x.rate, 0)
    R = matrix_from_quaternion(turned(four(x.q), dt * w[0], dt * w[1], dt * w[2]))
    north, east, down = rotate(R, field)
    level = north * north + east * east
    if not level > _LEAST * _LEAST:
        return False
    x.residual[0] = wrap_angle(law.declination - math.atan2(east, north))
    # Turning the body by its axis a turns the field's heading by a_z - z (x a_x + y a_y) / level.
    # Of the field as expected: slopes from the measured one go with its noise, and pull at tilt.
    size = math.sqrt(level)
    north, east = size * math.cos(law.declination), size * math.sin(law.declination)
    for i in range(3):
        x.H[0, TH + i] = R[6 + i] - down * (north * R[i] + east * R[3 + i]) / level
        x.offset_slope[i] = (east * R[i] - north * R[3 + i]) / level
    x.variance[0] = law.noise * law.noise / level
    return True


@machine_code
@kernel
def fuse_heading(
    filters: Filter, laws: Law, gate: float, time: float, field: Vec3, believed: bool
) -> float:
    """Fuse the heading of a magnetic ``field`` [Gauss, FRD] of ``time`` [s].

    ``gate`` [1] is a chi-square. One that is not ``believed``, though it is within its gate, says
    nothing: infinite.
    """
    x, law = filters[0], laws[0]
    if not heading_rows(x, law, field, time - x.time):
        x.innovation[0, 0] = 0.0
        return math.inf
    x.innovation[0, 0] = x.residual[0]
    ratio: float = distance_with_offset(x, law.offset) / gate
    if ratio <= 1.0:
        if not believed:
            return math.inf
        correct_with_offset(x, law.offset)
    return ratio


@compilable
def distance_with_offset(x: Any, offset: float) -> float:
    """Chi-square of a heading's residual; the ``offset`` [Gauss] is a deviation of each axis.

    Leaves behind what ``error_state.distance`` does.
    """
    M, X, H, J, W = x.covariance, x.with_offset, x.H, x.offset_slope, x.gain
    if not x.compass:
        X[:] = 0.0
        x.compass = 1
    variance = x.variance[0]
    for j in range(FIELD):
        variance += offset * offset * J[j] * J[j]
    for i in range(ERRORS):
        straight, through = 0.0, 0.0
        for j in range(ERRORS):
            straight += M[i, j] * H[0, j]
        for j in range(FIELD):
            through += X[i, j] * J[j]
        W[i, 0] = straight + through
        variance += H[0, i] * (straight + 2.0 * through)
    x.factor[0, 0] = math.sqrt(variance)
    x.residual[0] /= x.factor[0, 0]
    return float(x.residual[0] * x.residual[0])


@compilable
def correct_with_offset(x: Any, offset: float) -> None:
    """Take in the heading that ``distance_with_offset`` has judged; ``offset`` [Gauss] as there."""
    correct(x, 1)
    for i in range(ERRORS):
        for j in range(FIELD):
            share = offset * offset * x.offset_slope[j] / x.factor[0, 0]
            x.with_offset[i, j] -= x.gain[i, 0] * share
