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

An estimate that is wrong pushes as well. A position, velocity or acceleration that is wrong by up
to e, however it changes, moves the base by at most e times the same sum, over the response to that
error (``estimate_tube``).

All of this is true only while no limit on the way from the error to the rotors is reached. The
same sum over the response of what meets a limit is the most that it can be asked for, so
``limits_used`` tells exactly up to which disturbance of one axis the loop is linear.

A force on the tool is known while it acts, and thrust cancels it, but a rotor lag and a tilt too
late. Whenever it comes and goes, up to f, it moves the base no further than

.. math:: \frac{f}{2 m} \int |g(t) + g_w(t)|\,dt + \frac{e}{m} \int |g(t)|\,dt ,

:math:`g_w` being the response to a memory of wind, which cancels as what is known does, and e what
is not known of the force (``of_contact``). The half: what is cancelled leaves nothing behind, so as
much of the response is positive as is negative.

Pushed on all axes at once, the thrust that holds the height also accelerates sideways, as far as
the vehicle leans, and turning while it leans takes from the lift. ``all_axes`` counts both as more
disturbance, and ``all_axes_up_to`` says up to which disturbance the rotors give what that asks.

Source: docs/equations.md T4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from fsw.autopilot.control.allocation import AXES, PITCH, ROLL
from fsw.autopilot.control.gains import TrackingGains, TrackingTuning, tracking_gains
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.multibody import posture
from fsw.autopilot.model.prediction import Array, zero_order_hold
from fsw.autopilot.model.rotors import WEIGHING_TIME
from fsw.autopilot.signals import Vec2
from fsw.compiled import compilable

_SETTLED_S = 6.0  # the slowest mode has decayed by e^-16 then
# What the plan's own motion and the arm's move the height by, 0.7 mm measured in calm flights.
CALM_HEIGHT = 1e-3  # m
RARE = 3.7  # standard deviations
_MIN_WEIGHT: Final = 5e-8  # on snap; below it little is won, and the estimate's noise is felt
_MAX_USED: Final = 0.95  # of any limit
# m/s^2 an axis of the memory of wind that a plan's stand-off covers. For what is beyond it
# clearances grow while it is in force.
WIND_COVERED = 0.05


class TubeAround(NamedTuple):
    """The tube around a plan, at an instant."""

    radius: float  # m
    wind: float  # m per m/s^2 of the memory of wind, beyond what the radius covers
    unsure: float  # m, that errors of the estimate add


