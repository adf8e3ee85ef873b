"""The reference over the planner's horizon, from the flight mode through the reference governor."""

from __future__ import annotations

import math

from fsw.autopilot.control.press import PressTuning
from fsw.autopilot.flight.land_detector import is_low
from fsw.autopilot.flight.modes.base import FlightMode
from fsw.autopilot.flight.setpoints.generator import PositionGoal, ReferenceState, arrived, step
from fsw.autopilot.flight.setpoints.reference_governor import (
    Limits,
    ReferenceGovernor,
    lead_at,
    max_lead,
    project,
)
from fsw.autopilot.flight.state import FlightState, SetpointMemory
from fsw.autopilot.geometry.vectors import add_scaled, clamp, dot, norm, subtract
from fsw.autopilot.model.kinematics import end_effector
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import (
    EndEffectorTarget,
    JointVector,
    MotionSetpoint,
    SafeSet,
    StateEstimate,
    Vec3,
)
from fsw.autopilot.tick_record import Tick
from fsw.frozen import replace

_AHEAD_US = 1_000_000
_OFF_PLAN = 0.05  # m; beyond what a disturbance alone does nearly always
# m, that a surface is followed from where it was announced: one that comes as far as it does, one
# that goes not far, because the other parts keep clear of where it was announced
_BACK, _AFTER = 0.3, 0.03
_FASTEST = 0.15  # m/s, of one that comes
_NOTHING: Vec3 = (0.0, 0.0, 0.0)

Horizon = tuple[tuple[EndEffectorTarget, ...], tuple[JointVector, ...]]
"""Targets at the nodes; joints at the nodes, or none where the arm is the planner's choice."""


class ReferenceHorizon:
    """Makes the horizons of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config
        self._governor = ReferenceGovernor(config)

    def warm_up(self, estimate: StateEstimate) -> None:
        """Compile every kernel."""
        here, rest, nothing = estimate.p_WB, (0.0, 0.0, 0.0), SafeSet()
        self._governor.limit_horizon((still_at(here),), here, rest, nothing)
        self._governor.limit_setpoint(
            here, rest, other_end=here, of_end_effector=False, safe_set=nothing, t_us=0
        )
        project(still_at(here), nothing)

    def __call__(
        self, mode: FlightMode, state: FlightState, estimate: StateEstimate, t_us: int
    ) -> tuple[FlightState, Horizon]:
        """Move the mode's setpoint on by a planning period; its horizon from ``t_us`` on."""
        state = mode.aim(state, estimate)
        reference, goal = state.setpoint.reference, state.setpoint.goal
        p_WE, v_WE = end_effector(self._config.airframe.bodies, estimate)
        if reference is not None and goal is not None:
            state, (targets, joints) = self._generated(mode, state, reference, goal, estimate, t_us)
        else:
            nodes, period_us = self._config.planner.horizon + 1, self._config.mpc_period_us
            if _leads_too_far(mode.target(state, t_us), p_WE):  # its time stands still
                begin_us = state.vehicle.mode_begin_us + period_us
                state = replace(state, vehicle=replace(state.vehicle, mode_begin_us=begin_us))
            targets = tuple(mode.target(state, t_us + node * period_us) for node in range(nodes))
            joints = ()
        balance = state.damage.balance
        if balance is not None:
            joints = (balance,) * len(targets)
        if not mode.external_reference and (reference is None or goal is None):
            targets = _led_aside(targets, p_WE, v_WE, self._config.steering.speed)
            return replace(state, limited="") if state.limited else state, (targets, joints)
        safe_set, why = state.kept.safe_set, ""
        if mode.external_reference:
            state, limits = self._came_up(state, targets[0])
            targets, why = self._governor.limit_horizon(targets, p_WE, v_WE, safe_set, limits)
        else:
            targets, _ = self._governor.limit_horizon(targets, p_WE, v_WE, safe_set)
            if goal is not None:
                why = self._governor.left_by(goal.motion)
        return replace(state, limited=why) if why != state.limited else state, (targets, joints)

    def target(
        self, mode: FlightMode, state: FlightState, estimate: StateEstimate, t_us: int
    ) -> EndEffectorTarget:
        """Where a mode has the end-effector at an instant, if it is from outside as it is limited.

        What follows the target, and the mode that takes over, go by this. While nothing of ours
        flies it is where the vehicle is: it may be carried, or flown by another autopilot.
        """
        if not state.vehicle.flies:
            return self.here(estimate, t_us)
        target = mode.target(state, t_us)
        if not mode.external_reference:
            return target
        p_WE, v_WE = end_effector(self._config.airframe.bodies, estimate)
        _, limits = self._came_up(state, target)
        return self._governor.limit_now(target, p_WE, v_WE, state.kept.safe_set, limits)

    def asked(
        self, mode: FlightMode, state: FlightState, estimate: StateEstimate, t_us: int
    ) -> Vec3:
        """The way [m, NED] from the vehicle to where a mode wants it a second after an instant.

        As if there were no walls.
        """
        reference, goal = state.setpoint.reference, state.setpoint.goal
        p_WE, _ = end_effector(self._config.airframe.bodies, estimate)
        if reference is None or goal is None:
            return subtract(mode.target(state, t_us + _AHEAD_US).p_WE, p_WE)
        wanted = step(reference, mode.guided(goal, state), self._config.steering, 1e-6 * _AHEAD_US)
        return subtract(wanted.p, p_WE if reference.of_end_effector else estimate.p_WB)

    def here(self, estimate: StateEstimate, t_us: int) -> EndEffectorTarget:
        """At rest where the end-effector is, from ``t_us`` [us] on."""
        p_WE, _ = end_effector(self._config.airframe.bodies, estimate)
        return still_at(p_WE, t_us, estimate.yaw)

    def _came_up(self, state: FlightState, target: EndEffectorTarget) -> tuple[FlightState, Limits]:
        """The state, and the limits of a reference from outside.

        One that takes off comes up from where its mode began. Once it was up it goes no lower.
        """
        vehicle = state.vehicle
        if not vehicle.is_up and self._governor.is_up(target):
            vehicle = replace(vehicle, is_up=True)
            state = replace(state, vehicle=vehicle)
        came_from = -math.inf if vehicle.is_up else vehicle.mode_origin[2]
        return state, self._governor.limits_from(came_from)

    def _generated(
        self,
        mode: FlightMode,
        state: FlightState,
        reference: ReferenceState,
        goal: PositionGoal,
        estimate: StateEstimate,
        t_us: int,
    ) -> tuple[FlightState, Horizon]:
        safe_set, waypoints, kept = state.kept.safe_set, state.setpoint.waypoints, goal
        if self._is_off_plan(state, estimate):
            still = MotionSetpoint(reference.of_end_effector, v=(0.0, 0.0, 0.0))
            goal = replace(goal, motion=still, orbit=None)
        else:
            goal = mode.guided(goal, state)
        reference = mode.generator.advance(reference, goal, estimate, safe_set)
        if waypoints and goal.motion.p is not None and arrived(reference, goal.motion.p):
            kept = goal = replace(goal, motion=replace(goal.motion, p=waypoints[0]))
            waypoints = waypoints[1:]
        state = replace(state, setpoint=SetpointMemory(reference, kept, waypoints))
        return state, mode.generator.horizon(reference, goal, estimate, safe_set, t_us)

    def _is_off_plan(self, state: FlightState, estimate: StateEstimate) -> bool:
        """Whether the fast loop is off the plan: then the reference does not advance."""
        nominal = state.plan_state
        if nominal is None:
            return False
        (x, y, z), (px, py, pz) = estimate.p_WB, nominal.p
        low = is_low(self._config, estimate)
        return math.hypot(px - x, py - y, 0.0 if low else pz - z) > _OFF_PLAN


