"""The estimate from sensors with their own time stamps; reports faults, passes on jumps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

from fsw.autopilot.control.cascade import in_hover
from fsw.autopilot.estimation.correlated_error import correlated_error
from fsw.autopilot.estimation.dead_reckoning import moved_on
from fsw.autopilot.estimation.error_state import Array, P
from fsw.autopilot.estimation.faults.residuals import scale_of_turns
from fsw.autopilot.estimation.faults.sample_rate import looked
from fsw.autopilot.estimation.faults.sensor_fault import Health, SensorFault, sentence
from fsw.autopilot.estimation.faults.sources import NOBODY, Source, names
from fsw.autopilot.estimation.fusion_memory import FusionMemory, Reset, at_start
from fsw.autopilot.estimation.imu import IMU_TOO_OLD
from fsw.autopilot.estimation.sensor_fusion import FilterCall, SensorFusion
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.estimation.turned_covariance import Vec6
from fsw.autopilot.flight.estimate.estimator_report import (
    AIDS_PLACE,
    estimator_report,
    unaided,
    unknown_report,
)
from fsw.autopilot.flight.estimate.jump import on_return, told
from fsw.autopilot.flight.fast_loop import FastLoop
from fsw.autopilot.flight.land_detector import is_aloft
from fsw.autopilot.flight.state import Aiding, FlightState, LostSensor
from fsw.autopilot.measurements import Sample, Sensor
from fsw.autopilot.model.rotors import agility, swing
from fsw.autopilot.signals import EstimatorReport, Severity, StateEstimate, StatusText, TickInputs
from fsw.autopilot.tick_record import Expected
from fsw.frozen import replace

# Since the last tick. The filter takes what is so old at once, and nothing that is older.
READ_LATE_US: Final = round(1e6 * IMU_TOO_OLD)
_STEP_US: Final = 4_000  # in which they are: the filter has room for more, but takes it for jitter
_CHECKED_US = 100_000  # between checks for silent sensors
_IMU = Sensor.IMU
_EVERY_TICK = (_IMU, Sensor.ENCODERS)
# The sensor is, all the same; of an IMU that disagrees the verdict tells.
_IN_USE = (SensorFault.REPEATED, SensorFault.RATE_TOO_LOW, SensorFault.DISAGREES, SensorFault.NOISY)
_NOISY = 4.0  # times the stated variance
_BEGUN = 1.0  # s, until scales have settled
_SCATTERS = 0.05  # s; for less a blow may make it look so
_SHOWN = 1.0  # s, for which another fault says more
_SET_BACK = 0.1  # s; a clock that goes back by more has been set to another time
_INERTIAL = Source.GYRO | Source.ACCELEROMETER
_LATELY = 0.02  # s, in which a fault is one of now
_HALF = 0.5  # s for which of poses that are used no attitude is
_AWAY = 0.1  # s that a position is overdue, after which its return is a jump
_NOT_MOVED = (0.0, 0.0, 0.0)
_ANEW = "estimate is not a number, or its variance negative: the filter starts anew"


class CaughtUp(NamedTuple):
    """What a tick knows once all of its samples are looked at."""

    memory: FusionMemory
    estimate: StateEstimate | None
    reset: Reset | None  # a jump of the estimate, along with which plan and observer are to move
    texts: tuple[StatusText, ...]


class SensedState:
    """The estimator of one configuration as the tick uses it."""

    def __init__(self, tuning: EstimatorTuning, fast: FastLoop) -> None:
        airframe = fast.law.airframe
        self._joints, self._legs = airframe.bodies.joints, airframe.leg_length
        self._turns = scale_of_turns(agility(airframe), swing(airframe))
        self._fusion, self._fast = SensorFusion(tuning, self._joints, fast.filter), fast
        self._tuning, self._stale = tuning, tuning.stale_time

    def warm_up(self) -> None:
        """Compile every kernel."""
        estimate = self._fusion.warm_up()
        self._fast.expected(in_hover(self._fast.law.airframe, estimate))

    def _memory(self, state: FlightState, now: float) -> FusionMemory:
        """The filter's memory at ``now`` [s].

        After a first stamp that was ahead of all others every reading is older than what it left. A
        clock that is set back by little is waited for: of what was known nothing is lost.
        """
        before = state.fusion
        if before is None or now < before.now - _SET_BACK:
            return at_start(self._joints, self._turns)
        return before

    def covariance(self, memory: FusionMemory | None) -> Array | None:
        """Covariance (17, 17) [SI] of the error of the estimate of a memory; None before both."""
        if memory is None or not memory.started:
            return None
        return self._fusion.covariance(memory, memory.now)

    def correlated_error(self, memory: FusionMemory) -> Vec6:
        """Variances of position [m^2, NED] and attitude [rad^2, FRD] besides the filter's."""
        return correlated_error(memory, self._tuning)

    def estimate(
        self, state: FlightState, inputs: TickInputs
    ) -> tuple[FlightState, FusionMemory, StateEstimate | None, CaughtUp | None]:
        """The estimate of this tick, or the last one while there is none.

        It is of IMU and encoders, and of what ``catch_up`` has made of the other sensors so far.
        Before there was one, nothing flies that has to wait, and ``catch_up`` is done at once.
        """
        now = 1e-6 * inputs.sensors.t_us
        before = self._memory(state, now)
        memory, estimate = self._fusion.take_in(before, inputs.samples, now, self._expected(state))
        caught = None
        if estimate is None and not state.record.has_estimate:
            caught = self.catch_up(state, memory, None, inputs)
            estimate = caught.estimate
        if estimate is None:
            state = replace(state, invalid_ticks=state.invalid_ticks + 1)
            return state, memory, _carried_on(state, inputs.sensors.t_us), caught
        if state.invalid_ticks:
            state = replace(state, invalid_ticks=0)
        return state, memory, estimate, caught

    def take_in_by(
        self, state: FlightState, inputs: TickInputs, run: FilterCall
    ) -> tuple[FusionMemory, int]:
        """What ``estimate`` makes of IMU and encoders by a call of ``run``, and what came of it."""
        now = 1e-6 * inputs.sensors.t_us
        return self._fusion.take_in_by(self._memory(state, now), inputs.samples, now, None, run)

    def rests(self, state: FlightState, memory: FusionMemory, inputs: TickInputs) -> bool:
        """Whether ``catch_up`` of a tick with an estimate would do nothing, as in most ticks."""
        before = state.fusion
        if before is None or not before.started or memory.health is not before.health:
            return False
        if not state.vehicle.flies or _is_due(before, inputs):
            return False
        return self._fusion.rests(memory, inputs.samples)

    def _expected(self, state: FlightState) -> Expected:
        """What commands make of a vehicle in a ``state``."""
        r, flies = state.record, state.vehicle.flies
        if not r.has_estimate:
            return Expected()
        # On the ground thrust does not explain how the vehicle moves.
        explains = flies and state.vehicle.unloaded is None
        judged = flies and not state.damage.joint
        return self._fast.expected(r, explains=explains, judged=judged)

    def take_missed(self, state: FlightState, inputs: TickInputs) -> tuple[FlightState, TickInputs]:
        """The state after ticks that were missed, and the ``inputs`` that are left for this one.

        What came meanwhile is taken in its order; what the actuators did meanwhile is not known.
        """
        *missed, inputs = missed_inputs(state.t_us, inputs)
        for one in missed:
            now = 1e-6 * one.sensors.t_us
            memory = self._memory(state, now)
            memory, estimate = self._fusion.take_in(memory, one.samples, now)
            memory, found = self._fused(state, memory, one.samples, estimate)
            state, known = replace(state, fusion=memory), found or estimate
            if known is not None:
                r = state.record.copy()
                r.state_estimate = known
                state = replace(state, record=r)
        return state, inputs

    def catch_up(
        self,
        state: FlightState,
        memory: FusionMemory,
        estimate: StateEstimate | None,
        inputs: TickInputs,
    ) -> CaughtUp:
        """What the other sensors make of the ``memory`` and the ``estimate`` of this tick.

        ``state`` has the memory of the tick before.
        """
        now = memory.now
        before = self._memory(state, now)
        due = _is_due(before, inputs)
        # A state that is carried on is none of this tick.
        known = None if state.invalid_ticks else estimate
        texts: list[StatusText] = []  # by itself: to call a type with its parameters takes 1 us
        memory, found = self._fused(state, memory, inputs.samples, known)
        news = memory.health is not before.health
        if due or news or found is None:
            memory = self._told(before, memory, texts, due=due)
        reset = None
        back = (news and _is_back(before, memory)) or not before.started
        back = back or memory.replays != before.replays
        if memory.reset.number != before.reset.number:
            reset = memory.reset
            texts.append(StatusText(Severity.WARNING, told(reset)))
        elif back and found is not None and estimate is not None:
            reset, said = on_return(found, estimate)
            texts += said
        return CaughtUp(memory, found or estimate, reset, tuple(texts))

    def _fused(
        self,
        state: FlightState,
        memory: FusionMemory,
        samples: tuple[Sample, ...],
        estimate: StateEstimate | None,
    ) -> tuple[FusionMemory, StateEstimate | None]:
        """See ``SensorFusion.catch_up``, of a vehicle in a ``state``."""
        now = memory.now
        if not state.vehicle.flies and memory.unproven != _NOT_MOVED:
            memory = replace(memory, unproven=_NOT_MOVED)  # it stands where it says
        return self._fusion.catch_up(
            memory,
            samples,
            estimate,
            aloft=lambda: is_aloft(state, now, self._legs, self._stale),
            flies=state.vehicle.flies,
            damaged=bool(state.damage.rotor or state.damage.joint),
            # What pushes back, or was just gripped, turns the vehicle by more than is known of it.
            touches=state.record.touches,
        )

    def reported(
        self, state: FlightState, estimate: StateEstimate, covariance: Array | None
    ) -> FlightState:
        """The state with what the estimator says about itself now; nothing before it started.

        ``covariance`` (17, 17) [SI] is of the error of the ``estimate``; None: nothing is known.
        """
        memory = state.fusion
        if memory is None:
            return state
        if covariance is None:
            if state.estimator is None:
                return state
            unknown = unknown_report(state.estimator, memory, estimate.t_us, self._stale)
            return replace(state, estimator=unknown)
        lasting = self.correlated_error(memory)
        report = estimator_report(memory, covariance, lasting, estimate, memory.now, self._stale)
        drifted = math.sqrt(max(0.0, *covariance.diagonal()[P : P + 3].tolist()))
        return replace(state, estimator=report, aiding=_aiding(state, memory, report, drifted))

    def _told(
        self, before: FusionMemory, memory: FusionMemory, texts: list[StatusText], *, due: bool
    ) -> FusionMemory:
        """Report what is new, and where a look at silent sensors is ``due`` what that finds."""
        if memory.restarts != before.restarts:
            texts.append(StatusText(Severity.CRITICAL, _ANEW))
        _report(before, memory, texts)
        if not due:
            return memory
        self._report_silence(memory, texts)
        return _report_noise(_report_seldom(memory, texts), texts)

    def _report_silence(self, memory: FusionMemory, texts: list[StatusText]) -> None:
        """Report sensors that have been silent for too long since the last check."""
        times = [(Sensor.IMU, memory.imu_came), (Sensor.ENCODERS, memory.joints_came)]
        times += [(health.sensor, health.came) for health in memory.health]
        for sensor, came in times:
            silent = memory.now - came - self._stale
            if came >= 0.0 and 0.0 < silent <= 1e-6 * _CHECKED_US:
                texts.append(StatusText(Severity.WARNING, sentence(sensor, SensorFault.STALE)))


