"""Rotors, joint drives and their end stops: from commands to thrust and torque."""

from __future__ import annotations

import numpy as np

from sitl.compiled import kernel
from sitl.plant.vector import V3, V4


@kernel
def thrust_rate(thrust: float, command: float, thrust_max: float, lag: float) -> float:
    """First-order lag of one rotor's ``thrust`` [N] behind its ``command`` [N], in N/s.

    The command saturates at 0 and ``thrust_max`` [N]; the time constant is ``lag`` [s].
    """
    return (min(max(command, 0.0), thrust_max) - thrust) / lag


@kernel
def rotor_torque(thrust: V4, shaft: V4, arm: float, yaw_ratio: float) -> V3:
    """Torque [N·m, B] of four thrusts [N] at a lever arm [m] with yaw_ratio [m], torque per thrust.

    .. math:: τ = [L(f_2 − f_4), L(f_3 − f_1), b(g_1 − g_2 + g_3 − g_4)]

    ``shaft`` is g, the thrusts [N] that the same rotors would have in free air.
    """
    f1, f2, f3, f4 = thrust
    g1, g2, g3, g4 = shaft
    return (arm * (f2 - f4), arm * (f3 - f1), yaw_ratio * (g1 - g2 + g3 - g4))


@kernel
def joint_torque(
    command: float, rate: float, torque_max: float, viscous: float, coulomb: float, width: float
) -> float:
    """Torque that reaches a joint after limit, viscous and smoothed Coulomb friction [N·m].

    ``command`` [N·m] is limited by ``torque_max`` [N·m]; at ``rate`` [rad/s] there act ``viscous``
    [N·m·s/rad] and ``coulomb`` [N·m] friction, 76 % of it at ``width`` [rad/s].
    """
    driven = min(max(command, -torque_max), torque_max)
    friction: float = viscous * rate + coulomb * np.tanh(rate / width)
    return driven - friction


@kernel
def stop_torque(angle: float, rate: float, stop: float, stiffness: float, damping: float) -> float:
    """Torque on a link at ``angle`` [rad] and ``rate`` [rad/s] from its end stop [N·m].

    The stops are at ± ``stop`` [rad]; a spring of ``stiffness`` [N·m/rad] and a damper of
    ``damping`` [N·m·s/rad] that push back and never pull.
    """
    if angle > stop:
        return min(-stiffness * (angle - stop) - damping * rate, 0.0)
    if angle < -stop:
        return max(-stiffness * (angle + stop) - damping * rate, 0.0)
    return 0.0
