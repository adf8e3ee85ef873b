"""The planner's program written a second time, from the paper, for a solver of its own.

Costs are eqs 18, 20 and 21 with the horizon's points linearised; constraints are Table I, the
tilt cone and, by controller, eq 25, eqs 14 and 15, or the costs of eqs 29 and 30. Nothing of
``fsw.autopilot.mpc`` or ``fsw.autopilot.barriers`` is used but the numbers of the configuration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cvxpy as cp
import numpy as np

from fsw.autopilot.barriers.safe_approach import BarrierTuning
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.signals import TARGET_SPHERE, SafeSet, Zone
from tests.fsw.autopilot.model.three_points import BASE, END_EFFECTOR, Points, points_of
from tests.fsw.paper_arm import INPUTS, LIMIT1, LIMIT12

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

    @cached_property
    def points(self) -> Points:
        """Base, joint 2 and end-effector over the horizon."""
        return points_of(self.horizon)


class _Linear:
    """The horizon's quantities as affine expressions of the unknown inputs."""

    def __init__(self, question: Question, U: cp.Variable) -> None:
        self._horizon, self._change = question.horizon, U - question.guess
        self._points = question.points

    def position(self, node: int, point: int) -> Any:
        points = self._points
        return points.position[node, point] + points.d_position[node, point] @ self._change

    def velocity(self, node: int, point: int) -> Any:
        points = self._points
        return points.velocity[node, point] + points.d_velocity[node, point] @ self._change

    def arm_com(self, node: int) -> Any:
        tracked = self._horizon.tracked
        return tracked.arm_com[node] + tracked.d_arm_com[node] @ self._change

    def yaw(self, node: int) -> Any:
        return self._horizon.states[node, 13] + self._horizon.model.gamma[node, 13] @ self._change

    def yaw_rate(self, node: int) -> Any:
        return self._horizon.states[node, 14] + self._horizon.model.gamma[node, 14] @ self._change

    def angles(self, node: int) -> Any:
        gamma = self._horizon.model.gamma[node, 15::2]
        return self._horizon.states[node, 15::2] + gamma @ self._change

    def joint_rates(self, node: int) -> Any:
        gamma = self._horizon.model.gamma[node, 16::2]
        return self._horizon.states[node, 16::2] + gamma @ self._change


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
            cp.abs(th1) <= LIMIT1 - margin + joint_slack[node - 1],
            cp.abs(th1 + th2) <= LIMIT12 - margin + joint_slack[node - 1],
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
        total += (5.0 if last else 1.0) * cp.sum_squares(linear.arm_com(node))
    return total


def _safety_cost(question: Question, linear: _Linear, config: PlannerConfig) -> Any:
    """Eqs 29 and 30 with Table II's 5 and 20, and our centring of 100 and 500."""
    total: Any = 0.0
    for zone in question.safe_set.zones:
        for node in range(1, config.horizon + 1):
            last = node == config.horizon
            if zone.shape.kind == TARGET_SPHERE:
                e = linear.position(node, BASE) - _centre(question, zone, node)
                here = question.points.position[node, BASE] - _centre(question, zone, node)
                if config.controller == "sc" and np.linalg.norm(here) >= zone.shape.numbers[3]:
                    total += (20.0 if last else 5.0) * cp.sum_squares(e)
                elif config.controller == "naive" and config.centred:
                    total += (500.0 if last else 100.0) * cp.sum_squares(e)
            elif config.controller == "sc":
                for k in range(3):
                    cost = _wall_cost(question, linear, zone, node, k)
                    total += cost / (20.0 if last else 5.0)
    return total


def _wall_cost(question: Question, linear: _Linear, zone: Zone, node: int, point: int) -> Any:
    """1/d^2 to second order about the guess; from 20 mm on, about 20 mm."""
    here = question.points.position[node, point]
    normal, gap = _front(zone, here)
    about = max(gap, 0.02)
    x = gap + normal @ (linear.position(node, point) - here) - about
    return 1.0 / about**2 - 2.0 / about**3 * x + 3.0 / about**4 * cp.square(x)


