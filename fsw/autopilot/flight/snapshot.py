"""What telemetry shows of the vehicle after a tick: looked up in the state it left, when asked."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
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


def _plan_state(shown: Shown) -> PredictionState | None:
    return shown.state.record.plan_state if shown.state.vehicle.flies else None


def _plan_input(shown: Shown) -> PlanInput | None:
    state = shown.state
    return state.record.plan_input if state.vehicle.flies and state.record.has_plan else None


def _failures(shown: Shown) -> tuple[str, ...]:
    held = shown.state.vehicle.conditions
    return tuple([one.value for one in held if one in FAULTS]) if held else ()


def _orbit(shown: Shown) -> Orbit | None:
    goal = shown.state.setpoint.goal
    return goal.orbit if goal is not None and shown.mode is Mode.ORBIT else None


def _contact(shown: Shown) -> ContactReport | None:
    """What the fast loop knows of the tool at a surface."""
    k = shown.state.record.pressing
    if not k.near:
        return None
    x, y, z = k.force.tolist()
    return ContactReport(
        bool(k.contact),
        (x, y, z),
        *(k.pressed, k.unsure, k.commanded, k.asked, k.most, k.distance),
    )


def _payload(shown: Shown) -> PayloadReport | None:
    gripper, mass = shown.state.vehicle.gripper, shown.state.record.payload.mass
    return PayloadReport(gripper > 0.0, float(mass)) if gripper else None


# Where fields are that the state has as they are.
_PLACES: Final = {
    "mode": "state.vehicle.mode",
    "armed": "state.vehicle.armed",
    "reference": "state.reference",
    "plan": "state.plan.running",
    "plan_status": "state.plan.status",
    "counters": "state.plan.counters",
    "constraints": "state.constraints",
    "landed": "state.vehicle.landed",
    "home": "state.vehicle.home",
    "battery": "state.battery",
    "arming_refusal": "state.arming_refusal",
    "intended_mode": "state.vehicle.intended_mode",
    "mission": "state.mission.flight.progress",
    "failsafe_from": "state.vehicle.failsafe_from",
    "accel_B": "sensors.accel_B",
    "safety": "state.safety.counters",
    "estimator": "state.estimator",
    "log_failure": "state.host.log_failure",
    "arming": "state.arming",
    "safe_set": "state.mission.safe_set",
    "safe_set_owner": "state.mission.owner",
    "actuators_found": "state.damage.report",
}
# The others are made when they are read first.
_MADE: Final[dict[str, Callable[[Shown], Any]]] = {
    "estimate": attrgetter("state.record.state_estimate"),
    "plan_state": _plan_state,
    "plan_input": _plan_input,
    "actuators": attrgetter("state.record.actuator_command"),
    "failures": _failures,
    "offboard": lambda shown: report(shown.state, shown.sensors.t_us),
    "orbit": _orbit,
    "sensors_lost": lambda shown: tuple([one.sensor.value for one in shown.state.aiding.lost]),
    "touching": _contact,
    "payload": _payload,
}
for _name, _place in _PLACES.items():
    setattr(Shown, _name, property(attrgetter(_place)))
for _name, _made in _MADE.items():
    setattr(Shown, _name, _Once(_name, _made))
