"""The steered reference over the planner's horizon."""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.geometry.rotation import wrap_angle
from fsw.model.kinematics import point_in_flight
from fsw.parameters.flight_config import FlightConfig
from fsw.signals import EndEffectorTarget, SafeSet, StateEstimate, Vec2, Vec3
from fsw.vehicle.steering import Aim, Lead, keep_out, keep_up, move, tie


def lead_from(config: FlightConfig, estimate: StateEstimate, *, of_end_effector: bool) -> Lead:
    """A reference that begins where the vehicle is and moves as it does."""
    if of_end_effector:
        p, v = point_in_flight(estimate, config.airframe.link_length)
        return Lead(True, p, v, estimate.yaw)
    return Lead(False, estimate.p_WB, estimate.v_WB, estimate.yaw, 0.0, estimate.q_arm)


def go_ahead(
    config: FlightConfig, lead: Lead, aim: Aim, estimate: StateEstimate, safe_set: SafeSet
) -> Lead:
    """The reference one planning period later."""
    moved = move(lead, aim, config.steering, config.planner.period)
    if lead.of_end_effector:
        vehicle = point_in_flight(estimate, config.airframe.link_length)[0]
    else:
        vehicle = estimate.p_WB
    return _out(config, tie(moved, vehicle, config.steering.leash), estimate, safe_set)


def horizon_of(
    config: FlightConfig,
    lead: Lead,
    aim: Aim,
    estimate: StateEstimate,
    safe_set: SafeSet,
    t_us: int,
) -> tuple[tuple[EndEffectorTarget, ...], tuple[Vec2, ...]]:
    """Targets and joints at the nodes, the first at ``t_us``; joints only where some are asked."""
    targets, joint_targets = [], []
    for node in range(config.planner.horizon + 1):
        if node > 0:
            lead = move(lead, aim, config.steering, config.planner.period)
            lead = _out(config, lead, estimate, safe_set)
        target = target_of(config, lead, t_us + node * config.mpc_period_us)
        # The planner looks ahead at the vehicle's yaw rate, so it has to see where ours leads.
        ahead = config.planner.weights.yaw_lead * lead.yaw_rate
        targets.append(replace(target, yaw=wrap_angle(target.yaw + ahead)))
        if lead.q_arm is not None:
            joint_targets.append(lead.q_arm)
    return tuple(targets), tuple(joint_targets)


def target_of(config: FlightConfig, lead: Lead, t_us: int) -> EndEffectorTarget:
    """The end-effector's target of a reference for the body or the end-effector."""
    if lead.of_end_effector or lead.q_arm is None:
        return EndEffectorTarget(t_us, lead.p, lead.v, (0.0, 0.0, 0.0), lead.yaw)
    x, y, z = _hanging(config, lead.q_arm, lead.yaw)
    p, v, w = lead.p, lead.v, lead.yaw_rate
    return EndEffectorTarget(
        t_us,
        (p[0] + x, p[1] + y, p[2] + z),
        (v[0] - w * y, v[1] + w * x, v[2]),
        (0.0, 0.0, 0.0),
        lead.yaw,
    )


def _out(config: FlightConfig, lead: Lead, estimate: StateEstimate, safe_set: SafeSet) -> Lead:
    x, y, z = _hanging(config, lead.q_arm or estimate.q_arm, lead.yaw)
    body_down = lead.p[2] - (z if lead.of_end_effector else 0.0)
    touch_speed = 0.0 if lead.of_end_effector else config.limits.land_speed
    lead = keep_up(lead, -body_down - config.airframe.leg_length, touch_speed)
    if not (safe_set.walls or safe_set.obstacles):
        return lead
    below = (-x, -y, -z) if lead.of_end_effector else (x, y, z)
    tuning = config.planner.walls
    return keep_out(lead, below, safe_set, tuning.alpha, tuning.slope)


def _hanging(config: FlightConfig, q_arm: Vec2, yaw: float) -> Vec3:
    """From the body to the end-effector while level [m]."""
    l1, l2 = config.airframe.link_length
    th1, th12 = q_arm[0], q_arm[0] + q_arm[1]
    ahead = l1 * math.sin(th1) + l2 * math.sin(th12)
    down = l1 * math.cos(th1) + l2 * math.cos(th12)
    return ahead * math.cos(yaw), ahead * math.sin(yaw), down
