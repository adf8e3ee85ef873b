"""The estimator: samples of all sensors in, the present state with its uncertainty out.

A sample is looked at when it comes (``sensors/base.py``), waits until the filter has reached the
time at which it was measured, and is fused there. What the gate refuses for long is taken as it is,
and the jump that this makes is reported, so that a plan can jump along.

Memory goes in and comes out, as everywhere in the tick; kernels work on the copy that the tick
makes of the filter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.estimation import fusion, kernels
from fsw.autopilot.estimation.error_state import DELAY, ERRORS, FRAME, TH, Array, Filter, Law
from fsw.autopilot.estimation.faults import residuals
from fsw.autopilot.estimation.faults.arbitration import Arbitration, begun
from fsw.autopilot.estimation.faults.confirmation import Run, ended, extended
from fsw.autopilot.estimation.faults.residuals import EVIDENCE, NO_AID
from fsw.autopilot.estimation.faults.sensor_fault import Health, SensorFault
from fsw.autopilot.estimation.faults.sources import AM, Source
from fsw.autopilot.estimation.faults.verdict import Verdict
from fsw.autopilot.estimation.filter_start import FilterStart
from fsw.autopilot.estimation.fusion_memory import (
    FusionMemory,
    TickInputs,
    Trail,
    Waiting,
    at_start,
    copied,
)
from fsw.autopilot.estimation.imu import IMU_SILENT, IMU_TOO_OLD, STUCK_READINGS, TIME_TOLERANCE
from fsw.autopilot.estimation.joint_filter import ENCODERS_TOO_OLD
from fsw.autopilot.estimation.kernels import (
    ADVANCE,
    END,
    FAULT,
    FINITE,
    JOINTS,
    PRESENT_AT,
    PUSH,
    READING,
    STUCK,
    Asked,
)
from fsw.autopilot.estimation.sensors import SENSORS
from fsw.autopilot.estimation.sensors.base import CREEPS, AidingSensor, attitude_of, chi_square
from fsw.autopilot.estimation.sensors.pose import Pose, is_attitude_stuck
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.geometry.quaternion import conjugate, multiply
from fsw.autopilot.geometry.rotation import matrix_from_quaternion, rotate_back
from fsw.autopilot.geometry.vectors import add_scaled, norm
from fsw.autopilot.measurements import (
    AidingSample,
    GnssSample,
    ImuSample,
    JointSample,
    PoseSample,
    Sample,
    Sensor,
)
from fsw.autopilot.signals import StateEstimate, Vec3, Vec4
from fsw.autopilot.tick_record import Expected, estimate_in
from fsw.compiled import machine_code, packed
from fsw.frozen import replace
from fsw.record import JOINTS as JOINT_CAPACITY
from fsw.record import padded

_FARTHEST_BEHIND: Final = 0.1  # s, that the filter stays behind while there is nothing to fuse
LATE: Final = 0.01  # s behind the filter, where a measurement is still fused as it stands
_MARGIN: Final = 0.003  # s, by which a measurement may take longer than lately
_LONGEST_STEP: Final = 0.05  # s, by which joints are predicted at once
# A pose that is refused by no more says nothing of itself at first: the inertial unit may have been
# wrong by as much before it is found out.
_FELT: Final = 0.3
_SMALL_STEP: Final = 0.05  # m
_SMALL_TURN: Final = 0.1  # rad
# A frame that has been moved is level to so much, and the filter to so many deviations.
_LEVEL: Final = 0.05  # rad
_SIGMAS: Final = 3.0
_JUST_REFUSED: Final = math.nextafter(1.0, 2.0)  # chi-square over gate
_SOON: Final = 0.25  # s, in which what an inertial unit does wrong shows by little
_UNKNOWN: Final = Expected()
_LOST: Final[Vec3] = (math.nan, math.nan, math.nan)
_OF_EVERY_TICK: Final = (ImuSample, JointSample)

FilterCall = Callable[[Filter, Law, NDArray[Any], int, float, float], int]
"""What ``kernels.tick`` is."""


class SensorFusion:
    """The estimator of one configuration; holds only what never changes in flight."""

    def __init__(self, tuning: EstimatorTuning, joints: int, run: FilterCall | None = None) -> None:
        """Estimate a vehicle of so many ``joints`` [1], by ``run`` or ``kernels.tick`` itself."""
        self.tuning, self._joints = tuning, joints
        self.law = packed(tuning)
        self._sensors: dict[type, AidingSensor[Any, Any]] = {
            kind.sample: kind(getattr(tuning, kind.sensor.name.lower())) for kind in SENSORS
        }
        self._pose = Pose(tuning.pose)
        self._start = FilterStart(tuning, self.law)
        self._arbitration = Arbitration(self._sensors, tuning.stale_time, self._again)
        self._asked = Asked()  # written anew in each call
        self._requests = self._asked.array
        self._tick = run or machine_code(kernels.tick)

    def warm_up(self) -> StateEstimate:
        """Compile every kernel: stand for a while with every sensor, then take jumps."""
        memory, estimate, t = at_start(self._joints), None, 0.0
        for k in range(60):
            t = 1.0 + 0.01 * k
            memory, estimate = self.step(memory, _at_rest(t, self._joints), t)
        assert estimate is not None
        for sensor in self._sensors.values():
            sensor.take(memory, sensor.at_rest, t, (2.0, 2.0))
        fusion.doubt_force(memory.numbers)
        residuals.look(np.zeros(1, EVIDENCE), memory.numbers, t, NO_AID, NO_AID, NO_AID, False)
        self.covariance(memory, t)
        return estimate

    def step(
        self,
        memory: FusionMemory,
        samples: Sequence[Sample],
        now: float,
        expected: Expected = _UNKNOWN,
    ) -> tuple[FusionMemory, StateEstimate | None]:
        """``take_in`` and ``catch_up``; the state at ``now`` [s] after both."""
        memory, estimate = self.take_in(memory, samples, now, expected)
        return self.catch_up(memory, samples, estimate)

    def take_in(
        self,
        memory: FusionMemory,
        samples: Sequence[Sample],
        now: float,
        expected: Expected = _UNKNOWN,
    ) -> tuple[FusionMemory, StateEstimate | None]:
        """Take in what IMU and encoders measured since the last tick; the state at ``now`` [s].

        Of the other ``samples`` it knows what ``catch_up`` has fused so far. Where IMU or encoders
        are silent or of no use, what is ``expected`` of the commands stands in. None before there
        was a pose, or a position and a heading, to start from, and a reading of the arm.
        """
        memory, found = self.take_in_by(memory, samples, now, expected, self._tick)
        if found & FINITE:
            return memory, estimate_in(self._asked, PRESENT_AT, self._joints)
        ready = memory.started and memory.joints_came >= 0.0
        return (_anew(memory) if ready else memory), None

    def take_in_by(
        self,
        memory: FusionMemory,
        samples: Sequence[Sample],
        now: float,
        expected: Expected | None,
        run: FilterCall,
    ) -> tuple[FusionMemory, int]:
        """What ``take_in`` does until ``now`` [s], and what came of it, by ``run``.

        That does what ``kernels.tick`` does; where nothing is ``expected`` it finds out by itself.
        """
        dt = min(max(now - memory.now, 0.0), _LONGEST_STEP) if memory.now >= 0.0 else 0.0
        x = copied(memory.numbers)
        asked = self._asked
        asked.begin(now, dt, expected)
        memory, parts, imu_came, joints_came = self._take_each(memory, x, samples, now, run)
        silent = 0.0 <= imu_came < now - IMU_SILENT
        if silent:
            # In place of a reading what the model makes of the last one; it is no fault.
            asked.read(now, _LOST, _LOST)
            parts |= READING
        if memory.started and joints_came >= 0.0:
            parts |= END
        found = run(x, self.law, self._requests, parts, now, 0.0)
        if found & FAULT:
            memory = memory.noting_faults(0 if silent else asked.of_imu, asked.of_encoders, now)
        trail = memory.trail
        if trail is not None:
            tick = samples, now, bytes(asked.expected.memory)
            trail = Trail(trail.start, trail.began, (tick, trail.ticks))
        memory = replace(
            memory,
            numbers=x,
            now=now,
            imu_came=imu_came,
            joints_came=memory.joints_came if found & STUCK else joints_came,
            trail=trail,
        )
        return memory, found

    def _take_each(
        self,
        memory: FusionMemory,
        x: Filter,
        samples: Sequence[Sample],
        now: float,
        run: FilterCall,
    ) -> tuple[FusionMemory, int, float, float]:
        """Ask for readings of IMU and encoders to be taken in, one after the other.

        Also the parts that are asked for by then, and when each sensor came last [s]. Of a second
        reading of a sensor the first is done at once.
        """
        asked, parts = self._asked, PUSH
        imu_came, joints_came = memory.imu_came, memory.joints_came
        for sample in samples:
            if isinstance(sample, ImuSample):
                if sample.time < now - IMU_TOO_OLD and memory.started:
                    memory = memory.noting_fault(Sensor.IMU, SensorFault.TOO_OLD, now)
                    continue
                if parts & READING:
                    memory, parts = self._done(memory, x, parts, now, run), 0
                asked.read(sample.time, sample.acceleration, sample.rate)
                parts, imu_came = parts | READING, now
            elif isinstance(sample, JointSample):
                fault = _fault_of_encoders(sample, now, joints_came)
                if fault:
                    memory = memory.noting_fault(Sensor.ENCODERS, fault, now)
                    if fault is not SensorFault.RATE_TOO_LOW:
                        continue
                if joints_came < 0.0 or parts & JOINTS:
                    memory, parts = self._done(memory, x, parts, now, run), 0
                if joints_came < 0.0:
                    angles = padded(sample.angles, JOINT_CAPACITY)
                    kernels.set_joints(x, self.law, sample.time, angles)
                else:
                    asked.read_joints(sample.angles, now - sample.time)
                    parts |= JOINTS
                joints_came = now
        return memory, parts, imu_came, joints_came

    def catch_up(
        self,
        memory: FusionMemory,
        samples: Sequence[Sample],
        estimate: StateEstimate | None,
        *,
        aloft: Callable[[], bool] = lambda: True,
        flies: bool = True,
        damaged: bool = False,
        touches: bool = False,
    ) -> tuple[FusionMemory, StateEstimate | None]:
        """Check the other ``samples``, fuse what the filter reaches; the state of this tick.

        The loops need not wait for it: a pose is late anyway, and the next tick knows of it. Where
        there is nothing to fuse the state is the ``estimate`` of ``take_in``. Every 20 ms it is
        asked whether all sensors agree, unless the vehicle is so low that the ground may hold it.
        Of a ``damaged`` one a rotor or a joint is known to have failed, and one that ``touches``
        something is turned by that.
        """
        memory, found = self._caught_up(memory, samples, estimate)
        if not memory.started:
            return memory, found
        if found is None:
            return begun(memory), None
        return self._arbitration.step(
            memory, found, aloft=aloft, flies=flies, damaged=damaged, touches=touches
        )

    def rests(self, memory: FusionMemory, samples: Sequence[Sample]) -> bool:
        """Whether ``catch_up`` would find nothing to do: nothing came, or is due."""
        if not memory.started or self._arbitration.is_due(memory):
            return False
        came = [one for one in samples if not isinstance(one, _OF_EVERY_TICK)]
        return not came and _rests(memory)

    def _again(
        self, memory: FusionMemory, tick: TickInputs
    ) -> tuple[FusionMemory, StateEstimate | None]:
        samples, now, expected = tick
        memory, found = self.take_in(memory, samples, now, Expected(expected))
        return self._caught_up(memory, samples, found)

    def _caught_up(
        self, memory: FusionMemory, samples: Sequence[Sample], estimate: StateEstimate | None
    ) -> tuple[FusionMemory, StateEstimate | None]:
        now = memory.now
        for sample in samples:
            if not isinstance(sample, _OF_EVERY_TICK):
                memory = self.take(memory, sample, now)
        if estimate is not None and _rests(memory):
            return memory, estimate
        x = copied(memory.numbers)
        memory = replace(memory, numbers=x)
        self._asked.begin(now, 0.0, _UNKNOWN)
        if not memory.started:
            memory = self._start(memory)
        if not (memory.started and memory.joints_came >= 0.0):
            return memory, None
        until = now - memory.delay - _MARGIN
        while memory.waiting and memory.waiting[0].time <= until:
            self._tick(x, self.law, self._requests, ADVANCE, now, memory.waiting[0].time)
            memory = self._fuse_first(memory)
        if self._tick(x, self.law, self._requests, ADVANCE | END, now, until) & FINITE:
            return memory, estimate_in(self._asked, PRESENT_AT, self._joints)
        return _anew(memory), None

    def _done(
        self, memory: FusionMemory, x: Filter, parts: int, now: float, run: FilterCall
    ) -> FusionMemory:
        """The memory once the filter has taken in ``parts`` of what is asked."""
        asked = self._asked
        if run(x, self.law, self._requests, parts, now, 0.0) & FAULT:
            memory = memory.noting_faults(asked.of_imu, asked.of_encoders, now)
        return memory

    def covariance(self, memory: FusionMemory, now: float) -> Array:
        """Covariance (17, 17) [SI] of the error of the state at ``now`` [s]."""
        found, shared = np.empty((ERRORS, ERRORS)), np.empty((ERRORS, FRAME))
        kernels.present_covariance(memory.numbers, self.law, now, found, shared)
        if not memory.numbers[0]["drifts"]:
            return found
        return memory.frame.in_world(found, shared, memory.numbers[0])

    def take(self, memory: FusionMemory, sample: AidingSample, now: float) -> FusionMemory:
        """Check a ``sample`` that came at ``now`` [s] and let it wait for its time."""
        x, sensor = memory.numbers, self._sensors[type(sample)]
        before = memory.of(sensor.sensor)
        health, fault = sensor.receive(
            before, sample, now, lambda: bool(x["same"][0].min() >= STUCK_READINGS)
        )
        half = fault is SensorFault.STUCK and is_attitude_stuck(health)
        if half:
            fault = SensorFault.NONE
        time = sensor.measured_at(memory, sample)
        if not fault and memory.started and time < x["time"][0] - LATE:
            fault = SensorFault.TOO_OLD
            # Measured before the filter began, it came as soon as it could.
            if time >= memory.began or now - time > self.tuning.longest_delay:
                health = health.with_fault(fault, now)
        delay = memory.delay
        if fault in (SensorFault.NONE, SensorFault.TOO_OLD):
            # As long as measurements have taken; it fades with the time since the last one.
            faded = delay - self.tuning.delay_decay * min(now - before.came, 1.0)
            delay = min(max(now - time, faded), self.tuning.longest_delay)
        others, used = memory.without(health.sensor), False
        if not fault:
            memory = memory.hearing(sample)
            health, used, half = _as_judged(memory.verdict, sensor.source, health, now, half)
        if not used:
            if isinstance(sample, GnssSample) and fault is SensorFault.NO_FIX:
                memory = replace(memory, without_fix=sample)
            return replace(memory, health=(*others, health), delay=delay)
        waiting = (*memory.waiting, Waiting(time, memory.arrivals, sample, half))
        if len(waiting) > 1 and waiting[-2].time > time:
            waiting = tuple(sorted(waiting))
        arrivals, known = memory.arrivals + 1, (*others, health)
        return replace(memory, waiting=waiting, health=known, arrivals=arrivals, delay=delay)

    def _with_delay_known(self, memory: FusionMemory) -> FusionMemory:
        """The memory after the parameters of the pose's delay may have changed in flight."""
        x, sigma = memory.numbers[0], self.tuning.pose.delay_sigma
        if not sigma:
            x["pose_delay"] = self.tuning.pose.delay
        if sigma == memory.delay_sigma or not memory.started:
            return memory
        M = x["covariance"]
        M[DELAY], M[:, DELAY], x["shared"][DELAY] = 0.0, 0.0, 0.0
        x["with_offset"][DELAY] = 0.0
        M[DELAY, DELAY] = sigma**2
        return replace(memory, delay_sigma=sigma)

    def _fuse_first(self, memory: FusionMemory) -> FusionMemory:
        """Fuse the first of the waiting samples, whose time the filter has."""
        one, now = memory.waiting[0], memory.now
        sample, sensor = one.sample, self._sensors[type(one.sample)]
        heads = sensor.source is Source.COMPASS and memory.verdict.suspects & Source.COMPASS
        if heads or _is_refuted(memory, sample):
            # A heading that may be wrong is not needed, and turns what else is measured. It may be
            # so since it has come.
            return replace(memory, waiting=memory.waiting[1:])
        announced, drifts = False, False
        refused: tuple[bool, ...] = ()
        if isinstance(sample, PoseSample):
            memory = self._with_delay_known(memory)
            announced = memory.reset_counter not in (None, sample.reset_counter)
            drifts = sample.drifts
            if drifts:
                stated = self._pose.stated(sample)
                moved = memory.frame.moved(memory.numbers[0], stated, announced)
                memory = replace(memory, frame=moved)
            # Whether each half of the last pose was.
            refused = tuple([1.0 < one < math.inf for one in memory.of(Sensor.POSE).ratio])
        kept = memory.numbers[0].copy() if (announced and drifts) or any(refused) else None
        ratio = sensor.fuse(memory, sample, one.half)
        innovation = tuple(memory.numbers["innovation"].ravel().tolist())
        if not (announced or any(refused)) and max(ratio) <= 1.0:  # as nearly always
            health = memory.of(sensor.sensor)
            shown = innovation if len(ratio) > 1 else innovation[:1]
            return memory.after(
                one,
                health.with_fused((now,) * len(ratio), ratio, shown),
                ended(memory.runs, sample),
            )
        passes = [r <= 1.0 and before for r, before in zip(ratio, refused, strict=False)]
        if any(passes) and not self._is_expected(memory, sample, innovation, passes):
            # The gate widens meanwhile, until some of what is garbage is within it: a run has to
            # say so.
            memory.numbers[0] = kept
            ratio = tuple([max(r, _JUST_REFUSED) for r in ratio])
        previous = kept if announced and drifts else None
        return self._judged(memory, one, ratio, innovation, announced=announced, previous=previous)

    def _is_expected(
        self,
        memory: FusionMemory,
        sample: AidingSample,
        innovation: tuple[float, ...],
        passes: Sequence[bool],
    ) -> bool:
        """Whether a pose whose last one was refused is used without a run that says the same.

        One is that is off by little, or by no more than noise makes it in what ``passes`` the gate
        of a filter that doubts; unless none has been used for so long that noise is not known. What
        has stepped is used as a step once it is believed: it is none of the vehicle's motion.
        """
        if any(one.goes_on(sample, innovation) for one in memory.runs):
            return False
        if _is_small(sample, innovation):
            return True
        used = memory.of(Sensor.POSE).fused
        if not isinstance(sample, PoseSample) or memory.now - min(used) > self.tuning.reset_time:
            return False
        sigmas = self._pose.deviations(memory, self._pose.stated(sample))
        most = math.sqrt(chi_square(self.tuning.pose.gate, 3))
        parts = zip(passes, (innovation[:3], innovation[3:]), sigmas, strict=True)
        return all(math.hypot(*off) <= most * sigma for said, off, sigma in parts if said)

    def _judged(
        self,
        memory: FusionMemory,
        one: Waiting,
        ratio: tuple[float, ...],
        innovation: tuple[float, ...],
        *,
        announced: bool,
        previous: Any,
    ) -> FusionMemory:
        """The memory after the first of the waiting samples was fused, or refused.

        Chi-square over gate and innovation are of each of its parts. The frame of a pose may have
        jumped (``announced``), from the filter's ``previous`` state if it drifts. How far, two
        poses must agree upon: the one that announces it may be wrong as well.
        """
        sample, sensor, now = one.sample, self._sensors[type(one.sample)], memory.now
        health = memory.of(sensor.sensor)
        # What is infinite says nothing here.
        refused = any(1.0 < r < math.inf for r in ratio)
        if refused and sensor.starts_anywhere and not health.fused:
            refused, memory = False, sensor.take(memory, sample, one.time, ratio)
            ratio = (1.0,) * len(ratio)
        runs, run = memory.runs if refused else ended(memory.runs, sample), None
        used = [at for at, r in zip(health.fused, ratio, strict=False) if r < math.inf]
        long_refused = bool(used) and now - min(used) > self.tuning.reset_time
        if refused:
            run = self._run(memory, sensor, sample, innovation)
            runs = (*[other for other in runs if other.kind is not run.kind], run)
            if run.stepped:  # which is no force's: that would grow
                memory.numbers["leaning"][0] = 0.0
            little = _is_small(sample, innovation)
            if announced or long_refused or not little:
                health = health.with_fault(SensorFault.JUMP, now)
            parts = [1.0 < r < math.inf for r in ratio]
            lately = now - float(memory.numbers["refuted"][0, 1]) < fusion.REFUTED_FOR
            # What turned as the gyro says, and moved as no force says, is the accelerometer's.
            moves = parts == [True, False] and not (announced or run.stepped or lately)
            moves = moves and _is_felt(memory)
            if little and moves and run.is_no_noise(parts):
                before = memory.numbers[0].copy()
                fusion.doubt_force(memory.numbers)
                ratio = sensor.fuse(memory, sample, one.half)
                memory = memory.led(_jump(before, memory.numbers[0])[0])
        fused = health.fused or (now,) * len(ratio)
        fused = tuple([now if r <= 1.0 else before for r, before in zip(ratio, fused, strict=True)])
        shown = innovation if len(ratio) > 1 else innovation[:1]
        health = health.with_fused(fused, ratio, shown)
        counter, memory = memory.reset_counter, memory.after(one, health, runs)
        believed = (
            run is not None
            and run.is_believable(
                self.tuning.reset_time, announced=announced, jumped=memory.unproven
            )
            and not _tilts(memory, sample, innovation)
        )
        if announced and run is not None and not believed:
            memory = replace(memory, reset_counter=counter)
        if run is not None and believed and any(1.0 < r < math.inf for r in ratio):
            memory = sensor.take(memory, sample, one.time, ratio)
            taken = zip(fused, ratio, strict=True)
            fused = tuple([now if r < math.inf else before for before, r in taken])
            # The estimate is there now: this one was used, and the next run begins anew.
            ratio = tuple([min(r, 1.0) if r < math.inf else r for r in ratio])
            health = health.with_fused(fused, ratio, (0.0,) * len(health.innovation))
            runs = tuple([one for one in memory.runs if one.kind is not run.kind])
            memory = replace(memory.noting(health), runs=runs)
        elif previous is not None and not refused:
            memory = memory.jumped(*_jump(previous, memory.numbers[0]), expected=True)
        return memory

    def _run(
        self,
        memory: FusionMemory,
        sensor: AidingSensor[Any, Any],
        sample: AidingSample,
        innovation: tuple[float, ...],
    ) -> Run:
        """The run of refused samples that this one goes on with, or begins."""
        scales = memory.numbers["noise_scale"][0, sensor.noise_scales].tolist()
        rooms = partial(sensor.rooms, sample, tuple([max(scale, 1.0) for scale in scales]))
        stepped = isinstance(sample, PoseSample) and self._stepped(memory, sample, innovation)
        new = Run(type(sample), sample.time, sample.time, innovation, stepped=stepped)
        seldom = memory.of(sensor.sensor).apart >= 0.25
        return extended(memory.runs, new, rooms, seldom=seldom)

    def _stepped(
        self, memory: FusionMemory, sample: PoseSample, innovation: tuple[float, ...]
    ) -> bool:
        """Whether a place is off at once by what it was not off by one pose before.

        A filter that an inertial unit leads astray is off by more and more, unless that says what
        none can say.
        """
        last, before = memory.pose, memory.of(Sensor.POSE).innovation
        if memory.now - memory.of(Sensor.IMU).fault_at < self.tuning.reset_time:
            return False
        if last is None or len(before) < 3 or not 0.0 < sample.time - last.time < _SOON:
            return False
        if memory.of(Sensor.POSE).ratio[0] > 1.0:
            return False  # that one was off itself
        sigma = self._pose.deviations(memory, self._pose.noise(memory, sample))[0]
        noise = self.tuning.pose.gate * math.sqrt(2.0) * sigma
        room = noise + CREEPS * (sample.time - last.time)
        return math.dist(innovation[:3], before[:3]) > room


