"""The horizon around the current guess: points, velocities and their gradients in the inputs.

Everything that shapes the optimum (costs, barriers, limits) is written in terms of the
position and velocity of three points, base, joint 2 and end-effector, at each node. This
file computes them and their exact gradients once an iteration; the others only combine.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fsw.compiled import compiled
from fsw.model.kinematics import arm_points, links
from fsw.model.prediction import INPUTS, Q_ARM, STATES, YAW, YAW_RATE, Array, CondensedModel

BASE, JOINT2, END_EFFECTOR = 0, 1, 2
POINTS = 3

# Prediction states that swing the arm's points about the base, and the rate of each where it is a
# state too: a point's velocity feels the rate as its position feels the state.
_SWING_STATES = np.array([[6, 9], [7, 10], [8, -1], [13, 14], [15, 17], [16, 18]])
# Prediction states each input can move, -1 where it moves fewer.
_REACHED = np.array(
    [
        [0, 3, 6, 9],
        [1, 4, 7, 10],
        [2, 5, 8, -1],
        [13, 14, -1, -1],
        [15, 17, -1, -1],
        [16, 18, -1, -1],
    ]
)
_STEP = 1e-30  # complex step: no subtraction, hence no rounding


class PointMotions(NamedTuple):
    """The three points at every node, for kernels; axes are those of the world (NED)."""

    position: Array  # (n + 1, 3 points, 3) m
    velocity: Array  # (n + 1, 3 points, 3) m/s
    d_position: Array  # (n + 1, 3 points, 3, 6 n)
    d_velocity: Array  # (n + 1, 3 points, 3, 6 n)


class Tracked(NamedTuple):
    """What the tracking cost compares with its targets, for kernels: end-effector, yaw, arm."""

    yaw: Array  # (n + 1, 2) rad and rad/s
    position: Array  # (n + 1, 3) m
    velocity: Array  # (n + 1, 3) m/s
    arm_com: Array  # (n + 1,) m
    d_yaw: Array  # (n + 1, 2, 6 n)
    d_position: Array  # (n + 1, 3, 6 n)
    d_velocity: Array  # (n + 1, 3, 6 n)
    d_arm_com: Array  # (n + 1, 6 n)


@dataclass(frozen=True)
class Linearisation:
    """Preallocated results of one linearisation; node 0 is the start of the horizon."""

    model: CondensedModel
    states: Array = field(init=False)  # (n + 1, 19)
    position: Array = field(init=False)  # (n + 1, 3 points, 3) m
    velocity: Array = field(init=False)  # (n + 1, 3 points, 3) m/s
    d_position: Array = field(init=False)  # (n + 1, 3 points, 3, 6 n)
    d_velocity: Array = field(init=False)  # (n + 1, 3 points, 3, 6 n)
    arm_com: Array = field(init=False)  # (n + 1,) m along body x
    d_arm_com: Array = field(init=False)  # (n + 1, 6 n)
    points: PointMotions = field(init=False)  # views of the above, as are those of
    tracked: Tracked = field(init=False)

    def __post_init__(self) -> None:
        nodes, unknowns = self.model.horizon + 1, INPUTS * self.model.horizon
        shapes = {
            "states": (nodes, STATES),
            "position": (nodes, POINTS, 3),
            "velocity": (nodes, POINTS, 3),
            "d_position": (nodes, POINTS, 3, unknowns),
            "d_velocity": (nodes, POINTS, 3, unknowns),
            "arm_com": (nodes,),
            "d_arm_com": (nodes, unknowns),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, np.zeros(shape))
        points = PointMotions(self.position, self.velocity, self.d_position, self.d_velocity)
        tracked = Tracked(
            yaw=self.states[:, YAW : YAW_RATE + 1],
            position=self.position[:, END_EFFECTOR],
            velocity=self.velocity[:, END_EFFECTOR],
            arm_com=self.arm_com,
            d_yaw=self.model.gamma[:, YAW : YAW_RATE + 1],
            d_position=self.d_position[:, END_EFFECTOR],
            d_velocity=self.d_velocity[:, END_EFFECTOR],
            d_arm_com=self.d_arm_com,
        )
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "tracked", tracked)

    def refill(self, start: Array, inputs: Array) -> None:
        """Linearise from the state ``start`` (19,) [SI] around the ``inputs`` (6 n,) [SI]."""
        airframe = self.model.airframe
        np.matmul(self.model.phi, start, out=self.states)
        np.add(self.states, self.model.gamma @ inputs, out=self.states)
        _fill_points(
            self.states,
            self.model.gamma,
            airframe.link_length[0],
            airframe.link_length[1],
            self.points,
        )
        m1, m2 = airframe.link_mass
        _fill_arm_com(
            self.states,
            self.model.gamma,
            (m1 * airframe.link_com[0] + m2 * airframe.link_length[0]) / (m1 + m2),
            m2 * airframe.link_com[1] / (m1 + m2),
            self.arm_com,
            self.d_arm_com,
        )


@compiled
def _fill_points(
    states: Array,
    gamma: Array,
    l1: float,
    l2: float,
    points: PointMotions,
) -> None:
    values = np.zeros((2, 2, 3))
    jacobian = np.zeros((2, 2, 3, STATES))  # of joint 2 and end-effector in the state
    for i in range(states.shape[0]):
        arm_points(states[i], l1, l2, values)
        points.position[i, 0] = states[i, 0:3]
        points.velocity[i, 0] = states[i, 3:6]
        points.position[i, 1:] = values[:, 0]
        points.velocity[i, 1:] = values[:, 1]
        if i > 0:  # the start does not depend on the inputs
            _differentiate(states[i], l1, l2, jacobian)
            _chain(jacobian, gamma[i], INPUTS * i, points.d_position[i], points.d_velocity[i])


@compiled
def _differentiate(state: Array, l1: float, l2: float, jacobian: Array) -> None:
    """Derivative of ``arm_points`` in the state (2, 2, 3, 19), by complex steps."""
    stepped = np.zeros((2, 2, 3), dtype=np.complex128)
    x = state.astype(np.complex128)
    for axis in range(3):
        jacobian[:, 0, axis, axis] = 1.0
        jacobian[:, 1, axis, 3 + axis] = 1.0
    for k, rate in _SWING_STATES:
        x[k] = complex(state[k], _STEP)
        arm_points(x, l1, l2, stepped)
        x[k] = state[k]
        jacobian[:, :, :, k] = stepped.imag / _STEP
        if rate >= 0:
            jacobian[:, 1, :, rate] = jacobian[:, 0, :, k]


@compiled
def _chain(
    jacobian: Array, gamma: Array, columns: int, d_position: Array, d_velocity: Array
) -> None:
    """Gradients of the three points in the inputs that act before this node."""
    for column in range(columns):
        for axis in range(3):
            d_position[0, axis, column] = gamma[axis, column]
            d_velocity[0, axis, column] = gamma[3 + axis, column]
            for point in range(2):
                moved_p, moved_v = 0.0, 0.0
                for k in _REACHED[column % INPUTS]:
                    if k >= 0:
                        moved_p += jacobian[point, 0, axis, k] * gamma[k, column]
                        moved_v += jacobian[point, 1, axis, k] * gamma[k, column]
                d_position[point + 1, axis, column] = moved_p
                d_velocity[point + 1, axis, column] = moved_v


@compiled
def _fill_arm_com(
    states: Array, gamma: Array, arm1: float, arm2: float, cog: Array, d_cog: Array
) -> None:
    for i in range(states.shape[0]):
        th1 = states[i, Q_ARM]
        (x1, c1), (x2, c12) = links((arm1, arm2), th1, th1 + states[i, Q_ARM + 1])
        cog[i] = x1 + x2
        for column in range(INPUTS * i):
            d_cog[i, column] = (c1 + c12) * gamma[i, Q_ARM, column] + c12 * gamma[
                i, Q_ARM + 1, column
            ]
