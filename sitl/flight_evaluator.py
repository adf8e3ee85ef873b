"""Judges a run on the plant's truth: margins, collisions, limits, landing, tracking error."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from sitl.compiled import machine_code
from sitl.judged_step import Free, Judge, judge_steps
from sitl.limits import LimitRecord, largest
from sitl.mission_clock import MissionClock
from sitl.plant.vector import Array
from sitl.result import EndKind, EndReason, MarginRecord, TrackingError, TruthResult, score
from sitl.scenario import V3, Scenario, vehicle_of
from sitl.scenario_validation import check_start
from sitl.start import flown_vehicle
from sitl.touch import TouchRecord, touch_flaws
from sitl.world import World, headroom

TOUCH_DOWN_MAX = 2.0  # m/s; a drop from 0.2 m
NO_AIM: Final = (np.empty(0), 0.0)
_NOTHING: Final = (0.0, 0.0)  # sent to a vehicle that is disarmed


class Flown(NamedTuple):
    """Plant steps that have been flown and wait to be judged."""

    places: Array  # (steps, rows, 3) m, NED
    states: Array  # (steps, n) SI
    thrust: tuple[float, ...]  # (r,) commanded, before any saturation, of each one's most [1]
    torque: tuple[float, ...]  # (j,) likewise
    armed: bool  # whether the vehicle flies: of one that does not, nothing is asked
    before_s: float  # time before the first
    step_s: float  # between two


class FlightEvaluator:
    """The score of one run and the first reason to end it.

    It begins with what the plant places at the start.

    Raises:
        ScenarioError: The start is outside the safe set.
    """

    def __init__(self, scenario: Scenario, clock: MissionClock, places: Array) -> None:
        """Begin with places (rows, 3) [m, NED], see ``sitl.plant.places``.

        For the full body the base's axes [1, NED] follow.
        """
        self._tool = 1 + len(vehicle_of(scenario).joints)  # row of the end-effector
        self.world = World(scenario)
        self.limits = LimitRecord(flown_vehicle(scenario))
        self.record = MarginRecord(self.world.keys, self.world.clearances)
        self.ended: EndReason | None = None
        self.left: str | None = None  # why the trajectory is no longer flown
        self.silent: str | None = None  # since which step the flight software was silent
        self._clock = clock
        self._error = TrackingError()
        self._duration_s = scenario.duration_s
        self._whole = _whole(scenario)
        table, parts = self.world.table, self.world.parts
        room = headroom(table, len(self.world.keys), len(places))
        self.quick = Judge(table, parts, *self.record.arrays, room, *self.limits.arrays)
        self._still = not any(zone.moves or zone.kind.follows_target for zone in self.world.zones)
        self._nowhere: Free = (room.places, parts.axes, parts.reach, -math.inf)
        self.free = self._nowhere  # in which there can be no incident
        self._flown: Flown | None = None
        none = (np.empty((0, *places.shape)), np.empty((0, 0)), (0.0, 0.0), NO_AIM, (0.0, 0.0))
        self._judge_steps = machine_code(judge_steps, self.quick, *none, False)
        margins = self.margins(places, 0.0)
        check_start(self.world.keys, margins)
        self.record.add(margins, 0.0)
        self._sample: tuple[V3, float] | None = None  # m, NED, of the end-effector; s
        self.sample_error(places, 0.0)

    def end(self, kind: EndKind, sentence: str, time_s: float) -> None:
        """End the run; the first reason stands."""
        if self.ended is None:
            self.ended = EndReason(kind, sentence, time_s)

    def margins(self, places: Array, time_s: float) -> tuple[float, ...]:
        """Margins [m] in the order of ``world.keys``, of places (rows, 3) [m, NED]."""
        applies = self.world.follows and self._clock.counts(time_s)
        target = self._clock.target_at(time_s).p if applies else None
        return self.world.margins(places, time_s, target)

    def judge(self, places: Array, time_s: float, step_s: float = 0.0) -> None:
        """Evaluate one plant step, ``step_s`` long, that ended with places (rows, 3) [m, NED]."""
        if self.ended is not None:
            return
        margins = self.margins(places, time_s)
        self.record.add(margins, time_s, step_s)
        if not np.isfinite(places).all():
            self.end(EndKind.DIVERGED, f"the simulation diverged at {time_s:.3f} s", time_s)
            return
        touched = self.world.collision(places, margins)
        if touched is not None:
            self.end(EndKind.COLLISION, f"{touched} at {time_s:.2f} s", time_s)

    def aim(self, until_s: float) -> tuple[Array, float] | None:
        """What ``record_if_clear`` aims at up to ``until_s``; None if it cannot judge till then."""
        if not self.world.follows:
            return NO_AIM
        clock = self._clock
        if clock.starts_s is None or not clock.counts(until_s):
            return None
        return clock.curve, clock.starts_s

    def judge_flown(self, flown: Flown, clear: bool) -> None:
        """Judge plant steps; where all have kept ``clear`` of any incident, that can wait.

        ``catch_up`` does it then, before ``flown`` is overwritten.
        """
        if self.ended is None:
            self._flown = flown
            if not clear:
                self._judge_flown()

    def _judge_flown(self) -> None:
        if self._flown is None:
            return
        (places, states, thrust, torque, armed, before_s, step_s) = self._flown
        self._flown = None
        aim = self.aim(before_s + len(places) * step_s)
        sent = largest(thrust, torque) if armed else _NOTHING
        how = (sent, aim or NO_AIM, (before_s, step_s), aim is not None)
        # The arm of a vehicle that stands is limp, and may fall against its stops.
        judged = states if armed else states[:0]
        free = self._judge_steps(self.quick, places, judged, *how)
        self.free = (*self._nowhere[:3], free) if self._still else self._nowhere
        if not free >= 0.0:
            self.judge_each(places, before_s, step_s)

    def judge_each(self, places: Array, before_s: float, step_s: float) -> None:
        """Judge the plant steps, ``step_s`` long, of an exchange that began at ``before_s``.

        ``places`` (steps, rows, 3) [m, NED] are from ``sitl.plant.integrator.integrate``.
        """
        for k, now in enumerate(places, start=1):
            self.judge(now, before_s + k * step_s, step_s)

    def judge_landing(self, speed: float, time_s: float) -> None:
        """Evaluate the landing speed [m/s] of the fastest foot on the ground."""
        if not (speed <= TOUCH_DOWN_MAX):
            sentence = (
                f"the legs hit the ground at {speed:.1f} m/s at {time_s:.2f} s, "
                f"{TOUCH_DOWN_MAX:.1f} m/s is the most they stand"
            )
            self.end(EndKind.CRASH, sentence, time_s)

    def judge_time(self, time_s: float) -> None:
        """End the run when its time is over."""
        if time_s >= self._duration_s - 1e-6:
            self.end(EndKind.DURATION, f"flew {time_s:.1f} s", time_s)

    def sample_error(self, places: Array, time_s: float) -> None:
        """Take one sample of the tracking error, of places (rows, 3) [m, NED], if it counts.

        It is compared with the reference by ``catch_up``: the vehicle need not wait for that.
        """
        self._compare()
        if self._clock.counts(time_s):
            self._sample = row_of_three(places, self._tool), time_s

    def catch_up(self) -> None:
        """Do what has been left for later: the last steps' judgement, and a sample's comparison."""
        self._judge_flown()
        self._compare()

    def _compare(self) -> None:
        """Compare the last sample with the reference, if that has not been done yet."""
        if self._sample is not None:
            (place, time_s), self._sample = self._sample, None
            self._error.add(place, self._clock.place_at(time_s))

    def result(self, time_s: float, touch: TouchRecord | None = None) -> TruthResult:
        """The score up to ``time_s``, with what the tool may ``touch`` if there is anything."""
        self.catch_up()
        uses = {} if touch is None else touch.uses()
        flaws = tuple(flaw for flaw in (self.left, self.silent) if flaw is not None)
        flaws += (*self.limits.flaws(), *touch_flaws(uses))
        truth = score(self.ended, time_s, self._error, self.record, self._whole, flaws)
        return replace(
            truth,
            limits=self.limits.uses(),
            touches=uses,
            force_error_rms_n=None if touch is None else touch.error_rms(),
            force_asked_rms_n=None if touch is None else touch.asked_rms(),
        )


def _whole(scenario: Scenario) -> EndKind:
    """The end that a completed run of a scenario has."""
    if scenario.pilot.plan == "hop":
        return EndKind.MISSION
    return EndKind.DURATION if math.isfinite(scenario.duration_s) else EndKind.INTERRUPTED


def row_of_three(places: Array, row: int) -> V3:
    """One ``row`` of places (rows, 3) [m, NED] as a tuple."""
    x, y, z = places[row].tolist()
    return (x, y, z)