NO_TUBE: Final = TubeAround(math.inf, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """Reach of a disturbance of 1 m/s^2 on one horizontal axis; of PX4's loops without wind."""

    base: float  # m, worst case, body origin
    end_effector: float  # m, worst case, a hanging end-effector across the arm's plane
    base_wind: float = 0.0  # m, what the memory of wind can add to it, at its limit
    wind: float = 0.0  # m per m/s^2 of that memory
    wind_beyond: float = 0.0  # m of it, by which clearances grow while the memory is in force
    known: float  # m per m/s^2 of a force on the tool, as it comes and goes
    height: float  # m, worst case, vertically
    end_effector_wind: float = 0.0  # m, of what is covered
    base_expected: float  # m, 3.7 sigma under random steps
    end_effector_expected: float  # m
    # The most that each quantity can be, worst case:
    acceleration: float  # m/s^2
    wanted_acceleration: float  # m/s^2
    acceleration_error: float  # m/s^2, wanted less present
    jerk: float  # m/s^3, wanted
    present_jerk: float  # m/s^3
    snap: float  # m/s^4, wanted
    vertical_acceleration: float  # m/s^2, of the thrust
    vertical_disturbance: float = 0.0  # m/s^2, observed


@lru_cache(maxsize=8)  # 4 ms; most changes of a tuning do not touch it
def tube(
    airframe: Airframe, tuning: TrackingTuning, hanging: float, hold_s: float, dt: float
) -> Tube:
    """The tube of the tracking loop with a tick of ``dt`` [s].

    The end-effector is ``hanging`` [m] below the base; a random disturbance keeps its value for
    ``hold_s``.
    """
    below, gains = hanging / GRAVITY, tracking_gains(tuning, airframe.rotor_lag, dt)
    states = impulse_responses(airframe, tuning, dt, wind=False)
    base, acceleration = states[:, 0], states[:, 2]
    k3, k4 = gains.k[2], gains.k[3]
    wanted = states @ _wanted_acceleration(gains)
    end_effector = base - below * acceleration
    in_wind = impulse_responses(airframe, tuning, dt, wind=True)
    base_wind = in_wind[:, 0]
    end_effector_wind = base_wind - below * in_wind[:, 2]
    climbs = _vertical_responses(airframe, tuning, gains, dt)
    per_hold = round(hold_s / dt)
    covered = min(tuning.wind_limit, WIND_COVERED)
    return Tube(
        base=worst(base),
        end_effector=worst(end_effector),
        base_wind=tuning.wind_limit * worst(base_wind),
        wind=worst(base_wind),
        wind_beyond=(tuning.wind_limit - covered) * worst(base_wind),
        known=0.5 * worst(base + base_wind),
        height=worst(climbs[:, 0]),
        end_effector_wind=covered * worst(end_effector_wind),
        base_expected=RARE * random_steps(base, per_hold),
        end_effector_expected=RARE * random_steps(end_effector, per_hold),
        acceleration=worst(acceleration),
        wanted_acceleration=worst(wanted),
        acceleration_error=worst(wanted - acceleration),
        jerk=k3 / k4 * worst(wanted - acceleration),
        present_jerk=worst(states[:, 3]),
        snap=worst(states @ _wanted_snap(gains)),
        vertical_acceleration=worst(climbs[:, 2] - climbs[:, 5]),
        vertical_disturbance=worst(climbs[:, 4]),
    )


@lru_cache(maxsize=4)
def base_after(airframe: Airframe, tuning: TrackingTuning, dt: float) -> Array:
    """How far [m] any disturbance within 1 m/s^2 of one axis can have pushed the base.

    An entry (ticks,) for each tick of ``dt`` [s] after it began.
    """
    off = impulse_responses(airframe, tuning, dt, wind=False)[:, 0]
    reach: Array = np.cumsum(np.abs(off))
    return reach


def base_reach(loop: Tube, disturbance: float) -> float:
    """How far a ``disturbance`` [m/s^2] pushes the base off its plan [m], an axis.

    Without what clearances grow by while the memory of wind is in force.
    """
    return loop.base * disturbance + loop.base_wind - loop.wind_beyond


@dataclass(frozen=True, slots=True)
class EstimateTube:
    """Reach of an error of the estimate, at most, on one horizontal axis."""

    position: float  # m per m: 1 if the error does not change
    velocity: float  # m per m/s
    acceleration: float  # m per m/s^2; an attitude that is wrong by an angle is wrong by g times it
    jerk: float  # m per m/s^3 of white noise, a value a tick: one standard deviation


@lru_cache(maxsize=4)
def estimate_tube(airframe: Airframe, tuning: TrackingTuning, dt: float) -> EstimateTube:
    """How far the base is moved by an estimate that is wrong, with a tick of ``dt`` [s]."""
    gains = tracking_gains(tuning, airframe.rotor_lag, dt)
    a, k, lag = _loop(airframe, tuning, gains), gains.k, airframe.rotor_lag
    gain_v, gain_d = 2.0 * tuning.observer_bandwidth, tuning.observer_bandwidth**2

    def moved(*enters: float) -> Array:
        """The base, by an error that enters the snap and the observer's two states."""
        return after_a_push(a, np.array([0.0, 0.0, 0.0, 0.0, *enters]), dt)[:, 0]

    return EstimateTube(
        position=worst(moved(-k[0] / lag, 0.0, 0.0)),
        velocity=worst(moved(0.0, gain_v, gain_d)),  # the observer alone uses it
        acceleration=worst(moved(-k[2] / lag, 1.0, 0.0)),
        jerk=float(np.linalg.norm(moved(-k[3] / lag, 0.0, 0.0))),
    )


def limits_used(
    airframe: Airframe, tuning: TrackingTuning, loop: Tube, disturbance: float
) -> dict[str, float]:
    """Share of every limit of the loop that the worst ``disturbance`` [m/s^2] of one axis uses."""
    stopping = 2.0 * tuning.stopping_snap * (disturbance * loop.acceleration_error + 0.15)
    return {
        "vertical disturbance": _share(
            disturbance * loop.vertical_disturbance, tuning.vertical_disturbance_limit
        ),
        "rotor torque": _share(disturbance * loop.snap, _snap_in_hover(airframe)),
        "position error": _share(
            disturbance * loop.base + loop.base_wind, tuning.position_error_limit
        ),
        "acceleration": _share(
            disturbance * loop.wanted_acceleration + tuning.wind_limit, tuning.acceleration_limit
        ),
        "jerk": _share(disturbance * loop.jerk, min(tuning.jerk_limit, math.sqrt(stopping))),
    }


def closest_tracking(
    airframe: Airframe,
    tuning: TrackingTuning,
    hanging: float,
    hold_s: float,
    disturbance: float,
    dt: float,
) -> TrackingTuning:
    """The tuning whose loop follows the plan as closely as this vehicle's rotors allow.

    Of the tuning's weight on snap, halved as long as the worst ``disturbance`` [m/s^2] of one axis
    leaves some of each limit. As of ``tube``: the end-effector is ``hanging`` [m] below the base, a
    disturbance keeps its value for ``hold_s`` [s], and a tick takes ``dt`` [s].
    """
    while tuning.input_weight > _MIN_WEIGHT:
        closer = replace(tuning, input_weight=max(0.5 * tuning.input_weight, _MIN_WEIGHT))
        loop = tube(airframe, closer, hanging, hold_s, dt)
        if max(limits_used(airframe, closer, loop, disturbance).values()) > _MAX_USED:
            break
        tuning = closer
    return tuning


def _share(used: float, limit: float) -> float:
    """Of a limit of zero, which switches its part of the loop off, any use is too much."""
    return used / limit if limit > 0.0 else math.inf


def all_axes(airframe: Airframe, loop: Tube, disturbance: float) -> tuple[float, float]:
    """Reach [m] on a horizontal axis and vertically under a ``disturbance`` [m/s^2] on every axis.

    The change of thrust that holds the height accelerates sideways by as much times the lean. The
    thrust is enlarged by what the lean takes from the lift, a rotor lag too late: by then the lift
    has changed by g times lean times turning, of both horizontal axes.
    """
    lean, turning = (
        disturbance * peak / GRAVITY for peak in (loop.acceleration, loop.present_jerk)
    )
    aside = lean * disturbance * loop.vertical_acceleration
    late = airframe.rotor_lag * GRAVITY * 2.0 * lean * turning
    across = (disturbance + aside) * loop.base + loop.base_wind
    return across, (disturbance + late) * loop.height + CALM_HEIGHT


def all_axes_up_to(airframe: Airframe, loop: Tube, most: float) -> float:
    """Largest disturbance of all axes, up to ``most`` [m/s^2], that saturates no rotor [m/s^2].

    Half-way between the axes both ask the same pair of rotors, root 2 times as much; along the axes
    each asks a pair of its own. With less thrust a turn makes less snap, and the pairs share less
    of it; a pair can have what the other one leaves.
    """
    low, high = 0.0, most
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _fits_all_axes(airframe, loop, middle) else (low, middle)
    return high if _fits_all_axes(airframe, loop, high) else low


def _fits_all_axes(airframe: Airframe, loop: Tube, disturbance: float) -> bool:
    lean = disturbance * loop.acceleration / GRAVITY
    pushed = disturbance + lean * disturbance * loop.vertical_acceleration
    change = disturbance * loop.vertical_acceleration / GRAVITY  # of the thrust
    lever = 1.0 - change
    hover = airframe.mass * GRAVITY / airframe.rotors
    shared = 1.0 - change * hover / min(hover, airframe.weakest_thrust - hover)
    used = pushed * loop.snap / _snap_in_hover(airframe)
    return math.sqrt(2.0) * used <= lever and used <= lever * shared


def _snap_in_hover(airframe: Airframe) -> float:
    """The snap [m/s^4] that the torque about one axis gives, where it gives least.

    At angles of zero: straight down the arm weighs most.
    """
    hover = airframe.mass * GRAVITY / airframe.rotors
    headroom = min(hover, airframe.weakest_thrust - hover)
    m = posture(airframe.bodies, (0.0,) * airframe.bodies.joints)
    least = math.inf
    for axis, inertia in ((ROLL, float(m.inertia[0])), (PITCH, float(m.inertia[4]))):
        hardest = max(map(abs, airframe.share[axis::AXES]))  # N a N m
        least = min(least, headroom / hardest / inertia)
    return GRAVITY * least


def worst(response: Array) -> float:
    """The most that any push within +-1 makes of a ``response`` (ticks,) [any] to one of a tick."""
    return float(np.abs(response).sum())


def _wanted_acceleration(gains: TrackingGains) -> Array:
    """The law's A as a row on the states of the loop, see ``fsw/autopilot/control/tracking.py``."""
    k = gains.k
    return np.array([-k[0], 0.0, 0.0, 0.0, 0.0, -k[1], -gains.k_disturbance]) / k[2]


def _wanted_snap(gains: TrackingGains) -> Array:
    k = gains.k
    return np.array([-k[0], 0.0, -k[2], -k[3], -k[4], -k[1], -gains.k_disturbance])


def impulse_responses(
    airframe: Airframe, tuning: TrackingTuning, dt: float, *, wind: bool
) -> Array:
    """States after a unit push of one tick of ``dt`` [s]: p, v, a, j, s and the observer's v, d.

    A row (7,) [SI] a tick. The push is a disturbance, or a memory of wind where there is none.
    """
    gains = tracking_gains(tuning, airframe.rotor_lag, dt)
    a = _loop(airframe, tuning, gains)
    b = np.zeros(len(a))
    if wind:
        b[4] = (gains.k_disturbance - gains.k[2]) / airframe.rotor_lag
    else:
        b[1] = 1.0
    return after_a_push(a, b, dt)


def _loop(airframe: Airframe, tuning: TrackingTuning, gains: TrackingGains) -> Array:
    """x' = A x of p, v, a, j, s and the observer's velocity and disturbance; the plan is 0."""
    a = np.zeros((7, 7))
    a[:4, 1:5] = np.eye(4)
    a[4] = _wanted_snap(gains) / airframe.rotor_lag
    a[4, 4] -= 1.0 / airframe.rotor_lag
    gain_v, gain_d = 2.0 * tuning.observer_bandwidth, tuning.observer_bandwidth**2
    a[5] = [0.0, gain_v, 1.0, 0.0, 0.0, -gain_v, 1.0]
    a[6] = [0.0, gain_d, 0.0, 0.0, 0.0, -gain_d, 0.0]
    return a


def _vertical_responses(
    airframe: Airframe, tuning: TrackingTuning, gains: TrackingGains, dt: float
) -> Array:
    """States after a unit disturbance of one tick, a row per tick.

    p, v, the acceleration that the loop asks for, the observer's v and d, and what of the
    disturbance is taken for mass: the accelerometer feels both alike. That is cancelled like wind,
    and turned against the vehicle when the disturbance turns.
    """
    k, bandwidth = gains.k_vertical, tuning.observer_bandwidth
    a = np.zeros((6, 6))
    a[:2, 1:3] = np.eye(2)
    wanted = np.array([-k[0], 0.0, -k[2], -k[1], -gains.k_vertical_disturbance, 0.0])
    a[2] = wanted / airframe.rotor_lag
    a[2, 2] -= 1.0 / airframe.rotor_lag
    gain_v, gain_d = 2.0 * bandwidth, bandwidth**2
    a[3] = [0.0, gain_v, 1.0, -gain_v, 1.0, 0.0]
    a[4] = [0.0, gain_d, 0.0, -gain_d, 0.0, 0.0]
    # The thrust follows a mass that changes with its lag, too.
    weighing = 1.0 / WEIGHING_TIME
    a[1, 5], a[2, 5], a[5, 5] = -1.0, a[2, 5] - weighing, -weighing
    return after_a_push(a, np.array([0.0, 1.0, weighing, 0.0, 0.0, weighing]), dt)


def after_a_push(a: Array, b: Array, dt: float, settled_s: float = _SETTLED_S) -> Array:
    """States of ``x' = a x + b d`` [SI] from one tick of d = 1 on, a row per tick of ``dt`` [s].

    ``a`` is (n, n) and ``b`` (n,) [SI]; nothing is left after ``settled_s`` [s].
    """
    held, pushed = zero_order_hold(a, b[:, None], dt)
    states = [pushed[:, 0]]
    while len(states) < round(settled_s / dt):
        states.append(held @ states[-1])
    return np.array(states)


def random_steps(response: Array, per_hold: int) -> float:
    """Standard deviation of a ``response`` (ticks,) [any] to steps drawn uniformly from +-1.

    The steps last ``per_hold`` ticks each. The draws are independent, so their shares add up in
    squares; the mean over the instants within a hold.
    """
    whole = len(response) // per_hold * per_hold
    variances = []
    for phase in range(0, per_hold, max(per_hold // 10, 1)):
        shifted = np.concatenate((np.zeros(phase), response[: whole - phase]))
        held = shifted.reshape(-1, per_hold).sum(axis=1)
        variances.append(float(held @ held))
    return float(np.sqrt(np.mean(variances) / 3.0))


@compilable
def beyond_covered(loop: Tube | TubeAround, memory: Vec2) -> Vec2:
    """What a ``memory`` of wind [m/s^2, NED] that is in force can add to the tube [m, NED].

    Beyond what the stand-off covers. However the push turns, the vehicle is no further off.
    """
    x, y = memory
    return (
        loop.wind * max(abs(x) - WIND_COVERED, 0.0),
        loop.wind * max(abs(y) - WIND_COVERED, 0.0),
    )


def of_contact(loop: Tube, force: float, unsure: float, mass: float) -> float:
    """What a ``force`` [N] on the tool, as it comes and goes, can add to the tube [m].

    It is ``unsure`` [N] how large it is. The ``mass`` [kg] is the whole vehicle's.
    """
    return (loop.known * force + loop.base * unsure) / mass