def _rests(memory: FusionMemory) -> bool:
    """Whether there is nothing to fuse now.

    Then the filter may stay where it is: the state is made of the IMU's readings since.
    """
    if not memory.started:
        return False
    waits = memory.waiting
    if waits:
        return waits[0].time > memory.now - memory.delay - _MARGIN
    return bool(memory.now - memory.numbers[0]["time"] < _FARTHEST_BEHIND)


def _anew(memory: FusionMemory) -> FusionMemory:
    """The memory with a filter that starts from the next samples, because it is no number."""
    x = memory.numbers[0]
    return replace(
        memory,
        numbers=at_start(int(x["joint_count"]), x["turns"]).numbers,
        joints_came=-1.0,
        imu_came=-1.0,
        started=False,
        waiting=(),
        pose=None,
        restarts=memory.restarts + 1,
        verdict=Verdict(),
        trail=None,
        trail_before=None,
    )


def _fault_of_encoders(sample: JointSample, now: float, came: float) -> SensorFault:
    """What is wrong with a reading of the encoders at ``now`` [s]; ``came`` [s] the last one."""
    if not sample.time <= now + TIME_TOLERANCE:
        return SensorFault.FUTURE
    if not all(abs(angle) < math.pi for angle in sample.angles):
        return SensorFault.IMPLAUSIBLE
    if came < 0.0:
        return SensorFault.NONE
    if sample.time < now - ENCODERS_TOO_OLD:
        return SensorFault.TOO_OLD
    return SensorFault.RATE_TOO_LOW if now - came > ENCODERS_TOO_OLD else SensorFault.NONE


