"""Joints in the dialect's messages: the first four in a base field, four more in an extension.

Extensions stand behind all base fields and are not sent while they are zero, so of an arm of up to
four joints a message is what it was before they came.
"""

from __future__ import annotations

from typing import Final

Values = tuple[float, ...]

JOINTS_MAX: Final = 8
BASE: Final = 4


def base(joints: Values) -> Values:
    """The base field of some joints."""
    return joints[:BASE] + (0.0,) * (BASE - len(joints))


def more(joints: Values) -> Values:
    """The extension field of some joints."""
    rest = joints[BASE:]
    return rest + (0.0,) * (JOINTS_MAX - BASE - len(rest))


def joined(values: Values, base_at: int, more_at: int, count: int) -> Values:
    """So many joints out of a message's values, whose fields begin at these places."""
    if count <= BASE:
        return values[base_at : base_at + count]
    return values[base_at : base_at + BASE] + values[more_at : more_at + count - BASE]


# Places in wire order.
STATE_AT: Final = ((1, 20), (5, 24), (9, 28))  # of ARM_JOINT_STATE: position, velocity, torque
STATE_COUNT_AT: Final = 19
SETPOINT_AT: Final = (1, 16)  # of ARM_JOINT_SETPOINT: position
SETPOINT_COUNT_AT: Final = 15
ENCODERS_AT: Final = (1, 6)  # of JOINT_ENCODERS: angle
ENCODERS_COUNT_AT: Final = 5