def missed_inputs(last_us: int, inputs: TickInputs) -> Iterator[TickInputs]:
    """What ticks since ``last_us`` [us] would have been given, and at the end what is left.

    Nothing but ``inputs`` themselves where few ticks were missed, or no sensor has measured.
    """
    now_us, samples = inputs.sensors.t_us, inputs.samples
    if samples and now_us - last_us > READ_LATE_US:
        for t_us in range(last_us + _STEP_US, now_us - _STEP_US, _STEP_US):
            due = tuple([one for one in samples if one.time <= 1e-6 * t_us])
            if due:
                samples = tuple([one for one in samples if not one.time <= 1e-6 * t_us])
                yield TickInputs(replace(inputs.sensors, t_us=t_us), samples=due)
        inputs = replace(inputs, samples=samples)
    yield inputs


def _is_due(before: FusionMemory, inputs: TickInputs) -> bool:
    """Whether sensors that are silent are looked for after a tick.

    By the filter's own clock: the state has none before the first estimate.
    """
    return inputs.sensors.t_us // _CHECKED_US != round(1e6 * before.now) // _CHECKED_US


def _carried_on(state: FlightState, now_us: int) -> StateEstimate | None:
    """The last estimate, if any, while there is none; telemetry goes by its time, and goes on."""
    last = state.estimate
    if last is None:
        return None
    if state.vehicle.flies:
        last = moved_on(last, 1e-6 * (now_us - last.t_us))
    return last._replace(t_us=now_us)


