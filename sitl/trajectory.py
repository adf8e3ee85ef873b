"""End-effector references p_d(t) with exact derivatives, NED."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

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


@dataclass(frozen=True, slots=True)
class HoldReference:
    """Stay at one point."""

    hold: Hold

    def at(self, t: float) -> TrajectoryPoint:
        """See ``Reference``."""
        still = (0.0, 0.0, 0.0)
        return TrajectoryPoint(self.hold.position_m, still, still)


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
        if t > 0.5 * self.duration:
            s, rate, bend = self.at(self.duration - t)
            return self.duration - self.ramp - s, rate, -bend
        x = min(max(t / self.ramp, 0.0), 1.0)
        rate = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        bend = 30.0 * x * x * (1.0 - x) ** 2 / self.ramp
        # The integral of the smooth step: half a ramp is lost by starting slowly.
        s = self.ramp * x**4 * (2.5 - 3.0 * x + x * x) + max(t - self.ramp, 0.0)
        return s, rate, bend


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

    def _axis(self, i: int, s: float, rate: float, bend: float) -> V3:
        size = self.curve.amplitude_m[i]
        frequency = 2.0 * math.pi / self.curve.period_s[i]
        angle = frequency * s + math.radians(self.curve.phase_deg[i])
        sine, cosine = math.sin(angle), math.cos(angle)
        slope = size * frequency * cosine
        return (
            self.curve.centre_m[i] + size * sine,
            slope * rate,
            slope * bend - size * frequency**2 * sine * rate * rate,
        )


def reference(trajectory: Trajectory) -> Reference:
    """The reference that a scenario describes."""
    if isinstance(trajectory, Hold):
        return HoldReference(trajectory)
    return LissajousReference(trajectory, Warp(trajectory.ramp_s, trajectory.duration_s))