def _is_refuted(memory: FusionMemory, sample: AidingSample) -> bool:
    """Whether it is of a time of which later poses have refuted those that came."""
    since, until = memory.numbers["refuted"][0].tolist()
    return isinstance(sample, PoseSample) and since <= sample.time < until


def _is_felt(memory: FusionMemory) -> bool:
    """Whether rotors do not contradict that the force that is felt is off."""
    evidence = memory.verdict.evidence
    return evidence is None or not 0.0 < evidence["ratio"][0, AM] <= _FELT


def _is_small(sample: AidingSample, innovation: tuple[float, ...]) -> bool:
    """Whether a pose is refused by so little that it need not be the pose that is wrong."""
    if not isinstance(sample, PoseSample):
        return False
    x, y, z, a, b, c = innovation
    return norm((x, y, z)) < _SMALL_STEP and norm((a, b, c)) < _SMALL_TURN


def _as_judged(
    verdict: Verdict, source: Source, health: Health, now: float, half: bool
) -> tuple[Health, bool, bool]:
    """A ``source``'s health at ``now`` [s], whether its sample is used, and whether by ``half``.

    Of a pose whose attitude repeats itself, is contested or is named, the place is used alone.
    """
    half = half or verdict.contested
    if not verdict.wrong:
        return health, True, half
    wrong = verdict.wrong & source
    if wrong:
        health = health.with_fault(SensorFault.DISAGREES, now)
    return health, not wrong & ~Source.ATTITUDE, half or bool(wrong)


