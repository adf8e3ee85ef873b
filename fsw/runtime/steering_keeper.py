"""What the steered modes do with places and set-points: hold at a place, return, offboard."""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.parameters.flight_config import FlightConfig
from fsw.runtime.flight_state import FlightState, OffboardMemory, SteerMemory
from fsw.runtime.leading import go_ahead, horizon_of, lead_from, target_of
from fsw.signals import (
    EndEffectorTarget,
    Home,
    Mode,
    MotionSetpoint,
    OffboardReport,
    Orbit,
    SetpointKind,
    StateEstimate,
    TickInputs,
    Vec2,
    Vec3,
)
from fsw.vehicle.mission import nearest
from fsw.vehicle.modes import Event
from fsw.vehicle.offboard import (
    Tilt,
    as_motion,
    attitude_refusal,
    joint_refusal,
    motion_refusal,
    tilted,
)
from fsw.vehicle.situation import Goto
from fsw.vehicle.steering import Aim, arrived

_STILL = 0.1  # m/s; faster, a hold brakes first
_OFF_PLAN = 0.05  # m; beyond what a disturbance alone does nearly always
_RISING = 0.1  # m, m/s or m/s^2 upwards: somebody on the ground wants to fly
_SINKING = 0.1  # m that the reference is below the vehicle: it presses on the ground
_NOTHING_HEARD = OffboardReport()


