r"""How far a bounded disturbance can push the vehicle off its plan where PX4's loops hold it to it.

The sums are those of ``tube.py``, over the responses of another loop. On a horizontal axis, as
errors from the plan, with what PX4 commands

.. math:: c = -K_v (K_p p + v) - z - K_a (a + d) - s \hat d, \qquad \dot z = K_i (K_p p + v),

and :math:`\dot v = a + d`; a follows c with the lag and the delay of ``Px4Tuning``. Nothing is
taken over from our own cascade, and its limits are not in it: what is bounded is the linear loop.
Its attitude loop is not quite as it is believed to be: all is the largest of that and of one that
is softer. The worst push moved a real PX4 by 82 mm of 99 mm.

Source: docs/decisions/0046-the-planner-above-px4.md.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import lru_cache

import numpy as np

from fsw.autopilot.control.px4_loops import Px4Tuning
from fsw.autopilot.control.tube import RARE, Tube, after_a_push, random_steps, worst
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.prediction import Array

_SETTLED_S = 15.0  # PX4's integral is slow
_SOFTER = 0.77  # share of the stiffness that is believed


@lru_cache(maxsize=8)
def px4_tube(px4: Px4Tuning, hanging: float, hold_s: float, dt: float) -> Tube:
    """The tube of PX4's loops with a tick of ``dt`` [s]; there is no memory of wind.

    The end-effector is ``hanging`` [m] below the base; a random disturbance keeps its value for
    ``hold_s``.
    """
    one, other = [_tube(loops, hanging, hold_s, dt) for loops in (px4, softer(px4))]
    names = [found.name for found in fields(Tube)]
    return Tube(**{name: max(getattr(one, name), getattr(other, name)) for name in names})


def softer(px4: Px4Tuning) -> Px4Tuning:
    """Loops whose attitude follows as late as it may, where they are believed to be ``px4``."""
    return replace(px4, tilt_kp=_SOFTER * px4.tilt_kp)


def _tube(px4: Px4Tuning, hanging: float, hold_s: float, dt: float) -> Tube:
    below = hanging / GRAVITY
    a, b = horizontal_loop(px4)
    states = after_a_push(a, b, dt, _SETTLED_S)
    base, end_effector = states[:, 0], states[:, 0] - below * states[:, 2]
    wanted = states @ _commanded(px4)
    wanted[0] -= px4.acceleration_gain / dt  # of the push itself, while it lasts
    climbs = after_a_push(*_vertical_loop(px4), dt, _SETTLED_S)
    per_hold = round(hold_s / dt)
    return Tube(
        base=worst(base),
        end_effector=worst(end_effector),
        known=worst(base),
        height=worst(climbs[:, 0]),
        base_expected=RARE * random_steps(base, per_hold),
        end_effector_expected=RARE * random_steps(end_effector, per_hold),
        acceleration=worst(states[:, 2]),
        wanted_acceleration=worst(wanted),
        acceleration_error=worst(wanted - states[:, 2]),
        jerk=worst(states[:, 3]),
        present_jerk=worst(states[:, 3]),
        snap=worst(states[:, 4]),
        vertical_acceleration=worst(climbs[:, 2]),
    )


def horizontal_loop(px4: Px4Tuning) -> tuple[Array, Array]:
    """x' = a x + b d of p, v, a, j, s, the integral z and the observer's v and d."""
    a, b = np.zeros((8, 8)), np.zeros(8)
    a[:4, 1:5] = np.eye(4)
    a[4] = px4.tilt_kp * _commanded(px4) / px4.delay
    a[4, 2:5] -= np.array([px4.tilt_kp, px4.tilt_kd, 1.0]) / px4.delay
    a[5, :2] = px4.velocity_integral * px4.position_gain, px4.velocity_integral
    gain_v, gain_d = 2.0 * px4.observer, px4.observer**2
    a[6] = [0.0, gain_v, 1.0, 0.0, 0.0, 0.0, -gain_v, 1.0]
    a[7] = [0.0, gain_d, 0.0, 0.0, 0.0, 0.0, -gain_d, 0.0]
    b[1], b[4] = 1.0, -px4.tilt_kp * px4.acceleration_gain / px4.delay
    return a, b


def is_stable(px4: Px4Tuning) -> bool:
    """Whether PX4's loop comes to rest by itself, as it is believed to be."""
    loops = *(horizontal_loop(one)[0] for one in (px4, softer(px4))), _vertical_loop(px4)[0]
    return all(float(np.linalg.eigvals(a).real.max()) < 0.0 for a in loops)


def _commanded(px4: Px4Tuning) -> Array:
    """c as a row on the states, without the disturbance's own part."""
    row = np.zeros(8)
    row[0] = -px4.velocity_gain * px4.position_gain
    row[[1, 2, 5, 7]] = -px4.velocity_gain, -px4.acceleration_gain, -1.0, -px4.cancelled
    return row


def _vertical_loop(px4: Px4Tuning) -> tuple[Array, Array]:
    """The same of p, v, a and the integral; thrust follows with the delay."""
    a, b = np.zeros((4, 4)), np.array([0.0, 1.0, 0.0, 0.0])
    a[0, 1] = a[1, 2] = 1.0
    wanted = np.array([-px4.climb_gain * px4.height_gain, -px4.climb_gain, 0.0, -1.0])
    a[2] = wanted / px4.delay
    a[2, 2] -= 1.0 / px4.delay
    a[3, :2] = px4.climb_integral * px4.height_gain, px4.climb_integral
    return a, b
