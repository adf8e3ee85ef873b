"""What telemetry shows of the vehicle after a tick: looked up in the state it left, when asked."""

from __future__ import annotations

from functools import cached_property
from operator import attrgetter
from typing import Final

from fsw.autopilot.flight.failsafe.table import FAULTS
from fsw.autopilot.flight.modes.offboard import report
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.signals import (
    ActuatorCommand,
    ContactReport,
    FlightSnapshot,
    Mode,
    OffboardReport,
    Orbit,
    PayloadReport,
    PlanInput,
    PredictionState,
    SensorFrame,
    StateEstimate,
)


class Shown(FlightSnapshot):
    """The snapshot of a ``state`` and the frame of the tick that left it.

    Of most ticks hardly anything is sent or logged, so each field is looked up when it is read, by
    its place in the state (``_PLACES``) or, once, as here.
    """

    def __init__(self, state: FlightState, sensors: SensorFrame) -> None:
        self.state, self.sensors = state, sensors
        object.__setattr__(self, "t_us", state.record.stamp_us)

    @cached_property
    def estimate(self) -> StateEstimate:
        """Where the vehicle is."""
        found = self.state.record.state_estimate
        assert found is not None
        return found

    @cached_property
    def plan_state(self) -> PredictionState | None:
        """Where the running plan wants it now, while it flies."""
        return self.state.record.plan_state if self.state.vehicle.flies else None

    @cached_property
    def plan_input(self) -> PlanInput | None:
        """What the plan's state goes on by."""
        r = self.state.record
        return r.plan_input if self.state.vehicle.flies and r.has_plan else None

    @cached_property
    def actuators(self) -> ActuatorCommand:
        """The last command."""
        return self.state.record.actuator_command

    @property
    def failures(self) -> tuple[str, ...]:
        """Conditions that are faults, by name."""
        held = self.state.vehicle.conditions
        return tuple([one.value for one in held if one in FAULTS]) if held else ()

    @cached_property
    def offboard(self) -> OffboardReport:
        """What has come of set-points."""
        return report(self.state, self.sensors.t_us)

    @cached_property
    def orbit(self) -> Orbit | None:
        """The circle that is being flown."""
        goal = self.state.setpoint.goal
        return goal.orbit if goal is not None and self.mode is Mode.ORBIT else None

    @cached_property
    def sensors_lost(self) -> tuple[str, ...]:
        """Sensors of no use, by name."""
        return tuple([one.sensor.value for one in self.state.aiding.lost])

    @cached_property
    def touching(self) -> ContactReport | None:
        """What the fast loop knows of the tool at a surface."""
        k = self.state.record.pressing
        if not k.near:
            return None
        x, y, z = k.force.tolist()
        return ContactReport(
            bool(k.contact),
            (x, y, z),
            *(k.pressed, k.unsure, k.commanded, k.asked, k.most, k.distance),
        )

    @cached_property
    def payload(self) -> PayloadReport | None:
        """What the gripper does, and holds."""
        gripper = self.state.vehicle.gripper
        if not gripper:
            return None
        return PayloadReport(gripper > 0.0, float(self.state.record.payload.mass))


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
for _name, _place in _PLACES.items():
    setattr(Shown, _name, property(attrgetter(_place)))