class SteeringKeeper:
    """Keeps the steered reference of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config

    def receive(self, memory: OffboardMemory, inputs: TickInputs) -> OffboardMemory:
        """Take in set-points; what is out of range is counted and not kept."""
        refused, accepted, now_us = inputs.refused_setpoints, 0, inputs.sensors.t_us
        motion, attitude, joints = inputs.motion, inputs.attitude, inputs.joints
        if motion is not None and motion_refusal(motion) is None:
            memory = replace(memory, motion=motion, attitude=None, motion_us=now_us)
            accepted += 1
        if attitude is not None and attitude_refusal(attitude) is None:
            memory = replace(memory, attitude=attitude, motion=None, motion_us=now_us)
            accepted += 1
        if joints is not None and joint_refusal(joints, self._config.airframe) is None:
            memory = replace(memory, joints=joints, joints_us=now_us)
            accepted += 1
        refused += sum(one is not None for one in (motion, attitude, joints)) - accepted
        return replace(
            memory, accepted=memory.accepted + accepted, refused=memory.refused + refused
        )

    def is_fresh(self, state: FlightState, now_us: int) -> bool:
        """Whether a set-point came a moment ago."""
        memory = state.offboard
        return self._is_young(max(memory.motion_us, memory.joints_us), now_us)

    def _is_young(self, heard_us: int, now_us: int) -> bool:
        return heard_us >= 0 and now_us - heard_us < self._config.limits.setpoint_timeout_us

    def steer_into(
        self, state: FlightState, mode: Mode, event: Event, estimate: StateEstimate
    ) -> SteerMemory:
        """The steered reference with which a mode begins; none in the modes that have their own."""
        if event in (Event.ARM, Event.CLIMB_DONE, Event.TRAJECTORY_DONE, Event.MISSION_DONE):
            return SteerMemory()
        if mode is Mode.ORBIT:
            return SteerMemory(state.steer.lead, state.steer.aim)
        if mode is Mode.RETURN and state.vehicle.home is not None:
            home = nearest(state.vehicle.home, state.mission.rally, estimate.p_WB)
            return self._way_home(home, estimate)
        if mode is Mode.HOLD and state.vehicle.flies:
            return self._stop(state, estimate)
        return SteerMemory()

    def stop(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """Break off the way to a place."""
        if state.steer.lead is None:
            return state
        return replace(state, steer=self._stop(state, estimate))

    def go_to(self, state: FlightState, goto: Goto, estimate: StateEstimate) -> FlightState:
        """Hold at another place from now on."""
        joints = state.steer.aim.joints if state.steer.aim is not None else None
        motion = MotionSetpoint(False, goto.p, yaw=goto.yaw)
        lead = state.steer.lead
        if lead is None or lead.of_end_effector:
            lead = lead_from(self._config, estimate, of_end_effector=False)
        return replace(state, steer=SteerMemory(lead, Aim(motion, joints, goto.speed)))

    def set_joints(self, state: FlightState, q_arm: Vec2, estimate: StateEstimate) -> FlightState:
        """Hold the body where it is, and the arm as asked, from now on."""
        steer = state.steer
        if steer.lead is None or steer.aim is None or steer.lead.of_end_effector:
            lead = lead_from(self._config, estimate, of_end_effector=False)
            motion = MotionSetpoint(False, lead.p)
            return replace(state, steer=SteerMemory(lead, Aim(motion, q_arm)))
        return replace(state, steer=replace(steer, aim=replace(steer.aim, joints=q_arm)))

    def circle(self, state: FlightState, orbit: Orbit, estimate: StateEstimate) -> FlightState:
        """Fly a circle from now on."""
        lead = state.steer.lead
        if lead is None or lead.of_end_effector:
            lead = lead_from(self._config, estimate, of_end_effector=False)
        joints = state.steer.aim.joints if state.steer.aim is not None else None
        motion = MotionSetpoint(False, orbit.centre, yaw=lead.yaw)
        return replace(state, steer=SteerMemory(lead, Aim(motion, joints, orbit=orbit)))

    def look_at(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """A hold that just stays has to be steered to turn."""
        if state.vehicle.mode is not Mode.HOLD or state.steer.lead is not None:
            return state
        if not state.vehicle.flies:
            return state
        lead = lead_from(self._config, estimate, of_end_effector=False)
        return replace(state, steer=SteerMemory(lead, Aim(MotionSetpoint(False, lead.p))))

    def is_home(self, state: FlightState) -> bool:
        """Whether the way home is flown."""
        lead, aim, waypoints = state.steer.lead, state.steer.aim, state.steer.waypoints
        if lead is None or aim is None or aim.motion.p is None or waypoints:
            return False
        return arrived(lead, aim.motion.p)

    def wants_to_rise(self, state: FlightState, estimate: StateEstimate) -> bool:
        """Whether the set-point asks a standing vehicle to fly."""
        motion = self._offboard_motion(state, estimate)[0]
        if motion.p is not None:
            return estimate.p_WB[2] - motion.p[2] > (0.0 if motion.of_end_effector else _RISING)
        if motion.v is not None:
            return -motion.v[2] > _RISING
        return motion.a is not None and -motion.a[2] > _RISING

    def wants_to_sink(self, state: FlightState, estimate: StateEstimate) -> bool:
        """Whether the reference is pressed on the ground."""
        lead = state.steer.lead
        if lead is None or lead.of_end_effector:
            return False
        return lead.p[2] - estimate.p_WB[2] > _SINKING

    def plan_ahead(
        self, state: FlightState, estimate: StateEstimate, t_us: int
    ) -> tuple[FlightState, tuple[EndEffectorTarget, ...], tuple[Vec2, ...]] | None:
        """Move the reference on by a period; its horizon from ``t_us`` on.

        None where the mode is not steered.
        """
        state = self._offboard_aim(state, estimate)
        lead, aim, waypoints = state.steer.lead, state.steer.aim, state.steer.waypoints
        if lead is None or aim is None:
            return None
        safe_set, asked = state.mission.safe_set, aim
        if self._is_off_plan(state, estimate):
            still = MotionSetpoint(lead.of_end_effector, v=(0.0, 0.0, 0.0))
            aim = replace(aim, motion=still, orbit=None)
        elif state.vehicle.mode is not Mode.OFFBOARD:
            aim = self._as_guided(aim, state)
        lead = go_ahead(self._config, lead, aim, estimate, safe_set)
        if waypoints and aim.motion.p is not None and arrived(lead, aim.motion.p):
            asked = aim = replace(aim, motion=replace(aim.motion, p=waypoints[0]))
            waypoints = waypoints[1:]
        state = replace(state, steer=SteerMemory(lead, asked, waypoints))
        targets, joint_targets = horizon_of(self._config, lead, aim, estimate, safe_set, t_us)
        return state, targets, joint_targets

    def _as_guided(self, aim: Aim, state: FlightState) -> Aim:
        """The aim with the speed and the heading that commands asked for."""
        vehicle = state.vehicle
        if vehicle.look_at is None and (vehicle.speed is None or aim.speed is not None):
            return aim
        return replace(aim, speed=aim.speed or vehicle.speed, look_at=vehicle.look_at)

    def target(self, state: FlightState, t_us: int) -> EndEffectorTarget | None:
        """The steered end-effector target now; None where the mode is not steered."""
        lead = state.steer.lead
        return None if lead is None else target_of(self._config, lead, t_us)

    def report(self, state: FlightState, now_us: int) -> OffboardReport:
        """What telemetry shows of set-points."""
        memory = state.offboard
        if memory.accepted == memory.refused == 0:
            return _NOTHING_HEARD
        kind = SetpointKind.NONE
        if state.vehicle.mode is Mode.OFFBOARD:
            kind = _kind(memory)
        heard_us = max(memory.motion_us, memory.joints_us)
        return OffboardReport(
            kind,
            memory.motion,
            memory.attitude,
            memory.joints,
            memory.accepted,
            memory.refused,
            now_us - heard_us if heard_us >= 0 else 0,
        )

    def _offboard_aim(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """Bring the aim up to date with the set-points, where they are flown."""
        if state.vehicle.mode is not Mode.OFFBOARD:
            return state
        motion, tilt = self._offboard_motion(state, estimate)
        lead = state.steer.lead
        if lead is None or lead.of_end_effector != motion.of_end_effector:
            lead = lead_from(self._config, estimate, of_end_effector=motion.of_end_effector)
        memory = state.offboard
        joints = state.steer.aim.joints if state.steer.aim is not None else None
        if memory.joints is not None and self._is_young(memory.joints_us, estimate.t_us):
            joints = memory.joints.q_arm
        if joints is not None and lead.q_arm is None:
            lead = replace(lead, q_arm=estimate.q_arm)
        return replace(
            state,
            steer=SteerMemory(lead, Aim(motion, joints, self._config.steering.speed)),
            offboard=replace(memory, tilt=tilt),
        )

    def _offboard_motion(
        self, state: FlightState, estimate: StateEstimate
    ) -> tuple[MotionSetpoint, Tilt]:
        memory, config = state.offboard, self._config
        ahead = Tilt(yaw=estimate.yaw)
        if not self._is_young(memory.motion_us, estimate.t_us):
            # Joints alone: the body stays.
            return MotionSetpoint(False, v=(0.0, 0.0, 0.0)), ahead
        if memory.attitude is not None:
            last = ahead if state.steer.lead is None else memory.tilt
            tilt_limit = config.planner.limits.tilt
            tilt = tilted(memory.attitude, last, tilt_limit, config.planner.period)
            thrust = 4.0 * config.airframe.rotor_thrust_max * memory.attitude.thrust
            return as_motion(tilt, thrust / state.cascade.mass), tilt
        assert memory.motion is not None, "one of the two is young"
        return _moved_on(memory.motion, estimate.t_us - memory.motion_us), ahead

    def _way_home(self, home: Home, estimate: StateEstimate) -> SteerMemory:
        """Up to the height of return, across, down to where it waits, and there it ends."""
        (x, y, z), limits = estimate.p_WB, self._config.limits
        height = min(z, home.p[2] - limits.return_height)
        waits = max(height, home.p[2] - limits.return_descent)
        lead = lead_from(self._config, estimate, of_end_effector=False)
        aim = Aim(MotionSetpoint(False, (x, y, height)))
        across: Vec3 = (home.p[0], home.p[1], height)
        down: Vec3 = (home.p[0], home.p[1], waits)
        return SteerMemory(lead, aim, (across, down) if waits > height else (across,))

    def _is_off_plan(self, state: FlightState, estimate: StateEstimate) -> bool:
        """Whether the fast loop is not where the plan is: then nothing new is asked of it."""
        if state.nominal is None:
            return False
        (x, y, z), (px, py, pz) = estimate.p_WB, state.nominal.p
        # On the ground the plan may well be lower.
        low = -z - self._config.airframe.leg_length < self._config.limits.airborne_height
        return math.hypot(px - x, py - y, 0.0 if low else pz - z) > _OFF_PLAN

    def _stop(self, state: FlightState, estimate: StateEstimate) -> SteerMemory:
        """Come to rest; a vehicle that hardly moves just stays."""
        lead = state.steer.lead
        if lead is None:
            if math.hypot(*estimate.v_WB) < _STILL:
                return SteerMemory()
            lead = lead_from(self._config, estimate, of_end_effector=True)
        joints = state.steer.aim.joints if state.steer.aim is not None else None
        motion = MotionSetpoint(lead.of_end_effector, v=(0.0, 0.0, 0.0))
        return SteerMemory(lead, Aim(motion, joints))


def _moved_on(motion: MotionSetpoint, age_us: int) -> MotionSetpoint:
    """A place that moves has moved since it was said."""
    if motion.p is None or motion.v is None or motion.along_heading:
        return motion
    age = 1e-6 * age_us
    p, v = motion.p, motion.v
    moved: Vec3 = (p[0] + age * v[0], p[1] + age * v[1], p[2] + age * v[2])
    return replace(motion, p=moved)


def _kind(memory: OffboardMemory) -> SetpointKind:
    if memory.attitude is not None:
        return SetpointKind.ATTITUDE
    if memory.motion is None:
        return SetpointKind.JOINTS
    return SetpointKind.END_EFFECTOR if memory.motion.of_end_effector else SetpointKind.BODY
