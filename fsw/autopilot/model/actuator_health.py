"""What rotors and joints give of what is commanded, as far as it is known not to be all of it."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from fsw.autopilot.signals import Vec2, Vec4
from fsw.autopilot.tick_record import Health

SOUND: Final = 0.0
STUCK: Final = 1.0  # the joint stands, whatever torque is asked for
LIMP: Final = 2.0  # torque has no effect


class ActuatorHealth(NamedTuple):
    """Of the rotors (rear, left, front, right) and of the joints."""

    effectiveness: Vec4 = (1.0, 1.0, 1.0, 1.0)  # thrust over what is commanded
    # A rotor that does not obey is left alone: its least and its most are what it gives.
    least: Vec4 = (0.0, 0.0, 0.0, 0.0)  # N
    most: Vec4 = (math.inf, math.inf, math.inf, math.inf)  # N, beside the rotor's own limit
    joints: Vec2 = (SOUND, SOUND)  # or STUCK or LIMP


HEALTHY: Final = ActuatorHealth()


def note_health(into: Health, health: ActuatorHealth) -> None:
    """Write down what has been found out."""
    rotors, joints = len(health.least), len(health.joints)
    into.effectiveness[:rotors] = health.effectiveness
    into.least[:rotors], into.most[:rotors] = health.least, health.most
    into.joints[:joints] = health.joints
