"""Thrust from a rotor's speed: ω follows its command with a first-order lag, thrust is k ω²."""

from __future__ import annotations

import math

from sitl.compiled import kernel

STARTING = 0.01  # share of full speed below which a rotor's thrust is not told from none


@kernel
def quadratic_thrust_rate(thrust: float, command: float, thrust_max: float, lag: float) -> float:
    r"""Rate [N/s] of a rotor's ``thrust`` [N] whose speed lags behind its ``command``'s [N].

    .. math:: \dot ω = (ω_c - ω)/τ, \; T = k ω^2 \; ⇒ \; \dot T = 2 \sqrt T (\sqrt{T_c} - \sqrt T)/τ

    The command saturates at 0 and ``thrust_max`` [N]; ``lag`` [s] is the time constant τ.

    Source: P. Corke, Robotics, Vision and Control, section 4.2, for thrust; the lag of a motor.
    """
    wanted = math.sqrt(min(max(command, 0.0), thrust_max))
    # A rotor at rest would never start: there thrust grows with the square of time.
    speed = math.sqrt(max(thrust, 0.0))
    carried = max(speed, STARTING * math.sqrt(thrust_max))
    return 2.0 * carried * (wanted - speed) / lag
