"""What every barrier and limit contributes to the planner's program."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.model.prediction import Array


class Rows(NamedTuple):
    """The numbers of a block, for kernels."""

    start: Array  # (starts,) the value of each zone and part at node 0
    value: Array  # (rows,)
    lower_bound: Array  # (rows,)
    gradient: Array  # (rows, inputs n)


class ConstraintBlock:
    """Rows ``value + gradient (U - U_guess) + slack >= lower_bound``, slack >= 0.

    Which slack softens a row never changes; the numbers are refilled in place each iteration.
    """

    def __init__(
        self, node: NDArray[np.intp], slack: NDArray[np.intp], unknowns: int, starts: int
    ) -> None:
        """Rows of so many ``unknowns`` (inputs n), and so many values at the start, node 0.

        ``node`` (rows,) [1] is that of each row, 1..n, ``slack`` (rows,) [1] its slack's index.
        """
        rows = len(node)
        self.node, self.slack = node, slack
        self.rows = Rows(
            np.zeros(starts), np.zeros(rows), np.zeros(rows), np.zeros((rows, unknowns))
        )
        self.start, self.value, self.lower_bound, self.gradient = self.rows

    @property
    def slacks(self) -> int:
        """How many slacks soften this block."""
        return int(self.slack.max()) + 1 if len(self.slack) else 0


def block(
    per_group: tuple[int, ...], first_node: int, horizon: int, inputs: int, starts: int = 0
) -> ConstraintBlock:
    """Rows of the nodes from a first one on; at each node groups of so many share a slack.

    A node of the ``horizon`` [1] has so many ``inputs`` [1].
    """
    nodes = np.arange(first_node, horizon + 1)
    rows, groups = sum(per_group), len(per_group)
    group = np.repeat(np.arange(groups), per_group)
    return ConstraintBlock(
        node=np.repeat(nodes, rows),
        slack=(groups * np.arange(len(nodes))[:, None] + group).ravel(),
        unknowns=inputs * horizon,
        starts=starts,
    )


@dataclass(frozen=True)
class TargetPoints:
    """End-effector reference at the nodes of one horizon, refilled in place."""

    position: Array  # (n + 1, 3) m
    velocity: Array  # (n + 1, 3) m/s
    yaw: Array  # (n + 1,) rad
    q_arm: Array | None = None  # (n + 1, j) rad; None: the planner is free to choose
    t_us: int = 0  # of node 0; what moves by itself is placed by it
    recent_disturbance: float = math.inf  # m/s^2, which lambda may follow
    pushes: Array | None = None  # (n, 3) m/s^2, NED, what pressing adds to thrust; None: nothing

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "yaw"):  # kernels rely on the layout
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            object.__setattr__(self, name, array)
