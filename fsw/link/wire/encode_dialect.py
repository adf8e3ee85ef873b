"""Messages of the pandion dialect from the vehicle's snapshot; pure.

Each encoder returns every field of its message in wire order (larger types first, see
``messages.frames.wire_fields``), or None when there is nothing to say yet.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from operator import attrgetter
from typing import Final

from fsw.autopilot.model.kinematics import end_effector
from fsw.autopilot.signals import FlightSnapshot, JointVector, SetpointKind
from fsw.link.wire.encode_standard import as_asked
from fsw.link.wire.outgoing import Outgoing, TelemetryContext, WireValues
from fsw.link.wire.zone_transfer import shape_values
from fsw.record import JOINTS, padded
from messages import message_ids
from messages.frames import wire_fields
from messages.joint_arrays import JOINTS_MAX, base, more

_LOCAL_NED: Final = 1  # MAV_FRAME
_MAX_CONSTRAINTS: Final = 16
_U16: Final = 0xFFFF
_U32: Final = 0xFFFFFFFF
_HORIZON_STEPS, _HORIZON_JOINTS = 6, 2  # of an MPC_HORIZON
_RATE_GROUPS: Final = ("inner", "mpc", "telemetry", "housekeeping")  # of LoopHealth


def arm_joint_state(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """ARM_JOINT_STATE; the torque is the one commanded, the arm has no torque sensor."""
    estimate = snapshot.estimate
    p_WE, v_WE = end_effector(context.facts.airframe.bodies, estimate)
    arrays = estimate.q_arm, estimate.qd_arm, snapshot.actuators.joint_torque
    return (snapshot.t_us, *_bases(arrays), *p_WE, *v_WE, len(arrays[0]), *_rests(arrays))


def arm_joint_setpoint(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues | None:
    """ARM_JOINT_SETPOINT in use: the one that is flown offboard, or the running plan's joints."""
    offboard, plan, inputs = snapshot.offboard, snapshot.plan_state, snapshot.plan_input
    if offboard.kind is not SetpointKind.NONE and offboard.joints is not None:
        arrays: tuple[JointVector, ...] = (offboard.joints.q_arm, (), ())
    elif plan is None or inputs is None:
        return None
    else:
        arrays = plan.q_arm, plan.qd_arm, inputs.qdd_arm
    return (snapshot.t_us, *_bases(arrays), 0, 0, len(arrays[0]), *_rests(arrays))


