"""Offboard: follows a ground station's setpoints while they arrive."""

from __future__ import annotations

from fsw.flight.land_detector import feel_ground, in_the_air
from fsw.flight.modes.base import CONTINUE, CommandContext, FlightMode, ModeResult, Px4Mode
from fsw.flight.offboard_setpoints import (
    Tilt,
    as_motion,
    attitude_refusal,
    joints_refusal,
    motion_refusal,
    tilted,
)
from fsw.flight.setpoint_generator import PositionGoal
from fsw.flight.state import FlightState, OffboardMemory, SetpointMemory, is_young
from fsw.frozen import replace
from fsw.geometry.vectors import add_scaled
from fsw.parameters.flight_config import FlightConfig
from fsw.signals import (
    Mode,
    MotionSetpoint,
    OffboardReport,
    SetpointKind,
    StateEstimate,
    TickInputs,
)

_RISING = 0.1  # m, m/s or m/s^2 upwards: the setpoint asks a standing vehicle to fly
_SINKING = 0.1  # m that the setpoint is below the vehicle: it presses on the ground
_NO_SETPOINTS = OffboardReport()


class Offboard(FlightMode):
    """PX4's OFFBOARD; what happens when setpoints stop is in ``failsafe.py``."""

    mode = Mode.OFFBOARD
    px4 = Px4Mode(6)
    before_arming = True
    manual = True

    def refusal(self, context: CommandContext) -> str | None:
        """Setpoints."""
        if context.setpoint_fresh:
            return None
        return "not offboard: no setpoint was received in the last 0.5 s"

    def waits(self, state: FlightState, now_us: int) -> str | None:
        """Dropped when setpoints stop."""
        if is_fresh(self.config, state, now_us):
            return None
        return "offboard cancelled: setpoints stopped before arming"

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """On the ground, wait for a setpoint to fly; in the air, notice that one has landed it."""
        vehicle = state.vehicle
        if vehicle.landed:
            if self._asks_to_rise(state, estimate):
                return state, ModeResult(lift_off=True)
            return state, CONTINUE
        if not _presses(state, estimate):
            return in_the_air(state, estimate), CONTINUE
        state, landed = feel_ground(self.config, state, estimate)
        if not landed:
            return state, CONTINUE
        return replace(state, vehicle=replace(state.vehicle, landed=True)), CONTINUE

    def _asks_to_rise(self, state: FlightState, estimate: StateEstimate) -> bool:
        motion = self._motion(state, estimate)[0]
        if motion.p is not None:
            return estimate.p_WB[2] - motion.p[2] > (0.0 if motion.of_end_effector else _RISING)
        if motion.v is not None:
            return -motion.v[2] > _RISING
        return motion.a is not None and -motion.a[2] > _RISING

    def aim(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """Follow the newest setpoints."""
        motion, tilt = self._motion(state, estimate)
        memory, goal, reference = state.offboard, state.setpoint.goal, state.setpoint.reference
        if reference is None or reference.of_end_effector != motion.of_end_effector:
            reference = self.generator.begin(estimate, of_end_effector=motion.of_end_effector)
        joints = goal.joints if goal is not None else None
        timeout_us = self.config.limits.setpoint_timeout_us
        if memory.joints is not None and is_young(memory.joints_us, estimate.t_us, timeout_us):
            joints = memory.joints.q_arm
        if joints is not None and reference.q_arm is None:
            reference = replace(reference, q_arm=estimate.q_arm)
        goal = PositionGoal(motion, joints, self.config.steering.speed)
        setpoint = SetpointMemory(reference, goal)
        return replace(state, setpoint=setpoint, offboard=replace(memory, tilt=tilt))

    def guided(self, goal: PositionGoal, state: FlightState) -> PositionGoal:
        """Speed and heading come from setpoints alone."""
        return goal

    def _motion(self, state: FlightState, estimate: StateEstimate) -> tuple[MotionSetpoint, Tilt]:
        memory, config = state.offboard, self.config
        ahead = Tilt(yaw=estimate.yaw)
        if not is_young(memory.motion_us, estimate.t_us, config.limits.setpoint_timeout_us):
            # Joints alone: the body stays.
            return MotionSetpoint(False, v=(0.0, 0.0, 0.0)), ahead
        if memory.attitude is not None:
            last = ahead if state.setpoint.reference is None else memory.tilt
            tilt_limit = config.planner.limits.tilt
            tilt = tilted(memory.attitude, last, tilt_limit, config.planner.period)
            thrust = 4.0 * config.airframe.rotor_thrust_max * memory.attitude.thrust
            return as_motion(tilt, thrust / state.cascade.mass), tilt
        assert memory.motion is not None, "one of the two is young"
        return _moved_on(memory.motion, estimate.t_us - memory.motion_us), ahead


def accept_setpoints(
    memory: OffboardMemory, inputs: TickInputs, config: FlightConfig
) -> OffboardMemory:
    """Store setpoints; those out of range are counted and dropped."""
    refused, accepted, now_us = inputs.refused_setpoints, 0, inputs.sensors.t_us
    motion, attitude, joints = inputs.motion, inputs.attitude, inputs.joints
    if motion is not None and motion_refusal(motion) is None:
        memory = replace(memory, motion=motion, attitude=None, motion_us=now_us)
        accepted += 1
    if attitude is not None and attitude_refusal(attitude) is None:
        memory = replace(memory, attitude=attitude, motion=None, motion_us=now_us)
        accepted += 1
    if joints is not None and joints_refusal(joints.q_arm, config.airframe) is None:
        memory = replace(memory, joints=joints, joints_us=now_us)
        accepted += 1
    refused += sum(one is not None for one in (motion, attitude, joints)) - accepted
    return replace(memory, accepted=memory.accepted + accepted, refused=memory.refused + refused)


def is_fresh(config: FlightConfig, state: FlightState, now_us: int) -> bool:
    """Whether the newest setpoint is within the timeout."""
    return state.offboard.is_fresh(now_us, config.limits.setpoint_timeout_us)


def report(state: FlightState, now_us: int) -> OffboardReport:
    """The current setpoints, for telemetry."""
    memory = state.offboard
    if memory.accepted == memory.refused == 0:
        return _NO_SETPOINTS
    return OffboardReport(
        kind=_kind(memory) if state.vehicle.mode is Mode.OFFBOARD else SetpointKind.NONE,
        motion=memory.motion,
        attitude=memory.attitude,
        joints=memory.joints,
        accepted=memory.accepted,
        refused=memory.refused,
        age_us=now_us - memory.heard_us if memory.heard_us >= 0 else 0,
    )


def _presses(state: FlightState, estimate: StateEstimate) -> bool:
    """Whether the setpoint commands a descent onto the ground."""
    reference = state.setpoint.reference
    if reference is None or reference.of_end_effector:
        return False
    return reference.p[2] - estimate.p_WB[2] > _SINKING


def _moved_on(motion: MotionSetpoint, age_us: int) -> MotionSetpoint:
    """A moving setpoint, extrapolated to now."""
    if motion.p is None or motion.v is None or motion.along_heading:
        return motion
    return replace(motion, p=add_scaled(motion.p, motion.v, 1e-6 * age_us))


def _kind(memory: OffboardMemory) -> SetpointKind:
    if memory.attitude is not None:
        return SetpointKind.ATTITUDE
    if memory.motion is None:
        return SetpointKind.JOINTS
    return SetpointKind.END_EFFECTOR if memory.motion.of_end_effector else SetpointKind.BODY
