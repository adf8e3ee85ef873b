"""The paper's optimiser: SciPy's SLSQP on the whole nonlinear problem, from u = 0.

The problem is the one that the sequence of quadratic programs approaches: costs, barriers and
limits are evaluated at the iterate itself through the same linearisation, whose program around
U says everything at U (cost, slope, margins and their slopes). Slacks are unknowns as well, so
that both optimisers minimise the same sum.

Source: docs/reference/paper-comparison.md (the paper solves eq 17 by SLSQP with numeric gradients).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from fsw.barriers.constraint_block import TargetPoints
from fsw.model.prediction import Array
from fsw.mpc.qp_data import CONE, QpData
from fsw.mpc.solution import Solution
from fsw.signals import SolverStatus

Gradients = Literal["numeric", "analytic"]

MAX_ITERATIONS = 100  # SciPy's default
TOLERANCE = 1e-6  # of the cost, SciPy's default

_CONVERGED, _INCOMPATIBLE, _ITERATIONS = 0, 4, 9  # SLSQP's exit modes
_STATUS = {
    _CONVERGED: SolverStatus.SOLVED,
    _INCOMPATIBLE: SolverStatus.INFEASIBLE,
    _ITERATIONS: SolverStatus.TIME_LIMIT,
}


class Linearisable(Protocol):
    """The part of ``fsw.mpc.ocp.Problem`` that is needed here."""

    cost: float

    @property
    def program(self) -> QpData:
        """The program around the last guess."""
        ...

    def linearise(self, start: Array, guess: Array, targets: TargetPoints) -> None:
        """Refill the program around ``guess`` (6 n,) [SI] from ``start`` (19,) [SI]."""
        ...


@dataclass(frozen=True, slots=True)
class SlsqpSolver:
    """SLSQP with SciPy's finite differences, as in the paper, or with our gradients."""

    gradients: Gradients = "numeric"
    tolerance: float = TOLERANCE
    max_iterations: int = MAX_ITERATIONS

    def minimise(self, ocp: Linearisable, start: Array, targets: TargetPoints) -> Solution:
        """Solve the nonlinear problem.

        Args:
            ocp: Of the safe set; holds the program around the optimum afterwards.
            start: (19,) [SI], prediction state at node 0.
            targets: Reference at the nodes.

        Returns:
            Inputs and slacks; usable only where SLSQP says that it converged.
        """
        point = _Point(ocp, start, targets)
        analytic = self.gradients == "analytic"
        constraints: dict[str, Any] = {"type": "ineq", "fun": point.margins}
        if analytic:
            constraints["jac"] = point.margin_slopes
        # Far iterates of a failing line search may overflow; the outcome is checked below.
        with np.errstate(over="ignore", invalid="ignore"):
            answer = minimize(
                point.cost,
                point.rest(),
                jac=point.slope if analytic else None,
                method="SLSQP",
                bounds=point.bounds(),
                constraints=[constraints],
                options={"ftol": self.tolerance, "maxiter": self.max_iterations},
            )
        return _solution(answer, point)


def _solution(answer: OptimizeResult, point: _Point) -> Solution:
    x = np.array(answer.x)
    status = _STATUS.get(int(answer.status), SolverStatus.NUMERICAL_ERROR)
    if not (np.isfinite(x).all() and np.isfinite(answer.fun)):
        status = SolverStatus.NUMERICAL_ERROR
    else:
        point.cost(x)  # leaves the problem around the answer, not around a last probe
    return Solution(status, x, int(answer.nit))


class _Point:
    """The problem at the inputs asked for last, linearised anew only where they changed.

    SciPy asks for cost, margins and slopes of one point in separate calls, and for a
    difference in a slack the inputs stay the same.
    """

    def __init__(self, ocp: Linearisable, start: Array, targets: TargetPoints) -> None:
        self._ocp, self._start, self._targets = ocp, start, targets
        program = ocp.program
        self._inputs = np.zeros(program.inputs)
        rows = program.rows
        self._holds = np.zeros((program.block_rows, len(program.penalty)))  # slacks of soft rows
        softened = np.flatnonzero(rows.slack >= 0)
        self._holds[softened, rows.slack[softened]] = 1.0
        ocp.linearise(start, self._inputs, targets)

    def rest(self) -> Array:
        """u = 0, and the slacks that make it admissible."""
        rest = np.zeros(len(self._inputs))
        return np.concatenate((rest, self._at(rest).least_slacks(rest)))

    def bounds(self) -> list[tuple[float | None, float | None]]:
        """Of every unknown; the tilt bounds the horizontal acceleration through the margins."""
        program = self._ocp.program
        rows, first = program.rows, program.block_rows
        upper = slice(first, (first + rows.first_cone) // 2)  # the lower bounds mirror them
        bounds: list[tuple[float | None, float | None]] = [(None, None)] * program.inputs
        for row, bound in zip(rows.g[upper], rows.b[upper], strict=True):
            bounds[int(row.argmax())] = (-bound, bound)
        return bounds + [(0.0, None)] * len(program.penalty)

    def cost(self, x: Array) -> float:
        """Costs at the inputs and the penalty of the slacks."""
        program = self._at(x)
        return float(self._ocp.cost + program.penalty @ x[program.inputs :])

    def slope(self, x: Array) -> Array:
        """Of ``cost``: the quadratic model around a point has the true slope there."""
        program = self._at(x)
        upper, inputs = program.hessian, x[: program.inputs]
        slope = upper @ inputs + upper.T @ inputs - upper.diagonal() * inputs + program.linear
        return np.concatenate((slope, program.penalty))

    def margins(self, x: Array) -> Array:
        """Non-negative where admissible: soft rows, then one a tilt cone.

        The cone's margin is the difference of squares: the norm has no slope at u = 0,
        where the paper starts.
        """
        program = self._at(x)
        rows, soft = program.rows, program.block_rows
        left = rows.b - rows.g @ x[: program.inputs]
        left[:soft] += self._holds @ x[program.inputs :]
        t, ax, ay = left[rows.first_cone :].reshape(-1, CONE).T
        return np.concatenate((left[:soft], t * t - ax * ax - ay * ay))

    def margin_slopes(self, x: Array) -> Array:
        """Of ``margins``, (margins, unknowns)."""
        program = self._at(x)
        rows, soft = program.rows, program.block_rows
        g, b = rows.g[rows.first_cone :], rows.b[rows.first_cone :]
        cones = (b - g @ x[: program.inputs]).reshape(-1, CONE)
        signed = 2.0 * cones * np.array([-1.0, 1.0, 1.0])
        tilt = np.einsum("ca,cak->ck", signed, g.reshape(-1, CONE, program.inputs))
        unfelt = np.zeros((len(tilt), len(program.penalty)))
        return np.block([[-rows.g[:soft], self._holds], [tilt, unfelt]])

    def _at(self, x: Array) -> QpData:
        ocp = self._ocp
        inputs = x[: len(self._inputs)]
        if not np.array_equal(inputs, self._inputs):
            self._inputs = inputs.copy()  # SLSQP writes into its x
            ocp.linearise(self._start, self._inputs, self._targets)
        return ocp.program
