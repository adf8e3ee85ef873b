"""Whether samples that the filter refuses agree with each other: one alone may be wrong.

What is refused in flight is compared by its innovation, which knows how the vehicle has moved: a
run of refused samples goes on where value and direction nearly stay, of which noise makes no long
one, and until a pose is used. How long a run must be until it is believed grows with how far it
would move the estimate, from where it is or from where it was before it jumped: what was believed
wrongly is soon undone. Once it is believed it ends: the next jump needs a run of its own. One that
began with a step of the place is used as that, or not at all: it is no motion of the vehicle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from fsw.autopilot.measurements import AidingSample, GnssSample, PoseSample
from fsw.autopilot.signals import Vec3

# By which share of itself an innovation changes besides, because an inertial unit that is wrong
# leads the filter astray ever faster.
_GROWS: Final = 0.5
# By which share of itself it may change from one sample to the next and be no noise: of noise that
# nobody has stated, two steps in a row are as short as that once in 700 times.
_STAYS: Final = 0.5
_NO_CHANCE: Final = 3
_APART: Final = 0.25  # s; readings farther apart do not confirm each other
_SELDOM_APART: Final = 1.25  # s; the same of a sensor whose readings come farther apart than that
# How far a run may move and turn the estimate for each second that it lasts, and how far at once if
# the sensor has announced it: it may be wrong in that as well.
_BELIEVED: Final = (1.0, 0.3)  # m/s, rad/s
_ANNOUNCED: Final = (0.5, 0.2)  # m, rad


class Run(NamedTuple):
    """Samples of one kind in a row that were refused and agree; times are those of the samples."""

    kind: type
    since: float  # s
    last: float  # s
    innovation: tuple[float, ...]  # of the last one [SI]
    samples: int = 1
    # Of the last two times: how far each part's innovation was from the one before [SI].
    steps: tuple[tuple[float, ...], ...] = ()
    stepped: bool = False  # a place changed at once by what no inertial unit leads a filter astray

    @property
    def is_no_chance(self) -> bool:
        """Whether more samples agree than do by chance."""
        return self.samples >= _NO_CHANCE

    def is_no_noise(self, refused: Sequence[bool]) -> bool:
        """Whether what each ``refused`` part says stays nearly the same, as no noise does."""
        parts = zip(refused, (self.innovation[:3], self.innovation[3:]), *self.steps, strict=False)
        return self.is_no_chance and all(
            max(steps) < _STAYS * math.hypot(*part) for one, part, *steps in parts if one
        )

    def goes_on(self, sample: AidingSample, innovation: tuple[float, ...]) -> bool:
        """Whether a ``sample`` with its ``innovation`` [SI] is still where this run has stepped."""
        if not self.stepped or self.kind is not type(sample) or sample.time - self.last > _APART:
            return False
        return math.hypot(*innovation[:3]) > _STAYS * math.hypot(*self.place)

    @property
    def place(self) -> tuple[float, ...]:
        """By how much [m, NED] it would move the estimate; empty: it says nothing of that."""
        return self.innovation[:3] if self.kind in (PoseSample, GnssSample) else ()

    def is_believable(
        self, least: float, *, announced: bool = False, jumped: Vec3 = (0.0, 0.0, 0.0)
    ) -> bool:
        """Whether it has lasted for ``least`` [s], and for as long as its size asks for.

        Where the sensor has ``announced`` that it jumps, by little, two samples are enough. By
        ``jumped`` [m, NED] runs have moved the estimate: what takes that back moves it by the rest.
        """
        place = self.place
        turn = self.innovation[3:] if self.kind is PoseSample else ()
        undone = math.hypot(*[p + jump for p, jump in zip(place, jumped, strict=False)])
        sizes = [min(math.hypot(*place), undone), math.hypot(*turn)]
        if announced:
            least = 0.0
            if all(size <= most for size, most in zip(sizes, _ANNOUNCED, strict=True)):
                sizes = [0.0, 0.0]
        takes = [size / speed for size, speed in zip(sizes, _BELIEVED, strict=True)]
        return self.samples > 1 and self.last - self.since >= max(least, *takes)


def ended(runs: tuple[Run, ...], sample: object) -> tuple[Run, ...]:
    """The runs after a ``sample`` was used: a pose speaks against the one of poses.

    Within the gate of a heading or of a height garbage is now and then.
    """
    if not runs or not isinstance(sample, PoseSample):
        return runs
    return tuple([one for one in runs if one.kind is not PoseSample])


def extended(
    runs: tuple[Run, ...], new: Run, rooms: Callable[[float], tuple[float, ...]], *, seldom: bool
) -> Run:
    """The run that a ``new`` one of a single refused sample goes on with, or is itself.

    By how much innovations of its parts may differ [SI] after a time [s], ``rooms`` says. A sensor
    is heard ``seldom`` if its readings come more than 0.25 s apart.
    """
    for one in runs:
        apart = new.last - one.last
        if one.kind is not new.kind or apart > (_SELDOM_APART if seldom else _APART):
            continue
        a, b = one.innovation, new.innovation
        step = math.dist(a[:3], b[:3]), math.dist(a[3:], b[3:])
        parts = zip(step, (a[:3], a[3:]), rooms(apart), strict=False)
        if all(off <= room + _GROWS * math.hypot(*before) for off, before, room in parts):
            steps = (*one.steps[-1:], step)
            return new._replace(
                since=one.since,
                samples=one.samples + 1,
                steps=steps,
                stepped=one.stepped or new.stepped,
            )
    return new