def _report(before: FusionMemory, memory: FusionMemory, texts: list[StatusText]) -> None:
    """Report each fault once, and again after it was gone for a while or where it lasts."""
    for new in memory.health:
        seen = new.fault_at == memory.now != before.of(new.sensor).fault_at
        if seen and new.is_news():
            texts.append(StatusText(Severity.WARNING, sentence(new.sensor, new.fault)))


def _report_seldom(memory: FusionMemory, texts: list[StatusText]) -> FusionMemory:
    """Report sensors that have begun to come less often than they did."""
    now = memory.now
    sample_rates, seldom = looked(memory.sample_rates, memory.health, now)
    memory = replace(memory, sample_rates=sample_rates)
    for sensor in seldom:
        memory = memory.noting_fault(sensor, SensorFault.RATE_TOO_LOW, now)
        texts.append(StatusText(Severity.WARNING, sentence(sensor, SensorFault.RATE_TOO_LOW)))
    return memory


def _report_noise(memory: FusionMemory, texts: list[StatusText]) -> FusionMemory:
    """Report sensors whose readings scatter more than they state, or are known to."""
    x, now = memory.numbers[0], memory.now
    if memory.joints_came < 0.0 or now - memory.began < _BEGUN:
        return memory
    pose, fix = x["noise_scale"][:2].max(), x["noise_scale"][2:].max()
    scales = (Sensor.POSE, pose), (Sensor.GNSS, fix), (Sensor.ENCODERS, x["encoder_scale"])
    for sensor, scale in scales:
        health, heard = memory.of(sensor), now - memory.came(sensor) < _SHOWN
        said_more = health.fault is not SensorFault.NOISY and now - health.fault_at < _SHOWN
        if scale > _NOISY and heard and not said_more:
            health = health.with_fault(SensorFault.NOISY, now)
            memory = memory.noting(health)
            if health.is_news(lasts=_SCATTERS):
                texts.append(StatusText(Severity.WARNING, sentence(sensor, SensorFault.NOISY)))
    return memory


