"""What telemetry shows of the vehicle after a tick."""

from __future__ import annotations

from fsw.autopilot.flight.failsafe.table import FAULTS
from fsw.autopilot.flight.modes.offboard import report
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.signals import ContactReport, FlightSnapshot, Mode, PayloadReport, SensorFrame
from fsw.autopilot.tick_record import Pressing


class Shown:
    """The snapshot of a state and the frame of the tick that left it, made when it is asked for."""

    def __init__(self, state: FlightState, sensors: SensorFrame) -> None:
        self._of = state, sensors
        self._snapshot: FlightSnapshot | None = None

    def __call__(self) -> FlightSnapshot:
        """The snapshot; the same one each time."""
        if self._snapshot is None:
            self._snapshot = snapshot_of(*self._of)
        return self._snapshot

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Shown) and self._of == other._of

    __hash__ = None  # type: ignore[assignment]


def snapshot_of(state: FlightState, sensors: SensorFrame) -> FlightSnapshot:
    """The vehicle after a tick with this frame of its ``sensors``, which left this state."""
    vehicle, plan, goal, r = state.vehicle, state.plan, state.setpoint.goal, state.record
    estimate, nominal = r.state_estimate, r.plan_state if vehicle.flies else None
    assert estimate is not None
    return FlightSnapshot(
        t_us=estimate.t_us,
        mode=vehicle.mode,
        armed=vehicle.armed,
        estimate=estimate,
        reference=state.reference,
        plan_state=nominal,
        plan_input=None if nominal is None else r.plan_input,
        actuators=r.actuator_command,
        plan=plan.running,
        plan_status=plan.status,
        counters=plan.counters,
        constraints=state.constraints,
        failures=tuple([c.value for c in vehicle.conditions if c in FAULTS]),
        landed=vehicle.landed,
        home=vehicle.home,
        battery=state.battery,
        arming_refusal=state.arming_refusal,
        offboard=report(state, sensors.t_us),
        intended_mode=vehicle.intended_mode,
        mission=state.mission.flight.progress,
        failsafe_from=vehicle.failsafe_from,
        orbit=goal.orbit if goal is not None and vehicle.mode is Mode.ORBIT else None,
        accel_B=sensors.accel_B,
        safety=state.safety.counters,
        estimator=state.estimator,
        log_failure=state.host.log_failure,
        arming=state.arming,
        safe_set=state.mission.safe_set,
        safe_set_owner=state.mission.owner,
        actuators_found=state.damage.report,
        sensors_lost=tuple([one.sensor.value for one in state.aiding.lost]),
        touching=contact_report(r.pressing) if r.pressing.near else None,
        payload=PayloadReport(vehicle.gripper > 0.0, float(r.payload.mass))
        if vehicle.gripper
        else None,
    )


def contact_report(k: Pressing) -> ContactReport:
    """What the fast loop knows of the tool at a surface."""
    x, y, z = k.force.tolist()
    return ContactReport(
        bool(k.contact),
        (x, y, z),
        *(k.pressed, k.unsure, k.commanded, k.asked, k.most, k.distance),
    )
