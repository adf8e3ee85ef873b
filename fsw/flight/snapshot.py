"""What telemetry shows of the vehicle after a tick."""

from __future__ import annotations

from fsw.flight.conditions import Condition
from fsw.flight.failsafe import FAULTS
from fsw.flight.modes.offboard import report
from fsw.flight.state import FlightState
from fsw.signals import FlightSnapshot, Mode, PlanInput, StateEstimate, TickInputs


def snapshot_of(
    state: FlightState, estimate: StateEstimate, u: PlanInput, inputs: TickInputs
) -> FlightSnapshot:
    """The vehicle after a tick with these ``inputs``, in which ``u`` was the plan's input."""
    vehicle, plan, goal = state.vehicle, state.plan, state.setpoint.goal
    lost = state.aiding.lost
    flies = vehicle.flies and state.nominal is not None
    return FlightSnapshot(
        estimate.t_us,
        vehicle.mode,
        vehicle.armed,
        estimate,
        state.reference,
        state.nominal if flies else None,
        u if flies else None,
        state.cascade.commanded,
        plan.running,
        plan.status,
        plan.counters,
        state.constraints,
        _faults(vehicle.conditions),
        vehicle.landed,
        vehicle.home,
        state.battery,
        state.arming_refusal,
        report(state, inputs.sensors.t_us),
        vehicle.intended_mode,
        state.mission.flight.progress,
        vehicle.failsafe_from,
        goal.orbit if goal is not None and vehicle.mode is Mode.ORBIT else None,
        inputs.sensors.accel_B,
        state.safety.counters,
        state.estimator,
        state.host.log_failure,
        state.arming,
        state.mission.safe_set,
        state.damage.report,
        tuple([one.sensor.value for one in lost]) if lost else (),
    )


def _faults(conditions: tuple[Condition, ...]) -> tuple[str, ...]:
    """The vehicle's own faults among the active conditions."""
    return tuple([c.value for c in conditions if c in FAULTS]) if conditions else ()
