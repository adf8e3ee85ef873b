"""What every barrier contributes to the planner's program."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fsw.model.linearisation import Linearisation
from fsw.model.prediction import INPUTS, Array


@dataclass(frozen=True)
class SoftRows:
    """Rows ``value + gradient (U - U_guess) + slack >= required``, slack >= 0.

    Which inputs a row can feel (of the kinds that move its point, those before its node)
    and which slack softens it never change; the numbers are refilled in place each
    iteration.
    """

    node: NDArray[np.intp]  # (rows,) node of each row, 1..n
    slack: NDArray[np.intp]  # (rows,) index of its slack among this block's slacks
    moved_by: NDArray[np.bool_]  # (rows, 6) kinds of input that can move the row's point
    unknowns: int  # 6 n
    # (rows,) rows that become active together, such as those of one wall; all in one if None
    group: NDArray[np.intp] | None = None
    value: Array = field(init=False)  # (rows,)
    required: Array = field(init=False)  # (rows,)
    gradient: Array = field(init=False)  # (rows, 6 n)

    def __post_init__(self) -> None:
        rows = len(self.node)
        object.__setattr__(self, "value", np.zeros(rows))
        object.__setattr__(self, "required", np.zeros(rows))
        object.__setattr__(self, "gradient", np.zeros((rows, self.unknowns)))

    @property
    def slacks(self) -> int:
        """How many slacks soften this block."""
        return int(self.slack.max()) + 1 if len(self.slack) else 0

    def feels(self) -> NDArray[np.bool_]:
        """(rows, 6 n), true where the gradient may be non-zero."""
        columns = np.arange(self.unknowns)
        before = columns[None, :] < INPUTS * self.node[:, None]
        return np.asarray(before & self.moved_by[:, columns % INPUTS])


def kinds_moving_base(normals: Array) -> NDArray[np.bool_]:
    """Kinds of input (rows, 6) that move the base along each normal (rows, 3)."""
    moved = np.zeros((len(normals), INPUTS), dtype=bool)
    moved[:, :3] = normals != 0.0
    return moved


def kinds_moving_points(normals: Array) -> NDArray[np.bool_]:
    """Kinds of input (walls, 3 points, 6) that move base, joint 2 and end-effector.

    The arm's points swing with the tilt and turn with the yaw, so they feel every
    acceleration whatever the normal; joint 2 does not feel its own joint.
    """
    moved = np.ones((len(normals), 3, INPUTS), dtype=bool)
    moved[:, 0] = kinds_moving_base(normals)
    moved[:, 1, 5] = False
    return moved


@dataclass(frozen=True)
class TargetPoints:
    """End-effector reference at the nodes of one horizon, refilled in place."""

    position: Array  # (n + 1, 3) m
    velocity: Array  # (n + 1, 3) m/s
    yaw: Array  # (n + 1,) rad
    q_arm: Array | None = None  # (n + 1, 2) rad; None: the planner is free to choose


class Barrier(Protocol):
    """A safe set that keeps the horizon inside by soft rows."""

    @property
    def rows(self) -> SoftRows:
        """The rows as of the last refill."""
        ...

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Bring the rows up to date with a linearisation."""
        ...

    def at_start(self) -> Array:
        """h of each constraint at node 0 as of the last refill [m/s]."""
        ...
