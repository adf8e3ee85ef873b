"""What a vehicle does and says before its first estimate: nothing moves, and it tells why not."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault, sentence
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.flight.commands.arming import NO_ESTIMATE
from fsw.autopilot.flight.estimate.estimator_report import AIDS_PLACE
from fsw.autopilot.flight.failsafe.conditions import Action, Condition
from fsw.autopilot.flight.failsafe.table import ROWS
from fsw.autopilot.flight.modes.offboard import report
from fsw.autopilot.flight.state import FlightState, PlanMemory
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.signals import (
    ArmingReport,
    ConstraintReport,
    FailsafeEvent,
    FlightSnapshot,
    StateEstimate,
    StatusText,
    TickOutputs,
)
from fsw.frozen import replace

TOLD_AFTER_US: Final = 1_000_000  # a filter that is given all it needs has begun long before
_LATELY: Final = 1.0  # s, in which a fault of a sensor may be why
_REPORT: Final = ArmingReport((NO_ESTIMATE[0],))  # the same object: it is not looked at again


def told(state: FlightState, tick_us: int) -> tuple[StatusText, ...]:
    """The lack of an estimate, once: in the tick in which it has lasted for a second."""
    lasted_us = state.invalid_ticks * tick_us
    if not lasted_us - tick_us < TOLD_AFTER_US <= lasted_us:
        return ()
    shortfall = Condition.ESTIMATE_INVALID
    severity = ROWS[shortfall].severity
    event = FailsafeEvent(shortfall.value, Action.WARN.value, severity)
    seconds = 1e-6 * TOLD_AFTER_US
    text = f"{shortfall.value} for {seconds:.0f} s: {_reason(state.fusion)}"
    return (StatusText(severity, text, event),)


def _reason(memory: FusionMemory | None) -> str:
    """The sensors that have never come; where all have, what is wrong with them."""
    if memory is None:
        return "no valid sensor frame has come"
    never = [one.value for one in (Sensor.IMU, Sensor.ENCODERS) if memory.came(one) < 0.0]
    if all(memory.came(one) < 0.0 for one in AIDS_PLACE):
        never.append(" or ".join(one.value for one in AIDS_PLACE))
    elif memory.came(Sensor.POSE) < 0.0 and memory.field is None:
        never.append(Sensor.MAGNETOMETER.value)  # for the heading, beside GNSS
    if never:
        return f"nothing has ever come from {', '.join(never)}"
    faults = [
        sentence(one.sensor, one.fault)
        for one in memory.health
        if one.fault is not SensorFault.NONE and memory.now - one.fault_at <= _LATELY
    ]
    return "; ".join(faults) or "readings come, and none is good enough to begin with"


def nowhere(t_us: int, joints: int) -> StateEstimate:
    """The estimate that telemetry shows and commands are looked at with, which says nothing.

    Of a vehicle of so many ``joints``.
    """
    zero = (0.0, 0.0, 0.0)
    level = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    return StateEstimate(
        t_us=t_us,
        p_WB=zero,
        v_WB=zero,
        R_WB=level,
        w_WB_B=zero,
        yaw=0.0,
        q_arm=(0.0,) * joints,
        qd_arm=(0.0,) * joints,
    )


def nothing_known(
    so_far: TickOutputs, state: FlightState, t_us: int, texts: tuple[StatusText, ...]
) -> TickOutputs:
    """The outputs at ``t_us``, ``so_far`` and with the ``texts`` of the whole tick.

    Telemetry goes on, and shows what is known all the same.
    """
    snapshot = FlightSnapshot(
        t_us=t_us,
        mode=so_far.mode,
        armed=so_far.armed,
        estimate=nowhere(t_us, state.record.joint_count),
        reference=None,
        plan_state=None,
        plan_input=None,
        actuators=so_far.actuators,
        plan=None,
        plan_status=PlanMemory().status,
        counters=state.plan.counters,
        constraints=ConstraintReport(),
        failures=(Condition.ESTIMATE_INVALID.value,),
        battery=state.battery,
        offboard=report(state, t_us),
        mission=state.mission.flight.progress,
        safety=state.safety.counters,
        log_failure=state.host.log_failure,
        arming=_REPORT,
        safe_set=state.mission.safe_set,
        safe_set_owner=state.mission.owner,
    )
    return replace(so_far, shown=snapshot, texts=texts)
