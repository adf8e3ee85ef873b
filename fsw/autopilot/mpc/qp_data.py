"""The planner's quadratic program as data, dense and refilled in place, and what a solver answers.

Minimise ``1/2 U' H U + c' U + penalty' s`` over the inputs U of all nodes and the slacks s >= 0 of
the soft rows, subject to

====================  ============================================  =============
rows, in this order   meaning                                       cone
====================  ============================================  =============
soft blocks           gradient U + slack >= lower bound - constant  non-negative
input bounds          -u_max <= u <= u_max                          non-negative
tilt, one a node      |a_xy| <= tan(tilt) (g - a_z)                 second-order
====================  ============================================  =============

Source: docs/equations.md E17.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.barriers.constraint_block import ConstraintBlock
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.prediction import QDD_ARM, Array
from fsw.autopilot.signals import SolverStatus, Vec4

HARD = -1  # in the place of a slack's index: no slack softens the row
CONE = 3  # rows of a tilt cone: what there is, then the two that it must cover


@dataclass(frozen=True, slots=True)
class InputLimits:
    """Bounds on the paper's u, and on the arm.

    The tilt bounds the horizontal acceleration, and its rate as well: the attitude's lag turns
    from one limit to the other at 1.6 rad/s.
    """

    tilt: float = math.pi / 10.0  # rad
    vertical: float = 3.0  # m/s^2, |a_z|
    yaw_acc: float = 0.1  # rad/s^2; the rotors' drag gives hardly more
    joint_acc: float = 10.0  # rad/s^2
    joint_rate: float = 3.0  # rad/s, which a plan stops within its horizon
    # To the limits of the angles: of a node 0.0125 rad for what happens between two of them.
    joint_margin: float = 0.03  # rad

    @property
    def most(self) -> Vec4:
        """Largest horizontal and vertical, yaw and joint accelerations that they admit."""
        level = math.tan(self.tilt) * (GRAVITY + self.vertical)
        return level, self.vertical, self.yaw_acc, self.joint_acc


@dataclass(frozen=True)
class Rows:
    """All constraints: ``b - g U``, plus its slack where it has one, lies in its cone."""

    g: Array  # (rows, inputs n)
    b: Array  # (rows,)
    slack: NDArray[np.intp]  # (rows,) index of the slack that softens the row, or ``HARD``
    first_cone: int  # rows from here on are tilt cones


class QpData:
    """Lays the rows out once and keeps the numbers."""

    def __init__(
        self,
        horizon: int,
        inputs: int,
        limits: InputLimits,
        blocks: tuple[tuple[ConstraintBlock, float | None], ...],
    ) -> None:
        """Lay out the rows of a ``horizon`` [1] of nodes with so many ``inputs`` [1] each.

        With each block comes the penalty of a unit of its slacks; None makes its rows hard. The
        penalty is linear, hence exact: rows that can hold, do hold.
        """
        self._blocks = tuple(rows for rows, _ in blocks)
        self.inputs = inputs * horizon
        self.hessian = np.zeros((self.inputs, self.inputs))  # upper triangle
        self.linear = np.zeros(self.inputs)
        slack: list[NDArray[np.intp]] = []
        self.penalty: Array = np.zeros(0)  # (slacks,)
        for rows, penalty in blocks:
            if penalty is None:
                slack.append(np.full(len(rows.node), HARD))
            else:
                slack.append(len(self.penalty) + rows.slack)
                self.penalty = np.append(self.penalty, np.full(rows.slacks, penalty))
        soft = self.block_rows = sum(map(len, slack))
        bound_rows, bounds = _bounds(horizon, inputs, limits)
        tilt_rows, tilts = _tilt_cones(horizon, inputs, limits.tilt)
        self.rows = Rows(
            np.vstack((np.zeros((soft, self.inputs)), bound_rows, tilt_rows)),
            np.concatenate((np.zeros(soft), bounds, tilts)),
            np.concatenate((*slack, np.full(len(bounds) + len(tilts), HARD))),
            soft + len(bounds),
        )

    @property
    def unknowns(self) -> int:
        """Inputs and slacks."""
        return self.inputs + len(self.penalty)

    def refill(self, guess: Array) -> None:
        """Take over the blocks, which are linearised around a ``guess`` (inputs n,) [SI]."""
        row = 0
        for block in self._blocks:
            end = row + len(block.node)
            np.negative(block.gradient, out=self.rows.g[row:end])
            self.rows.b[row:end] = block.value - block.gradient @ guess - block.lower_bound
            row = end


def _bounds(horizon: int, inputs: int, limits: InputLimits) -> tuple[Array, Array]:
    """Upper, then lower bounds of (vertical, yaw, each joint) a node."""
    joints = [limits.joint_acc] * (inputs - QDD_ARM)
    bound = np.tile([limits.vertical, limits.yaw_acc, *joints], horizon)
    each = np.eye(inputs * horizon)
    bounded = each[np.tile(np.arange(inputs) >= 2, horizon)]
    return np.vstack((bounded, -bounded)), np.concatenate((bound, bound))


def _tilt_cones(horizon: int, inputs: int, tilt: float) -> tuple[Array, Array]:
    """Three rows a node: what the tilt allows, and the two accelerations it must cover."""
    slope = math.tan(tilt)
    cone = np.zeros((CONE, inputs))
    cone[0, 2], cone[1, 0], cone[2, 1] = slope, -1.0, -1.0
    rows = np.kron(np.eye(horizon), cone).astype(np.float64)
    return rows, np.tile([slope * GRAVITY, 0.0, 0.0], horizon)


@dataclass(frozen=True, slots=True)
class Solution:
    """Outcome of one solve; ``x`` is usable only where the status is (almost) solved."""

    status: SolverStatus
    x: Array  # (unknowns,)
    iterations: int

    @property
    def usable(self) -> bool:
        """Whether ``x`` may be flown: a truncated iterate is finite but wrong."""
        return self.status in (SolverStatus.SOLVED, SolverStatus.ALMOST_SOLVED)


class QpSolver(Protocol):
    """Solves one ``QpData``, which it is built with, again and again as filled anew."""

    def solve(self, guess: Array) -> Solution:
        """Inputs and slacks at the optimum; a ``guess`` (inputs n,) [SI] may save time."""
        ...
