"""End-effector references p_d(t) with exact derivatives, NED."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from sitl.compiled import compilable
from sitl.plant.vector import Array
from sitl.scenario import V3, Circle, Hold, Lissajous, Points, Push, Trajectory

_LISSAJOUS: Final = 14  # numbers of a curve of sinusoids; polynomials have others


class TrajectoryPoint(NamedTuple):
    """The reference at one time."""

    p: V3  # m, NED
    v: V3  # m/s
    a: V3  # m/s²
    force: float = 0.0  # N, to press with


@compilable
def warped(t: float, ramp: float, duration: float) -> tuple[float, float, float]:
    """Own time s [s] of a curve that starts and stops smoothly, ds/dt [1] and d²s/dt² [1/s].

    At t [s] after the start ds/dt has followed the quintic smooth step from 0 to 1 over ``ramp``
    [s] and goes back before ``duration`` [s], at least 2 ramps, so that velocity and acceleration
    of any curve p(s) vanish at both ends.
    """
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
def lissajous_at(centre: float, amplitude: float, period: float, phase: float, s: float) -> float:
    """One coordinate [m] of a Lissajous curve at its own time s [s], from ``warped``.

    It swings about ``centre`` [m] by ``amplitude`` [m] with ``period`` [s] and ``phase`` [deg].
    """
    return centre + amplitude * math.sin(2.0 * math.pi / period * s + math.radians(phase))


@dataclass(frozen=True, slots=True)
class Reference:
    """p = c + A sin(2π s/T + φ) per axis, with s from ``warped``; to hold a point, A is zero.

    Time counts from the pilot's trajectory start.
    """

    row: tuple[float, ...]  # as ``curve_row``

    def at(self, t: float) -> TrajectoryPoint:
        """The reference at time t [s] after the start; at rest before 0."""
        s, rate, bend = warped(t, self.row[12], self.row[13])
        x, y, z = (self._axis(i, s, rate, bend) for i in range(3))
        return TrajectoryPoint((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))

    def place(self, t: float) -> V3:
        """Position of ``at(t)`` alone [m, NED]; t [s]."""
        return place_on_curve(self.row, t)

    def _axis(self, i: int, s: float, rate: float, bend: float) -> V3:
        centre, size, period, phase = self.row[i:12:3]
        frequency = 2.0 * math.pi / period
        angle = frequency * s + math.radians(phase)
        sine, cosine = math.sin(angle), math.cos(angle)
        slope = size * frequency * cosine
        return (
            lissajous_at(centre, size, period, phase, s),
            slope * rate,
            slope * bend - size * frequency**2 * sine * rate * rate,
        )


class PiecewiseReference(Reference):
    """A curve of polynomials, one after the other; it stands still before and after them."""

    def at(self, t: float) -> TrajectoryPoint:
        """The reference at time t [s] after the start; at rest before and after."""
        p, v, a = _on_pieces(self.row, t)
        return TrajectoryPoint(p, v, a)


@dataclass(frozen=True, slots=True)
class PressingReference(PiecewiseReference):
    """The same with a force to press with [N], the first coordinate of a curve of its own."""

    force_row: tuple[float, ...]

    def at(self, t: float) -> TrajectoryPoint:
        """The reference at time t [s] after the start, with its force."""
        p, v, a = _on_pieces(self.row, t)
        return TrajectoryPoint(p, v, a, self.force(t))

    def force(self, t: float) -> float:
        """The force alone [N]; t [s]."""
        return _on_pieces(self.force_row, t)[0][0]


def reference(trajectory: Trajectory) -> Reference:
    """The reference that a scenario describes."""
    row = curve_row(trajectory)
    if isinstance(trajectory, Push):
        return PressingReference(row, _smooth_row(_press_legs(trajectory), of_force=True))
    return Reference(row) if len(row) == _LISSAJOUS else PiecewiseReference(row)


def curve_row(trajectory: Trajectory) -> tuple[float, ...]:
    """Numbers of a curve for ``place_on_curve``.

    Of sinusoids centre, amplitude, period, phase and warp; of polynomials how many there are, the
    coefficients of each, the times [s] between them, and the coefficients, the highest power first.
    """
    curve = trajectory
    if isinstance(curve, Hold):
        still = (0.0,) * 3
        return (*curve.position_m, *still, *(1.0,) * 3, *still, 1.0, 2.0)
    if isinstance(curve, Circle):
        # North is the cosine of the bearing from the centre, east its sine; clockwise it grows.
        size, begin = curve.radius_m, curve.start_deg
        north, east = (begin + 90.0, begin) if curve.clockwise else (90.0 - begin, 180.0 - begin)
        shape = (*curve.centre_m, size, size, 0.0, *(curve.period_s,) * 3, north, east, 0.0)
        return (*shape, curve.ramp_s, curve.duration_s)
    if isinstance(curve, Lissajous):
        shape = (*curve.centre_m, *curve.amplitude_m, *curve.period_s, *curve.phase_deg)
        return (*shape, curve.ramp_s, curve.duration_s)
    if isinstance(curve, Points):
        return _spline_row(curve)
    if isinstance(curve, Push):
        return _smooth_row(_press_legs(curve), of_force=False)
    order = max(len(curve.north), len(curve.east), len(curve.down))
    axes = (curve.north, curve.east, curve.down)
    rows = [part for axis in axes for part in (*(0.0,) * (order - len(axis)), *reversed(axis))]
    return (1.0, float(order), 0.0, curve.duration_s, *rows)


def _spline_row(curve: Points) -> tuple[float, ...]:
    """The cubic spline through points, with a continuous acceleration."""
    from scipy.interpolate import CubicSpline  # here: it takes a third of a second to load

    times, places = np.array(curve.time_s), np.array(curve.position_m)
    ends = "clamped" if curve.ends == "rest" else "not-a-knot"
    found = CubicSpline(times, places, axis=0, bc_type=ends).c  # (4, pieces, 3)
    pieces = found.transpose(1, 2, 0).reshape(-1)
    return (float(len(times) - 1), 4.0, *curve.time_s, *pieces.tolist())


class _Leg(NamedTuple):
    """From one place and force to another, by smooth steps."""

    takes_s: float
    begin: V3  # m, NED
    end: V3
    force: tuple[float, float]  # N, at both ends


def _press_legs(curve: Push) -> list[_Leg]:
    """All legs, the ones that take no time left out."""

    def ahead(place: V3, by: V3, share: float = 1.0) -> V3:
        x, y, z = (p + share * d for p, d in zip(place, by, strict=True))
        return (x, y, z)

    legs: list[_Leg] = []
    still, slides = (0.0, 0.0), curve.slide_m or ((0.0, 0.0, 0.0),) * len(curve.position_m)
    for place, force, hold_s, slide in zip(
        curve.position_m, curve.force_n, curve.hold_s, slides, strict=True
    ):
        left, off = ahead(place, slide), ahead(place, curve.normal, curve.away_m)
        if legs:
            legs.append(_Leg(curve.move_s, legs[-1].end, off, still))
        legs += [
            _Leg(curve.approach_s, off, place, still),
            _Leg(curve.ramp_s, place, place, (0.0, force)),
            _Leg(hold_s, place, left, (force, force)),
            _Leg(curve.ramp_s, left, left, (force, 0.0)),
            _Leg(curve.approach_s, left, ahead(left, curve.normal, curve.away_m), still),
        ]
    return [leg for leg in legs if leg.takes_s > 0.0]


def _smooth_row(legs: list[_Leg], *, of_force: bool) -> tuple[float, ...]:
    """Quintic smooth steps, at rest at both ends of each leg."""
    times, pieces = [0.0], list[float]()
    for leg in legs:
        ends = (
            (leg.force, (0.0, 0.0), (0.0, 0.0))
            if of_force
            else tuple(zip(leg.begin, leg.end, strict=True))
        )
        t = leg.takes_s
        for begin, end in ends:
            by = end - begin
            pieces += [6.0 * by / t**5, -15.0 * by / t**4, 10.0 * by / t**3, 0.0, 0.0, begin]
        times.append(times[-1] + t)
    return (float(len(legs)), 6.0, *times, *pieces)


@compilable
def place_on_curve(row: Sequence[float] | Array, t: float) -> V3:
    """``Reference.at(t).p`` [m, NED] of the curve with the ``curve_row`` row (n,) [SI]; t [s]."""
    if len(row) != _LISSAJOUS:
        return _on_pieces(row, t)[0]
    s = warped(t, row[12], row[13])[0]
    return (
        lissajous_at(row[0], row[3], row[6], row[9], s),
        lissajous_at(row[1], row[4], row[7], row[10], s),
        lissajous_at(row[2], row[5], row[8], row[11], s),
    )


@compilable
def _on_pieces(row: Sequence[float] | Array, t: float) -> tuple[V3, V3, V3]:
    """Position [m, NED], velocity [m/s] and acceleration [m/s²] on polynomials (n,) at t [s]."""
    pieces, order = int(row[0]), int(row[1])
    at = min(max(t, row[2]), row[2 + pieces])
    low, high = 0, pieces - 1
    while low < high:  # the last piece that has begun
        middle = (low + high + 1) // 2
        if row[2 + middle] <= at:
            low = middle
        else:
            high = middle - 1
    s, first = at - row[2 + low], 3 + pieces + 3 * order * low
    x = _horner(row, first, order, s)
    y = _horner(row, first + order, order, s)
    z = _horner(row, first + 2 * order, order, s)
    p = (x[0], y[0], z[0])
    if t != at:
        return p, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    return p, (x[1], y[1], z[1]), (x[2], y[2], z[2])


@compilable
def _horner(
    row: Sequence[float] | Array, first: int, order: int, s: float
) -> tuple[float, float, float]:
    """A polynomial and its two derivatives at s [s], from its coefficients (order,) in ``row``."""
    p = v = a = 0.0
    for k in range(first, first + order):
        a = a * s + 2.0 * v
        v = v * s + p
        p = p * s + row[k]
    return p, v, a
