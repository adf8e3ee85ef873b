"""Base, joint 2 and end-effector of a horizon, as the flight software linearises them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.body import body_of
from fsw.autopilot.model.kinematics import position, velocity
from fsw.autopilot.model.linearisation import TURNED, Linearisation, chain, fill_slopes, fill_turned
from fsw.autopilot.model.prediction import Array
from tests.fsw.paper_arm import STATES

BASE, JOINT2, END_EFFECTOR = 0, 1, 2
_PLACES = [(part.on, part.begin) for part in body_of("points", AIRFRAME).parts]
_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Points(NamedTuple):
    """Of every node, point and axis; gradients in all inputs of the horizon."""

    position: Array  # (n + 1, 3, 3) m
    velocity: Array  # (n + 1, 3, 3) m/s
    d_position: Array  # (n + 1, 3, 3, 6 n)
    d_velocity: Array  # (n + 1, 3, 3, 6 n)


def positions_of(linearised: Linearisation) -> tuple[Array, Array]:
    """Positions and velocities of the three points at each node, (n + 1, 3, 3) each."""
    p, v = (
        np.array(
            [[seen(frame, *place) for place in _PLACES] for frame in linearised.horizon.frames]
        )
        for seen in (position, velocity)
    )
    return p, v


def points_of(linearised: Linearisation) -> Points:
    """The three points of the paper over a horizon."""
    horizon = linearised.horizon
    nodes, unknowns = len(horizon.frames), len(horizon.inputs)
    points = Points(
        *positions_of(linearised),
        np.zeros((nodes, 3, 3, unknowns)),
        np.zeros((nodes, 3, 3, unknowns)),
    )
    turned, slopes = np.zeros((TURNED, 3)), np.zeros((2, STATES))
    for node in range(1, nodes):  # the start feels no input
        for k, (on, local) in enumerate(_PLACES):
            for axis, n in enumerate(_AXES):
                fill_turned(horizon.frames[node], n, turned)
                fill_slopes(horizon.frames[node], on, local, n, turned, slopes)
                chain(horizon.impulse, node, slopes[0], points.d_position[node, k, axis])
                chain(horizon.impulse, node, slopes[1], points.d_velocity[node, k, axis])
    return points
