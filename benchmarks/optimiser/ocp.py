"""The planner's problem a second time, stage by stage, as CasADi wants it.

Same model (the discrete chain and the arm's own equations, traced), same costs, rows, slacks,
bounds and tilt limit as ``blf``; states and inputs of every node are unknowns, ordered stage by
stage so that FATROP finds the structure. The directions of eq 23 are parameters, held where the
converged solution has them, so that both problems have the same optimum.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.optimiser.instances import INPUTS, STATES
from fsw.autopilot.barriers.safe_approach import BarrierTuning
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.kinematics import body_axes, turning_of
from fsw.autopilot.model.prediction import (
    Q_ARM,
    QD_ARM,
    YAW,
    YAW_RATE,
    P,
    V,
    discretise,
)
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.signals import TARGET_SPHERE, SafeSet, Zone

# A node's parameters: target position, velocity, yaw; directions as rows; required h of each row.
TARGET, DIRECTIONS = 7, 9


@dataclass
class NonlinearProgram:
    """A nonlinear program under construction."""

    unknowns: list[Any] = field(default_factory=list)
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    rows: list[Any] = field(default_factory=list)
    row_upper: list[float] = field(default_factory=list)  # 0: equality, else free above zero
    cost: Any = 0.0
    states: list[int] = field(default_factory=list)  # of each stage
    controls: list[int] = field(default_factory=list)  # of each stage, slacks among them
    path_rows: list[int] = field(default_factory=list)  # of each stage

    def add(self, name: str, lower: Iterable[float], upper: Iterable[float]) -> Any:
        """New bounded unknowns."""
        low = list(lower)
        symbol = ca.SX.sym(name, len(low))
        self.unknowns.append(symbol)
        self.lower += low
        self.upper += list(upper)
        return symbol

    def nothing_but(self, zero: Any) -> None:
        """Rows that must vanish."""
        self.rows.append(zero)
        self.row_upper += [0.0] * zero.numel()

    def at_least_zero(self, rows: list[Any]) -> None:
        """Rows that must not be negative."""
        self.rows += rows
        self.row_upper += [float("inf")] * len(rows)


def sphere_of(safe_set: SafeSet) -> Zone | None:
    """The sphere that follows the target (Case II); None: there are walls alone (Case I)."""
    spheres = [zone for zone in safe_set.zones if zone.shape.kind == TARGET_SPHERE]
    return spheres[0] if spheres else None


def barrier_rows(safe_set: SafeSet) -> int:
    """Rows of eq 22 or 23 at a node."""
    return 6 if sphere_of(safe_set) is not None else 3 * len(safe_set.zones)


def tuning_of(config: PlannerConfig, safe_set: SafeSet) -> BarrierTuning:
    """The barrier's constants in this safe set."""
    return config.workspace if sphere_of(safe_set) is not None else config.walls


def build(
    config: PlannerConfig, airframe: Airframe, safe_set: SafeSet
) -> tuple[NonlinearProgram, Any]:
    """The program and its parameters: start (19,), then those of the nodes 1..n."""
    if hasattr(ca.GlobalOptions, "setNumpyMode"):
        ca.GlobalOptions.setNumpyMode(-1)  # symbols stay symbols in numpy's functions, silently
    n, program = config.horizon, NonlinearProgram()
    a, b = (ca.DM(matrix) for matrix in discretise(airframe, config.period))
    rows = barrier_rows(safe_set)
    start = ca.SX.sym("start", STATES)
    nodes = [ca.SX.sym(f"node{i}", TARGET + DIRECTIONS + rows) for i in range(1, n + 1)]
    free = [float("inf")] * STATES
    x = program.add("x0", [-value for value in free], free)
    for i in range(n + 1):
        program.states.append(STATES)
        u, slack = _controls(program, config, safe_set, i)
        program.controls.append((INPUTS if i < n else 0) + slack.numel())
        if i < n:
            successor = program.add(f"x{i + 1}", [-value for value in free], free)
            program.nothing_but(successor - (a @ x + b @ u))
            program.cost += config.weights.inputs * ca.sumsqr(u)
        before = len(program.row_upper)
        if i == 0:
            program.nothing_but(x - start)
        else:
            _node(program, config, airframe, safe_set, i, x, slack, nodes[i - 1])
        if i < n:
            t = np.tan(config.limits.tilt) * (GRAVITY - u[2])
            program.at_least_zero([t * t - u[0] * u[0] - u[1] * u[1]])
            x_next = successor
        program.path_rows.append(len(program.row_upper) - before)
        if i < n:
            x = x_next
    return program, ca.vertcat(start, *nodes)


def _controls(
    program: NonlinearProgram, config: PlannerConfig, safe_set: SafeSet, i: int
) -> tuple[Any, Any]:
    limits, infinite = config.limits, float("inf")
    u = ca.SX(0, 1)
    if i < config.horizon:
        bound = [infinite, infinite, limits.vertical, limits.yaw_acc, *[limits.joint_acc] * 2]
        u = program.add(f"u{i}", [-value for value in bound], bound)
    count = 0
    if i > 0:
        count = 1 + (len(safe_set.zones) if i > tuning_of(config, safe_set).skipped_nodes else 0)
    return u, program.add(f"s{i}", [0.0] * count, [infinite] * count)