def _aiding(
    state: FlightState, memory: FusionMemory, report: EstimatorReport, drifted: float
) -> Aiding:
    """What is missing, as failsafes look at it.

    Without a position the estimate drifts, by a deviation of ``drifted`` [m] so far. What lasts of
    a receiver's error was there before, and is no reason to come down.
    """
    before, now, verdict = state.aiding, memory.now, memory.verdict
    lost = _lost(memory, before.lost, report.t_us)
    aid = memory.of(Sensor.POSE)
    half_pose = bool(aid.fused) and aid.fused[0] - aid.fused[1] > _HALF
    if aid.came < 0.0:
        aid = memory.of(Sensor.GNSS)
    disputed, suspects = 0.0, NOBODY
    if verdict.contradicts:
        disputed, suspects = now - verdict.since, verdict.suspects
    elif half_pose:  # who is wrong about its attitude may soon be so about its place
        disputed, suspects = now - aid.fused[1], Source.POSE
    pose, V = report.pose_covariance, report.velocity_covariance
    return Aiding(
        unaided_us=max(round(1e6 * _overdue(memory, now)), 0) if report.unaided_us > 0 else 0,
        pose=aid.sensor,
        pose_fault=aid.fault if now - aid.fault_at < _recently(aid) else SensorFault.STALE,
        position_sigma=drifted,
        elsewhere=_elsewhere(memory),
        unproven=memory.unproven,
        velocity_sigma=math.sqrt(max(V[0], V[6], V[11], 0.0)),
        attitude_sigma=math.sqrt(max(pose[15], pose[18], 0.0)),
        height_sigma=math.sqrt(max(pose[11], 0.0)),
        lost=lost,
        gyro_lost=bool(verdict.wrong & Source.GYRO)
        or any(one.sensor is _IMU and one.fault is SensorFault.STALE for one in lost),
        half_pose=half_pose,
        disputed_us=max(round(1e6 * disputed), 1) if suspects else 0,
        suspects=names(suspects),
    )


