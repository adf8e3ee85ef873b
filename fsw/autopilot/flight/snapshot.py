"""What telemetry shows of the vehicle after a tick: looked up in the state it left, when asked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from fsw.autopilot.flight.failsafe.table import FAULTS
from fsw.autopilot.flight.modes.offboard import report
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.signals import (
    ContactReport,
    FlightSnapshot,
    Mode,
    Orbit,
    PayloadReport,
    PlanInput,
    PredictionState,
    SensorFrame,
)


class _Once:
    """A field that is made when it is read first, and kept by its ``name``."""

    def __init__(self, name: str, made: Callable[[Shown], Any]) -> None:
        self._name, self._made = name, made

    def __get__(self, shown: Shown, kind: type[Shown]) -> Any:
        value = shown.__dict__[self._name] = self._made(shown)
        return value


class Shown(FlightSnapshot):
    """The snapshot of a ``state`` and the frame of the tick that left it.

    Of most ticks hardly anything is sent or logged, so each field is looked up when it is read.
    """

    def __init__(self, state: FlightState, sensors: SensorFrame) -> None:
        self.state, self.sensors = state, sensors
        object.__setattr__(self, "t_us", state.record.stamp_us)


def _plan_state(state: FlightState) -> PredictionState | None:
    return state.record.plan_state if state.vehicle.flies else None


def _plan_input(state: FlightState) -> PlanInput | None:
    flown = state.vehicle.flies and state.record.has_plan
    return state.record.plan_input if flown else None


def _orbit(state: FlightState) -> Orbit | None:
    goal = state.setpoint.goal
    return goal.orbit if goal is not None and state.vehicle.mode is Mode.ORBIT else None


def _failures(state: FlightState) -> tuple[str, ...]:
    held = state.vehicle.conditions
    return tuple([one.value for one in held if one in FAULTS]) if held else ()


def _contact(state: FlightState) -> ContactReport | None:
    """What the fast loop knows of the tool at a surface."""
    k = state.record.pressing
    if not k.near:
        return None
    x, y, z = k.force.tolist()
    return ContactReport(
        bool(k.contact),
        (x, y, z),
        *(k.pressed, k.unsure, k.commanded, k.asked, k.most, k.distance),
    )


def _payload(state: FlightState) -> PayloadReport | None:
    gripper = state.vehicle.gripper
    return PayloadReport(gripper > 0.0, float(state.record.payload.mass)) if gripper else None


# What takes longer is made once.
_MADE: Final[dict[str, Callable[[Shown], Any]]] = {
    "estimate": lambda shown: shown.state.record.state_estimate,
    "plan_state": lambda shown: _plan_state(shown.state),
    "plan_input": lambda shown: _plan_input(shown.state),
    "actuators": lambda shown: shown.state.record.actuator_command,
    "failures": lambda shown: _failures(shown.state),
}
_FIELDS: Final[dict[str, Callable[[Shown], Any]]] = {
    "mode": lambda shown: shown.state.vehicle.mode,
    "armed": lambda shown: shown.state.vehicle.armed,
    "reference": lambda shown: shown.state.reference,
    "plan": lambda shown: shown.state.plan.running,
    "plan_status": lambda shown: shown.state.plan.status,
    "counters": lambda shown: shown.state.plan.counters,
    "constraints": lambda shown: shown.state.constraints,
    "landed": lambda shown: shown.state.vehicle.landed,
    "home": lambda shown: shown.state.vehicle.home,
    "battery": lambda shown: shown.state.battery,
    "arming_refusal": lambda shown: shown.state.arming_refusal,
    "offboard": lambda shown: report(shown.state, shown.sensors.t_us),
    "intended_mode": lambda shown: shown.state.vehicle.intended_mode,
    "mission": lambda shown: shown.state.mission.flight.progress,
    "failsafe_from": lambda shown: shown.state.vehicle.failsafe_from,
    "orbit": lambda shown: _orbit(shown.state),
    "accel_B": lambda shown: shown.sensors.accel_B,
    "safety": lambda shown: shown.state.safety.counters,
    "estimator": lambda shown: shown.state.estimator,
    "log_failure": lambda shown: shown.state.host.log_failure,
    "arming": lambda shown: shown.state.arming,
    "safe_set": lambda shown: shown.state.mission.safe_set,
    "safe_set_owner": lambda shown: shown.state.mission.owner,
    "actuators_found": lambda shown: shown.state.damage.report,
    "sensors_lost": lambda shown: tuple([one.sensor.value for one in shown.state.aiding.lost]),
    "touching": lambda shown: _contact(shown.state),
    "payload": lambda shown: _payload(shown.state),
}
for _name, _found in _FIELDS.items():
    setattr(Shown, _name, property(_found))
for _name, _found in _MADE.items():
    setattr(Shown, _name, _Once(_name, _found))