def _leads_too_far(target: EndEffectorTarget, p_WE: Vec3) -> bool:
    """Whether a target moves on too far ahead of the end-effector at ``p_WE`` [m, NED].

    What holds the vehicle up may go away, and a reference that had gone on would be caught up with.
    """
    ahead, speed = dot(subtract(target.p_WE, p_WE), target.v_WE), norm(target.v_WE)
    return ahead > speed * max_lead(speed)


def _led_aside(
    targets: tuple[EndEffectorTarget, ...], p_WE: Vec3, v_WE: Vec3, fastest: float
) -> tuple[EndEffectorTarget, ...]:
    """The targets of a mode that generates no setpoint, as near as the ``fastest`` [m/s] leads.

    The end-effector is at ``p_WE`` [m, NED] and moves at ``v_WE`` [m/s, NED]. The height is left to
    the mode: a landing asks for what is below the ground, at a speed of its own.
    """
    near, limited = lead_at(v_WE, fastest), []
    for one in targets:
        reach = near + 1e-6 * fastest * (one.t_us - targets[0].t_us)
        north, east, _ = subtract(one.p_WE, p_WE)
        away = math.hypot(north, east)
        if away > reach:
            share = reach / away
            p = (p_WE[0] + share * north, p_WE[1] + share * east, one.p_WE[2])
            one = replace(one, p_WE=p)
        limited.append(one)
    return tuple(limited)


def pressed_reference(
    targets: tuple[EndEffectorTarget, ...], r: Tick, p_WE: Vec3, tuning: PressTuning
) -> tuple[tuple[EndEffectorTarget, ...], tuple[Vec3, ...]]:
    """The targets of a horizon for a tool at ``p_WE`` [m, NED], and the pushes on the base.

    A surface is where it is felt, not where it was announced: along its normal the targets of a
    tool in contact are moved to where the tool is. The plan counts on what the surface pushes back
    in each step [m/s^2, NED], nothing where nothing is pressed. The force that is given now rises
    and falls as the fast loop lets it.
    """
    k = r.pressing
    if not k.contact:
        if not any(target.force > 0.0 for target in targets):
            return targets, ()
        return targets, (_NOTHING,) * (len(targets) - 1)
    n = (float(k.normal[0]), float(k.normal[1]), float(k.normal[2]))
    moved, pushes = [], []
    speed = clamp(k.surface_speed - k.mean_speed, 0.0, _FASTEST)
    for target in targets:
        ahead_s = 1e-6 * (target.t_us - targets[0].t_us)
        if target.force > 0.0:
            off = clamp(dot(n, subtract(p_WE, target.p_WE)), -_AFTER, _BACK) + ahead_s * speed
            target = replace(
                target,
                p_WE=add_scaled(target.p_WE, n, off),
                v_WE=add_scaled(target.v_WE, n, speed),
            )
        moved.append(target)
        least, most = k.ramped - ahead_s * tuning.fall, k.ramped + ahead_s * tuning.rise
        force = max(clamp(target.force, least, most), 0.0)
        pushes.append(add_scaled(_NOTHING, n, force / r.mass))
    return tuple(moved), tuple(pushes[:-1])
