"""What rotors and joints give of what is commanded, as far as it is known not to be all of it."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from fsw.autopilot.signals import JointVector, RotorVector
from fsw.autopilot.tick_record import Health

SOUND: Final = 0.0
STUCK: Final = 1.0  # the joint stands, whatever torque is asked for
LIMP: Final = 2.0  # torque has no effect


class ActuatorHealth(NamedTuple):
    """Of each rotor and of each joint; those behind the last that is named are sound."""

    effectiveness: RotorVector = ()  # thrust over what is commanded
    # A rotor that does not obey is left alone: its least and its most are what it gives.
    least: RotorVector = ()  # N
    most: RotorVector = ()  # N, beside the rotor's own limit
    joints: JointVector = ()  # SOUND, STUCK or LIMP


HEALTHY: Final = ActuatorHealth()


def note_health(into: Health, health: ActuatorHealth) -> None:
    """Write down what has been found out."""
    into.effectiveness[:], into.least[:], into.most[:], into.joints[:] = 1.0, 0.0, math.inf, SOUND
    into.effectiveness[: len(health.effectiveness)] = health.effectiveness
    into.least[: len(health.least)] = health.least
    into.most[: len(health.most)] = health.most
    into.joints[: len(health.joints)] = health.joints
