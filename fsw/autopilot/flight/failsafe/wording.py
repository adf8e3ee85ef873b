"""What is said of an active condition, behind its name, where a row does not say it in a line."""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.estimation.faults.sensor_fault import sentence
from fsw.autopilot.flight.failsafe.evidence import (
    force_on_tool,
    is_unaided,
    lost_sensors,
    plan_age_us,
    way_home_s,
)
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import PlanMemory, is_young
from fsw.autopilot.signals import SolverStatus


def uncertain(context: Situation) -> str:
    """By how much the position is, and why it is not measured."""
    aiding = context.state.aiding
    if not is_unaided(context):
        return f" by {1e3 * math.hypot(*aiding.unproven):.0f} mm: it has jumped"
    return f" by {1e3 * max(aiding.position_sigma, aiding.elsewhere):.0f} mm{unaided(context)}"


def unaided(context: Situation) -> str:
    """Which sensor should give the position, what is wrong with it, and for how long."""
    aiding = context.state.aiding
    return f": {sentence(aiding.pose, aiding.pose_fault)}, for {1e-6 * aiding.unaided_us:.2f} s"


def lost_sensor(context: Situation) -> str:
    """Which sensors are lost, each with its fault."""
    now_us = context.estimate.t_us
    return f": {'; '.join([one.sentence(now_us) for one in lost_sensors(context)])}"


def suspects(context: Situation) -> str:
    """Which sensors may be wrong, and for how long they have contradicted each other."""
    aiding = context.state.aiding
    return f": {aiding.suspects}, for {1e-6 * aiding.disputed_us:.2f} s"


def time_left(context: Situation) -> str:
    """Of the battery, and the time that the way home takes."""
    left = context.state.battery.time_left
    return f": {left:.0f} s left, {way_home_s(context):.0f} s needed for the way home"


def tilted(context: Situation) -> str:
    """Which angle is beyond its limit, and for how long."""
    safety, limits = context.state.safety, context.limits
    rolled = safety.rolled_us >= 0
    since_us = safety.rolled_us if rolled else safety.pitched_us
    angle = limits.roll_failure if rolled else limits.pitch_failure
    seconds = 1e-6 * (context.estimate.t_us - since_us)
    return (
        f": {'roll' if rolled else 'pitch'} above {math.degrees(angle):.0f} deg for {seconds:.2f} s"
    )


_PLANNER_FAILS: Final = {
    SolverStatus.INFEASIBLE: "infeasible",
    SolverStatus.TIME_LIMIT: "out of time",
    SolverStatus.NUMERICAL_ERROR: "numerical error",
    SolverStatus.INPUT_REFUSED: "input refused",
}


def no_plan(context: Situation) -> str:
    """What the planner does instead of planning, and since when."""
    plan = context.state.plan
    why = "silent" if plan.awaited_missed or not plan.refused else ""
    why = why or _planner_fails(plan)
    return f": planner {why}, last plan {1e-6 * plan_age_us(context):.2f} s ago"


def refused_setpoints(context: Situation) -> str:
    """Why the setpoints that still come are refused; nothing where none comes."""
    memory, timeout_us = context.state.offboard, context.limits.setpoint_timeout_us
    if not is_young(memory.problem_us, context.estimate.t_us, timeout_us):
        return ""
    return f": refused: {memory.problem}"


def refused_plan(context: Situation) -> str:
    """Without a number: it may come and go ten times a second, and is then told once in a while."""
    return f": {_planner_fails(context.state.plan)}"


def _planner_fails(plan: PlanMemory) -> str:
    why = _PLANNER_FAILS.get(plan.status, "failing")
    return f"{why}, {plan.reason}" if plan.reason else why


def jumped(context: Situation) -> str:
    """By how much time did."""
    jump_us = context.state.safety.jump_us
    if abs(jump_us) < 100_000:
        return f" by {1e-3 * jump_us:+g} ms"
    return f" by {1e-6 * jump_us:+.2f} s"


def by_mm(length: float) -> str:
    """How far beyond a limit: a ``length`` [m]."""
    return f" by {1e3 * length:.0f} mm"


def force(context: Situation) -> str:
    """How hard the tool is pressed upon, and what is allowed."""
    pressing = context.state.record.pressing
    found, unsure, most = force_on_tool(context), pressing.unsure, pressing.most
    return f": {found:.1f} N, or {unsure:.1f} N more, of {most:.1f} N"


def carried(context: Situation) -> str:
    """What tells that the ground carries the vehicle, and for how long it has."""
    since_us = context.state.safety.light_us
    return f": rotors carry less than the weight{lasting(context, since_us)}"


def lasting(context: Situation, since_us: int) -> str:
    """Since when a condition is so."""
    return f", for {1e-6 * (context.estimate.t_us - since_us):.2f} s"
