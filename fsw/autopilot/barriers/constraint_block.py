"""What every barrier and limit contributes to the planner's program."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import SafeSet


class Rows(NamedTuple):
    """The numbers of a block, for kernels."""

    start: Array  # (starts,)
    value: Array  # (rows,)
    lower_bound: Array  # (rows,)
    gradient: Array  # (rows, inputs n)


@dataclass(frozen=True)
class ConstraintBlock:
    """Rows ``value + gradient (U - U_guess) + slack >= lower_bound``, slack >= 0.

    Which slack softens a row never changes; the numbers are refilled in place each iteration.
    """

    node: NDArray[np.intp]  # (rows,) node of each row, 1..n
    slack: NDArray[np.intp]  # (rows,) index of its slack among this block's slacks
    unknowns: int  # inputs n
    starts: int  # values at node 0
    start: Array = field(init=False)  # (starts,) the value of each zone and part at node 0
    value: Array = field(init=False)  # (rows,)
    lower_bound: Array = field(init=False)  # (rows,)
    gradient: Array = field(init=False)  # (rows, inputs n)

    def __post_init__(self) -> None:
        rows = len(self.node)
        object.__setattr__(self, "start", np.zeros(self.starts))
        object.__setattr__(self, "value", np.zeros(rows))
        object.__setattr__(self, "lower_bound", np.zeros(rows))
        object.__setattr__(self, "gradient", np.zeros((rows, self.unknowns)))

    @property
    def rows(self) -> Rows:
        """The arrays themselves."""
        return Rows(self.start, self.value, self.lower_bound, self.gradient)

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


class Barrier(Protocol):
    """A safe set that keeps the horizon inside by soft rows."""

    @property
    def rows(self) -> ConstraintBlock:
        """The rows as of the last refill."""
        ...

    def update(self, safe_set: SafeSet) -> None:
        """Take other numbers of the same zones: they moved, or their clearance changed."""
        ...

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Bring the rows up to date with a linearisation."""
        ...
