"""Base, joint 2 and end-effector of a horizon, as the flight software linearises them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fsw.model.airframe import AIRFRAME
from fsw.model.body import body_of
from fsw.model.linearisation import Linearisation, chain, place, slopes
from fsw.model.prediction import STATES, Array

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
    horizon = linearised.horizon
    nodes = range(horizon.states.shape[0])
    seen = np.array([[place(horizon, i, on, local) for on, local in _PLACES] for i in nodes])
    return seen[:, :, 0], seen[:, :, 1]


def points_of(linearised: Linearisation) -> Points:
    """The three points of the paper over a horizon."""
    horizon = linearised.horizon
    nodes, unknowns = horizon.states.shape[0], horizon.gamma.shape[2]
    points = Points(
        *positions_of(linearised),
        np.zeros((nodes, 3, 3, unknowns)),
        np.zeros((nodes, 3, 3, unknowns)),
    )
    at_position, at_velocity = np.zeros(STATES), np.zeros(STATES)
    for node in range(nodes):
        for k, (on, local) in enumerate(_PLACES):
            for axis, n in enumerate(_AXES if node > 0 else ()):  # the start feels no input
                slopes(horizon, node, on, local, n, at_position, at_velocity)
                chain(horizon, node, at_position, points.d_position[node, k, axis])
                chain(horizon, node, at_velocity, points.d_velocity[node, k, axis])
    return points
