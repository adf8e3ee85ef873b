r"""The lag of PX4's loops, found from a short manoeuvre: a few pushes along each axis.

PX4 is asked for pushes that end where they began, and its gains are known from its parameters. So
what its position loop commands at each instant is known, c of ``px4_loops.py``, and how its
attitude follows is seen as the vehicle leans. Of

.. math:: \tau \dddot a + \ddot a = k_p(c - a) - k_d \dot a

the three numbers are those with which the simulated lean is nearest to the one that was seen, by
least squares, with a constant beside it for what PX4's integral holds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter

from fsw.autopilot.control.px4_loops import Px4Tuning
from fsw.autopilot.geometry.rotation import matrix_from_quaternion, yaw_of
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import JointVector, SensorFrame, Setpoint, Vec3

_PUSH: Final = 1.0  # m/s^2
_LENGTHS_S: Final = (0.2, 0.3, 0.45)  # of the first quarter of a push
_REST_S: Final = 1.2  # before and after each
_STEP_S: Final = 0.004  # of the grid that is fitted on
_WORST: Final = 0.35  # share of the lean that may be left unexplained


class Pushed(NamedTuple):
    """One instant of the manoeuvre."""

    t: float  # s
    asked: tuple[Vec3, Vec3, Vec3]  # m, m/s, m/s^2: the setpoint
    p: Vec3  # m
    v: Vec3  # m/s
    lean: tuple[float, float]  # m/s^2, the acceleration that the attitude says


class Manoeuvre:
    """Pushes along north, then east, from where the vehicle is when they begin."""

    def __init__(self) -> None:
        self.seen: list[Pushed] = []
        self._begin: tuple[float, Vec3, float] | None = None

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return 2.0 * sum(4.0 * one + _REST_S for one in _LENGTHS_S) + _REST_S

    def done(self, t_us: int) -> bool:
        """Whether it is over at a time [us]."""
        return self._begin is not None and 1e-6 * t_us > self._begin[0] + self.seconds

    def stop(self) -> None:
        """Begin anew, from wherever the vehicle is then."""
        self.seen, self._begin = [], None

    def step(self, frame: SensorFrame, q_arm: JointVector) -> Setpoint:
        """What PX4 is asked for by readings, with joints at ``q_arm`` [rad]; notes what is seen."""
        t, R = 1e-6 * frame.t_us, matrix_from_quaternion(frame.q_WB)
        if self._begin is None:
            self._begin = t, frame.p_WB, yaw_of(R)
        begun, place, yaw = self._begin
        p, v, a = _asked(t - begun)
        p = (p[0] + place[0], p[1] + place[1], place[2])
        f = GRAVITY / max(R[8], 0.5)
        lean = -f * R[2], -f * R[5]
        if math.isfinite(frame.p_WB[0]):
            self.seen.append(Pushed(t, (p, v, a), frame.p_WB, frame.v_WB, lean))
        return Setpoint(p, v, a, yaw, 0.0, q_arm)


def _asked(since: float) -> tuple[Vec3, Vec3, Vec3]:
    """Place [m], velocity [m/s] and acceleration [m/s^2] so many seconds [s] after the begin."""
    at = _REST_S
    for axis in range(2):
        for length in _LENGTHS_S:
            if at <= since < at + 4.0 * length:
                along = _push(since - at, length)
                p, v, a = (tuple([x if k == axis else 0.0 for k in range(3)]) for x in along)
                return p, v, a  # type: ignore[return-value]
            at += 4.0 * length + _REST_S
    none = (0.0, 0.0, 0.0)
    return none, none, none


def _push(t: float, length: float) -> Vec3:
    """Place, velocity and acceleration of a push: one part on, two back, one on, at rest again."""
    n = length
    if t < n:
        return 0.5 * _PUSH * t * t, _PUSH * t, _PUSH
    if t < 3.0 * n:
        back = t - n
        return _PUSH * (0.5 * n * n + n * back - 0.5 * back * back), _PUSH * (n - back), -_PUSH
    left = 4.0 * n - t
    return 0.5 * _PUSH * left * left, -_PUSH * left, _PUSH


@dataclass(frozen=True, slots=True)
class Identified:
    """PX4's loops as they were found."""

    px4: Px4Tuning
    unexplained: float  # share of the lean, root mean square

    @property
    def refusal(self) -> str:
        """Why it is of no use; empty: it is."""
        if self.unexplained <= _WORST:
            return ""
        return (
            f"{self.unexplained:.0%} of the lean is not what such a loop does, and at most "
            f"{_WORST:.0%} may be: fly it in still air, with PX4's parameters unchanged"
        )


def identify(seen: list[Pushed], px4: Px4Tuning) -> Identified:
    """The lag of the loops with the gains of ``px4``.

    Raises:
        ValueError: Too little was seen.
    """
    if len(seen) < 500 or seen[-1].t - seen[0].t < 5.0:
        raise ValueError("too little of the manoeuvre was seen to find PX4's lag")
    grid = np.arange(seen[0].t, seen[-1].t, _STEP_S)
    times = np.array([one.t for one in seen])
    lean = np.stack([np.interp(grid, times, [one.lean[k] for one in seen]) for k in range(2)])
    commands = np.stack([_commanded(seen, px4, k, times, grid, lean[k]) for k in range(2)])

    def left(x: Array) -> Array:
        found: Array = (_followed(commands, *x) - lean).ravel()
        return found

    def against(x: Array) -> Array:
        rest = left(x).reshape(2, -1)
        found: Array = (rest - rest.mean(axis=1, keepdims=True)).ravel()
        return found

    start = np.array([px4.tilt_kp, px4.tilt_kd, px4.delay])
    bounds = (np.array([5.0, 1.0, 0.002]), np.array([1000.0, 100.0, 0.2]))
    best = min(
        (
            least_squares(against, start * factor, bounds=bounds, x_scale=start)
            for factor in (np.ones(3), np.array([0.4, 0.6, 2.0]))
        ),
        key=lambda found: float(found.cost),
    )
    kp, kd, delay = (float(one) for one in best.x)
    moved = lean - lean.mean(axis=1, keepdims=True)
    share = math.sqrt(2.0 * float(best.cost) / float((moved**2).sum()))
    return Identified(replace(px4, tilt_kp=kp, tilt_kd=kd, delay=delay), share)


def _commanded(
    seen: list[Pushed], px4: Px4Tuning, axis: int, times: Array, grid: Array, lean: Array
) -> Array:
    """What PX4's position loop commands on an ``axis`` [m/s^2] at times of the ``grid`` [s]."""
    held = np.searchsorted(times, grid, side="right") - 1  # a setpoint holds until the next
    asked = np.array([[part[axis] for part in one.asked] for one in seen])[held]
    p = np.interp(grid, times, [one.p[axis] for one in seen])
    v = np.interp(grid, times, [one.v[axis] for one in seen])
    error = asked[:, 1] - v + px4.position_gain * (asked[:, 0] - p)
    lasting = px4.velocity_integral * _STEP_S * np.cumsum(error)
    found: Array = asked[:, 2] + px4.velocity_gain * error + lasting - px4.acceleration_gain * lean
    return found


def _followed(commands: Array, kp: float, kd: float, delay: float) -> Array:
    """The lean that follows ``commands`` (2, n) [m/s^2]."""
    b, a, _ = cont2discrete(([kp], [delay, 1.0, kd, kp]), _STEP_S)
    begun = commands[:, :1]
    followed: Array = lfilter(b.ravel(), a, commands - begun, axis=1) + begun
    return followed
