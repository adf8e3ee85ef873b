"""Offboard: follows a ground station's setpoints while they arrive."""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.flight.commands.bounds import motion_refusal
from fsw.autopilot.flight.land_detector import feel_ground, in_the_air
from fsw.autopilot.flight.modes.base import CONTINUE, FlightMode, ModeResult, Px4Mode
from fsw.autopilot.flight.setpoints.generator import PositionGoal
from fsw.autopilot.flight.setpoints.offboard_setpoint import (
    Tilt,
    as_motion,
    attitude_refusal,
    finite_or_zero,
    joints_refusal,
    tilted,
    turn_level,
)
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import FlightState, OffboardMemory, SetpointMemory, is_young
from fsw.autopilot.geometry.vectors import add_scaled
from fsw.autopilot.model.kinematics import end_effector
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import (
    Mode,
    MotionSetpoint,
    OffboardReport,
    PositionFrom,
    SetpointKind,
    Severity,
    StateEstimate,
    StatusText,
    TickInputs,
)
from fsw.frozen import replace

_RISING = 0.1  # m, m/s or m/s^2 upwards: the setpoint asks a standing vehicle to fly
_SINKING = 0.1  # m that the setpoint is below the vehicle: it presses on the ground
_TOLD_AGAIN_US: Final = 5_000_000
_NO_SETPOINTS = OffboardReport()


class Offboard(FlightMode):
    """PX4's OFFBOARD; what happens when setpoints stop is in ``failsafe/``."""

    mode = Mode.OFFBOARD
    px4 = Px4Mode(6, 0, 14, "offboard")
    before_arming = True
    manual = True

    def refusal(self, context: Situation) -> str | None:
        """Setpoints."""
        now_us = context.estimate.t_us
        if is_fresh(self.config, context.state, now_us):
            return None
        problem = current_problem(self.config, context.state, now_us)
        if problem:
            return f"not offboard: setpoints are refused: {problem}"
        timeout = 1e-6 * self.config.limits.setpoint_timeout_us
        return f"not offboard: no setpoint was received in the last {timeout:g} s"

    def waits(self, state: FlightState, now_us: int) -> str | None:
        """Dropped when setpoints stop."""
        if is_fresh(self.config, state, now_us):
            return None
        problem = current_problem(self.config, state, now_us)
        why = f"were refused: {problem}" if problem else "stopped before arming"
        return f"offboard cancelled: setpoints {why}"

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
        if motion.p is not None and math.isfinite(motion.p[2]):
            return estimate.p_WB[2] - motion.p[2] > (0.0 if motion.of_end_effector else _RISING)
        if motion.v is not None and math.isfinite(motion.v[2]):
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
            airframe = config.airframe
            thrust = airframe.full_thrust * memory.attitude.thrust
            return as_motion(tilt, thrust / state.record.mass), tilt
        assert memory.motion is not None, "one of the two is young"
        return _moved_on(memory.motion, estimate.t_us - memory.motion_us), ahead


def accept_setpoints(
    state: FlightState, inputs: TickInputs, config: FlightConfig, texts: list[StatusText]
) -> OffboardMemory:
    """Store setpoints; refused ones are counted, with the reason of the newest.

    A text says it, and again every few seconds while setpoints are refused.
    """
    memory, now_us = state.offboard, inputs.sensors.t_us
    motion, attitude, joints = inputs.motion, inputs.attitude, inputs.joints
    refused, accepted, problem = inputs.refused_setpoints, 0, inputs.setpoint_problem
    if motion is not None:
        placed = _place_motion(motion, state, config)
        if isinstance(placed, MotionSetpoint):
            memory = replace(memory, motion=placed, attitude=None, motion_us=now_us)
            accepted += 1
        else:
            problem = placed
    if attitude is not None:
        against = attitude_refusal(attitude)
        if against is None:
            memory = replace(memory, attitude=attitude, motion=None, motion_us=now_us)
            accepted += 1
        problem = against or problem
    if joints is not None:
        against = joints_refusal(joints.q_arm, config.airframe)
        if against is None:
            memory = replace(memory, joints=joints, joints_us=now_us)
            accepted += 1
        problem = against or problem
    refused += sum(one is not None for one in (motion, attitude, joints)) - accepted
    if problem:
        memory = replace(memory, problem=problem, problem_us=now_us)
        if not is_young(memory.told_us, now_us, _TOLD_AGAIN_US):
            texts.append(StatusText(Severity.WARNING, f"setpoint refused: {problem}"))
            memory = replace(memory, told_us=now_us)
    return replace(memory, accepted=memory.accepted + accepted, refused=memory.refused + refused)


def current_problem(config: FlightConfig, state: FlightState, now_us: int) -> str:
    """Why setpoints are refused now; empty: none was within the timeout."""
    memory = state.offboard
    if is_young(memory.problem_us, now_us, config.limits.setpoint_timeout_us):
        return memory.problem
    return ""


def _place_motion(
    motion: MotionSetpoint, state: FlightState, config: FlightConfig
) -> MotionSetpoint | str:
    """A setpoint whose position counts from the origin of the local frame; or why it is refused."""
    if motion.p is not None and motion.p_from is not PositionFrom.ORIGIN:
        x, y, z = motion.p
        home, estimate = state.vehicle.home, state.estimate
        if motion.p_from is PositionFrom.HOME_HEIGHT:
            if home is None:
                return "its height counts from home, and no home is set"
            place = (x, y, z + home.p[2])
        elif estimate is None:
            return "its position counts from the vehicle's, which is not known"
        else:
            if motion.along_heading:
                x, y, z = turn_level(motion.p, estimate.yaw)
            p = estimate.p_WB
            if motion.of_end_effector:
                p = end_effector(config.airframe.bodies, estimate)[0]
            place = (x + p[0], y + p[1], z + p[2])
        motion = replace(motion, p=place, p_from=PositionFrom.ORIGIN)
    return motion_refusal(motion) or motion


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
        age_us=now_us - memory.last_received_us if memory.last_received_us >= 0 else 0,
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
    v = finite_or_zero(motion.v)
    return replace(motion, p=add_scaled(motion.p, v, 1e-6 * age_us))


def _kind(memory: OffboardMemory) -> SetpointKind:
    if memory.attitude is not None:
        return SetpointKind.ATTITUDE
    if memory.motion is None:
        return SetpointKind.JOINTS
    return SetpointKind.END_EFFECTOR if memory.motion.of_end_effector else SetpointKind.BODY
