"""The paper's optimiser: SciPy's SLSQP on the whole nonlinear problem, from u = 0.

The problem is the one that the sequence of quadratic programs approaches: costs, barriers and
limits are evaluated at the iterate itself through the same linearisation, whose program around
U says everything at U (cost, slope, margins and their slopes). Slacks are unknowns as well, so
that both optimisers minimise the same sum.

Source: docs/reference/paper-comparison.md (the paper solves eq 17 by SLSQP with numeric gradients).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.mpc.ocp import Ocp
from fsw.autopilot.mpc.optimisers import Question, Search, Stopwatch
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.qp_data import CONE, QpData, Solution
from fsw.autopilot.signals import SolverStatus

Slopes = tuple[Callable[[Array], Array], Callable[[Array], Array]]
"""Gradients of cost and margins in the unknowns."""

MAX_ITERATIONS = 100  # SciPy's default
TOLERANCE = 1e-6  # of the cost, SciPy's default

_CONVERGED, _INCOMPATIBLE, _ITERATIONS = 0, 4, 9  # SLSQP's exit modes
_STATUS = {
    _CONVERGED: SolverStatus.SOLVED,
    _INCOMPATIBLE: SolverStatus.INFEASIBLE,
    _ITERATIONS: SolverStatus.TIME_LIMIT,
}


def by_slsqp(asked: Question, config: PlannerConfig, stopwatch_us: Stopwatch) -> Search:
    """The paper's optimiser, from rest whatever was planned before."""
    mark = stopwatch_us()
    solution = minimise(NonlinearProgram(asked.ocp, asked.start, asked.targets))
    solve_us = stopwatch_us() - mark
    return Search(solution, solution.iterations, solution.iterations, 0.0, solve_us)


def minimise(
    problem: NonlinearProgram, max_iterations: int = MAX_ITERATIONS, slopes: Slopes | None = None
) -> Solution:
    """Solve the nonlinear problem by SciPy's finite differences, as in the paper, or by slopes.

    The problem is left around its optimum. The solution is usable only where SLSQP says that it
    converged.
    """
    from scipy.optimize import minimize  # 0.1 s of every start, else

    cost_slope, margin_slopes = slopes or (None, None)
    constraint = {"type": "ineq", "fun": problem.margins}
    # Far iterates of a failing line search may overflow; the outcome is checked below.
    with np.errstate(over="ignore", invalid="ignore"):
        answer = minimize(
            problem.cost,
            problem.rest(),
            jac=cost_slope,
            method="SLSQP",
            bounds=problem.bounds(),
            constraints=[constraint if slopes is None else constraint | {"jac": margin_slopes}],
            options={"ftol": TOLERANCE, "maxiter": max_iterations},
        )
    x = np.array(answer.x)
    status = _STATUS.get(int(answer.status), SolverStatus.NUMERICAL_ERROR)
    if np.isfinite(x).all() and np.isfinite(answer.fun):
        problem.cost(x)  # leaves the problem around the answer, not around a last probe
    else:
        status = SolverStatus.NUMERICAL_ERROR
    return Solution(status, x, int(answer.nit))


def min_slacks(program: QpData, inputs: Array) -> Array:
    """Smallest slacks (slacks,) with which the soft rows admit ``inputs`` (inputs n,) [SI]."""
    rows, slacks = program.rows, np.zeros(len(program.penalty))
    held = np.flatnonzero(rows.slack >= 0)
    np.maximum.at(slacks, rows.slack[held], rows.g[held] @ inputs - rows.b[held])
    return slacks


class NonlinearProgram:
    """The problem at the inputs asked for last, linearised anew only where they changed.

    SciPy asks for cost, margins and slopes of one point in separate calls, and for a
    difference in a slack the inputs stay the same.
    """

    def __init__(self, ocp: Ocp, start: Array, targets: TargetPoints) -> None:
        """Begin at u = 0 from ``start`` (states,) [SI]."""
        self._ocp, self._start, self._targets = ocp, start, targets
        program = ocp.qp
        self._inputs = np.zeros(program.inputs)
        rows = program.rows
        self.holds = np.zeros((program.block_rows, len(program.penalty)))  # slacks of soft rows
        softened = np.flatnonzero(rows.slack >= 0)
        self.holds[softened, rows.slack[softened]] = 1.0
        ocp.linearise(start, self._inputs, targets)

    def rest(self) -> Array:
        """u = 0, and the slacks that make it admissible."""
        rest = np.zeros(len(self._inputs))
        return np.concatenate((rest, min_slacks(self.at(rest), rest)))

    def bounds(self) -> list[tuple[float | None, float | None]]:
        """Of every unknown; the tilt bounds the horizontal acceleration through the margins."""
        program = self._ocp.qp
        rows, first = program.rows, program.block_rows
        upper = slice(first, (first + rows.first_cone) // 2)  # the lower bounds mirror them
        bounds: list[tuple[float | None, float | None]] = [(None, None)] * program.inputs
        for row, bound in zip(rows.g[upper], rows.b[upper], strict=True):
            bounds[int(row.argmax())] = (-bound, bound)
        return bounds + [(0.0, None)] * len(program.penalty)

    def cost(self, x: Array) -> float:
        """Costs at ``x`` (unknowns,) [SI]: those of the inputs and the penalty of the slacks."""
        program = self.at(x)
        return float(self._ocp.cost + program.penalty @ x[program.inputs :])

    def margins(self, x: Array) -> Array:
        """Non-negative where ``x`` (unknowns,) [SI] is admissible: soft rows, one a tilt cone.

        The cone's margin is the difference of squares: the norm has no slope at u = 0,
        where the paper starts.
        """
        program = self.at(x)
        rows, soft = program.rows, program.block_rows
        left = rows.b - rows.g @ x[: program.inputs]
        left[:soft] += self.holds @ x[program.inputs :]
        t, ax, ay = left[rows.first_cone :].reshape(-1, CONE).T
        return np.concatenate((left[:soft], t * t - ax * ax - ay * ay))

    def at(self, x: Array) -> QpData:
        """The program around the inputs in ``x`` (unknowns,) [SI]."""
        ocp = self._ocp
        inputs = x[: len(self._inputs)]
        if not np.array_equal(inputs, self._inputs):
            self._inputs = inputs.copy()  # SLSQP writes into its x
            ocp.linearise(self._start, self._inputs, self._targets)
        return ocp.qp
