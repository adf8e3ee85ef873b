"""The planner's program written a second time, from the paper, for a solver of its own.

Costs are eqs 18, 20 and 21 with the horizon's points linearised; constraints are Table I, the
tilt cone and, by controller, eq 25, eqs 14 and 15, or the costs of eqs 29 and 30. Nothing of
``fsw.mpc`` or ``fsw.barriers`` is used but the numbers of the configuration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from fsw.barriers.safe_approach import BarrierTuning
from fsw.model.airframe import AIRFRAME
from fsw.model.linearisation import BASE, END_EFFECTOR, Linearisation
from fsw.model.prediction import INPUTS, Array
from fsw.mpc.planner_config import PlannerConfig
from fsw.signals import PointObstacle, SafeSet, Wall, WorkspaceSphere

_PERIOD = 0.1  # s


@dataclass(frozen=True)
class Optimum:
    """Where the second program has its minimum."""

    inputs: Array  # (6 n,)
    joint_slack: Array
    barrier_slack: Array
    value: float


@dataclass(frozen=True)
class Question:
    """One linearised instance."""

    horizon: Linearisation
    guess: Array  # (6 n,)
    target_p: Array  # (n + 1, 3)
    target_v: Array  # (n + 1, 3)
    target_yaw: Array  # (n + 1,) within half a turn of the horizon's
    safe_set: SafeSet


class _Linear:
    """The horizon's quantities as affine expressions of the unknown inputs."""

    def __init__(self, question: Question, U: cp.Variable) -> None:
        self._horizon, self._change = question.horizon, U - question.guess

    def position(self, node: int, point: int) -> Any:
        horizon = self._horizon
        return horizon.position[node, point] + horizon.d_position[node, point] @ self._change

    def velocity(self, node: int, point: int) -> Any:
        horizon = self._horizon
        return horizon.velocity[node, point] + horizon.d_velocity[node, point] @ self._change

    def arm_com(self, node: int) -> Any:
        return self._horizon.arm_com[node] + self._horizon.d_arm_com[node] @ self._change

    def yaw(self, node: int) -> Any:
        return self._horizon.states[node, 13] + self._horizon.model.gamma[node, 13] @ self._change

    def yaw_rate(self, node: int) -> Any:
        return self._horizon.states[node, 14] + self._horizon.model.gamma[node, 14] @ self._change

    def angles(self, node: int) -> Any:
        gamma = self._horizon.model.gamma[node, 15:17]
        return self._horizon.states[node, 15:17] + gamma @ self._change

    def joint_rates(self, node: int) -> Any:
        gamma = self._horizon.model.gamma[node, 17:19]
        return self._horizon.states[node, 17:19] + gamma @ self._change


class InfeasibleError(Exception):
    """The second program has no solution."""


def optimum(question: Question, config: PlannerConfig) -> Optimum:
    """Solve the second program.

    Raises:
        InfeasibleError: Its hard rows contradict each other.
    """
    n = config.horizon
    U = cp.Variable(INPUTS * n)
    linear = _Linear(question, U)
    joint_slack = cp.Variable(n, nonneg=True)
    rows, barrier_slack = (
        _hard_rows(question, linear, config)
        if config.controller == "hc"
        else _barrier(question, linear, config)
    )
    constraints = _input_limits(U, config) + rows
    margin = config.limits.joint_margin
    for node in range(1, n + 1):
        th1, th2 = linear.angles(node)[0], linear.angles(node)[1]
        constraints += [
            cp.abs(th1) <= AIRFRAME.joint1_limit - margin + joint_slack[node - 1],
            cp.abs(th1 + th2) <= AIRFRAME.joint12_limit - margin + joint_slack[node - 1],
            cp.abs(linear.joint_rates(node)) <= config.limits.joint_rate + joint_slack[node - 1],
        ]
    ocp = cp.Problem(
        cp.Minimize(
            _cost(question, linear, U, config)
            + _safety_cost(question, linear, config)
            + config.joint_slack * cp.sum(joint_slack)
            + config.barrier_slack * cp.sum(barrier_slack)
        ),
        constraints,
    )
    tolerance = 1e-7
    ocp.solve(solver=cp.CLARABEL, tol_gap_abs=tolerance, tol_gap_rel=tolerance, tol_feas=tolerance)
    if ocp.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
        raise InfeasibleError
    assert ocp.status == cp.OPTIMAL
    return Optimum(
        np.asarray(U.value),
        np.asarray(joint_slack.value),
        np.asarray(barrier_slack.value),
        float(ocp.value),
    )


