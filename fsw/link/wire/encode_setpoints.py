"""A motion setpoint as the numbers and the mask it came with; pure."""

from __future__ import annotations

from fsw.signals import MotionSetpoint


def as_asked(motion: MotionSetpoint) -> tuple[tuple[float, ...], int]:
    """Position, velocity, acceleration, yaw and yaw rate, and POSITION_TARGET_TYPEMASK."""
    groups = ((motion.p, 0x007), (motion.v, 0x038), (motion.a, 0x1C0))
    mask = sum(ignored for vector, ignored in groups if vector is None)
    mask |= (0x400 if motion.yaw is None else 0) | (0x800 if motion.yaw_rate is None else 0)
    numbers = tuple(number for vector, _ in groups for number in vector or (0.0, 0.0, 0.0))
    return (*numbers, motion.yaw or 0.0, motion.yaw_rate or 0.0), mask
