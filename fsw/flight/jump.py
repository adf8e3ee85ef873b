"""The estimate jumps, and plan and observer jump along: what is flown does not change by it."""

from __future__ import annotations

from dataclasses import replace

from fsw.estimation.sensor_fusion import Reset
from fsw.flight.state import FlightState
from fsw.geometry.quaternion import conjugate, multiply
from fsw.geometry.rotation import (
    matrix_from_quaternion,
    quaternion_from_matrix,
    wrap_angle,
    yaw_of,
)
from fsw.geometry.vectors import add_scaled, norm
from fsw.signals import StateEstimate


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


def jumped(state: FlightState, reset: Reset) -> FlightState:
    """The plan and the observer's velocity moved along with the estimate."""
    nominal, yaw = state.nominal, yaw_of(matrix_from_quaternion(reset.turn))
    if nominal is not None:
        nominal = nominal._replace(
            p=add_scaled(nominal.p, reset.position, 1.0), yaw=wrap_angle(nominal.yaw + yaw)
        )
    observed = state.cascade.observed
    observed = observed._replace(v=add_scaled(observed.v, reset.velocity, 1.0))
    return replace(state, nominal=nominal, cascade=state.cascade._replace(observed=observed))
