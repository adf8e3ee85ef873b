"""The estimate from frames of exact states: believed where they are numbers and in range.

Nothing is filtered (docs/decisions/0006-estimate-without-filter.md), and nothing looks for sensors
that lie: a simulator's truth is for development, and faults of sensors are flown with suites
(docs/decisions/0042-exact-states-are-believed.md). In flight, what stands in for a part that is
missing is in ``estimation/frame_dropout.py``. On the ground a frame is taken whole or not at all.
"""

from __future__ import annotations

from fsw.autopilot.estimation.dead_reckoning import moved_on
from fsw.autopilot.estimation.estimator import read_frame
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.estimation.frame_dropout import Dropout, filled
from fsw.autopilot.flight.estimate.jump import all_along, on_return
from fsw.autopilot.flight.fast_loop import FastLoop
from fsw.autopilot.flight.state import AIDED, COMPLETE, Aiding, FlightState, LostSensor
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.signals import Severity, StateEstimate, StatusText, TickInputs
from fsw.autopilot.tick_record import Tick
from fsw.frozen import replace


class ExactState:
    """Exact states as the tick of one configuration uses them."""

    def __init__(self, fast: FastLoop) -> None:
        self._fast = fast

    def estimate(
        self, state: FlightState, inputs: TickInputs, texts: list[StatusText]
    ) -> tuple[FlightState, Tick]:
        """The record of this tick with its estimate, the last one while there is none.

        Appends to ``texts``.
        """
        sensors, last = inputs.sensors, state.record
        r = last.copy()
        missing = read_frame(sensors, r)
        if not (missing or inputs.stale_us or state.invalid_ticks) and state.dropout is COMPLETE:
            return state, r
        before, found = last.state_estimate, r.state_estimate
        assert found is not None
        if before is not None and state.vehicle.flies:
            lost = state.dropout is not COMPLETE and state.dropout.lost
            if lost and inputs.stale_us:
                found = moved_on(before, 1e-6 * (sensors.t_us - before.t_us))
                r.state_estimate = found._replace(t_us=sensors.t_us)
                return state, r
            if (missing or lost) and not inputs.stale_us:
                state, found = self._incomplete(state, before, found, missing, inputs, texts)
                r = state.record.copy()
                r.state_estimate = found
                return state, r
        elif state.dropout is not COMPLETE and not (missing or inputs.stale_us):
            state = replace(state, dropout=COMPLETE, aiding=AIDED)
        if missing:
            r = last.copy()
            if before is not None:  # telemetry goes by its time, and goes on
                r.state_estimate = before._replace(t_us=sensors.t_us)
            return replace(state, invalid_ticks=state.invalid_ticks + 1), r
        if inputs.stale_us:
            r.state_estimate = moved_on(found, 1e-6 * inputs.stale_us)
        return (replace(state, invalid_ticks=0) if state.invalid_ticks else state), r

    def _incomplete(
        self,
        state: FlightState,
        before: StateEstimate,
        found: StateEstimate,
        missing: int,
        inputs: TickInputs,
        texts: list[StatusText],
    ) -> tuple[FlightState, StateEstimate]:
        """In flight with a frame that lacks parts, or after one."""
        away = state.dropout.pose.since_us >= 0
        dropout, sentences = state.dropout.after(missing, found.t_us)
        texts.extend(StatusText(Severity.WARNING, text) for text in sentences)
        aiding = AIDED
        if missing:
            r = state.record
            found = filled(
                *(missing, inputs.sensors, found, before),
                lambda: tuple(self._fast.expected(r).u[: r.joint_count].tolist()),
            )
            aiding = _aiding(dropout, found.t_us)
        if away and dropout.pose.since_us < 0:
            reset, said = on_return(found, before)
            texts += said
            record, state, plan = all_along(state.record, state, state.plan, reset)
            state = replace(state, record=record, plan=plan)
        return replace(state, dropout=dropout, aiding=aiding), found


def _aiding(dropout: Dropout, now_us: int) -> Aiding:
    """What is missing, as failsafes look at it."""
    position, velocity, attitude = dropout.sigmas(now_us)
    pose, fault = dropout.pose, SensorFault.IMPLAUSIBLE
    return Aiding(
        unaided_us=now_us - pose.since_us if pose.since_us >= 0 else 0,
        pose_fault=fault,
        position_sigma=position,
        velocity_sigma=velocity,
        attitude_sigma=attitude,
        height_sigma=position,
        lost=tuple(
            [LostSensor(s, fault, gap.since_us) for s, gap in dropout.lost if s is not Sensor.POSE]
        ),
    )
