"""What rotors and joints give of what is commanded, as far as it is known not to be all of it."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from fsw.autopilot.signals import Vec2, Vec4
from fsw.autopilot.tick_record import Health
from fsw.compiled import compilable
from fsw.record import Floats

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


@compilable
def given(health: ActuatorHealth | Health, commanded: Vec4 | Floats) -> Vec4:
    """Thrust [N] that rotors settle at when it is ``commanded`` [N]."""
    e = health.effectiveness
    return e[0] * commanded[0], e[1] * commanded[1], e[2] * commanded[2], e[3] * commanded[3]


@compilable
def commanded_for(health: ActuatorHealth | Health, thrust: Vec4) -> Vec4:
    """What is to be commanded [N] for a ``thrust`` [N] of each rotor."""
    e = health.effectiveness
    return thrust[0] / e[0], thrust[1] / e[1], thrust[2] / e[2], thrust[3] / e[3]


@compilable
def limits_of(health: ActuatorHealth | Health, top: float) -> tuple[Vec4, Vec4]:
    """Least and most thrust [N] of each rotor, whose command goes up to ``top`` [N]."""
    e, least, most = health.effectiveness, health.least, health.most
    return (least[0], least[1], least[2], least[3]), (
        min(top * e[0], most[0]),
        min(top * e[1], most[1]),
        min(top * e[2], most[2]),
        min(top * e[3], most[3]),
    )
