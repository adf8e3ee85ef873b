"""Which encoders are stuck: they say the same while their joints must move."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

from fsw.autopilot.signals import JointVector

_REPEATS: Final = 6  # of encoders; a resting arm's 12 bits are the same for longer
# N m of each joint. Friction and noise: 0.025 of the joint that has less, where both repeat
# themselves; three times the friction holds 0.03. Stuck encoders: more within 0.1 to 0.4 s.
_HELD: Final = 0.1
# Of that; 0.7 and more of joints that move unseen, less than 0 of ones that fail.
_FELT: Final = 0.5
_UNSEEN: Final = 0.02  # rad, by which a joint must have moved that holds a tool on its surface


class EncoderWatch(NamedTuple):
    """Whether the joints' encoders still follow the joints."""

    angles: JointVector = ()  # rad, the last reading
    # Of each: readings in a row that were the same, infinite of one that is stuck, what undid its
    # joint's torque when they began [N m], and by how much it must have moved unseen [rad].
    repeats: tuple[float, ...] = ()
    first: JointVector = ()
    unseen: JointVector = ()

    @property
    def repeating(self) -> bool:
        """Whether all have said the same for long enough to ask whether they are stuck."""
        return min(self.repeats, default=0) >= _REPEATS

    @property
    def stuck(self) -> bool:
        """Whether any of them is."""
        return math.inf in self.repeats

    def after(
        self,
        angles: JointVector,
        undone: JointVector,
        unseen: JointVector,
        felt: Callable[[], JointVector],
        *,
        judged: bool,
    ) -> EncoderWatch:
        """The watch after a reading of ``angles`` (j,) [rad].

        An encoder is stuck that says the same while torque that its joint is given moves nothing,
        and what carries the joint feels that it moves. ``undone`` (j,) [N m] is what the watch over
        the joints finds to act against each torque, and ``felt`` says how much of that is felt
        nearer to the base (j,) [1] (``actuator_watch.felt_inside``). A joint that fails is not
        felt, a load that is not known acts from the start. At a surface it is stuck where its joint
        must have moved ``unseen`` (j,) [rad], or the tool would not be where it is. On the ground,
        and where a joint is known to have failed, they are not ``judged``.
        """
        repeats, first, began = [0.0] * len(angles), list(undone), list(unseen)
        for k in range(len(angles) if judged and len(self.angles) == len(angles) else 0):
            if angles[k] == self.angles[k]:
                repeats[k], first[k] = self.repeats[k] + 1.0, self.first[k]
                began[k] = self.unseen[k]
                held = abs(undone[k] - first[k]) > _HELD and felt()[k] > _FELT
                if repeats[k] >= _REPEATS and (held or abs(unseen[k] - began[k]) > _UNSEEN):
                    repeats[k] = math.inf
        return EncoderWatch(angles, tuple(repeats), tuple(first), tuple(began))