def _tilts(memory: FusionMemory, sample: AidingSample, innovation: tuple[float, ...]) -> bool:
    """Whether a pose has jumped in a way that no frame does: down stays where it is.

    In flight the filter knows where, but for what a gyro may have turned it by that others
    contradict now.
    """
    x, evidence = memory.numbers[0], memory.verdict.evidence
    if not isinstance(sample, PoseSample) or evidence is None or evidence[0]["began"] < 0.0:
        return False
    verdict, room = memory.verdict, 0.0
    if verdict.is_on:  # what fires by chance has turned nothing so far
        used = max(memory.of(Sensor.POSE).fused[1], verdict.since)
        room = (memory.now - used) * residuals.size_of(evidence, Source.GYRO)
    rx, ry, rz = innovation[3:]
    down = rotate_back(matrix_from_quaternion(attitude_of(x)), (0.0, 0.0, 1.0))
    along = rx * down[0] + ry * down[1] + rz * down[2]
    known = math.sqrt(max(x["covariance"].diagonal()[TH : TH + 3].tolist()))
    tilt = norm(add_scaled((rx, ry, rz), down, -along))
    return bool(tilt > _LEVEL + _SIGMAS * known + room)


def _jump(before: Any, after: Any) -> tuple[Vec3, Vec3, Vec4]:
    """Position [m, NED], velocity [m/s, NED] and turn [1] from one state to another."""
    px, py, pz = (after["p"] - before["p"]).tolist()
    vx, vy, vz = (after["v"] - before["v"]).tolist()
    return (px, py, pz), (vx, vy, vz), multiply(attitude_of(after), conjugate(attitude_of(before)))


def _at_rest(t: float, joints: int) -> tuple[Sample, ...]:
    """A reading of every sensor, of a vehicle of so many ``joints`` that stands."""
    none = (0.0, 0.0, 0.0)
    return (
        ImuSample(t - 1e-3, (0.0, 0.0, -9.81), none),
        ImuSample(t, (0.0, 0.0, -9.81 + 1e-3 * t), none),
        JointSample(t, (0.0,) * joints),
        *[_moved(kind, t) for kind in SENSORS],
    )


def _moved(kind: type[AidingSensor[Any, Any]], t: float) -> AidingSample:
    """A reading at ``t`` [s] that is never the same, as those of a sensor that is stuck are."""
    name, by = kind.measures[0], 1e-3 * t
    value = getattr(kind.at_rest, name)
    moved = tuple(x + by for x in value) if isinstance(value, tuple) else value + by
    changes: dict[str, Any] = {"time": t, name: moved}
    return replace(kind.at_rest, **changes)