def _cost(question: Question, linear: _Linear, U: cp.Variable, config: PlannerConfig) -> Any:
    """Table II: 10, 2 and 1 on the way, 50, 10 and 5 at the end."""
    weights, n = config.weights, config.horizon
    total: Any = weights.inputs * cp.sum_squares(U)
    for node in range(1, n + 1):
        last = node == n
        error = linear.position(node, END_EFFECTOR) - question.target_p[node]
        speed = linear.velocity(node, END_EFFECTOR)
        if weights.relative_velocity:
            speed = speed - question.target_v[node]
        total += (50.0 if last else 10.0) * cp.sum_squares(error)
        total += (10.0 if last else 2.0) * cp.sum_squares(speed)
        total += weights.yaw * cp.square(
            linear.yaw(node) + weights.yaw_lead * linear.yaw_rate(node) - question.target_yaw[node]
        )
        total += (5.0 if last else 1.0) * cp.square(linear.arm_com(node))
    return total


def _safety_cost(question: Question, linear: _Linear, config: PlannerConfig) -> Any:
    """Eqs 29 and 30 with Table II's 5 and 20, and our centring of 100 and 500."""
    sphere, n = question.safe_set.sphere, config.horizon
    total: Any = 0.0
    for node in range(1, n + 1):
        last = node == n
        if sphere is not None:
            if config.controller == "sc":
                centre = question.target_p[node] + np.array(sphere.centre_from_target)
                outside = np.linalg.norm(question.horizon.position[node, BASE] - centre)
                if outside >= sphere.radius:
                    e = linear.position(node, BASE) - centre
                    total += (20.0 if last else 5.0) * cp.sum_squares(e)
            elif config.centred:
                centre = question.target_p[node] + np.array(sphere.centre_from_target)
                e = linear.position(node, BASE) - centre
                total += (500.0 if last else 100.0) * cp.sum_squares(e)
        elif config.controller == "sc":
            for point, wall in _planes(question, node):
                total += _wall_cost(question, linear, wall, node, point) / (20.0 if last else 5.0)
    return total


def _wall_cost(question: Question, linear: _Linear, wall: Wall, node: int, point: int) -> Any:
    """1/d^2 to second order about the guess; from 20 mm on, about 20 mm."""
    normal = np.array(wall.normal)
    limit = wall.offset + wall.clearance
    gap = float(normal @ question.horizon.position[node, point]) - limit
    about = max(gap, 0.02)
    x = normal @ linear.position(node, point) - limit - about
    return 1.0 / about**2 - 2.0 / about**3 * x + 3.0 / about**4 * cp.square(x)


def _planes(question: Question, node: int) -> list[tuple[int, Wall]]:
    """Every critical point with each wall, and with what each obstacle is to it at the guess."""
    planes = [(point, wall) for point in range(3) for wall in question.safe_set.walls]
    for obstacle in question.safe_set.obstacles:
        for point in range(3):
            away = question.horizon.position[node, point] - np.array(obstacle.position)
            x, y, z = (away / np.linalg.norm(away)).tolist()
            offset = float(np.dot((x, y, z), obstacle.position))
            planes.append((point, Wall((x, y, z), offset, obstacle.clearance)))
    return planes


def _hard_rows(
    question: Question, linear: _Linear, config: PlannerConfig
) -> tuple[list[Any], cp.Variable]:
    """Eqs 14 and 15 at every node; the slack is for none of them."""
    horizon, sphere, rows = question.horizon, question.safe_set.sphere, []
    for node in range(1, config.horizon + 1):
        for point, wall in _planes(question, node):
            gap = np.array(wall.normal) @ linear.position(node, point) - wall.offset
            rows.append(gap >= wall.clearance)
        if sphere is not None:
            centre = question.target_p[node] + np.array(sphere.centre_from_target)
            e = horizon.position[node, BASE] - centre
            outward = e / np.linalg.norm(e)
            rows.append(outward @ (linear.position(node, BASE) - centre) <= sphere.radius)
    return rows, cp.Variable(1, nonneg=True)


def _input_limits(U: cp.Variable, config: PlannerConfig) -> list[Any]:
    limits, constraints = config.limits, []
    for node in range(config.horizon):
        ax, ay, az, yaw, joint1, joint2 = (U[INPUTS * node + k] for k in range(INPUTS))
        constraints += [
            cp.norm(cp.hstack([ax, ay])) <= math.tan(limits.tilt) * (9.81 - az),
            cp.abs(az) <= limits.vertical,
            cp.abs(yaw) <= limits.yaw_acc,
            cp.abs(joint1) <= limits.joint_acc,
            cp.abs(joint2) <= limits.joint_acc,
        ]
    return constraints


def _safe_speed(d: float, tuning: BarrierTuning) -> tuple[float, float]:
    """S(d) and its slope."""
    k, alpha = tuning.slope, tuning.alpha
    if d < alpha / k**2:
        return k * d, k
    value = math.sqrt(2.0 * alpha * d - (alpha / k) ** 2)
    return value, alpha / value


