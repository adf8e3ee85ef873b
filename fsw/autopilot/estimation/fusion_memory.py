"""What the estimator carries from tick to tick: the filter, and what it knows of each sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.estimation.drift import FrameDrift
from fsw.autopilot.estimation.error_state import FILTER, Filter
from fsw.autopilot.estimation.faults.confirmation import Run
from fsw.autopilot.estimation.faults.encoder_watch import REPEATS
from fsw.autopilot.estimation.faults.residuals import MIN_WALKS
from fsw.autopilot.estimation.faults.sample_rate import SampleRate
from fsw.autopilot.estimation.faults.sensor_fault import Health, SensorFault
from fsw.autopilot.estimation.faults.verdict import Verdict
from fsw.autopilot.geometry.vectors import ZERO, add_scaled
from fsw.autopilot.measurements import (
    AidingSample,
    GnssSample,
    MagneticSample,
    PoseSample,
    Sample,
    Sensor,
)
from fsw.autopilot.signals import Vec3, Vec4
from fsw.frozen import dataclass, replace

NO_TURN: Final[Vec4] = (1.0, 0.0, 0.0, 0.0)


class Waiting(NamedTuple):
    """A sample, and when the filter reaches it; a tie is broken by the order of arrival."""

    time: float  # s
    number: int
    sample: AidingSample
    half: bool = False  # of a pose, only the place is used


class Reset(NamedTuple):
    """Jumps of the estimate, as PX4 reports them: how many there were, and the last one."""

    number: int = 0
    position: Vec3 = ZERO  # m, NED, new minus old
    velocity: Vec3 = ZERO  # m/s, NED, new minus old
    turn: Vec4 = NO_TURN  # new attitude times the inverse of the old one, NED
    expected: bool = True  # within what the filter doubted; else no other sensor says so


TickInputs = tuple[Sequence[Sample], float, bytes]
"""Samples, now [s], and the memory of what was ``Expected``."""


class Trail(NamedTuple):
    """A memory, and the inputs of all ticks since: to go back, and do without a sensor."""

    start: FusionMemory
    began: float  # s
    ticks: tuple[TickInputs, Any] | None = None  # the last one, and all before it

    def inputs(self) -> list[TickInputs]:
        """Of all ticks, in their order."""
        found, left = [], self.ticks
        while left is not None:
            one, left = left
            found.append(one)
        return found[::-1]


@dataclass(frozen=True, slots=True)
class FusionMemory:
    """What the estimator carries from tick to tick."""

    numbers: Filter
    now: float = -1.0  # s, of the last tick; negative: there was none
    imu_came: float = -1.0  # s, when a reading came last; negative: never
    joints_came: float = -1.0
    trail: Trail | None = None  # the newest one
    waiting: tuple[Waiting, ...] = ()
    health: tuple[Health, ...] = ()  # of each sensor heard so far
    arrivals: int = 0
    delay: float = 0.0  # s, that measurements have lately taken
    gnss: GnssSample | None = None  # the newest one
    pose: PoseSample | None = None  # the last one that the filter has reached
    reset_counter: int | None = None  # of the last pose
    runs: tuple[Run, ...] = ()  # of each kind the last samples that were refused
    started: bool = False
    field: Vec3 | None = None  # Gauss, body, the last one
    frame: FrameDrift = FrameDrift()  # of poses that drift
    reset: Reset = Reset()
    unproven: Vec3 = ZERO  # m, NED, by which jumps have moved the estimate that none expected
    delay_sigma: float = 0.0  # s, with which the estimate of the pose's own delay began
    sample_rates: tuple[SampleRate, ...] = ()  # how often sensors are heard
    restarts: int = 0  # how often the filter had to start anew, because it had no numbers any more
    began: float = -math.inf  # s, the filter's own time when it began
    without_fix: GnssSample | None = None  # the newest one that has none
    trail_before: Trail | None = None  # up to where the newest one began
    newest_pose: PoseSample | None = None  # whether it is used or not
    newest_field: MagneticSample | None = None
    verdict: Verdict = Verdict()  # on who is wrong
    replays: int = 0  # how often the filter went back to do without a sensor
    asked: float = -math.inf  # s, when it was last whether refused poses refute those before

    def of(self, sensor: Sensor) -> Health:
        """What is known of a sensor."""
        for one in self.health:
            if one.sensor is sensor:
                return one
        return Health(sensor)

    @property
    def encoders_stuck(self) -> bool:
        """Whether any of them is."""
        return math.inf in self.numbers["encoder_repeats"].ravel().tolist()

    @property
    def encoders_repeat(self) -> bool:
        """Whether all have said the same for long enough to ask whether they are stuck."""
        x = self.numbers[0]
        return bool(x["encoder_repeats"][: x["joint_count"]].min() >= REPEATS)

    def came(self, sensor: Sensor) -> float:
        """When a reading of a sensor came last [s]; negative: never."""
        if sensor is Sensor.IMU:
            return self.imu_came
        return self.joints_came if sensor is Sensor.ENCODERS else self.of(sensor).came

    def noting(self, health: Health) -> FusionMemory:
        """The memory with the health of one sensor renewed."""
        return replace(self, health=(*self.without(health.sensor), health))

    def noting_fault(self, sensor: Sensor, fault: SensorFault, now: float) -> FusionMemory:
        """The memory with a ``fault`` of a sensor that was seen at ``now`` [s]."""
        return self.noting(self.of(sensor).with_fault(fault, now))

    def noting_faults(self, of_imu: int, of_encoders: int, now: float) -> FusionMemory:
        """The memory with faults that the filter has seen at ``now`` [s]; 0: none."""
        memory = self
        for sensor, fault in ((Sensor.IMU, of_imu), (Sensor.ENCODERS, of_encoders)):
            if fault:
                memory = memory.noting_fault(sensor, SensorFault(fault), now)
        return memory

    def hearing(self, sample: AidingSample) -> FusionMemory:
        """The memory after a ``sample`` that is plausible, whether it is used or not."""
        match sample:
            case PoseSample():
                return replace(self, newest_pose=sample)
            case GnssSample():
                return replace(self, gnss=sample)
            case MagneticSample():
                return replace(self, newest_field=sample)
        return self

    def after(self, one: Waiting, health: Health, runs: tuple[Run, ...]) -> FusionMemory:
        """The memory after the first of the waiting samples was fused, or refused: see ``runs``."""
        sample, pose, counter = one.sample, self.pose, self.reset_counter
        if isinstance(sample, PoseSample):
            pose, counter = sample, sample.reset_counter
        known, waiting = (*self.without(health.sensor), health), self.waiting[1:]
        return replace(
            self, waiting=waiting, health=known, pose=pose, reset_counter=counter, runs=runs
        )

    def without(self, sensor: Sensor) -> list[Health]:
        """What is known of the other sensors."""
        return [one for one in self.health if one.sensor is not sensor]

    def jumped(
        self,
        position: Vec3 = ZERO,
        velocity: Vec3 = ZERO,
        turn: Vec4 = NO_TURN,
        *,
        expected: bool = False,
    ) -> FusionMemory:
        """The memory after the estimate's ``position`` [m, NED] and all else have jumped.

        ``velocity`` [m/s, NED], ``turn`` [1] and ``expected`` as in ``Reset``.
        """
        reset = Reset(self.reset.number + 1, position, velocity, turn, expected)
        memory = replace(self, reset=reset)
        return memory._begun_anew() if expected else memory.led(position)

    def led(self, by: Vec3) -> FusionMemory:
        """The memory after the estimate was moved ``by`` [m, NED], and none but a place says so."""
        return replace(self, unproven=add_scaled(self.unproven, by, 1.0))._begun_anew()

    def _begun_anew(self) -> FusionMemory:
        """The memory whose innovations are compared from now on.

        They begin at none: one that has gone because the estimate has moved there was no noise.
        """
        for before in ("innovated_last", "innovated_before", "leaning"):
            self.numbers[before] = 0.0
        return self


def copied(x: NDArray[Any]) -> NDArray[Any]:
    """Another record ``x`` (1,) [SI] of the same numbers; as bytes, in half an array's time."""
    memory: Any = x.base
    return np.ndarray(1, x.dtype, bytearray(memory if type(memory) is bytearray else x.tobytes()))


def at_start(joints: int, turns: Sequence[float] = (1.0,) * 4) -> FusionMemory:
    """Memory before the first sample, of a vehicle of so many ``joints``.

    What rotors do not explain ``turns`` it so much [1] more than the paper's
    (``residuals.scale_of_turns``).
    """
    x = np.ndarray(1, FILTER, bytearray(FILTER.itemsize))
    x["joint_count"], x["turns"] = joints, turns
    x["model_walk"], x["scatter"], x["refuted"] = MIN_WALKS, 1.0, -math.inf
    return FusionMemory(x)