def _elsewhere(memory: FusionMemory) -> float:
    """How far [m] from the estimate a run of positions is that are refused since one was used."""
    used = memory.now - unaided(memory, memory.now)
    runs = [one for one in memory.runs if one.last > used and one.is_no_chance]
    return max([math.hypot(*one.place) for one in runs], default=0.0)


def _recently(aid: Health) -> float:
    """Time [s] in which the last fault of a sensor is one of now: its next reading takes so long.

    A fault that its last reading had, that is: a sensor that has fallen silent is silent.
    """
    return max(_LATELY, 1.5 * aid.apart) if aid.fault_at >= aid.came else _LATELY


def _is_back(before: FusionMemory, memory: FusionMemory) -> bool:
    """Whether a position is used now that was overdue for long."""
    now = memory.now
    if unaided(before, now) <= _AWAY:  # the usual case, known at less cost
        return False
    return _overdue(before, now) > _AWAY > _overdue(memory, now)


def _overdue(memory: FusionMemory, now: float) -> float:
    """Time [s] at ``now`` [s] since the next position after the last used one was due."""
    return unaided(memory, now) - max(memory.of(one).apart for one in AIDS_PLACE)


def _lost(
    memory: FusionMemory, before: tuple[LostSensor, ...], now_us: int
) -> tuple[LostSensor, ...]:
    """The sensors that every tick needs and that are of no use now; those ``before`` as well."""
    now, found = memory.now, []
    for sensor in _EVERY_TICK:
        health, fault = memory.of(sensor), SensorFault.NONE
        if sensor is Sensor.ENCODERS and memory.encoders_stuck:
            fault = SensorFault.STUCK
        elif sensor is Sensor.IMU and memory.verdict.wrong & _INERTIAL:
            fault = SensorFault.DISAGREES
        elif now - memory.came(sensor) > _LATELY:
            fault = SensorFault.STALE
        elif now - health.fault_at < _LATELY and health.fault not in _IN_USE:
            fault = health.fault
        if fault is not SensorFault.NONE:
            since = [one.since_us for one in before if one.sensor is sensor]
            found.append(LostSensor(sensor, fault, since[0] if since else now_us))
    return tuple(found)