def _barrier(
    question: Question, linear: _Linear, config: PlannerConfig
) -> tuple[list[Any], cp.Variable]:
    if config.controller != "blf":
        return [], cp.Variable(1, nonneg=True)
    if question.safe_set.sphere is not None:
        return _sphere_rows(question, linear, config, question.safe_set.sphere)
    walls, obstacles = question.safe_set.walls, question.safe_set.obstacles
    count = len(walls) + len(obstacles)
    slack = cp.Variable((config.horizon + 1, max(count, 1)), nonneg=True)
    rows: list[Any] = []
    for k, wall in enumerate(walls):
        rows += _wall_rows(question, linear, config.walls, wall, slack[:, k])
    for k, obstacle in enumerate(obstacles, len(walls)):
        rows += _point_rows(question, linear, config.walls, obstacle, slack[:, k])
    return rows, slack


def _required(h_start: float, node: int, tuning: BarrierTuning) -> float:
    decay = (1.0 - tuning.gamma * _PERIOD) ** node
    return decay * h_start + (1.0 - decay) * tuning.lambda_


def _wall_rows(
    question: Question, linear: _Linear, tuning: BarrierTuning, wall: Wall, slack: Any
) -> list[Any]:
    horizon, n = question.horizon, np.array(wall.normal)
    limit, rows = wall.offset + wall.clearance, []
    for point in range(3):
        start_gap = float(n @ horizon.position[0, point]) - limit
        h_start = _safe_speed(start_gap, tuning)[0] + float(n @ horizon.velocity[0, point])
        for node in range(1 + tuning.skipped_nodes, len(horizon.position)):
            gap = float(n @ horizon.position[node, point]) - limit
            value, slope = _safe_speed(gap, tuning)
            room = n @ linear.position(node, point) - limit - gap
            h = value + slope * room + n @ linear.velocity(node, point)
            rows.append(h + slack[node] >= _required(h_start, node, tuning))
    return rows


def _point_rows(
    question: Question, linear: _Linear, tuning: BarrierTuning, obstacle: PointObstacle, slack: Any
) -> list[Any]:
    """Eq 11 under eq 25, with the direction that a point has at a node of the guess."""
    horizon, centre, rows = question.horizon, np.array(obstacle.position), []
    for point in range(3):
        for node in range(1 + tuning.skipped_nodes, len(horizon.position)):
            away = horizon.position[node, point] - centre
            n = away / np.linalg.norm(away)
            start = n @ (horizon.position[0, point] - centre) - obstacle.clearance
            h_start = _safe_speed(float(start), tuning)[0] + n @ horizon.velocity[0, point]
            value, slope = _safe_speed(float(n @ away) - obstacle.clearance, tuning)
            room = n @ (linear.position(node, point) - horizon.position[node, point])
            h = value + slope * room + n @ linear.velocity(node, point)
            rows.append(h + slack[node] >= _required(float(h_start), node, tuning))
    return rows


def _sphere_rows(
    question: Question, linear: _Linear, config: PlannerConfig, sphere: WorkspaceSphere
) -> tuple[list[Any], cp.Variable]:
    horizon, tuning = question.horizon, config.workspace
    slack = cp.Variable(config.horizon + 1, nonneg=True)
    centre = question.target_p + np.array(sphere.centre_from_target)
    e_start = horizon.position[0, BASE] - centre[0]
    w_start = horizon.velocity[0, BASE] - question.target_v[0]
    rows: list[Any] = []
    for node in range(1 + tuning.skipped_nodes, config.horizon + 1):
        e = horizon.position[node, BASE] - centre[node]
        for n in _directions(e):
            gap = sphere.radius - float(n @ e)
            value, slope = _safe_speed(gap, tuning)
            room = sphere.radius - n @ (linear.position(node, BASE) - centre[node]) - gap
            h = value + slope * room - n @ (linear.velocity(node, BASE) - question.target_v[node])
            start = _safe_speed(sphere.radius - float(n @ e_start), tuning)[0] - float(n @ w_start)
            rows.append(h + slack[node] >= _required(start, node, tuning))
    return rows, slack


def _directions(e: Array) -> list[Array]:
    """Plus and minus an orthonormal frame: outward, then from the least parallel world axis."""
    first = e / np.linalg.norm(e)
    seed = np.eye(3)[np.argmin(np.abs(first))]
    second = seed - (seed @ first) * first
    second /= np.linalg.norm(second)
    third = np.cross(first, second)
    return [sign * axis for axis in (first, second, third) for sign in (1.0, -1.0)]
