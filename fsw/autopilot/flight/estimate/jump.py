"""The estimate jumps, and plan and observer jump along: what is flown does not change by it."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.estimation.dead_reckoning import moved_on
from fsw.autopilot.estimation.fusion_memory import Reset
from fsw.autopilot.flight.state import FlightState
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


def difference(found: StateEstimate, expected: StateEstimate, number: int = 1) -> Reset:
    """The jump from an expected estimate to the one that was found."""
    turn = multiply(
        quaternion_from_matrix(found.R_WB), conjugate(quaternion_from_matrix(expected.R_WB))
    )
    return Reset(
        number,
        add_scaled(found.p_WB, expected.p_WB, -1.0),
        add_scaled(found.v_WB, expected.v_WB, -1.0),
        turn,
    )


def told(reset: Reset) -> str:
    """What the operator reads."""
    yaw = yaw_of(matrix_from_quaternion(reset.turn))
    place = 1e3 * norm(reset.position)
    return f"estimate moved by {place:.0f} mm, {abs(yaw):.3f} rad: the plan moves along"


def moved_along(r: Tick, reset: Reset) -> Tick:
    """The record with the plan's state and the observer's velocity moved along."""
    r, nominal = r.copy(), r.plan_state
    if nominal is not None:
        yaw = yaw_of(matrix_from_quaternion(reset.turn))
        r.plan_state = nominal._replace(
            p=add_scaled(nominal.p, reset.position, 1.0), yaw=wrap_angle(nominal.yaw + yaw)
        )
    r.observed.v += reset.velocity
    return r


def on_return(found: StateEstimate, before: StateEstimate) -> tuple[Reset, list[StatusText]]:
    """The jump when positions are there again, and what is told of it.

    What was found takes the place of what had been carried on from ``before``.
    """
    expected = moved_on(before, 1e-6 * (found.t_us - before.t_us))
    reset = difference(found, expected)
    if max(map(abs, reset.position)) > _TOLD:
        return reset, [StatusText(Severity.WARNING, told(reset))]
    return reset, []


def returned(
    state: FlightState, found: StateEstimate, before: StateEstimate, texts: list[StatusText]
) -> FlightState:
    """The state when positions are there again; appends to ``texts``.

    The plan moves along with what was found instead of what had been carried on from ``before``.
    """
    reset, said = on_return(found, before)
    texts += said
    return replace(state, record=moved_along(state.record, reset))
