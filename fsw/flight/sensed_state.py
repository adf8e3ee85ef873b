"""The estimate from sensors with times of their own; its faults are told, its jumps handed on."""

from __future__ import annotations

from dataclasses import replace

from fsw.control.cascade import Cascade, in_hover
from fsw.estimation.error_state import Array
from fsw.estimation.sensor_fault import Sensor, SensorFault, sentence
from fsw.estimation.sensor_fusion import FusionMemory, Reset, SensorFusion, at_start
from fsw.estimation.tuning import EstimatorTuning
from fsw.flight.state import FlightState
from fsw.geometry.rotation import matrix_from_quaternion, wrap_angle, yaw_of
from fsw.geometry.vectors import add_scaled, norm
from fsw.model.airframe import AIRFRAME
from fsw.signals import Severity, StateEstimate, StatusText, TickInputs

_CHECKED_US = 100_000  # between checks for silent sensors
_QUIET = 10.0  # s without a fault until the same one is reported again


class SensedState:
    """The estimator of one configuration as the tick uses it."""

    def __init__(self, tuning: EstimatorTuning, cascade: Cascade) -> None:
        self._fusion = SensorFusion(tuning, cascade.law.dt)
        self._cascade = cascade
        self._stale = tuning.stale_time

    def warm_up(self) -> None:
        """Compile every kernel."""
        estimate = self._fusion.warm_up()
        self._cascade.joint_acceleration(in_hover(AIRFRAME, estimate), estimate)

    def covariance(self, memory: FusionMemory) -> Array:
        """Covariance (17, 17) [SI] of the error of the last tick's estimate."""
        return self._fusion.covariance(memory, memory.now)

    def estimate(
        self, state: FlightState, inputs: TickInputs, texts: list[StatusText]
    ) -> tuple[FlightState, FusionMemory, StateEstimate | None]:
        """The estimate of this tick, or the last one while there is none; appends to ``texts``."""
        before = state.fusion or at_start()
        now = 1e-6 * inputs.sensors.t_us
        pushed = (0.0, 0.0)
        if state.estimate is not None:
            pushed = self._cascade.joint_acceleration(state.cascade, state.estimate)
        memory, estimate = self._fusion.step(before, inputs.samples, now, pushed)
        if state.vehicle.flies:
            asked = state.cascade.joints.reference
            memory = self._fusion.watch_joints(memory, before, asked)
        if memory.health is not before.health:
            _report(before, memory, now, texts)
        if inputs.sensors.t_us // _CHECKED_US != state.t_us // _CHECKED_US:
            self._report_silence(memory, now, texts)
        if memory.reset.number != before.reset.number:
            texts.append(StatusText(Severity.WARNING, _told(memory.reset)))
            state = _jumped(state, memory.reset)
        if estimate is None:
            state = replace(state, fusion=memory, invalid_ticks=state.invalid_ticks + 1)
            return state, memory, state.estimate
        if state.invalid_ticks:
            state = replace(state, invalid_ticks=0)
        return state, memory, estimate

    def _report_silence(self, memory: FusionMemory, now: float, texts: list[StatusText]) -> None:
        """Report sensors that have been silent for too long since the last check."""
        times = [(Sensor.IMU, memory.imu_came), (Sensor.ENCODERS, memory.joints_came)]
        times += [(health.sensor, health.came) for health in memory.health]
        for sensor, came in times:
            silent = now - came - self._stale
            if came >= 0.0 and 0.0 < silent <= 1e-6 * _CHECKED_US:
                texts.append(StatusText(Severity.WARNING, sentence(sensor, SensorFault.STALE)))


def _report(
    before: FusionMemory, memory: FusionMemory, now: float, texts: list[StatusText]
) -> None:
    """Report each fault once, and again after it was gone for a while."""
    for new in memory.health:
        old = before.of(new.sensor)
        again = old.fault is not new.fault or now - old.fault_at > _QUIET
        if new.fault_at == now and again:
            texts.append(StatusText(Severity.WARNING, sentence(new.sensor, new.fault)))


def _told(reset: Reset) -> str:
    yaw = yaw_of(matrix_from_quaternion(reset.turn))
    place = 1e3 * norm(reset.position)
    return f"estimate moved by {place:.0f} mm, {abs(yaw):.3f} rad: the plan moves along"


def _jumped(state: FlightState, reset: Reset) -> FlightState:
    """The plan and the observer's velocity moved along with the estimate."""
    nominal, yaw = state.nominal, yaw_of(matrix_from_quaternion(reset.turn))
    if nominal is not None:
        nominal = nominal._replace(
            p=add_scaled(nominal.p, reset.position, 1.0), yaw=wrap_angle(nominal.yaw + yaw)
        )
    observed = state.cascade.observed
    observed = observed._replace(v=add_scaled(observed.v, reset.velocity, 1.0))
    return replace(state, nominal=nominal, cascade=state.cascade._replace(observed=observed))
