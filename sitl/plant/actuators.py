"""Rotors, joint drives and their end stops: from commands to thrust and torque."""

from __future__ import annotations

from typing import Final

import numpy as np

from sitl.compiled import kernel

SLOW: Final = 0.05  # rad/s, width of the smoothed sign change of a joint's Coulomb friction


@kernel
def thrust_rate(thrust: float, command: float, thrust_max: float, lag: float) -> float:
    """First-order lag of one rotor's ``thrust`` [N] behind its ``command`` [N], in N/s.

    The command saturates at 0 and ``thrust_max`` [N]; the time constant is ``lag`` [s].
    """
    return (min(max(command, 0.0), thrust_max) - thrust) / lag


@kernel
def joint_torque(
    command: float, rate: float, torque_max: float, viscous: float, coulomb: float
) -> float:
    """Torque that reaches a joint after limit, viscous and smoothed Coulomb friction [N·m].

    ``command`` [N·m] is limited by ``torque_max`` [N·m]; at ``rate`` [rad/s] there act ``viscous``
    [N·m·s/rad] and ``coulomb`` [N·m] friction, 76 % of it at 0.05 rad/s.
    """
    driven = min(max(command, -torque_max), torque_max)
    friction: float = viscous * rate + coulomb * np.tanh(rate / SLOW)
    return driven - friction


@kernel
def stop_torque(beyond: float, rate: float, stiffness: float, damping: float) -> float:
    """Torque [N·m] from an end stop, ``beyond`` [rad] which an angle is with a ``rate`` [rad/s].

    A spring of ``stiffness`` [N·m/rad] and a damper of ``damping`` [N·m·s/rad] that push back and
    never pull.
    """
    push = -stiffness * beyond - damping * rate
    return min(push, 0.0) if beyond > 0.0 else max(push, 0.0)
