"""The estimate jumps, and plan and observer jump along: what is flown does not change by it.

So does the place that is held, where nothing says that the estimate was wrong before: PX4 shifts
its setpoints alike. What is asked for by others stays in their frame. Source: docs/decisions/0041.
"""

from __future__ import annotations

from typing import Final

from fsw.autopilot.estimation.dead_reckoning import moved_on
from fsw.autopilot.estimation.fusion_memory import Reset
from fsw.autopilot.flight.state import FlightState, PlanMemory
from fsw.autopilot.geometry.quaternion import conjugate, multiply
from fsw.autopilot.geometry.rotation import (
    matrix_from_quaternion,
    quaternion_from_matrix,
    wrap_angle,
    yaw_of,
)
from fsw.autopilot.geometry.vectors import add_scaled, norm
from fsw.autopilot.signals import Severity, StateEstimate, StatusText
from fsw.autopilot.tick_record import Tick
from fsw.frozen import replace

_TOLD: Final = 0.02  # m, of a jump that the operator reads about


def told(reset: Reset) -> str:
    """What the operator reads."""
    place, yaw = 1e3 * norm(reset.position), abs(_yaw(reset))
    return f"estimate moved by {place:.0f} mm, {yaw:.3f} rad: the plan moves along"


def all_along(
    r: Tick, state: FlightState, plan: PlanMemory, reset: Reset
) -> tuple[Tick, FlightState, PlanMemory]:
    """All that is of the frame before the jump, moved along: record, place that is held, plan."""
    return moved_along(r, reset), held_along(state, reset), without_answer(plan, reset)


def held_along(state: FlightState, reset: Reset) -> FlightState:
    """The state with the place that the vehicle keeps moved along, and its setpoint.

    Where a jump was expected the estimate had drifted, and the vehicle with it: it goes back. Where
    a goal says so it goes there anyway, as slowly as from any other place.
    """
    if reset.expected:
        return state
    yaw, vehicle, setpoint = _yaw(reset), state.vehicle, state.setpoint
    vehicle = replace(
        vehicle,
        mode_origin=add_scaled(vehicle.mode_origin, reset.position, 1.0),
        mode_yaw=wrap_angle(vehicle.mode_yaw + yaw),
    )
    ahead = setpoint.reference
    if ahead is not None:
        p, turned = add_scaled(ahead.p, reset.position, 1.0), wrap_angle(ahead.yaw + yaw)
        setpoint = replace(setpoint, reference=replace(ahead, p=p, yaw=turned))
    return replace(state, vehicle=vehicle, setpoint=setpoint)


def without_answer(plan: PlanMemory, reset: Reset) -> PlanMemory:
    """The memory of a planner whose next answer would lead back to where the vehicle was."""
    if plan.awaited_id < 0 or not _is_far(reset):
        return plan
    return replace(plan, awaited_id=-1, awaited_missed=False)


def _is_far(reset: Reset) -> bool:
    """Whether the estimate jumped so far that the operator reads about it."""
    return max(map(abs, reset.position)) > _TOLD


def _yaw(reset: Reset) -> float:
    """By how much the heading jumped [rad]."""
    return yaw_of(matrix_from_quaternion(reset.turn))


def moved_along(r: Tick, reset: Reset) -> Tick:
    """The record with the plan's state and the observer's velocity moved along."""
    r, nominal = r.copy(), r.plan_state
    if nominal is not None:
        p, yaw = add_scaled(nominal.p, reset.position, 1.0), wrap_angle(nominal.yaw + _yaw(reset))
        r.plan_state = nominal._replace(p=p, yaw=yaw)
    r.observed.v += reset.velocity
    return r


def on_return(found: StateEstimate, before: StateEstimate) -> tuple[Reset, list[StatusText]]:
    """The jump when positions are there again, and what is told of it.

    What was found takes the place of what had been carried on from ``before``.
    """
    expected = moved_on(before, 1e-6 * (found.t_us - before.t_us))
    q, carried = quaternion_from_matrix(found.R_WB), quaternion_from_matrix(expected.R_WB)
    moved = add_scaled(found.p_WB, expected.p_WB, -1.0)
    faster = add_scaled(found.v_WB, expected.v_WB, -1.0)
    reset = Reset(1, moved, faster, multiply(q, conjugate(carried)))
    return reset, [StatusText(Severity.WARNING, told(reset))] if _is_far(reset) else []