def end_effector_target(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues | None:
    """END_EFFECTOR_TARGET in use; shows whether a setpoint was accepted."""
    asked = snapshot.offboard.motion
    if snapshot.offboard.kind is SetpointKind.END_EFFECTOR and asked is not None:
        numbers, mask = as_asked(asked)
        return (0, *numbers, mask, 0, 0, _LOCAL_NED, 0.0)
    target = snapshot.reference
    if target is None:
        return None
    motion = (*target.p_WE, *target.v_WE, *target.a_WE)
    return (target.t_us, *motion, target.yaw, 0.0, 0, 0, 0, _LOCAL_NED, target.force)


def setpoint_status(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """SETPOINT_STATUS: how many setpoints were accepted and refused, and which kind is flown."""
    report = snapshot.offboard
    counts = (report.accepted & _U32, report.refused & _U32, min(report.age_us, _U32))
    return (snapshot.t_us, *counts, int(report.kind), snapshot.safety.refusals & _U32)


def barrier_margin(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues | None:
    """BARRIER_MARGIN of the active safe set; a barrier counts as active at or below zero."""
    report = snapshot.constraints
    margins, barrier, smallest = report.shown(_MAX_CONSTRAINTS)
    if smallest is None:
        return None
    active = sum(1 << i for i, value in enumerate(barrier) if not value > 0.0)
    return (
        snapshot.t_us,
        *padded(margins, _MAX_CONSTRAINTS),
        *padded(barrier, _MAX_CONSTRAINTS),
        snapshot.plan.slack_max if snapshot.plan is not None else 0.0,
        min(report.margins),
        active,
        int(report.kind),
        len(margins),
        smallest,
        snapshot.safety.breaches & _U16,
        snapshot.safety.departures & _U16,
        snapshot.safety.interventions & _U16,
        *padded(report.added[:_MAX_CONSTRAINTS], _MAX_CONSTRAINTS),
        report.shortfall,
    )


def tool_contact(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues | None:
    """TOOL_CONTACT while a surface that may be touched is near."""
    if snapshot.touching is None:
        return None
    contact, force, *numbers = snapshot.touching
    return (snapshot.t_us, *force, *numbers, int(contact))


def payload_status(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues | None:
    """PAYLOAD_STATUS once the gripper was told something."""
    if snapshot.payload is None:
        return None
    return (snapshot.t_us, snapshot.payload.mass, int(snapshot.payload.closed))


def mpc_status(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues | None:
    """MPC_STATUS of the last plan that was accepted, with the status of the last cycle."""
    plan, facts = snapshot.plan, context.facts
    if plan is None:
        return None
    return (
        plan.t_us,
        plan.plan_id & _U32,
        _microseconds(plan.timings.total_us),
        _microseconds(plan.timings.linearise_us),
        _microseconds(plan.timings.solve_us),
        facts.mpc_delay_us,
        snapshot.counters.missed_deadlines,
        snapshot.counters.fallbacks,
        plan.cost,
        plan.slack_max,
        facts.mpc_delay_us,
        facts.horizon,
        round(1e6 / facts.mpc_period_us),
        plan.sqp_iterations & 0xFF,
        plan.solver_iterations & 0xFF,
        int(snapshot.plan_status),
    )


def mpc_horizon(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues | None:
    """MPC_HORIZON of the plan in use; of a long one the first steps."""
    plan = snapshot.plan
    if plan is None or snapshot.plan_state is None:
        return None
    x, steps = plan.start, plan.inputs[:_HORIZON_STEPS]
    start = (*x.p, *x.v, *x.a, *x.j, *x.s, x.yaw, x.yaw_rate, *_two(x.q_arm), *_two(x.qd_arm))
    inputs = tuple([value for u in steps for value in (*u.a, u.yaw_acc, *_two(u.qdd_arm))])
    filled = padded(inputs, 6 * _HORIZON_STEPS)
    return (plan.t_us, *start, *filled, plan.plan_id & _U32, plan.period_us, len(steps))


def mpc_horizon_arm(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues | None:
    """MPC_HORIZON_ARM of the plan in use: all joints, of which MPC_HORIZON has the first two."""
    plan = snapshot.plan
    if plan is None or snapshot.plan_state is None:
        return None
    x, steps = plan.start, plan.inputs[:_HORIZON_STEPS]
    accelerations = padded(
        tuple([qdd for u in steps for qdd in u.qdd_arm]), JOINTS * _HORIZON_STEPS
    )
    arm = (*padded(x.q_arm, JOINTS_MAX), *padded(x.qd_arm, JOINTS_MAX), *accelerations)
    return (plan.t_us, *arm, plan.plan_id & _U32, len(steps), len(x.q_arm))


def safe_set_shapes(which: float, snapshot: FlightSnapshot, _: TelemetryContext) -> list[Outgoing]:
    """OBSTACLE_SHAPE of the safe set in force: all, or the one of number ``which`` [1], from 1."""
    zones = snapshot.safe_set.zones
    if not zones:
        nothing = (0,) * len(wire_fields(message_ids.OBSTACLE_SHAPE))
        return [Outgoing(message_ids.OBSTACLE_SHAPE, nothing, message_ids.PANDION)]
    every = not which >= 1.0  # NaN and 0 ask for all
    return [
        Outgoing(message_ids.OBSTACLE_SHAPE, values, message_ids.PANDION)
        for number, values in enumerate(shape_values(zones), start=1)
        if every or number == which
    ]


def loop_timing(group: int) -> Callable[[FlightSnapshot, TelemetryContext], WireValues]:
    """The encoder of LOOP_TIMING of one PANDION_RATE_GROUP."""
    timing = attrgetter(_RATE_GROUPS[group])
    return lambda snapshot, context: (snapshot.t_us, *timing(context.health).shown, group)


def _microseconds(value: float) -> int:
    return min(round(value), _U32) if 0.0 <= value < math.inf else _U32


def _bases(arrays: tuple[JointVector, ...]) -> tuple[float, ...]:
    return tuple([value for one in arrays for value in base(one)])


def _rests(arrays: tuple[JointVector, ...]) -> tuple[float, ...]:
    return tuple([value for one in arrays for value in more(one)])


def _two(joints: JointVector) -> JointVector:
    return padded(joints[:_HORIZON_JOINTS], _HORIZON_JOINTS)
