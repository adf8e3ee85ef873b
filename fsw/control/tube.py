r"""How far a bounded disturbance can push the vehicle off its plan: the tube, from the gains.

The tracking loop is linear until it saturates. From a disturbance acceleration d to a point
a height below the base it has an impulse response g, and no disturbance within
:math:`|d| \le d_m` on an axis, whatever its shape, can move that point further than

.. math:: d_m \int_0^\infty |g(t)|\,dt .

The bound is attained by the disturbance that always pushes the worst way, so it is exact
for the linear loop. Drawn at random, as the paper draws it, the disturbance comes nowhere
near; ``expected_peak`` is 3.7 standard deviations, about one in five thousand.

The memory of wind is not linear, because it is limited. It acts on the loop as a second
disturbance within that limit, and the worst that both can do together bounds what they do.

The loop stays linear while the snap it commands stays within what the rotors' torque can
give; ``peak_snap_share`` says how much of that is used.

Source: docs/equations.md T4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm

from fsw.control.gains import TrackingGains, TrackingTuning
from fsw.model.airframe import GRAVITY, Airframe
from fsw.model.prediction import Array

_SETTLED_S = 6.0  # the slowest mode has decayed by e^-16 then
_RARE = 3.7  # standard deviations


@dataclass(frozen=True, slots=True)
class Tube:
    """Reach of a disturbance of 1 m/s^2 on one horizontal axis."""

    base: float  # m, worst case, body origin
    end_effector: float  # m, worst case, a hanging end-effector across the arm's plane
    base_wind: float  # m, what the memory of wind can add to it, at its limit
    end_effector_wind: float  # m
    base_expected: float  # m, 3.7 sigma under random steps
    end_effector_expected: float  # m
    snap_expected: float  # m/s^4


@lru_cache(maxsize=8)  # 4 ms; most changes of a tuning do not touch it
def tube(
    airframe: Airframe,
    tuning: TrackingTuning,
    gains: TrackingGains,
    hanging: float,
    hold_s: float,
    dt: float,
) -> Tube:
    """The tube of the tracking loop with a tick of ``dt`` [s].

    The end-effector is ``hanging`` [m] below the base; a random disturbance keeps its value for
    ``hold_s``.
    """
    below = hanging / GRAVITY
    base, acceleration, snap = _impulse_responses(airframe, tuning, gains, dt, wind=False)
    end_effector = base - below * acceleration
    base_wind, acceleration, _ = _impulse_responses(airframe, tuning, gains, dt, wind=True)
    end_effector_wind = base_wind - below * acceleration
    per_hold = round(hold_s / dt)
    return Tube(
        float(np.abs(base).sum()),
        float(np.abs(end_effector).sum()),
        tuning.wind_limit * float(np.abs(base_wind).sum()),
        tuning.wind_limit * float(np.abs(end_effector_wind).sum()),
        *(_RARE * _random_steps(response, per_hold) for response in (base, end_effector, snap)),
    )


def peak_snap_share(airframe: Airframe, tube_per_unit: Tube, disturbance: float) -> float:
    """Share of the rotors' snap in hover that a ``disturbance`` [m/s^2] uses."""
    hover = airframe.mass * GRAVITY / 4.0
    headroom = min(hover, airframe.rotor_thrust_max - hover)
    limit = GRAVITY * 2.0 * airframe.rotor_arm * headroom / max(airframe.inertia[:2])
    return tube_per_unit.snap_expected * disturbance / limit


def _impulse_responses(
    airframe: Airframe, tuning: TrackingTuning, gains: TrackingGains, dt: float, *, wind: bool
) -> tuple[Array, Array, Array]:
    """Position, acceleration and commanded snap after a unit push of one tick, per tick.

    The push is a disturbance, or a memory of wind that is of no disturbance.
    """
    k, kd, bandwidth = gains.k, gains.k_disturbance, tuning.observer_bandwidth
    # p, v, a, j, s and the observer's velocity and disturbance; the plan stands still at 0.
    n = 7
    a = np.zeros((n, n))
    a[:4, 1:5] = np.eye(4)
    snap = np.array([-k[0], 0.0, -k[2], -k[3], -k[4], -k[1], -kd])
    a[4] = snap / airframe.rotor_lag
    a[4, 4] -= 1.0 / airframe.rotor_lag
    gain_v, gain_d = 2.0 * bandwidth, bandwidth**2
    a[5] = [0.0, gain_v, 1.0, 0.0, 0.0, -gain_v, 1.0]
    a[6] = [0.0, gain_d, 0.0, 0.0, 0.0, -gain_d, 0.0]
    block = np.zeros((n + 1, n + 1))
    block[:n, :n] = a * dt
    if wind:
        block[4, n] = dt * (kd - k[2]) / airframe.rotor_lag
    else:
        block[1, n] = dt
    exponential = expm(block)
    x = exponential[:n, n]
    states = []
    for _ in range(round(_SETTLED_S / dt)):
        states.append(x)
        x = exponential[:n, :n] @ x
    history = np.array(states)
    return history[:, 0], history[:, 2], history @ snap


def _random_steps(response: Array, per_hold: int) -> float:
    """Standard deviation under steps drawn uniformly from +-1 every ``per_hold`` ticks.

    The draws are independent, so their shares add up in squares; the mean over the instants
    within a hold.
    """
    whole = len(response) // per_hold * per_hold
    variances = []
    for phase in range(0, per_hold, max(per_hold // 10, 1)):
        shifted = np.concatenate((np.zeros(phase), response[: whole - phase]))
        held = shifted.reshape(-1, per_hold).sum(axis=1)
        variances.append(float(held @ held))
    return float(np.sqrt(np.mean(variances) / 3.0))
