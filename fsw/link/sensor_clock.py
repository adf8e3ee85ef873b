"""The sensors' clock, and the vehicle's time, which goes on evenly where that clock jumps.

Steps are stamped by the sensors' clock. All that flies counts the vehicle's time: no plan, timeout
or measurement changes its age when the sensors' clock is set. A stamp that neither follows the last
step nor fits the time since is doubted at first. It may be wrong once, and datagrams come late,
twice and in another order. A step that is stamped a little before the last one and was sent after
it, as MAVLink's numbers of frames say, needs no second look: no late or doubled one is like that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from fsw.autopilot.measurements import Sample
from fsw.autopilot.ports import Clock
from fsw.frozen import replace

_GAP_US: Final = 50_000  # in which steps may be missing, as many as a tick makes up for
# So many steps in a row make another time. Those behind the last one may be old ones that come
# late, but then newer ones come in between. The last of four is there before readings are too old.
# Where old ones have come before, some newer ones may be lost as well; 40 ms can be made up for.
_STEPS_AHEAD, _STEPS_BACK, _STEPS_BACK_OR_LATE = 2, 4, 20
# So far back the numbers of frames, which begin anew after 256, say which step was sent first: late
# ones are less than half of that behind, at six frames a step.
_NUMBERED_US: Final = 40_000
# If the second stamp is farther behind the first one, the first one was wrong.
_FORGOTTEN_US: Final = 1_200_000
_LAST_US: Final = 1 << 62  # a stamp beyond is none: no step could follow it


@dataclass(slots=True)
class _Doubt:
    """Steps that follow each other, but not the last one that was believed."""

    first_us: int
    after_us: int  # from the last one that was believed to the first of these
    newest_us: int
    look: int  # in which the newest came
    silence: int  # how many there had been
    needed: int
    steps: int = 1


@dataclass(slots=True)
class SensorClock:
    """Says which steps are new, and what time it is for the vehicle."""

    _period_us: int  # from step to step
    _clock: Clock
    _say: Callable[[str], None]  # takes what was odd
    _jumped: Callable[[int], None]  # takes by how much the sensors' clock did [us]
    newest_us: int = -1  # stamp of the newest step, by the sensors' clock; -1: none yet
    ahead_us: int = 0  # of the sensors' clock before the vehicle's time
    looks: int = 0  # at what had come; steps of one look may be a burst of old ones
    silences: int = 0  # in which a simulator that waits for an answer repeats its step
    _number: int = 0  # of a frame of the newest step
    _jumped_us: int = -_NUMBERED_US  # when the clock has jumped, monotonic
    _usual_us: int = 0  # how far a step may be ahead without a second thought
    _first: bool = False  # the newest step is the first one
    _needed_back: int = _STEPS_BACK
    _doubt: _Doubt | None = None
    _heard_us: int = -1  # when a step was heard last, monotonic; -1: steps wait for answers
    _heard_stamp_us: int = -1  # its stamp

    def follows(self, t_us: int, number: int) -> bool:
        """Whether a stamp [us] is of a new step, which it is only once.

        ``number`` is that of a frame of the step, which its sender counts from 0 to 255.
        """
        if 0 < t_us - self.newest_us <= self._usual_us:
            self.newest_us, self._number = t_us, number
            return True
        return self._examine(t_us, number)

    def note_time(self) -> None:
        """Note that the newest step came now; what was silent for long may be far ahead then."""
        self._heard_us, self._heard_stamp_us = self._clock(), self.newest_us

    def in_vehicle_time(self, samples: list[Sample]) -> list[Sample]:
        """The samples at the vehicle's time."""
        ahead_us = self.ahead_us
        if not ahead_us:
            return samples
        # From whole microseconds, as they are read: no sample is behind its step by a rounding.
        return [replace(one, time=1e-6 * (round(1e6 * one.time) - ahead_us)) for one in samples]

    def _examine(self, t_us: int, number: int) -> bool:
        """What :meth:`follows` says, where it takes a second thought."""
        if self.newest_us < 0:
            return self._begin(t_us, number)
        gap_us = t_us - self.newest_us
        if self._first and gap_us < -_FORGOTTEN_US:
            # All steps would be older than the first one.
            self._say("first step stamped ahead of all others: forgotten")
            return self._begin(t_us, number)
        if self._was_sent_later(gap_us, number):
            self._doubt_step(t_us)
            self._jump()
        elif gap_us == 0 or self._is_of_before(number):
            return False
        elif 0 < gap_us <= _GAP_US or (gap_us > 0 and self._was_silent(t_us)):
            self._forget_doubt()
        elif self._is_another_time(t_us):
            self._jump()
        else:
            return False
        self.newest_us, self._number, self._first = t_us, number, False
        self._usual_us = 0 if self._jumps_now else _GAP_US
        return True

    def _begin(self, t_us: int, number: int) -> bool:
        if not t_us < _LAST_US:
            self._say("first step stamped beyond all times: ignored")
            return False
        self.newest_us, self._number, self._first = t_us, number, True
        return True

    def _was_sent_later(self, gap_us: int, number: int) -> bool:
        """Whether a step that is not stamped later was sent later than the newest all the same.

        In lockstep nothing is late, and a simulator may number a step anew that it repeats.
        """
        real_time = self._heard_us >= 0
        return real_time and -_NUMBERED_US <= gap_us <= 0 and 0 < self._sent_after(number) < 128

    def _is_of_before(self, number: int) -> bool:
        """Whether a step was sent before a jump, and comes late: its stamp may be ahead then."""
        return self._jumps_now and self._sent_after(number) >= 128

    def _sent_after(self, number: int) -> int:
        """How many frames after the newest step one was sent; from 128 on, before it."""
        return (number - self._number) % 256

    @property
    def _jumps_now(self) -> bool:
        """Whether steps of before the last jump may still come, in real time."""
        return self._heard_us >= 0 and self._clock() - self._jumped_us <= _NUMBERED_US

    def _was_silent(self, t_us: int) -> bool:
        """Whether so much time has passed since the last step; in lockstep none is missing."""
        if self._heard_us < 0:
            return False
        return t_us - self._heard_stamp_us <= self._clock() - self._heard_us + _GAP_US

    def _forget_doubt(self) -> None:
        doubt, self._doubt = self._doubt, None
        if doubt is None:
            return
        ahead_us = doubt.first_us - self.newest_us
        if ahead_us > 0:
            self._say(f"step stamped {1e-6 * ahead_us:.1f} s ahead: ignored")
        else:
            self._needed_back = _STEPS_BACK_OR_LATE

    def _is_another_time(self, t_us: int) -> bool:
        """Whether this step confirms those that were doubted."""
        doubt = self._doubt
        gap_us = _GAP_US + 1 if doubt is None else t_us - doubt.newest_us
        if doubt is None or not -_GAP_US <= gap_us <= _GAP_US or not t_us < _LAST_US:
            self._doubt_step(t_us)
            return False
        if gap_us < 0:
            return False  # one of these, late or twice
        if gap_us == 0:
            return self.silences != doubt.silence
        doubt.newest_us = t_us
        if self.looks != doubt.look:
            doubt.look = self.looks
            doubt.steps += 1
        return doubt.steps >= doubt.needed

    def _doubt_step(self, t_us: int) -> None:
        needed = _STEPS_AHEAD if t_us > self.newest_us else self._needed_back
        after_us = self._since_newest()
        self._doubt = _Doubt(t_us, after_us, t_us, self.looks, self.silences, needed)
        self._usual_us = 0

    def _since_newest(self) -> int:
        """Whole periods [us] that have begun since the newest step came, at least one."""
        if self._heard_us < 0:
            return self._period_us
        since_us = self._heard_stamp_us + self._clock() - self._heard_us - self.newest_us
        return max(round(since_us / self._period_us), 1) * self._period_us

    def _jump(self) -> None:
        """Let the vehicle's time go on from the last step that was believed."""
        doubt, self._doubt = self._doubt, None
        assert doubt is not None
        jump_us = doubt.first_us - self.newest_us - doubt.after_us
        self.ahead_us += jump_us
        self._heard_stamp_us += jump_us
        self._jumped_us = self._clock()
        self._jumped(jump_us)