def _node(
    program: NonlinearProgram,
    config: PlannerConfig,
    airframe: Airframe,
    safe_set: SafeSet,
    i: int,
    x: Any,
    slack: Any,
    node: Any,
) -> None:
    """Costs, joint limits and barrier rows of one node."""
    points = _points(airframe, x)
    _add_cost(program, config, airframe, i == config.horizon, x, points[2], node)
    joint, barrier = config.joint_slack, config.barrier_slack
    program.cost += joint * slack[0]
    for k in range(1, slack.numel()):
        program.cost += barrier * slack[k]
    th1, th12 = x[Q_ARM], x[Q_ARM] + x[Q_ARM + 2]
    for angle, limit in zip((th1, th12), airframe.angle_limits, strict=True):
        program.at_least_zero([limit.high + slack[0] - angle, limit.high + slack[0] + angle])
    if slack.numel() > 1:
        program.at_least_zero(_barrier(config, safe_set, points, slack, node))


def _points(airframe: Airframe, x: Any) -> list[tuple[Any, Any]]:
    """Position and velocity of base, joint 2 and end-effector."""
    turning = turning_of(np.array(ca.vertsplit(x), dtype=object))
    b1, b3, d1, d3 = (ca.vertcat(*axis) for axis in body_axes(turning))
    p, v = x[P : P + 3], x[V : V + 3]
    points = [(p, v)]
    angle, rate = 0.0, 0.0
    for joint, length in enumerate((airframe.bodies.offset[5], airframe.bodies.tip[2])):
        angle, rate = angle + x[Q_ARM + 2 * joint], rate + x[QD_ARM + 2 * joint]
        ahead, down = length * ca.sin(angle), length * ca.cos(angle)
        p = p + ahead * b1 + down * b3
        v = v + ahead * d1 + down * d3 + rate * (down * b1 - ahead * b3)
        points.append((p, v))
    return points


def _add_cost(
    program: NonlinearProgram,
    config: PlannerConfig,
    airframe: Airframe,
    last: bool,
    x: Any,
    tip: tuple[Any, Any],
    node: Any,
) -> None:
    w = config.weights
    target_v = node[3:6] if w.relative_velocity else 0.0
    m1, m2 = airframe.bodies.mass[:2]
    th1, th12 = x[Q_ARM], x[Q_ARM] + x[Q_ARM + 2]
    moment1 = m1 * airframe.bodies.com[2] + m2 * airframe.bodies.offset[5]
    cog = (moment1 * ca.sin(th1) + m2 * airframe.bodies.com[5] * ca.sin(th12)) / (m1 + m2)
    program.cost += (w.tracking_terminal if last else w.tracking) * ca.sumsqr(tip[0] - node[:3])
    program.cost += (w.velocity_terminal if last else w.velocity) * ca.sumsqr(tip[1] - target_v)
    program.cost += (w.arm_com_terminal if last else w.arm_com) * cog**2
    program.cost += w.yaw * (x[YAW] + w.yaw_lead * x[YAW_RATE] - node[6]) ** 2


def _barrier(
    config: PlannerConfig, safe_set: SafeSet, points: list[tuple[Any, Any]], slack: Any, node: Any
) -> list[Any]:
    tuning = tuning_of(config, safe_set)
    required = node[TARGET + DIRECTIONS :]
    rows: list[Any] = []
    sphere = sphere_of(safe_set)
    if sphere is None:
        for k, wall in enumerate(safe_set.zones):
            normal, offset = ca.DM(wall.shape.numbers[:3]), wall.shape.numbers[3]
            for p, v in points:
                gap = ca.dot(normal, p) - offset - wall.clearance
                h = _root(gap, tuning) + ca.dot(normal, v)
                rows.append(h + slack[1 + k] - required[len(rows)])
        return rows
    centre, radius = node[:3] + ca.DM(sphere.shape.numbers[:3]), sphere.shape.numbers[3]
    e, w = points[0][0] - centre, points[0][1] - node[3:6]
    for k in range(6):
        along = node[TARGET + 3 * (k // 2) : TARGET + 3 * (k // 2) + 3] * (-1.0) ** k
        h = _root(radius - ca.dot(along, e), tuning) - ca.dot(along, w)
        rows.append(h + slack[1] - required[k])
    return rows


def _root(d: Any, tuning: BarrierTuning) -> Any:
    knee = tuning.alpha / tuning.slope**2
    # Both branches are evaluated: the root must stay real where it does not count.
    root = ca.sqrt(2.0 * tuning.alpha * (ca.fmax(d, knee) - 0.5 * knee))
    return ca.if_else(d < knee, tuning.slope * d, root)
