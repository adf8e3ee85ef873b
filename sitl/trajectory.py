"""End-effector references p_d(t) with exact derivatives, NED."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from sitl.compiled import compilable
from sitl.plant.vector import Array
from sitl.scenario import Hold, Lissajous, Trajectory

V3 = tuple[float, float, float]


class TrajectoryPoint(NamedTuple):
    """The reference at one time."""

    p: V3  # m, NED
    v: V3  # m/s
    a: V3  # m/s²


class Reference(Protocol):
    """An end-effector reference; time counts from the pilot's trajectory start."""

    def at(self, t: float) -> TrajectoryPoint:
        """The reference ``t`` seconds after the start; at rest before 0."""
        ...

    def place(self, t: float) -> V3:
        """Position of ``at(t)`` alone [m, NED]."""
        ...


@dataclass(frozen=True, slots=True)
class HoldReference:
    """Stay at one point."""

    hold: Hold

    def at(self, t: float) -> TrajectoryPoint:
        """See ``Reference``."""
        still = (0.0, 0.0, 0.0)
        return TrajectoryPoint(self.hold.position_m, still, still)

    def place(self, t: float) -> V3:
        """See ``Reference``."""
        return self.hold.position_m


@dataclass(frozen=True, slots=True)
class Warp:
    """Own time s(t) of a curve that starts and stops smoothly.

    ds/dt follows the quintic smooth step from 0 to 1 over ``ramp`` and back before
    ``duration``, so that velocity and acceleration of any curve p(s) vanish at both ends.
    """

    ramp: float  # s, > 0
    duration: float  # s, >= 2 ramp

    def at(self, t: float) -> tuple[float, float, float]:
        """S [s], ds/dt and d²s/dt² [1/s] at ``t``."""
        return warped(t, self.ramp, self.duration)


@compilable
def warped(t: float, ramp: float, duration: float) -> tuple[float, float, float]:
    """``Warp.at`` of a ramp and a duration [s]."""
    # The second half is the first one backwards.
    backwards = t > 0.5 * duration
    passed = duration - t if backwards else t
    x = min(max(passed / ramp, 0.0), 1.0)
    rate = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    bend = 30.0 * x * x * (1.0 - x) ** 2 / ramp
    # The integral of the smooth step: half a ramp is lost by starting slowly.
    s = ramp * x**4 * (2.5 - 3.0 * x + x * x) + max(passed - ramp, 0.0)
    if backwards:
        return duration - ramp - s, rate, -bend
    return s, rate, bend


@compilable
def swung(centre: float, size: float, period: float, phase: float, s: float) -> float:
    """One coordinate of a Lissajous curve [m] at its own time ``s`` [s]; phase in degrees."""
    return centre + size * math.sin(2.0 * math.pi / period * s + math.radians(phase))


@dataclass(frozen=True, slots=True)
class LissajousReference:
    """p = c + A sin(2π s/T + φ) per axis, with s from ``Warp``."""

    curve: Lissajous
    warp: Warp

    def at(self, t: float) -> TrajectoryPoint:
        """See ``Reference``."""
        s, rate, bend = self.warp.at(t)
        x, y, z = (self._axis(i, s, rate, bend) for i in range(3))
        return TrajectoryPoint((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))

    def place(self, t: float) -> V3:
        """See ``Reference``."""
        s, curve = self.warp.at(t)[0], self.curve
        (cx, cy, cz), (ax, ay, az) = curve.centre_m, curve.amplitude_m
        (tx, ty, tz), (px, py, pz) = curve.period_s, curve.phase_deg
        return swung(cx, ax, tx, px, s), swung(cy, ay, ty, py, s), swung(cz, az, tz, pz, s)

    def _axis(self, i: int, s: float, rate: float, bend: float) -> V3:
        size = self.curve.amplitude_m[i]
        frequency = 2.0 * math.pi / self.curve.period_s[i]
        angle = frequency * s + math.radians(self.curve.phase_deg[i])
        sine, cosine = math.sin(angle), math.cos(angle)
        slope = size * frequency * cosine
        return (
            swung(self.curve.centre_m[i], size, self.curve.period_s[i], self.curve.phase_deg[i], s),
            slope * rate,
            slope * bend - size * frequency**2 * sine * rate * rate,
        )


def reference(trajectory: Trajectory) -> Reference:
    """The reference that a scenario describes."""
    if isinstance(trajectory, Hold):
        return HoldReference(trajectory)
    return LissajousReference(trajectory, Warp(trajectory.ramp_s, trajectory.duration_s))


def curve_row(trajectory: Trajectory) -> Array:
    """Numbers of a curve for ``place_on_curve``: centre, amplitude, period, phase, warp."""
    if isinstance(trajectory, Hold):
        still = (0.0,) * 3
        return np.array([*trajectory.position_m, *still, *(1.0,) * 3, *still, 1.0, 2.0])
    curve = trajectory
    shape = (*curve.centre_m, *curve.amplitude_m, *curve.period_s, *curve.phase_deg)
    return np.array([*shape, curve.ramp_s, curve.duration_s])


@compilable
def place_on_curve(row: Array, t: float) -> V3:
    """``Reference.at(t).p`` of the curve whose ``curve_row`` it is [m, NED]."""
    s = warped(t, row[12], row[13])[0]
    return (
        swung(row[0], row[3], row[6], row[9], s),
        swung(row[1], row[4], row[7], row[10], s),
        swung(row[2], row[5], row[8], row[11], s),
    )