def _front(zone: Zone, p: Array) -> tuple[Array, float]:
    """Direction away from a wall or a point, and what a place has left to its clearance."""
    numbers = np.array(zone.shape.numbers)
    if zone.shape.kind == "half-space":
        return numbers[:3], float(numbers[:3] @ p) - numbers[3] - zone.clearance
    assert (zone.shape.kind, numbers[3]) == ("ball", 0.0)
    away = float(np.linalg.norm(p - numbers[:3]))
    return (p - numbers[:3]) / away, away - zone.clearance


def _centre(question: Question, sphere: Zone, node: int) -> Array:
    return np.asarray(question.target_p[node] + np.array(sphere.shape.numbers[:3]))


def _hard_rows(
    question: Question, linear: _Linear, config: PlannerConfig
) -> tuple[list[Any], cp.Variable]:
    """Eqs 14 and 15 at every node; the slack is for none of them."""
    rows: list[Any] = []
    for zone in question.safe_set.zones:
        for node in range(1, config.horizon + 1):
            if zone.shape.kind == TARGET_SPHERE:
                centre = _centre(question, zone, node)
                e = linear.position(node, BASE) - centre
                for n in _directions(question.points.position[node, BASE] - centre):
                    rows.append(n @ e <= zone.shape.numbers[3])
                continue
            for k in range(3):
                here = question.points.position[node, k]
                normal, gap = _front(zone, here)
                rows.append(gap + normal @ (linear.position(node, k) - here) >= 0.0)
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
    zones = question.safe_set.zones
    slack = cp.Variable((config.horizon + 1, max(len(zones), 1)), nonneg=True)
    rows: list[Any] = []
    for k, zone in enumerate(zones):
        if zone.shape.kind == TARGET_SPHERE:
            rows += _sphere_rows(question, linear, config, zone, slack[:, k])
        else:
            rows += _front_rows(question, linear, config.walls, zone, slack[:, k])
    return rows, slack


def _required(h_start: float, node: int, tuning: BarrierTuning) -> float:
    decay = (1.0 - tuning.gamma * _PERIOD) ** node
    return decay * h_start + (1.0 - decay) * tuning.lambda_


def _front_rows(
    question: Question, linear: _Linear, tuning: BarrierTuning, zone: Zone, slack: Any
) -> list[Any]:
    """Eqs 11 and 22 under eq 25, with the direction that a point has at a node of the guess."""
    points, rows = question.points, []
    for k in range(3):
        for node in range(1 + tuning.skipped_nodes, len(points.position)):
            here, start = points.position[node, k], points.position[0, k]
            n, gap = _front(zone, here)
            h_start = _safe_speed(gap + float(n @ (start - here)), tuning)[0]
            h_start += float(n @ points.velocity[0, k])
            value, slope = _safe_speed(gap, tuning)
            h = value + slope * (n @ (linear.position(node, k) - here))
            h += n @ linear.velocity(node, k)
            rows.append(h + slack[node] >= _required(h_start, node, tuning))
    return rows


def _sphere_rows(
    question: Question, linear: _Linear, config: PlannerConfig, sphere: Zone, slack: Any
) -> list[Any]:
    points, tuning, radius = question.points, config.workspace, sphere.shape.numbers[3]
    e_start = points.position[0, BASE] - _centre(question, sphere, 0)
    w_start = points.velocity[0, BASE] - question.target_v[0]
    rows: list[Any] = []
    for node in range(1 + tuning.skipped_nodes, config.horizon + 1):
        centre = _centre(question, sphere, node)
        e = points.position[node, BASE] - centre
        for n in _directions(e):
            gap = radius - float(n @ e)
            value, slope = _safe_speed(gap, tuning)
            room = radius - n @ (linear.position(node, BASE) - centre) - gap
            h = value + slope * room - n @ (linear.velocity(node, BASE) - question.target_v[node])
            start = _safe_speed(radius - float(n @ e_start), tuning)[0] - float(n @ w_start)
            rows.append(h + slack[node] >= _required(start, node, tuning))
    return rows


def _directions(e: Array) -> list[Array]:
    """Plus and minus an orthonormal frame: outward, then from the least parallel world axis."""
    first = e / np.linalg.norm(e)
    seed = np.eye(3)[np.argmin(np.abs(first))]
    second = seed - (seed @ first) * first
    second /= np.linalg.norm(second)
    third = np.cross(first, second)
    return [sign * axis for axis in (first, second, third) for sign in (1.0, -1.0)]
