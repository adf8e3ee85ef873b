"""Who flies: PX4's pilot gives the vehicle by Offboard, and takes it back by any other mode.

PX4 arms, takes off, lands and has failsafes of its own. The plan is followed only while PX4 is in
Offboard and in the air. Setpoints stream before that, at the place where the vehicle is, because
PX4 enters Offboard only with a stream. What PX4 or its pilot chooses is never undone: out of
Offboard for whatever reason, planning ends, it is said, and nothing begins again until the vehicle
is given anew. An operator of ours who arms asks PX4 for Offboard, and who disarms gives it back.

Pure: what PX4 and the autopilot say goes in, what to do comes out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, NamedTuple

from fsw.autopilot.signals import Severity, StatusText
from fsw.link.px4.messages import HOLD, OFFBOARD, mode_name

ANSWER_US: Final = 2_000_000  # in which PX4 enters Offboard when it is asked
_ASK_AGAIN_US: Final = 500_000
_ARM_AGAIN_US: Final = 1_000_000
# PX4 has been silent so long, or we have: the link is lost, and PX4 may fly another mode.
LOST_US: Final = 500_000


class Px4Seen(NamedTuple):
    """What PX4 says of itself."""

    silent_us: int  # since it was heard
    armed: bool = False
    mode: tuple[int, int] = (0, 0)
    landed: bool = True

    @property
    def heard(self) -> bool:
        """Whether its link works."""
        return self.silent_us < LOST_US

    @property
    def gives(self) -> bool:
        """Whether it follows setpoints, and flies."""
        return self.heard and self.armed and self.mode == OFFBOARD and not self.landed


class Wish(NamedTuple):
    """What is to be done now."""

    arm: bool = False  # our autopilot: the vehicle is ours
    disarm: bool = False  # it is not any more
    mode: tuple[int, int] | None = None  # to command PX4
    texts: tuple[StatusText, ...] = ()


@dataclass(slots=True)
class Handover:
    """What was decided so far."""

    looked_us: int = -1  # when the last look was
    flies: bool = False  # our autopilot did then
    mode: tuple[int, int] = (0, 0)  # PX4's then
    asked_us: int = -1  # since when PX4 is asked for Offboard; -1: it is not
    ask_us: int = 0  # when to ask again
    arm_us: int = 0  # when our autopilot may be armed again
    spent: bool = False  # what was given has been given back: wait until it is given anew
    silent: bool = False  # PX4's link was lost at the last look
    _texts: list[StatusText] = field(default_factory=list)

    def step(self, px4: Px4Seen, now_us: int, *, flies: bool) -> Wish:
        """Look at PX4 and at whether our autopilot ``flies`` at ``now_us`` [us]."""
        stopped_us = now_us - self.looked_us if self.looked_us >= 0 else 0
        if flies and stopped_us >= LOST_US:
            what = f"this planner stopped for {1e-6 * stopped_us:.1f} s: its plan ends"
            self._say(Severity.CRITICAL, what)
            wish = Wish(disarm=True)
        else:
            wish = self._decide(px4, now_us, flies=flies)
        self.looked_us, self.flies, self.mode = now_us, flies and not wish.disarm, px4.mode
        texts, self._texts = tuple(self._texts), []
        return wish._replace(texts=texts) if texts else wish

    @property
    def streams(self) -> bool:
        """Whether setpoints are sent: not to a PX4 that is not heard, nor after giving back."""
        return not (self.silent or self.spent)

    def _decide(self, px4: Px4Seen, now_us: int, *, flies: bool) -> Wish:
        if px4.heard == self.silent:
            self._tell_of_link(px4)
        if px4.mode != OFFBOARD or not px4.armed:
            self.spent = False
        if self.silent:
            self.spent, self.asked_us = True, -1
            return Wish(disarm=flies)
        if px4.gives and not self.spent:
            return self._given(px4, now_us, flies=flies)
        if not flies:
            self.asked_us = -1
            return Wish()
        if px4.gives:  # armed by an operator, though it was given back
            self.spent = False
            return Wish()
        return self._not_given(px4, now_us)

    def _given(self, px4: Px4Seen, now_us: int, *, flies: bool) -> Wish:
        self.asked_us = -1
        if flies:
            return Wish()
        if self.flies:
            self.spent = True
            self._say(Severity.WARNING, "given back to PX4, which is asked to hold")
            return Wish(mode=HOLD)
        if now_us < self.arm_us:
            return Wish()
        if self.mode != OFFBOARD:
            self._say(Severity.INFO, "PX4 gives the vehicle: it follows the plan")
        self.arm_us = now_us + _ARM_AGAIN_US
        return Wish(arm=True)

    def _not_given(self, px4: Px4Seen, now_us: int) -> Wish:
        """Our autopilot flies and PX4 does not follow."""
        if self.flies and self.asked_us < 0:
            what = f"PX4 flies {mode_name(px4.mode)}" if px4.armed else "PX4 has disarmed"
            if px4.armed and px4.landed:
                what = "PX4 has landed"
            self._say(Severity.CRITICAL, f"{what}: the plan is not followed any more")
            return Wish(disarm=True)
        if not px4.armed or px4.landed:
            self._say(Severity.CRITICAL, "PX4 stands on the ground: take off with PX4 first")
            return Wish(disarm=True)
        if self.asked_us < 0:
            self.asked_us, self.ask_us = now_us, now_us
        if now_us - self.asked_us >= ANSWER_US:
            self.asked_us = -1
            why = f"PX4 stays in {mode_name(px4.mode)} and does not enter Offboard"
            self._say(Severity.CRITICAL, why)
            return Wish(disarm=True)
        if now_us < self.ask_us:
            return Wish()
        self.ask_us = now_us + _ASK_AGAIN_US
        return Wish(mode=OFFBOARD)

    def _tell_of_link(self, px4: Px4Seen) -> None:
        self.silent = not px4.heard
        if self.silent:
            why = f"PX4 is silent for {1e-6 * px4.silent_us:.1f} s: setpoints end"
            self._say(Severity.CRITICAL, why)
        else:
            self._say(Severity.INFO, "PX4 is heard")

    def _say(self, severity: Severity, text: str) -> None:
        self._texts.append(StatusText(severity, text, prompt=True))
