"""Which encoders are stuck: they say the same while their joints must move."""

from __future__ import annotations

import math
from typing import Any, Final

from fsw.autopilot.tick_record import JUDGES, NOT_WATCHED, Expected
from fsw.compiled import compilable
from fsw.record import Floats

REPEATS: Final = 6  # of encoders; a resting arm's 12 bits are the same for longer
# N m of each joint. Friction and noise: 0.025 of the joint that has less, where both repeat
# themselves; three times the friction holds 0.03. Stuck encoders: more within 0.1 to 0.4 s.
_HELD: Final = 0.1
# Of that; 0.7 and more of joints that move unseen, less than 0 of ones that fail.
_FELT: Final = 0.5
_UNSEEN: Final = 0.02  # rad, by which a joint must have moved that holds a tool on its surface


@compilable
def encoders_stuck(x: Any) -> bool:
    """Whether any encoder is."""
    most = 0.0
    for k in range(x.joint_count):
        most = max(most, x.encoder_repeats[k])
    return most == math.inf


@compilable
def watch_encoders(x: Any, angles: Floats, expected: Expected) -> bool:
    """Look at a reading of ``angles`` (j,) [rad]; whether any encoder is stuck now.

    An encoder is stuck that says the same while torque that its joint is given moves nothing, and
    what carries the joint feels that it moves. A joint that fails is not felt, a load that is not
    known acts from the start. At a surface it is stuck where its joint must have moved unseen, or
    the tool would not be where it is. On the ground, and where a joint is known to have failed, the
    watch begins anew.
    """
    for k in range(x.joint_count):
        if expected.judges == JUDGES and angles[k] == x.encoders[k]:
            x.encoder_repeats[k] += 1.0
            held = abs(expected.undone[k] - x.encoder_undone[k]) > _HELD
            moved = abs(expected.unseen[k] - x.encoder_unseen[k]) > _UNSEEN
            if x.encoder_repeats[k] >= REPEATS and ((held and expected.felt[k] > _FELT) or moved):
                x.encoder_repeats[k] = math.inf
        elif expected.judges != NOT_WATCHED:
            x.encoder_repeats[k] = 0.0
            x.encoder_undone[k], x.encoder_unseen[k] = expected.undone[k], expected.unseen[k]
    return encoders_stuck(x)
